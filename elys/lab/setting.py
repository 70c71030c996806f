"""What an experiment may choose about how a scene is simulated, from cheap to exact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Final

import msgspec

from elys.common.scene import OpenedScene, SceneSettings

TICK_FACTORS: Final = (0.5, 1.0, 2.0, 4.0)  # of the scene's tick rate
SUBSTEPS: Final = (1, 2, 4, 8, 16)
STRENGTHS: Final = (1, 5)  # no island gets more substeps than others, or those that need them do


class Setting(msgspec.Struct, frozen=True, order=True):
    """How a scene is simulated, in what costs time."""

    tick_rate: int  # [Hz]
    substeps: int  # of the contact solver in a tick
    strengths: int  # how often substeps may be doubled for islands that need it, that and one

    @property
    def label(self) -> str:
        """As a table shows it."""
        return f"{self.tick_rate} Hz x {self.substeps}" + ("" if self.strengths > 1 else ", even")

    def applied_to(self, scene: OpenedScene) -> OpenedScene:
        """The scene, simulated like this."""
        return msgspec.structs.replace(scene, settings=self.applied_to_settings(scene.settings))

    def applied_to_settings(self, settings: SceneSettings) -> SceneSettings:
        """A scene's settings with these among them."""
        return msgspec.structs.replace(
            settings, tick_rate=self.tick_rate, substeps=self.substeps, strengths=self.strengths
        )


def setting_of(settings: SceneSettings) -> Setting:
    """How a scene says that it shall be simulated."""
    return Setting(settings.tick_rate, settings.substeps, settings.strengths)


def ladder(settings: SceneSettings, *, factors: Sequence[float] = TICK_FACTORS) -> list[Setting]:
    """Settings from cheap to dear around those of a scene, its own among them."""
    rates = [max(round(factor * settings.tick_rate), 1) for factor in factors]
    steps = (Setting(*chosen) for chosen in product(rates, SUBSTEPS, STRENGTHS))
    return sorted({*steps, setting_of(settings)}, key=lambda step: (step.tick_rate * step.substeps, step))


def refined(setting: Setting, doublings: int) -> Setting:
    """The setting with a tick half as long, so many times."""
    return msgspec.structs.replace(setting, tick_rate=setting.tick_rate << doublings)


def common_rate(settings: Sequence[Setting]) -> int:
    """The highest rate at which all of them have a tick [Hz]: there they can be compared."""
    return math.gcd(*(setting.tick_rate for setting in settings))
