"""What scripts remember, for states: kept as values (memory.py), and found again."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from elys.common.errors import ScriptError
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.scripts.game_world import GameWorld
from elys.sim_node.scripts.handles import EntityHandle
from elys.sim_node.scripts.memory import Finder, Keeper
from elys.sim_node.scripts.program import Program
from elys.sim_node.scripts.running import Running

if TYPE_CHECKING:
    from elys.sim_node.scripts.runner import Scripts

_log = logging.getLogger(__name__)


class Recollection:
    """Keeps the memories of the behaviours of a simulation."""

    def __init__(self, scripts: Scripts) -> None:
        self._scripts = scripts
        self._said: set[tuple[int, str]] = set()  # what was said to be no memory

    def kept(self, running: Mapping[int, Running]) -> tuple[Any, ...]:
        """All behaviours with what they remember."""
        keeper = Keeper(_Names(self._scripts, running))
        return tuple(
            (one.entity, one.source, one.has_started, one.is_enabled, one.failure, *self._memory(keeper, one))
            for one in running.values()
        )

    def found(self, kept: Sequence[Any], running: dict[int, Running]) -> Iterator[tuple[Running, Exception]]:
        """Fills `running` with the behaviours of `kept`; yields those of which something is not there any more, or other."""
        scripts = self._scripts
        for entity, source, has_started, is_enabled, failure, *_ in kept:
            one = Running(
                entity=entity, source=source, values={}, has_started=has_started, is_enabled=is_enabled, failure=failure
            )
            running[entity] = one
            try:
                if source:
                    one.script = scripts.loaded(source)
                    one.itself = one.script.behaviour.__new__(one.script.behaviour)
                    one.itself.entity, one.itself.world = EntityHandle(scripts, entity), scripts.world_of(source)
            except ScriptError as error:
                one.failure = one.failure or str(error)
        finder = Finder(_Names(scripts, running))
        for one, (*_, values, attributes, tasks) in zip(running.values(), kept, strict=True):
            try:
                one.values = finder.found(values)
                for name, value in attributes:
                    found = finder.found(value)
                    if one.itself is not None:
                        setattr(one.itself, name, found)
                one.tasks = [finder.task(task) for task in tasks] if one.itself is not None else []
            except Exception as error:  # its code has changed, or what it remembers makes no sense to it
                yield one, error

    def _memory(self, keeper: Keeper, one: Running) -> tuple[Any, ...]:
        """What cannot be kept is said once and left out: to look at a run must not change it."""
        attributes, tasks = [], []
        for name, value in vars(one.itself).items() if one.itself is not None else ():
            if name not in ("entity", "world"):
                try:
                    attributes.append((name, keeper.kept(value, f"self.{name}")))
                except ScriptError as error:
                    self._cannot_keep(one, error)
        for task in one.tasks:
            try:
                tasks.append(keeper.task(task, "what a waiting function knows as"))
            except ScriptError as error:
                self._cannot_keep(one, error)
        return keeper.kept(dict(one.values), "values"), tuple(attributes), tuple(tasks)

    def _cannot_keep(self, one: Running, error: ScriptError) -> None:
        if (said := (one.entity, str(error))) not in self._said:
            self._said.add(said)
            name = self._scripts.named_script(one)
            _log.error("%s will lose a part of its memory when time is wound back: %s", name, error)


class _Names:
    """What memories name that lives in the world."""

    def __init__(self, scripts: Scripts, running: Mapping[int, Running]) -> None:
        self._scripts = scripts
        self._running = running
        self._behaviours = {id(one.itself): one.entity for one in running.values() if one.itself is not None}

    def word_for(self, value: Any) -> tuple[Any, ...] | None:
        if type(value) is EntityHandle:
            return ("entity", int(value.id))
        if type(value) is GameWorld:
            return ("world", value.source)
        if isinstance(value, Behaviour):
            return ("behaviour", self._behaviours.get(id(value), 0))
        return None

    def named_by(self, words: tuple[Any, ...]) -> Any:
        match words:
            case ("entity", int(entity)):
                return EntityHandle(self._scripts, entity)
            case ("world", *source):  # states of before worlds were each script's own have none
                return self._scripts.world_of(source[0] if source else "")
            case ("behaviour", int(entity)):
                one = self._running.get(entity)
                return one.itself if one is not None else None
        raise ScriptError(f"a memory names {words!r}, which nobody knows")

    def program(self, name: str, digest: str) -> Program:
        return self._scripts.library.program(name, digest)

    def record(self, name: str) -> type[Any] | None:
        source, _, called = name.partition("/")
        return self._scripts.library.record(called, source)

    def name_of_record(self, kind: type[Any]) -> str | None:
        found = self._scripts.library.name_of_record(kind)
        return "/".join(found) if found is not None else None
