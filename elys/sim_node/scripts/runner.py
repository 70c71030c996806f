"""Runs the behaviours of a world: who has one, what becomes of them each tick, and what they remember.

A tick, for scripts: those whose component came, changed or went; what happened since, told to each in turn; functions that wait
go on; `fixed_update`. After physics: `update`. Scripts run in the order of their entities' ids. While one of them holds time
(holding.py), only that one is called.
"""

from __future__ import annotations

import logging
import random
import time
from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np

from elys.bus.messages.session import Event
from elys.common.assets.store import is_reference
from elys.common.components import Script
from elys.common.errors import ScriptError
from elys.common.ids import Entity, index_of
from elys.sim_node.scripts.behaviour import Behaviour, is_a
from elys.sim_node.scripts.budget import Budget
from elys.sim_node.scripts.calls import Calls
from elys.sim_node.scripts.event_queue import EventQueue
from elys.sim_node.scripts.field_values import field_values
from elys.sim_node.scripts.game_world import GameWorld
from elys.sim_node.scripts.handles import EntityHandle
from elys.sim_node.scripts.happenings import contacts_of, visits_of
from elys.sim_node.scripts.holding import CALLED, MOST_MISSED, Hold
from elys.sim_node.scripts.interruption import is_interruption
from elys.sim_node.scripts.library import LoadedScript, ScriptLibrary
from elys.sim_node.scripts.memory_watch import MemoryWatch
from elys.sim_node.scripts.modules import line_in
from elys.sim_node.scripts.program import Program
from elys.sim_node.scripts.pushes import Pushes
from elys.sim_node.scripts.recollection import Recollection
from elys.sim_node.scripts.running import Running, failure_text
from elys.sim_node.scripts.sounds import ScriptSounds
from elys.sim_node.scripts.task import Task
from elys.sim_node.scripts.waiting import Call
from elys.sim_node.scripts.watchdog import ScriptGrowth, ScriptTimeout, Watchdog, reason_of

if TYPE_CHECKING:
    from elys.sim_node.ecs.world import World
    from elys.sim_node.simulation import Simulation

B = TypeVar("B", bound=Behaviour)
MOST_SAID: Final = 10  # scripts that fail in a tick for the same reason, each with its entity
MOST_SPAWNED: Final = 10_000  # entities in a tick
MOST_THERE: Final = 50_000  # entities in the world beyond which scripts spawn none
LOADING_LIMIT: Final = 20.0  # [s] that a file may take to be run as it is loaded: it may import much
_log = logging.getLogger(__name__)


class Scripts:
    """All behaviours of one simulation."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.world = GameWorld(self)
        self._worlds: dict[str, GameWorld] = {}  # by script
        self.library = ScriptLibrary(simulation.assets)
        self._query = simulation.world.query(Script)
        self._running: dict[int, Running] = {}  # by entity, rising
        self._seen: tuple[object, ...] = ()
        self.events = EventQueue(self)
        self._doomed: list[Entity] = []
        self._events: list[Event] = []
        self.sounds = ScriptSounds(simulation)
        self.hold = Hold()
        self.pushes = Pushes(simulation)
        self._recollection = Recollection(self)
        self.watchdog = Watchdog(named=self.named_script)
        self._budget = Budget()
        self._calls = Calls(self, self._budget)
        self._memory = MemoryWatch()
        self._spent = 0.0  # [s] in this tick, before physics
        self._spawned = 0  # entities in this tick
        self._failed: Counter[tuple[str, str]] = Counter()  # in this tick, by script and what was the matter
        self._are_new = False  # some have not started yet
        self._listening: dict[str, list[Running]] = {}  # by hook; made anew when anybody comes, goes or changes

    def __len__(self) -> int:
        return len(self._running)

    @property
    def tick(self) -> int:
        """Steps done, but for those in which time was held: what scripts count in."""
        return self.simulation.tick - self.hold.ticks

    # --- the tick

    def run(self, world: World) -> None:
        """Before physics: all but `update`."""
        self.hold.stands = False
        self._spawned = 0
        if not (self._running or len(self._query)):
            self._events += self.events.take()
            return
        began = time.thread_time()
        with self.watchdog.watching(), self._memory.bounded():
            self._run_early()
        self._spent = time.thread_time() - began

    def _run_early(self) -> None:
        self._follow()
        heard = self.events.take()
        self._events += heard
        holder = self._holder()
        if holder is not None:
            self._run_holder(holder, heard)
            return
        heard = [*self.hold.take_missed(), *heard]
        for one in self._waiting_to_start():
            one.has_started = True
            self._listening = {}
            self._calls.one(one, "start")
        self._tell(heard)
        self._calls.resume(heard)
        self._calls.all("fixed_update", self.world.dt)
        self._end_doomed()

    def _holder(self) -> Running | None:
        """Who holds time; nobody does who is off, gone or never called in a hold, or time would stand for ever."""
        one = self._running.get(self.hold.by)
        if one is None or not one.has_started or not one.hooks & CALLED:
            self.hold.by = 0
            return None
        return one

    def _run_holder(self, one: Running, heard: list[Event]) -> None:
        hold = self.hold
        hold.stands, hold.ticks = True, hold.ticks + 1
        hold.missed += heard
        if len(hold.missed) > MOST_MISSED:
            hold.missed.clear()
            self.fail(one, ScriptError(f"more than {MOST_MISSED} events were told while it held time"))
        self._calls.one(one, "fixed_update", self.world.dt)
        self._end_doomed()

    def run_late(self, world: World) -> None:
        """After physics: `update`."""
        if not self._running:
            return
        began = time.thread_time()
        with self.watchdog.watching(), self._memory.bounded():
            if not self.hold.stands:
                self._calls.all("update", self.world.dt)
            elif (holder := self._running.get(self.hold.by)) is not None:
                self._calls.one(holder, "update", self.world.dt)
            self._end_doomed()
        spent = self._spent + time.thread_time() - began
        self._say_how_many_failed()
        self._budget.look(spent, self._running.values(), dt=self.world.dt, named=self.named_script)
        self._look_at_memory()

    def _waiting_to_start(self) -> list[Running]:
        if not self._are_new:
            return []
        self._are_new = False
        return [one for one in self._running.values() if one.is_enabled and not one.has_started and not one.failure]

    def _tell(self, heard: list[Event]) -> None:
        for happening in (*visits_of(self), *contacts_of(self)):
            self._calls.one(self._running[happening.entity], happening.hook, *happening.arguments)
        for one in self.listening("on_event") if heard else ():
            for event in heard:
                if not event.entity or event.entity == one.entity:
                    for told in self.events.as_heard(one, event):
                        self._calls.one(one, "on_event", told)
        for player in self.world.players:
            self._calls.all("on_input", player)

    def listening(self, hook: str) -> list[Running]:
        """Those whose hook is called now, in their order."""
        if hook not in self._listening:
            self._listening[hook] = [one for one in self._running.values() if one.has_started and hook in one.hooks]
        return self._listening[hook]

    # --- who runs

    def _follow(self) -> None:
        """Behaviours become what the components say."""
        table = self.simulation.world.table(Script)
        entities, rows = self._query.entities, self._query.rows(Script)
        switches = self.simulation.world.hierarchy.enabled_in_hierarchy[self._query.indices]
        columns = [table.column(name)[rows] for name in ("source", "enabled", "values")]
        # Texts are told by their rows: where those are others, all is looked at anew.
        seen = (self.simulation.world.strings, *(column.tobytes() for column in (entities, switches, *columns)))
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
                began = time.thread_time() if self._budget.measures else 0.0
                self._become(one, component)
                if self._budget.measures:
                    one.spent += time.thread_time() - began
        self._running = dict(sorted(self._running.items()))
        self._are_new = True
        self._listening = {}

    def _become(self, one: Running, component: Script) -> None:
        try:
            script = self.loaded(component.source) if component.source != one.source else None
            with self.watchdog.inside(who=one):
                if script is not None:
                    self._change_script(one, script)
                one.source = component.source
                if one.itself is not None and one.script is not None and component.values != one.values:
                    given = field_values(self, one.script, component.values, before=one.values)
                    one.values = component.values
                    for name, value in given.items():
                        setattr(one.itself, name, value)
        except BaseException as error:
            if is_interruption(error):
                raise
            one.source = component.source
            self.fail(one, error)

    def loaded(self, source: str) -> LoadedScript:
        """A script's class. Raises ScriptError, also for a file that does not come back, or takes all memory."""
        try:
            with self.watchdog.watching(), self.watchdog.inside(LOADING_LIMIT):
                return self.library.load(source)
        except ScriptTimeout as error:
            where = line_in(self.library.place_of(source), error)
            raise ScriptError(
                f"{where}: the file did not come back within {LOADING_LIMIT:g} s as it was loaded"
            ) from error
        except (ScriptGrowth, MemoryError) as error:
            raise ScriptError(f"{line_in(self.library.place_of(source), error)}: {reason_of(error)}") from error

    def _change_script(self, one: Running, script: LoadedScript) -> None:
        """A new behaviour, or the same one as its file was saved anew, which goes on with what it remembers."""
        before, one.script = one.script, script
        if before is not None and before.name == script.name and one.itself is not None:
            one.itself.__class__ = script.behaviour
            one.itself.world = self.world_of(script.source)
            kept = [task for task in one.tasks if all(self._is_current(frame.program, script) for frame in task.frames)]
            if len(kept) < len(one.tasks):
                _log.info("%s: what it was waiting in has changed and ends", self.named_script(one))
            one.tasks = kept
            return
        if one.itself is not None:
            self._end(one)
        one.itself = script.behaviour.__new__(script.behaviour)
        one.itself.entity, one.itself.world = EntityHandle(self, one.entity), self.world_of(script.source)
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
                with self.watchdog.inside(who=one):
                    one.itself.on_destroy()
            except BaseException as error:
                if is_interruption(error):
                    raise
                self.fail(one, error)
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

    def fail(self, one: Running, error: BaseException) -> None:
        """Switches a script off and says why; nothing else is harmed."""
        with self.watchdog.inside(who=one):  # an error's text is told by code of the script's own
            text = failure_text(one, error)
        one.failure = text
        one.tasks.clear()
        self._listening = {}
        self._failed[one.source, text] += 1
        if self._failed[one.source, text] > MOST_SAID:
            return
        _log.error("%s is off: %s", self.named_script(one), text)
        self._events.append(Event(kind="script", entity=one.entity, values={"text": text}))

    def _say_how_many_failed(self) -> None:
        for (_, text), count in self._failed.items():
            if count > MOST_SAID:
                _log.error("%d more are off for the same reason: %s", count - MOST_SAID, text)
        self._failed.clear()

    def make_room(self, count: int) -> None:
        """A script spawns so many entities. ScriptError where something spawns without end."""
        there = self.simulation.world.entity_count
        if self._spawned + count > MOST_SPAWNED:
            raise ScriptError(f"more than {MOST_SPAWNED} entities were spawned in one tick: spread it over several")
        if there + count > MOST_THERE:
            raise ScriptError(
                f"there are {there} entities, and scripts may spawn no more: something spawns without end, or destroys too little"
            )
        self._spawned += count

    def named_script(self, one: Running) -> str:
        name = one.script.name if one.script is not None else "the script"
        return f"{name} of {self.simulation.named(one.entity)}"

    def _look_at_memory(self) -> None:
        """Switches off who holds most when all together have grown too much, and lets go of what that was."""
        if self._memory.is_too_much() and (found := self._memory.culprit(self._running.values())) is not None:
            one, sentence = found
            self.fail(one, ScriptError(sentence))
            one.forget()

    # --- what scripts ask

    def running(self) -> list[Running]:
        """All behaviours, in their order."""
        return list(self._running.values())

    def tasks(self) -> list[Task]:
        """All async functions that have begun."""
        return [task for one in self._running.values() for task in one.tasks]

    def world_of(self, source: str) -> GameWorld:
        """The world as one script sees it."""
        return self._worlds.setdefault(source, GameWorld(self, source))

    def hear(self, events: list[Event]) -> None:
        """Tells what happened in this tick; heard in the next one."""
        self.events.waiting += events

    def require_trust(self) -> None:
        """Raises ScriptError if any script may not run here, so that ticks would be other than they were."""
        for entity in self._query.entities.tolist():
            self.library.require_trusted(self.simulation.world.get(Entity(entity), Script).source)

    def take_events(self) -> list[Event]:
        """What was told and what went wrong, since this was last asked."""
        events, self._events = [*self._events, *self.sounds.take()], []
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
        one = self._running.get(owner.entity.id)
        if one is None:
            raise ScriptError(f"{type(owner).__name__} is being taken away: nothing more can be begun in it")
        self._calls.begin(one, call)

    def source_named(self, name: str) -> str | None:
        """The content of the first script of the world that is called so, as "door.py" or "door.py#Door"; None if none is."""
        file, _, behaviour = name.partition("#")
        for entity in sorted(self._query.entities.tolist(), key=index_of):
            source = self.simulation.world.get(Entity(entity), Script).source
            if is_reference(source) and self.library.is_called(source, file, behaviour):
                return source
        return None

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
        running = self._recollection.kept(self._running)
        return {
            "running": running,
            "queue": tuple(self.events.waiting),
            "hold": self.hold.saved(),
            "pushes": self.pushes.saved(),
        }

    def load(self, saved: Mapping[str, Any]) -> None:
        """Puts back what `saved` gave; a script that is not there any more, or other, stays off and says so."""
        self._seen, self._listening = (), {}
        self._doomed.clear()
        self._events.clear()
        # A state of before there were scripts has neither.
        self.events.waiting = list(saved["queue"] or ())
        self.hold = Hold.of(saved["hold"])
        self.pushes.load(saved["pushes"] or ())
        self._running = {}
        for one, error in self._recollection.found(saved["running"] or (), self._running):
            self.fail(one, error)
