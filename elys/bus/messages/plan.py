"""What is on, what is off and why: of the steps of a simulation and of the pictures of a render node."""

from __future__ import annotations

import msgspec


class StagePlan(msgspec.Struct, frozen=True, kw_only=True):
    """A stage that only some scenes need."""

    name: str
    is_on: bool
    why: str  # one sentence, with the numbers
    is_forced: bool = False  # on although nothing needs it


class PlanRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks the host what a step consists of."""


class PhysicsPlan(msgspec.Struct, frozen=True, kw_only=True):
    """The switches of physics in the order of a step, as the world stands after the last one."""

    tick: int
    bodies: int
    contacts: int
    stages: tuple[StagePlan, ...]


class RenderProfile(msgspec.Struct, frozen=True, kw_only=True):
    """What one picture of a view cost, stage by stage, and which passes it consisted of."""

    node: str  # that drew it
    view: str
    sequence: int  # of the request
    tick: int
    width: int
    height: int
    total: float  # [ms] from the request's turn until the picture is sent
    stages: dict[str, float]  # [ms] of the processor; drivers may draw later than that
    passes: tuple[StagePlan, ...]  # none of a view that shows data instead of light
