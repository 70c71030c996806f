"""Events that are told in a tick and heard in the next, by name or as values of classes that scripts declare."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Final

from elys.bus.messages.commands import Tell
from elys.bus.messages.session import Event
from elys.common.errors import RequestError, ScriptError
from elys.sim_node.scripts.event_names import event_name, is_event_class
from elys.sim_node.scripts.handles import EntityHandle
from elys.sim_node.scripts.happenings import checked_event, event_of
from elys.sim_node.scripts.typed_events import EventClasses
from elys.sim_node.scripts.watchdog import ScriptGrowth, ScriptTimeout, reason_of

if TYPE_CHECKING:
    from elys.sim_node.scripts.runner import Scripts
    from elys.sim_node.scripts.running import Running

MOST_EVENTS: Final = 10_000  # told in a tick; a script that tells more fails
_log = logging.getLogger(__name__)


class EventQueue:
    """What scripts are told.

    Attributes:
        waiting: told and not heard yet.
    """

    def __init__(self, scripts: Scripts) -> None:
        self._scripts = scripts
        self._classes = EventClasses(scripts.library.names_beside, lambda entity: EntityHandle(scripts, entity))
        self.waiting: list[Event] = []
        self._listening: list[Running] = []  # of whom `_taken` says, by name, which classes they take
        self._taken: dict[str, list[type[Any]]] = {}

    def take(self) -> list[Event]:
        """What is heard now."""
        heard, self.waiting = self.waiting, []
        return heard

    def emit(self, event: str | Any, entity: int, values: dict[str, Any]) -> None:
        """Tells what a script does, by name or as a value of a class.

        Raises:
            TypeError: it is of other types than its class, or that of a listener, says. ScriptError: there are too many.
        """
        if len(self.waiting) >= MOST_EVENTS:
            raise ScriptError(f"more than {MOST_EVENTS} events were told in one tick")
        name = event
        if is_event_class(type(event)):
            if values:
                raise TypeError(f"emit() takes the values of a {type(event).__name__} from itself, and no others")
            name, values = event_name(type(event)), self._classes.values_of(event)
        elif not isinstance(event, str):
            raise TypeError(
                f"emit() takes the name of an event, or a named tuple or Struct, not a {type(event).__name__}"
            )
        told = checked_event(name, entity, values)
        self._require_fitting(told, self._heard_by_hooks(name))
        self.waiting.append(told)

    def tell(self, command: Tell) -> None:
        """Tells what somebody outside does; RequestError if he may not, or it is not as those who listen say."""
        if len(self.waiting) >= MOST_EVENTS:
            raise RequestError(f"{MOST_EVENTS} events are told in this tick already")
        scripts = self._scripts
        told = event_of(command, is_alive=scripts.simulation.world.is_alive)
        awaited = [kind for task in scripts.tasks() for kind in task.waits_for()]
        kinds = [kind for kind in awaited if not isinstance(kind, str) and event_name(kind) == told.kind]
        kinds += self._heard_by_hooks(told.kind)
        if kinds:
            try:
                with scripts.watchdog.watching(), scripts.watchdog.inside():
                    self._require_fitting(told, kinds)
            except (TypeError, ScriptTimeout, ScriptGrowth) as error:
                raise RequestError(reason_of(error) or str(error)) from error
        self.waiting.append(told)

    def awaited(self, happened: Mapping[str, Event], names: tuple[str | type[Any], ...]) -> Any:
        """The first of some names and classes that has happened; None if none has."""
        return self._classes.heard(happened, names)

    def as_heard(self, one: Running, event: Event) -> list[Any]:
        """What the `on_event` of a script is called with: the event, or if it takes classes a value of that one."""
        kinds = one.script.events if one.script is not None else ()
        if not kinds:
            return [event]
        if one.failure:
            return []
        for kind in kinds:
            if event_name(kind) == event.kind:
                try:
                    with self._scripts.watchdog.inside(who=one):
                        return [self._classes.made(event, kind)]
                except TypeError as error:  # told before there was such a listener
                    _log.error("%s does not hear an event: %s", self._scripts.named_script(one), error)
                except (ScriptTimeout, ScriptGrowth) as error:
                    self._scripts.fail(one, error)
        return []

    def _heard_by_hooks(self, name: str) -> list[type[Any]]:
        """The classes as which `on_event` of somebody takes an event."""
        listening = self._scripts.listening("on_event")
        if listening is not self._listening:
            self._listening, self._taken = listening, {}
            for script in {id(one.script): one.script for one in listening if one.script is not None}.values():
                for kind in script.events:
                    self._taken.setdefault(event_name(kind), []).append(kind)
        return self._taken.get(name, [])

    def _require_fitting(self, told: Event, kinds: Iterable[type[Any]]) -> None:
        for kind in kinds:
            self._classes.made(told, kind)
