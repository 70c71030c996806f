"""A puppet: a player with hips, a spine and an arm below it, and clips made of lines between keys."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.common.assets import AssetStore
from elys.common.assets.clip import Channel, Clip, Property, encode_clips
from elys.common.components import Animation, Component, Transform
from elys.common.ids import Entity
from elys.common.math import quaternion
from elys.common.scene import SceneSettings
from elys.sim_node.simulation import Simulation

RATE = 50
HIPS, SPINE, ARM = ("Hips",), ("Hips", "Spine"), ("Hips", "Spine", "Arm")


def track(target: tuple[str, ...], values: Any, *, name: Property = "position", duration: float = 1.0) -> Channel:
    """A channel through values [K, width] at even times."""
    keys = np.asarray(values, np.float32)
    times = np.linspace(0.0, duration, len(keys)).astype(np.float32)
    return Channel(target=target, property=name, interpolation="linear", times=times, values=keys)


def constant(
    name: str, target: tuple[str, ...], value: Any, *, duration: float = 1.0, of: Property = "position"
) -> Clip:
    """A clip in which one thing stands still."""
    return Clip(name=name, channels=(track(target, [value, value], name=of, duration=duration),))


def turn(axis: Any, degrees: float) -> np.ndarray:
    return np.asarray(quaternion.from_axis_angle(axis, np.radians(degrees)))


class Puppet:
    def __init__(
        self, *clips: Clip, more: tuple[Component, ...] = (), at: Transform | None = None, **animation: Any
    ) -> None:
        self.assets = AssetStore()
        self.simulation = Simulation(settings=SceneSettings(tick_rate=RATE), assets=self.assets)
        self.world = self.simulation.world
        self.clips = self.assets.put(encode_clips(clips), kind="clips")
        parts = [at or Transform(), Animation(clips=self.clips, **animation), *more]
        self.player = self.world.spawn(parts, name="Puppet")
        self.hips = self.world.spawn([Transform(position=(0.0, 1.0, 0.0))], name="Hips", parent=self.player)
        self.spine = self.world.spawn([Transform(position=(0.0, 0.5, 0.0))], name="Spine", parent=self.hips)
        self.arm = self.world.spawn([Transform(position=(0.25, 0.0, 0.0))], name="Arm", parent=self.spine)
        self.simulation.settle()
        self.simulation.take_changes()

    def run(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.simulation.step()

    def set(self, component: type[Component] = Animation, entity: Entity | None = None, **values: Any) -> None:
        self.world.set_fields(entity or self.player, component, values)

    def animation(self) -> Animation:
        return self.world.get(self.player, Animation)

    def place(self, entity: Entity) -> tuple[float, float, float]:
        return self.world.get(entity, Transform).position

    def rotation(self, entity: Entity) -> tuple[float, ...]:
        return self.world.get(entity, Transform).rotation

    def problems(self) -> list[str]:
        return [event.values["text"] for event in self.simulation.take_events() if event.kind == "animation"]
