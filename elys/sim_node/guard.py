"""The guard of a run: it names the body and the cause when something goes wrong, and has the last seconds written down.

What a step finds by itself (numbers that are not finite, explosions, speeds over the limit) it takes from the events. Beside
that it looks at what the step has left: bodies that stay deep inside others, and joints that stay apart.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from elys.bus.last_seconds import LastSeconds
from elys.bus.messages.physics import Diagnostics
from elys.bus.messages.session import Event
from elys.bus.recording_names import free_name
from elys.sim_node.simulation import Simulation

MOST_FILES: Final = 3  # in one run
QUIET: Final = 5.0  # [s] of simulation after a file in which no other is written: it would hold the same
SHALLOW: Final = 10.0  # times what contacts may give way: nothing to look at twice
SUNK: Final = 0.25  # share of the thinner body's thickness: what stays deeper in another is not held by it
APART: Final = 1.0  # [m] between the anchors of a joint that holds nothing together any more
PATIENCE: Final = 0.5  # [s] of simulation for which it has to stay so
TOLD_AT_SPAWN: Final = "deep_overlap"  # whoever placed it there has been told, and is pushed out by and by
_log = logging.getLogger(__name__)


class Guard:
    """Looks at each tick of a simulation; `path_at(tick)` says where its last seconds go."""

    def __init__(self, simulation: Simulation, last: LastSeconds, path_at: Callable[[int], Path]) -> None:
        self.paths: list[Path] = []  # what was written
        self._simulation = simulation
        self._last = last
        self._path_at = path_at
        self._quiet_until = -1.0
        self._found = 0  # files because of what went wrong
        self._since: dict[tuple[str, int, int], int] = {}  # what is wrong, and since which tick
        self._told: set[tuple[str, int, int]] = set()
        self._thickness: tuple[tuple[int, int], float] = ((0, 0), 0.0)  # of the thinner of two bodies [m]

    def look(self, found: Diagnostics) -> list[Event]:
        """What is wrong with what a tick has left, told once while it lasts."""
        wrong: dict[tuple[str, int, int], str] = {}
        if found.deepest_overlap > SHALLOW * self._simulation.physics.settings.contact_overlap:
            self._look_for_sunk(found, wrong)
        if found.joint_error > APART:
            text = f"the joint of {self._simulation.named(found.joint)} is {found.joint_error:.3g} m apart: "
            remedy = "look for forces or masses that it cannot hold, or let it break there (break_force)"
            wrong["joint_apart", found.joint, 0] = text + remedy
        self._since = {what: self._since.get(what, found.tick) for what in wrong}
        self._told &= wrong.keys()
        patience = PATIENCE * self._simulation.settings.tick_rate
        lasting = [what for what in wrong if found.tick - self._since[what] >= patience and what not in self._told]
        self._told.update(lasting)
        events = []
        for what in lasting:
            cause, entity, other = what
            _log.error("%s", wrong[what])
            events.append(
                Event(kind="physics", entity=entity, other=other, values={"text": wrong[what], "cause": cause})
            )
        return events

    def end_tick(self, events: Sequence[Event]) -> None:
        """Ends a tick, after all of it was published; writes the last seconds if something went wrong in it."""
        simulation = self._simulation
        self._last.end_tick(simulation.tick, simulation.settings.tick_rate)
        causes = [str(event.values["cause"]) for event in events if event.kind == "physics" and "cause" in event.values]
        if all(cause == TOLD_AT_SPAWN for cause in causes):
            return
        if self._found >= MOST_FILES or simulation.time < self._quiet_until:
            return
        self._quiet_until = simulation.time + QUIET
        self._found += 1
        self.keep()

    @property
    def is_writing(self) -> bool:
        """Whether a file is not whole yet."""
        return self._last.is_writing

    def keep(self) -> Path:
        """Writes the last seconds because somebody asks for them, or the run ends as it should not; returns where."""
        # That of an earlier run may be there, and one is asked for twice while time stands still.
        path = free_name(self._path_at(self._simulation.tick), taken=self.paths)
        self.paths.append(path)
        self._last.save(path)
        return path

    def close(self) -> None:
        """Waits for what is being written."""
        self._last.close()

    def _look_for_sunk(self, found: Diagnostics, wrong: dict[tuple[str, int, int], str]) -> None:
        a, b = found.deepest
        if self._thickness[0] != found.deepest:
            thinner = min(self._simulation.physics.thickness_of(entity) for entity in (a, b))
            self._thickness = (found.deepest, thinner)
        if found.deepest_overlap > SUNK * self._thickness[1]:
            named = self._simulation.named
            text = f"{named(a)} stays {found.deepest_overlap:.3g} m deep in {named(b)}, more than a quarter of its thickness: "
            wrong["sunk", a, b] = f"{text}look for extreme masses or for what presses them together, or raise substeps"
