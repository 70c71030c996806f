"""What a world makes its steps do, and why the rest of them is switched off.

A stage that only some worlds need has a switch. The step asks the switches; the plan tells of the same facts in words. What a
switch saves changes no result: `PhysicsSettings.forced` turns it on in any world, and the state hashes stay the same. Where
they cannot, `proof` says so.
"""

from __future__ import annotations

from typing import Any, Final, Literal, NamedTuple

import msgspec
import numpy as np

from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import SHAPE_NAMES, ColliderTable
from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.joints import JointTable
from elys.sim_node.physics.kernels.tables import DYNAMIC, SPHERE
from elys.sim_node.physics.settings import PhysicsSettings, SwitchName

Array = np.ndarray[Any, Any]

ENOUGH: Final = 300  # contacts for each thread: fewer are done before others have come

Proof = Literal["same bits", "rounding", "approximation"]


class SwitchFacts(NamedTuple):
    """What does not change about a switch."""

    proof: Proof = "same bits"  # how the states compare with and without it, where nothing needs it
    stages: tuple[str, ...] = ()  # of the profile, which it alone brings
    kernels: tuple[str, ...] = ()  # machine code that it alone needs


SWITCH_FACTS: Final[dict[SwitchName, SwitchFacts]] = {
    "polytopes": SwitchFacts(kernels=("physics.update_manifolds",)),
    "overlap_check": SwitchFacts(stages=("find_deep_overlaps",)),
    "solver": SwitchFacts(stages=("build_islands", "colour_contacts", "prepare_bodies", "solve_contacts")),
    "joints": SwitchFacts(
        stages=("prepare_joints", "finish_joints"),
        kernels=(
            "physics.prepare_joints",
            "physics.finish_joints",
            "physics.measure_joints",
            "physics.solve_jointed_contacts",
        ),
    ),
    "shared_solver": SwitchFacts(kernels=("physics.solve_shared_contacts",)),
    "strong_solver": SwitchFacts(proof="approximation"),
    "bounces": SwitchFacts(),
    "rolling": SwitchFacts(),
    "locked_axes": SwitchFacts(proof="rounding"),
    "gyroscopic": SwitchFacts(proof="rounding"),
    "attractors": SwitchFacts(proof="rounding"),
    "continuous_collision": SwitchFacts(stages=("stop_at_impacts",), kernels=("physics.stop_at_impacts",)),
    "contact_events": SwitchFacts(stages=("track_contacts",)),
    "triggers": SwitchFacts(stages=("track_triggers",), kernels=("physics.track_triggers",)),
    "sleepers": SwitchFacts(proof="approximation"),
}


def without_exact(settings: PhysicsSettings) -> PhysicsSettings:
    """Settings without the forced switches that change no bit: where those alone change nobody has to wake."""
    kept = tuple(name for name in settings.forced if SWITCH_FACTS[name].proof != "same bits")
    return msgspec.structs.replace(settings, forced=kept)


class PlannedStage(NamedTuple):
    """A stage that only some worlds need, as a world stands."""

    name: SwitchName
    is_on: bool
    why: str  # one sentence, with the numbers
    is_forced: bool = False


class Switches:
    """Which stages a step does, from what a world holds and what the step has found so far.

    Attributes:
        held_end: how many bodies contacts and joints held when islands were last made.
        fast_count: how many pairs may have missed each other in the last step.
    """

    def __init__(self, bodies: BodyTable, colliders: ColliderTable, contacts: ContactStore, joints: JointTable) -> None:
        self._bodies = bodies
        self._colliders = colliders
        self._contacts = contacts
        self._joints = joints
        self.held_end = 0
        self.fast_count = 0
        self.force(())

    def force(self, forced: tuple[SwitchName, ...]) -> None:
        """Has these on whatever the world holds."""
        self._all_joints = "joints" in forced
        self._all_polytopes = "polytopes" in forced
        self._all_checks = "overlap_check" in forced
        self._all_bounces = "bounces" in forced
        self._always_solved = "solver" in forced
        self._always_shared = "shared_solver" in forced
        self._always_swept = "continuous_collision" in forced
        self._always_visited = "triggers" in forced

    @property
    def polytopes(self) -> bool:
        """Whether the narrow phase is the one for all shapes."""
        return self._all_polytopes or not self._colliders.is_simple

    @property
    def overlap_check(self) -> bool:
        """Whether somebody may have been put deep into others."""
        return self._all_checks or self._bodies.has_fresh

    @property
    def joints(self) -> bool:
        """Whether joints are prepared, solved and finished."""
        return self._all_joints or len(self._joints.rows) > 0

    @property
    def islands(self) -> bool:
        """Whether anything holds, or did in the last step: else nobody is in an island, as before."""
        contacts = self._contacts
        return contacts.touching_count > 0 or contacts.is_changed or self._always_solved or self.joints

    @property
    def solver(self) -> bool:
        """Whether there is anything to solve."""
        return self.held_end > 0 or self._always_solved or self.joints

    @property
    def bounces(self) -> bool:
        """Whether contacts that may bounce are looked for."""
        return self._colliders.can_bounce or self._all_bounces

    def shared_solver(self, threads: int) -> bool:
        """Whether several threads solve together."""
        if threads == 1:
            return False
        return self._always_shared or self._contacts.touching_count >= ENOUGH * threads

    @property
    def continuous_collision(self) -> bool:
        """Whether anything may be through another by now."""
        return self.fast_count > 0 or self._always_swept

    @property
    def triggers(self) -> bool:
        """Whether anything is near a trigger."""
        return self._contacts.trigger_count > 0 or self._always_visited

    # ---------------------------------------------------------------- in words

    def plan(self, settings: PhysicsSettings, threads: int) -> tuple[PlannedStage, ...]:
        """Every switch in the order of a step; `threads` are those there are."""
        told: dict[SwitchName, tuple[bool, str]] = {
            "polytopes": self._tell_polytopes(),
            "overlap_check": self._tell_overlap_check(),
            "solver": self._tell_solver(),
            "joints": self._tell_joints(),
            "shared_solver": self._tell_shared(threads),
            "strong_solver": self._tell_strengths(settings),
            "bounces": self._tell_some("restitution", "restitution"),
            "rolling": self._tell_some("rolling or spinning friction", "rolling_friction", "spin_friction"),
            "locked_axes": self._tell_locks(),
            "gyroscopic": self._tell_moments(),
            "attractors": self._tell_attractors(settings),
            "continuous_collision": self._tell_fast(),
            "contact_events": (
                settings.events,
                f"events are switched {'on' if settings.events else 'off'} by the settings",
            ),
            "triggers": self._tell_triggers(settings),
            "sleepers": self._tell_sleepers(settings),
        }
        return tuple(
            PlannedStage(name, is_on or name in settings.forced, why, name in settings.forced)
            for name, (is_on, why) in told.items()
        )

    @property
    def _dynamic(self) -> Array:
        return self._bodies.rows[self._bodies.rows["motion"] == DYNAMIC]

    def _tell_polytopes(self) -> tuple[bool, str]:
        kinds = self._colliders.rows["kind"]
        others = kinds[kinds > SPHERE]
        if self._colliders.is_simple:
            return False, f"no shapes but boxes and balls among {_counted(len(kinds), 'collider')}"
        counts = [(int((others == kind).sum()), SHAPE_NAMES[kind]) for kind in np.unique(others).tolist()]
        listed = ", ".join(_counted(count, name) for count, name in counts)
        return True, f"shapes other than boxes and balls among {_counted(len(kinds), 'collider')}: {listed}"

    def _tell_overlap_check(self) -> tuple[bool, str]:
        if self._bodies.has_fresh:
            return True, "bodies have come or were placed since the last step"
        return False, "nobody has come or was placed since the last step"

    def _tell_solver(self) -> tuple[bool, str]:
        dynamic = self._dynamic
        if self.held_end > 0 or len(self._joints.rows):
            touching = _counted(self._contacts.touching_count, "contact")
            return True, f"{_counted(self.held_end, 'body')} held by {touching} and {self._joint_text}"
        if not len(dynamic):
            return False, "no dynamic bodies"
        if (dynamic["asleep"] != 0).all():
            return False, f"nobody of {_counted(len(dynamic), 'dynamic body')} is awake"
        return False, "nothing touches, and no joint holds anything"

    @property
    def _joint_text(self) -> str:
        return _counted(len(self._joints.rows), "joint") if len(self._joints.rows) else "no joints"

    def _tell_joints(self) -> tuple[bool, str]:
        return len(self._joints.rows) > 0, self._joint_text

    def _tell_shared(self, threads: int) -> tuple[bool, str]:
        if threads == 1:
            return False, "one thread"
        needed, count = ENOUGH * threads, self._contacts.touching_count
        return count >= needed, f"{_counted(count, 'contact')}; {threads} threads pay from {needed} on"

    def _tell_strengths(self, settings: PhysicsSettings) -> tuple[bool, str]:
        dynamic = self._dynamic
        strength = dynamic["strength"][(dynamic["held"] != 0) & (dynamic["asleep"] == 0)]
        if not len(strength):
            return False, "no islands"
        hard = int((strength > 1).sum())
        if not hard:
            return (
                False,
                f"no island of {_counted(len(strength), 'held body')} needs more than {settings.substeps} substeps",
            )
        most = (settings.substeps << int(strength.max())) // 2
        return True, f"{hard} of {_counted(len(strength), 'held body')} in islands that need up to {most} substeps"

    def _tell_some(self, what: str, *columns: str) -> tuple[bool, str]:
        rows = self._colliders.rows
        count = int(np.any([rows[column] > 0.0 for column in columns], axis=0).sum())
        if not count:
            return False, f"no collider has {what}"
        return True, f"{count} of {_counted(len(rows), 'collider')} with {what}"

    def _tell_locks(self) -> tuple[bool, str]:
        count = int((self._bodies.rows["locked"] != 0).sum())
        return count > 0, f"{_counted(count, 'body')} with locked axes" if count else "no body has a locked axis"

    def _tell_moments(self) -> tuple[bool, str]:
        moments = self._dynamic["inverse_inertia"]
        if not len(moments):
            return False, "no dynamic bodies"
        unequal = int((moments != moments[:, :1]).any(1).sum())
        if not unequal:
            return False, f"no unequal moments of inertia among {_counted(len(moments), 'dynamic body')}"
        return True, f"{unequal} of {_counted(len(moments), 'dynamic body')} with unequal moments of inertia"

    def _tell_attractors(self, settings: PhysicsSettings) -> tuple[bool, str]:
        count = len(settings.attractors)
        return count > 0, _counted(count, "attractor") if count else "no attractors: what is free flies on parabolas"

    def _tell_fast(self) -> tuple[bool, str]:
        if self.fast_count:
            return (
                True,
                f"{_counted(self.fast_count, 'pair')} so fast or thin that one may be through the other in a step",
            )
        return False, "nothing is so fast or thin that it may be through another in a step"

    def _tell_triggers(self, settings: PhysicsSettings) -> tuple[bool, str]:
        count = int((self._colliders.rows["trigger"] != 0).sum())
        if not count:
            return False, "no triggers"
        if not settings.events:
            return False, f"nobody is told of {_counted(count, 'trigger')}: events are switched off by the settings"
        near = self._contacts.trigger_count
        if not near:
            return False, f"nothing is near {_counted(count, 'trigger')}"
        return True, f"{_counted(near, 'pair')} near {_counted(count, 'trigger')}"

    def _tell_sleepers(self, settings: PhysicsSettings) -> tuple[bool, str]:
        dynamic = self._dynamic
        asleep = int((dynamic["asleep"] != 0).sum())
        if asleep:
            return False, f"{asleep} of {_counted(len(dynamic), 'dynamic body')} at rest and not stepped"
        if not settings.sleeping:
            return True, "sleeping is switched off by the settings"
        return len(dynamic) > 0, f"nobody of {_counted(len(dynamic), 'dynamic body')} asleep"


_PLURALS: Final = {
    "body": "bodies",
    "dynamic body": "dynamic bodies",
    "held body": "held bodies",
    "box": "boxes",
    "mesh": "meshes",
}


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun if count == 1 else _PLURALS.get(noun, noun + 's')}"
