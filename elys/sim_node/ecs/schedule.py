"""Systems in the order in which they are written, each timed."""

from __future__ import annotations

import time
from collections.abc import Callable, MutableMapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from elys.sim_node.ecs.world import World

System = Callable[["World"], None]


def run(world: World, systems: Sequence[System], profile: MutableMapping[str, float]) -> None:
    """Runs each system, then the structural changes it recorded; adds what both took to `profile`, in ms by its name."""
    for system in systems:
        name = getattr(system, "__name__", type(system).__name__)
        started = time.perf_counter()
        system(world)
        world.commands.apply()
        profile[name] = profile.get(name, 0.0) + (time.perf_counter() - started) * 1e3
