"""What a scene makes the engine do, stage by stage: why, what it costs, and what is saved by what is switched off.

What a switch saves is measured: worlds that go on from the same moment, one as it is and one more for each switch that is off,
with that switch forced. They are stepped in turns, so that whatever else the machine does meets all of them alike.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

import msgspec
import numpy as np

from elys.sim_node.kernel_cache import kernel_sizes
from elys.sim_node.physics.plan import SWITCH_FACTS, PlannedStage, Proof, SwitchName
from elys.sim_node.physics.world import PhysicsWorld
from elys.sim_node.simulation import Simulation

Array = np.ndarray[Any, Any]
Progress = Callable[[str, int, int], None]  # what is measured, ticks done, ticks in all

REST: Final = "between stages"  # what a tick takes beside its stages
AFTER_PHYSICS: Final = "bodies into components"  # the rest of the system that physics' stages are timed within
_PREFIX: Final = "physics."
_OF_SIMULATION: Final = "elys.sim_node."  # whose objects have tables
_OWN: Final = "simulate_physics"


class Saving(msgspec.Struct, frozen=True, kw_only=True):
    """What a switch saves by being off: measured against a world with it forced on."""

    time: float  # [ms] of processor time a tick, the median
    noise: float  # [ms] standard error of that
    code: int  # [bytes] of machine code that need not be loaded; 0 too where it is not compiled yet
    tables: int  # [bytes] of arrays that the world with it forced on holds more, after the sample
    difference: float  # [m] the largest between bodies of both worlds after the sample
    is_same: bool  # the state hashes were equal after each tick of the sample


class StageReport(msgspec.Struct, frozen=True, kw_only=True):
    """A stage that only some scenes need."""

    name: SwitchName
    is_on: bool
    why: str
    proof: Proof  # how the states with it and without it compare, where nothing needs it
    time: float  # [ms] a tick that its own stages of the profile took
    saving: Saving | None  # of what is off, where it could be measured


class PlanReport(msgspec.Struct, frozen=True, kw_only=True):
    """The plan of a scene at a moment, and what was measured from there on.

    Attributes:
        other_stages: what every scene needs, and what a tick takes between its stages: [ms] a tick. With the times in `stages`
            they make `tick_time`. Names of systems, and `physics.STAGE`.
    """

    scene: str
    moment: float  # [s] of simulation
    body_count: int
    ticks: int  # that were measured; 0 where nothing was
    tick_time: float  # [ms] the mean of a whole tick
    stages: tuple[StageReport, ...]
    other_stages: dict[str, float]


def advance(simulation: Simulation, moment: float) -> None:
    """Steps a simulation to `moment` [s], at least by one tick: before it nothing has been looked at."""
    for _ in range(max(round(moment * simulation.settings.tick_rate), 1)):
        simulation.step()


def forcible(simulation: Simulation) -> tuple[SwitchName, ...]:
    """The switches that are off now and can be forced on."""
    return tuple(
        stage.name
        for stage in simulation.physics.plan()
        if not stage.is_on and (stage.name != "shared_solver" or simulation.physics.settings.threads > 1)
    )


def kernels_of(names: Sequence[SwitchName]) -> tuple[str, ...]:
    """The kernels that some switches need beside those of every world."""
    return tuple(dict.fromkeys(kernel for name in names for kernel in SWITCH_FACTS[name].kernels))


def report(simulation: Simulation, *, seconds: float, progress: Progress | None = None) -> PlanReport:
    """The plan as it is now; what its stages take, and what is saved, over `seconds` of simulation from here on.

    The simulation goes on by that; with 0 seconds nothing is measured. The kernels of what is `forcible` are compiled unless
    they are there: see `kernels_of`.
    """
    plan = simulation.physics.plan()
    moment = simulation.time
    ticks = round(seconds * simulation.settings.tick_rate)
    names = forcible(simulation) if ticks else ()
    savings = _savings(simulation, names, ticks, progress) if names else {}
    times, tick_time = _profile(simulation, ticks) if ticks else ({}, 0.0)
    stages = tuple(_stage(stage, times, savings.get(stage.name)) for stage in plan)
    return PlanReport(
        scene=simulation.name,
        moment=moment,
        body_count=simulation.physics.body_count,
        ticks=ticks,
        tick_time=tick_time,
        stages=stages,
        other_stages=times,
    )


def _stage(stage: PlannedStage, times: dict[str, float], saving: Saving | None) -> StageReport:
    """Takes the stage's own times out of `times`."""
    facts = SWITCH_FACTS[stage.name]
    own = sum(times.pop(_PREFIX + name, 0.0) for name in facts.stages)
    return StageReport(name=stage.name, is_on=stage.is_on, why=stage.why, proof=facts.proof, time=own, saving=saving)


def _profile(simulation: Simulation, ticks: int) -> tuple[dict[str, float], float]:
    """Means over some ticks [ms]: each stage and what is between them, which make the second, the whole tick."""
    sums: dict[str, float] = {}
    whole = 0.0
    for _ in range(ticks):
        began = time.perf_counter()
        simulation.step()
        whole += 1000.0 * (time.perf_counter() - began)
        for name, spent in simulation.stage_times.items():
            sums[name] = sums.get(name, 0.0) + spent
    in_physics = sum(spent for name, spent in sums.items() if name.startswith(_PREFIX))
    sums[AFTER_PHYSICS] = sums.pop(_OWN) - in_physics
    sums[REST] = whole - sum(sums.values())
    return {name: spent / ticks for name, spent in sums.items()}, whole / ticks


def _savings(
    simulation: Simulation, names: Sequence[SwitchName], ticks: int, progress: Progress | None
) -> dict[SwitchName, Saving]:
    start = simulation.physics.snapshot()
    settings = simulation.physics.settings
    worlds = []
    for forced in ((), *((name,) for name in names)):
        world = PhysicsWorld(msgspec.structs.replace(settings, forced=forced))
        world.restore(start)
        worlds.append(world)
    clock = time.thread_time if settings.threads == 1 else time.process_time  # of all threads that share the work
    spent = np.zeros((ticks, len(worlds)))
    same = np.ones(len(worlds), bool)
    for tick in range(ticks):
        if progress is not None:
            progress(f"{len(worlds)} worlds in turns", tick, ticks)
        for turn in range(len(worlds)):
            place = (tick + turn) % len(worlds)  # nobody always comes after the same one
            began = clock()
            worlds[place].step(1.0 / simulation.settings.tick_rate)
            spent[tick, place] = 1000.0 * (clock() - began)
        expected = worlds[0].state_hash()
        same &= np.array([world.state_hash() == expected for world in worlds])
    sizes, held = kernel_sizes(), table_bytes(worlds[0])
    as_it_is = worlds[0].bodies.position
    return {
        name: _saving(
            spent[:, place] - spent[:, 0],
            tables=table_bytes(worlds[place]) - held,
            code=sum(sizes.get(kernel, 0) for kernel in SWITCH_FACTS[name].kernels),
            difference=_farthest(worlds[place].bodies.position, as_it_is),
            is_same=bool(same[place]),
        )
        for place, name in enumerate(names, start=1)
    }


def _saving(differences: Array, *, code: int, tables: int, difference: float, is_same: bool) -> Saving:
    median = float(np.median(differences))
    # Of a median, from the median deviation: what else the machine did stands out of most ticks and counts for little.
    deviation = 1.4826 * float(np.median(np.abs(differences - median)))
    noise = math.sqrt(0.5 * math.pi / len(differences)) * deviation
    return Saving(time=median, noise=noise, code=code, tables=tables, difference=difference, is_same=is_same)


def _farthest(one: Array, other: Array) -> float:
    return float(np.linalg.norm(one - other, axis=1).max(initial=0.0))


def table_bytes(world: PhysicsWorld) -> int:
    """Bytes of all arrays that a world and its parts hold, each once however many views of it there are."""
    total = 0
    seen: set[int] = set()
    waiting: list[Any] = [world]
    while waiting:
        held = waiting.pop()
        while isinstance(held, np.ndarray) and isinstance(held.base, np.ndarray):
            held = held.base
        if id(held) in seen:
            continue
        seen.add(id(held))
        if isinstance(held, np.ndarray):
            total += held.nbytes
        elif isinstance(held, tuple | list):
            waiting += held
        elif isinstance(held, dict):
            waiting += held.values()
        elif type(held).__module__.startswith(_OF_SIMULATION):
            slots = (name for kind in type(held).__mro__ for name in getattr(kind, "__slots__", ()))
            waiting += [getattr(held, name) for name in slots if hasattr(held, name)]
            waiting += getattr(held, "__dict__", {}).values()
    return total
