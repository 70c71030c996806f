"""Calls of scripts: hooks and async functions, each watched, measured where that is asked, and ended alone when it fails."""

from __future__ import annotations

import time
from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

from elys.bus.messages.session import Event
from elys.common.ids import NO_ENTITY
from elys.sim_node.scripts.budget import Budget
from elys.sim_node.scripts.interruption import is_interruption
from elys.sim_node.scripts.running import Running
from elys.sim_node.scripts.task import Hear, Task, hear_nothing
from elys.sim_node.scripts.waiting import Call

if TYPE_CHECKING:
    from elys.sim_node.scripts.runner import Scripts


class Happened:
    """The events of a tick as those hear them who wait: of each name the first that is told to them, or to all."""

    def __init__(self, heard: list[Event]) -> None:
        self._heard = heard
        self._first: dict[int, dict[str, int]] = {NO_ENTITY: {}}  # where it stands, by whom it is told to and name
        for place, event in enumerate(heard):
            self._first.setdefault(event.entity, {}).setdefault(event.kind, place)
        self._to_all = self._of(self._first[NO_ENTITY].values())

    def to(self, entity: int) -> dict[str, Event]:
        """What one hears; all those to whom alone nothing is told share theirs."""
        if entity not in self._first:
            return self._to_all
        return self._of(sorted((*self._first[entity].values(), *self._first[NO_ENTITY].values()), reverse=True))

    def _of(self, places: Iterable[int]) -> dict[str, Event]:
        return {self._heard[place].kind: self._heard[place] for place in places}


class Calls:
    """Calls the scripts of a simulation."""

    def __init__(self, scripts: Scripts, budget: Budget) -> None:
        self._scripts = scripts
        self._budget = budget

    def all(self, hook: str, *arguments: Any) -> None:
        """Calls a hook of all that have it. One loop, entered anew only behind a script that fails: this is what a tick costs."""
        listening, place, watchdog = self._scripts.listening(hook), 0, self._scripts.watchdog
        measures = self._budget.measures
        watchdog.is_inside = True
        while place < len(listening):
            try:
                for one in listening[place:]:
                    watchdog.call += 1
                    watchdog.who = one
                    place += 1
                    began = time.thread_time() if measures else 0.0
                    result = getattr(one.itself, hook)(*arguments)
                    if result is not None and type(result) is Call:
                        self.begin(one, result)
                    if measures:
                        one.spent += time.thread_time() - began
            except BaseException as error:
                watchdog.is_inside = False
                if is_interruption(error):
                    raise
                self._scripts.fail(listening[place - 1], error)
                watchdog.is_inside = True
        watchdog.is_inside = False

    def one(self, one: Running, hook: str, *arguments: Any) -> None:
        """Calls a hook of one."""
        if hook not in one.hooks or not self._scripts.simulation.world.is_alive(one.entity):
            return
        began = time.thread_time() if self._budget.measures else 0.0
        try:
            with self._scripts.watchdog.inside(who=one):
                result = getattr(one.itself, hook)(*arguments)
                if type(result) is Call:
                    self.begin(one, result)
        except BaseException as error:
            if is_interruption(error):
                raise
            self._scripts.fail(one, error)
        if self._budget.measures:
            one.spent += time.thread_time() - began

    def begin(self, one: Running, call: Call) -> None:
        """Begins an async function, which goes as far as it can at once."""
        task = Task.of(call, self._scripts.tick, self._ticks_in)
        one.tasks.append(task)
        task.advance(self._scripts.tick, self._ticks_in, hear_nothing)
        if task.is_done:
            one.tasks.remove(task)

    def resume(self, heard: list[Event]) -> None:
        """Async functions go on, of who has any. One loop as in `all`, for the same reason."""
        waiting = [one for one in self._scripts.running() if one.tasks and one.is_enabled]
        place, watchdog = 0, self._scripts.watchdog
        tick, measures = self._scripts.tick, self._budget.measures
        hear: Hear = hear_nothing
        happened = Happened(heard)
        watchdog.is_inside = True
        while place < len(waiting):
            try:
                for one in waiting[place:]:
                    watchdog.call += 1
                    watchdog.who = one
                    place += 1
                    began = time.thread_time() if measures else 0.0
                    if heard:
                        hear = partial(self._scripts.events.awaited, happened.to(one.entity))
                    for task in one.tasks.copy():
                        task.advance(tick, self._ticks_in, hear)
                        if task.is_done and task in one.tasks:
                            one.tasks.remove(task)
                    if measures:
                        one.spent += time.thread_time() - began
            except BaseException as error:
                watchdog.is_inside = False
                if is_interruption(error):
                    raise
                self._scripts.fail(waiting[place - 1], error)
                watchdog.is_inside = True
        watchdog.is_inside = False

    def _ticks_in(self, seconds: float) -> int:
        return round(min(seconds, 1e9) * self._scripts.simulation.settings.tick_rate)
