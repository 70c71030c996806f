"""Runs the behaviours of a world: who has one, what becomes of them each tick, and what they remember.

A tick, for scripts: those whose component came, changed or went; what happened since, told to each in turn; functions that wait
go on; `fixed_update`. After physics: `update`. Scripts run in the order of their entities' ids.
"""

from __future__ import annotations

import logging
import random
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, TypeVar

import msgspec
import numpy as np

from elys.bus.messages.session import Event
from elys.common.components import Script
from elys.common.errors import ScriptError
from elys.common.ids import Entity
from elys.sim_node.scripts.behaviour import Behaviour, is_a
from elys.sim_node.scripts.field_values import field_values
from elys.sim_node.scripts.handles import EntityHandle, GameWorld
from elys.sim_node.scripts.happenings import contacts_of, visits_of
from elys.sim_node.scripts.library import LoadedScript, ScriptLibrary
from elys.sim_node.scripts.memory import Finder, Keeper
from elys.sim_node.scripts.modules import describe, line_in
from elys.sim_node.scripts.program import Program
from elys.sim_node.scripts.task import Task
from elys.sim_node.scripts.waiting import Call
from elys.sim_node.scripts.watchdog import LIMIT, ScriptTimeout, Watchdog

if TYPE_CHECKING:
    from elys.sim_node.ecs.world import World
    from elys.sim_node.simulation import Simulation

B = TypeVar("B", bound=Behaviour)
BUDGET: Final = 0.5  # of a tick's length, for all scripts together
LOADING_LIMIT: Final = 20.0  # [s] that a file may take to be run as it is loaded: it may import much
FAILURE_LENGTH: Final = 1000  # characters
MOST_EVENTS: Final = 10_000  # told in a tick; a script that tells more fails
_SAID_EVERY: Final = 5.0  # [s]
_FAILURES: Final = (Exception, SystemExit, ScriptTimeout)  # of a script, which end it alone
_log = logging.getLogger(__name__)


@dataclass(slots=True, kw_only=True)
class Running:
    """A behaviour on an entity.

    Attributes:
        values: what its component said of its fields when it was last looked at.
        failure: why it is off; it stays so until its component changes.
        spent: time that it took in this tick [s].
    """

    entity: int
    source: str
    values: Mapping[str, Any]
    script: LoadedScript | None = None
    itself: Behaviour | None = None
    has_started: bool = False
    is_enabled: bool = True
    failure: str = ""
    tasks: list[Task] = field(default_factory=list)
    spent: float = 0.0

    @property
    def hooks(self) -> frozenset[str]:
        """Those that are called now."""
        is_on = self.is_enabled and not self.failure and self.script is not None
        return self.script.hooks if is_on and self.script is not None else frozenset()


class Scripts:
    """All behaviours of one simulation."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.world = GameWorld(self)
        self.library = ScriptLibrary(simulation.assets)
        self._query = simulation.world.query(Script)
        self._running: dict[int, Running] = {}  # by entity, rising
        self._seen: tuple[bytes, ...] = ()
        self._queue: list[Event] = []  # told in this tick, heard in the next
        self._doomed: list[Entity] = []
        self._events: list[Event] = []
        self.watchdog = Watchdog()
        self._said = -_SAID_EVERY
        self._cannot: set[tuple[int, str]] = set()  # what was said to be no memory
        self._spent = 0.0  # [s] in this tick, before physics
        self._measures = False  # how long each takes
        self._are_new = False  # some have not started yet
        self._listening: dict[str, list[Running]] = {}  # by hook; made anew when anybody comes, goes or changes

    def __len__(self) -> int:
        return len(self._running)

    # --- the tick

    def run(self, world: World) -> None:
        """Before physics: all but `update`."""
        if not (self._running or len(self._query)):
            self._queue.clear()
            return
        began = time.thread_time()
        self.watchdog.begin()
        self._follow()
        heard, self._queue = self._queue, []
        self._events += heard
        for one in self._waiting_to_start():
            one.has_started = True
            self._listening = {}
            self._call(one, "start")
        self._tell(heard)
        happened = {event.kind: event for event in reversed(heard)}
        for one in [one for one in self._running.values() if one.tasks and one.is_enabled]:
            self._resume(one, happened)
        self._call_all("fixed_update", self.world.dt)
        self._end_doomed()
        self.watchdog.end()
        self._spent = time.thread_time() - began

    def run_late(self, world: World) -> None:
        """After physics: `update`."""
        if not self._running:
            return
        began = time.thread_time()
        self.watchdog.begin()
        self._call_all("update", self.world.dt)
        self._end_doomed()
        self.watchdog.end()
        self._look_at_budget(self._spent + time.thread_time() - began)

    def _waiting_to_start(self) -> list[Running]:
        if not self._are_new:
            return []
        self._are_new = False
        return [one for one in self._running.values() if one.is_enabled and not one.has_started and not one.failure]

    def _tell(self, heard: list[Event]) -> None:
        for happening in (*visits_of(self), *contacts_of(self)):
            self._call(self._running[happening.entity], happening.hook, *happening.arguments)
        for one in self.listening("on_event") if heard else ():
            for event in heard:
                if not event.entity or event.entity == one.entity:
                    self._call(one, "on_event", event)
        for player in self.world.players:
            self._call_all("on_input", player)

    def listening(self, hook: str) -> list[Running]:
        """Those whose hook is called now, in their order."""
        if hook not in self._listening:
            self._listening[hook] = [one for one in self._running.values() if one.has_started and hook in one.hooks]
        return self._listening[hook]

    def _call_all(self, hook: str, *arguments: Any) -> None:
        """Calls a hook of all that have it. One loop, entered anew only behind a script that fails: this is what a tick costs."""
        listening, place, watchdog = self.listening(hook), 0, self.watchdog
        measures = self._measures
        watchdog.is_inside = True
        while place < len(listening):
            try:
                for one in listening[place:]:
                    watchdog.call += 1
                    place += 1
                    began = time.thread_time() if measures else 0.0
                    result = getattr(one.itself, hook)(*arguments)
                    if result is not None and type(result) is Call:
                        self._begin(one, result)
                    if measures:
                        one.spent += time.thread_time() - began
            except _FAILURES as error:
                self._fail(listening[place - 1], error)
        watchdog.is_inside = False

    def _call(self, one: Running, hook: str, *arguments: Any) -> None:
        if hook not in one.hooks or not self.simulation.world.is_alive(one.entity):
            return
        try:
            with self.watchdog.inside():
                result = getattr(one.itself, hook)(*arguments)
                if type(result) is Call:
                    self._begin(one, result)
        except _FAILURES as error:
            self._fail(one, error)

    def _begin(self, one: Running, call: Call) -> None:
        task = Task.of(call, self.simulation.tick, self._ticks_in)
        one.tasks.append(task)
        task.advance(self.simulation.tick, self._ticks_in, {})
        if task.is_done:
            one.tasks.remove(task)

    def _resume(self, one: Running, happened: Mapping[str, Event]) -> None:
        began = time.thread_time() if self._measures else 0.0
        mine = {kind: event for kind, event in happened.items() if event.entity in (0, one.entity)}
        try:
            with self.watchdog.inside():
                for task in list(one.tasks):
                    task.advance(self.simulation.tick, self._ticks_in, mine)
                    if task.is_done and task in one.tasks:
                        one.tasks.remove(task)
        except _FAILURES as error:
            self._fail(one, error)
        if self._measures:
            one.spent += time.thread_time() - began

    def _ticks_in(self, seconds: float) -> int:
        return round(min(seconds, 1e9) * self.simulation.settings.tick_rate)

    # --- who runs

    def _follow(self) -> None:
        """Behaviours become what the components say."""
        table = self.simulation.world.table(Script)
        entities, rows = self._query.entities, self._query.rows(Script)
        switches = self.simulation.world.hierarchy.enabled_in_hierarchy[self._query.indices]
        columns = [table.column(name)[rows] for name in ("source", "enabled", "values")]
        seen = tuple(column.tobytes() for column in (entities, switches, *columns))
        if seen == self._seen:
            return
        self._seen = seen
        lookup = self.simulation.world.get
        wanted = {
            entity: (lookup(Entity(entity), Script), is_on)
            for entity, is_on in sorted(zip(entities.tolist(), switches.tolist(), strict=True))
        }
        for entity in self._running.keys() - wanted.keys():
            self._end(self._running.pop(entity))
        for entity, (component, is_on) in wanted.items():
            one = self._running.get(entity)
            if one is None:
                self._running[entity] = one = Running(entity=entity, source="", values={})
            is_enabled = is_on and component.enabled
            if one.failure and (component.source != one.source or (is_enabled and not one.is_enabled)):
                one.failure = ""
                one.source = one.source if one.itself is not None else ""
            one.is_enabled = is_enabled
            if is_enabled and not one.failure:
                self._become(one, component)
        self._running = dict(sorted(self._running.items()))
        self._are_new = True
        self._listening = {}

    def _become(self, one: Running, component: Script) -> None:
        try:
            script = self.loaded(component.source) if component.source != one.source else None
            with self.watchdog.inside():
                if script is not None:
                    self._change_script(one, script)
                one.source = component.source
                if one.itself is not None and one.script is not None and component.values != one.values:
                    given = field_values(self, one.script, component.values, before=one.values)
                    one.values = component.values
                    for name, value in given.items():
                        setattr(one.itself, name, value)
        except _FAILURES as error:
            one.source = component.source
            self._fail(one, error)

    def loaded(self, source: str) -> LoadedScript:
        """A script's class. Raises ScriptError, also for a file that does not come back."""
        self.watchdog.begin()
        try:
            with self.watchdog.inside(LOADING_LIMIT):
                return self.library.load(source)
        except ScriptTimeout as error:
            raise ScriptError(f"the file did not come back within {LOADING_LIMIT:g} s as it was loaded") from error
        finally:
            self.watchdog.end()

    def _change_script(self, one: Running, script: LoadedScript) -> None:
        """A new behaviour, or the same one as its file was saved anew, which goes on with what it remembers."""
        before, one.script = one.script, script
        if before is not None and before.name == script.name and one.itself is not None:
            one.itself.__class__ = script.behaviour
            kept = [task for task in one.tasks if all(self._is_current(frame.program, script) for frame in task.frames)]
            if len(kept) < len(one.tasks):
                _log.info("%s: what it was waiting in has changed and ends", self._named(one))
            one.tasks = kept
            return
        if one.itself is not None:
            self._end(one)
        one.itself = script.behaviour.__new__(script.behaviour)
        one.itself.entity, one.itself.world = EntityHandle(self, one.entity), self.world
        one.values, one.tasks, one.has_started = {}, [], False
        one.itself.__init__()  # type: ignore[misc]

    @staticmethod
    def _is_current(program: Program, script: LoadedScript) -> bool:
        own = any(name == program.name for name, _ in script.modules.programs)
        return not own or (program.name, program.digest) in script.modules.programs

    def _end(self, one: Running) -> None:
        """It is taken away: its waiting functions end, and it may say farewell."""
        one.tasks.clear()
        self._listening = {}
        if one.has_started and "on_destroy" in one.hooks and one.itself is not None:
            try:
                with self.watchdog.inside():
                    one.itself.on_destroy()
            except _FAILURES as error:
                self._fail(one, error)
        one.has_started = False

    def _end_doomed(self) -> None:
        doomed, self._doomed = self._doomed, []
        world = self.simulation.world
        for entity in doomed:
            if world.is_alive(entity):
                for below in world.hierarchy.subtree_of(entity).tolist():
                    if (one := self._running.pop(below, None)) is not None:
                        self._end(one)
                world.despawn(entity)

    # --- what goes wrong

    def _fail(self, one: Running, error: BaseException) -> None:
        """Switches a script off and says why; nothing else is harmed."""
        if isinstance(error, ScriptError):
            text = str(error)
        else:
            places = [] if one.script is None else one.script.modules.places
            where = next((line for place in places if (line := line_in(place, error)) != place), "")
            what = f"it did not come back within {LIMIT:g} s" if isinstance(error, ScriptTimeout) else describe(error)
            text = f"{where}: {what}" if where else what
        text = text[:FAILURE_LENGTH].encode(errors="backslashreplace").decode()  # it goes over the bus
        one.failure = text
        one.tasks.clear()
        self._listening = {}
        _log.error("%s is off: %s", self._named(one), text)
        self._events.append(Event(kind="script", entity=one.entity, values={"text": text}))

    def _named(self, one: Running) -> str:
        name = one.script.name if one.script is not None else "the script"
        return f"{name} of {self.simulation.named(one.entity)}"

    def _look_at_budget(self, spent: float) -> None:
        """Names the script that takes most when all together take too much: the next tick measures each."""
        allowed = BUDGET * self.world.dt
        if self._measures:
            worst = max(self._running.values(), key=lambda one: one.spent, default=None)
            if worst is not None and spent > allowed:
                self._said = time.monotonic()
                _log.warning(
                    "scripts took %.1f of a tick's %.1f ms, %s alone %.1f ms",
                    1e3 * spent,
                    1e3 * self.world.dt,
                    self._named(worst),
                    1e3 * worst.spent,
                )
            for one in self._running.values():
                one.spent = 0.0
        self._measures = spent > allowed and time.monotonic() - self._said > _SAID_EVERY

    # --- what scripts ask

    def emit(self, kind: str, entity: int, values: dict[str, Any]) -> None:
        """Tells an event, heard in the next tick."""
        if len(self._queue) >= MOST_EVENTS:
            raise ScriptError(f"more than {MOST_EVENTS} events were told in one tick")
        told = Event(kind=kind, entity=entity, values=values)
        for name, value in values.items():
            if not _is_plain(value):
                raise TypeError(
                    f"{name} of the event {kind!r} must be a number, a text or a tuple of such, not a {type(value).__name__}"
                )
        msgspec.json.encode(told)  # raises here, in the script, what could not go over the bus
        self._queue.append(told)

    def require_trust(self) -> None:
        """Raises ScriptError if any script may not run here, so that ticks would be other than they were."""
        for entity in self._query.entities.tolist():
            self.library.require_trusted(self.simulation.world.get(Entity(entity), Script).source)

    def take_events(self) -> list[Event]:
        """What was told and what went wrong, since this was last asked."""
        events, self._events = self._events, []
        return events

    def named(self, name: str) -> list[int]:
        """All entities of a name, in the tree's order."""
        hierarchy = self.simulation.world.hierarchy
        places = hierarchy.order.astype(np.intp)
        ids = self.simulation.world.allocator.ids[places].tolist()
        return [entity for entity, called in zip(ids, hierarchy.names(places), strict=True) if called == name]

    def destroy_later(self, entity: Entity) -> None:
        """Ends an entity when this pass is over."""
        self._doomed.append(entity)

    def start_task(self, owner: Behaviour, call: Call) -> None:
        """Begins an async function beside what runs."""
        one = self._running[owner.entity.id]
        self._begin(one, call)

    def prelude(self, name: str, *arguments: Any) -> Call:
        """A function of prelude.py, to be awaited."""
        return Call(self.library.prelude(name), arguments, {})

    def behaviour_of(self, entity: EntityHandle, behaviour: type[B]) -> B:
        """The behaviour of an entity; LookupError if it has none of this class."""
        one = self._running.get(entity.id)
        if one is None or not is_a(one.itself, behaviour):
            raise LookupError(f"{entity!r} has no running script {behaviour.__name__}")
        return one.itself

    def behaviours_of(self, behaviour: type[B]) -> list[B]:
        """All of a class, in the order in which they run."""
        return [one.itself for one in self._running.values() if is_a(one.itself, behaviour)]

    def random_of(self, behaviour: Behaviour) -> random.Random:
        """A generator of a behaviour's own: the same numbers in each run."""
        return random.Random(f"{behaviour.entity.id}/{type(behaviour).__name__}")

    # --- other times

    def saved(self) -> dict[str, Any]:
        """All that scripts remember, for a state."""
        keeper = Keeper(_Names(self))
        kept = [
            (one.entity, one.source, one.has_started, one.is_enabled, one.failure, *self._memory(keeper, one))
            for one in self._running.values()
        ]
        return {"running": tuple(kept), "queue": tuple(self._queue)}

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
        if (said := (one.entity, str(error))) not in self._cannot:
            self._cannot.add(said)
            _log.error("%s will lose a part of its memory when time is wound back: %s", self._named(one), error)

    def load(self, saved: Mapping[str, Any]) -> None:
        """Puts back what `saved` gave; a script that is not there any more, or other, stays off and says so."""
        self._seen, self._listening = (), {}
        self._doomed.clear()
        self._events.clear()
        # A state of before there were scripts has neither.
        self._queue = list(saved["queue"] or ())
        kept, self._running = saved["running"] or (), {}
        names = _Names(self)
        for entity, source, has_started, is_enabled, failure, *_ in kept:
            one = Running(
                entity=entity, source=source, values={}, has_started=has_started, is_enabled=is_enabled, failure=failure
            )
            self._running[entity] = one
            try:
                if source:
                    one.script = self.loaded(source)
                    one.itself = one.script.behaviour.__new__(one.script.behaviour)
                    one.itself.entity, one.itself.world = EntityHandle(self, entity), self.world
            except ScriptError as error:
                one.failure = one.failure or str(error)
        finder = Finder(names)
        for one, (*_, values, attributes, tasks) in zip(self._running.values(), kept, strict=True):
            try:
                one.values = finder.found(values)
                for name, value in attributes:
                    found = finder.found(value)
                    if one.itself is not None:
                        setattr(one.itself, name, found)
                one.tasks = [finder.task(task) for task in tasks] if one.itself is not None else []
            except Exception as error:  # its code has changed, or what it remembers makes no sense to it
                self._fail(one, error)


def _is_plain(value: object) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, bool | int | float | str)


class _Names:
    """What memories name that lives in the world."""

    def __init__(self, scripts: Scripts) -> None:
        self._scripts = scripts
        self._behaviours = {id(one.itself): one.entity for one in scripts._running.values() if one.itself is not None}

    def word_for(self, value: Any) -> tuple[Any, ...] | None:
        if type(value) is EntityHandle:
            return ("entity", int(value.id))
        if value is self._scripts.world:
            return ("world",)
        if isinstance(value, Behaviour):
            return ("behaviour", self._behaviours.get(id(value), 0))
        return None

    def named_by(self, words: tuple[Any, ...]) -> Any:
        match words:
            case ("entity", int(entity)):
                return EntityHandle(self._scripts, entity)
            case ("world",):
                return self._scripts.world
            case ("behaviour", int(entity)):
                one = self._scripts._running.get(entity)
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
