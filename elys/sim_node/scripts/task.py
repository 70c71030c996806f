"""A running `async` function: where it stands, its variables and what it waits for, all of it values that a state can hold."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from elys.sim_node.scripts.blocks import RESULT, Block, Locals
from elys.sim_node.scripts.program import (
    Await,
    Begin,
    Catch,
    Do,
    Forget,
    Guard,
    Jump,
    Next,
    Program,
    Reraise,
    Return,
    Unguard,
    Unless,
)
from elys.sim_node.scripts.waiting import Awaited, Call, EventNamed, Seconds, Several, Ticks, Until, require_awaited

DEEPEST: Final = 200  # async functions that await one another
# Finds the first of some names and classes of events that was told in this tick; None if none was.
Hear = Callable[[tuple[str | type[Any], ...]], Any]


@dataclass(slots=True)
class Frame:
    """One async function that has begun.

    Attributes:
        place: the step that comes next; the one that waits, while it waits.
        guards: where errors go on, innermost last, each with how many errors were being dealt with around it.
        errors: those that are being dealt with; never any while it waits.
    """

    program: Program
    variables: Locals
    place: int = 0
    guards: list[tuple[int, int]] = field(default_factory=list)
    errors: list[BaseException] = field(default_factory=list)


@dataclass(slots=True)
class Wait:
    """What a task waits for.

    Attributes:
        due: the tick at which it is over; -1 for none.
        names: events that end it, and classes of such.
        parts: tasks that have to be over, `is_first` if one of them is enough; finished ones keep their `result`.
        asks: whether the place's own condition is asked again in each tick.
    """

    due: int = -1
    names: tuple[str | type[Any], ...] = ()
    parts: list[Task] = field(default_factory=list)
    is_first: bool = False
    asks: bool = False


@dataclass(slots=True)
class Task:
    """Async functions that await one another, the innermost last."""

    frames: list[Frame]
    wait: Wait | None = None
    is_done: bool = False
    result: Any = None

    @classmethod
    def of(cls, awaited: Awaited, now: int, ticks_in: Callable[[float], int]) -> Task:
        """A task that does nothing but wait for something, or run an async function."""
        task = cls([])
        if isinstance(awaited, Call):
            task.frames.append(_begun(awaited))
        else:
            task.wait = _wait_for(awaited, now, ticks_in)
        return task

    def waits_for(self) -> Iterator[str | type[Any]]:
        """The events that would end a wait of it."""
        if self.wait is not None:
            yield from self.wait.names
            for part in self.wait.parts:
                yield from part.waits_for()

    def advance(self, now: int, ticks_in: Callable[[float], int], hear: Hear) -> None:
        """Goes on as far as it can at a tick; `hear` finds this tick's events.

        Raises:
            Exception: what a script raised and did not deal with. The task is over then.
        """
        try:
            if self.wait is None or self._end_wait(now, ticks_in, hear):
                self._run(now, ticks_in)
        except BaseException as error:
            self.is_done = True
            if self.frames and not hasattr(error, "place"):  # ended from outside: that may have been between two blocks
                error.place = self.frames[-1].program.place_at(self.frames[-1].place)  # type: ignore[attr-defined]
            raise

    def _end_wait(self, now: int, ticks_in: Callable[[float], int], hear: Hear) -> bool:
        """Whether the wait is over and functions go on; what it raises is raised where they await."""
        try:
            is_over, result = self._look(now, ticks_in, hear)
        except Exception as error:
            self.wait = None
            self._fail(error)
            return True
        if not is_over:
            return False
        self.wait = None
        if not self.frames:
            self.is_done, self.result = True, result
            return False
        self._resume(result)
        return True

    def _look(self, now: int, ticks_in: Callable[[float], int], hear: Hear) -> tuple[bool, Any]:
        """Whether the wait is over, and what came of it."""
        wait = self.wait
        assert wait is not None
        if wait.parts:
            for part in wait.parts:
                if not part.is_done:
                    part.advance(now, ticks_in, hear)
            if wait.is_first:
                done = next((number for number, part in enumerate(wait.parts) if part.is_done), None)
                return done is not None, (done, wait.parts[done].result) if done is not None else None
            return all(part.is_done for part in wait.parts), [part.result for part in wait.parts]
        if wait.asks:
            frame = self.frames[-1]
            step = frame.program.steps[frame.place]
            assert isinstance(step, Await)
            answer = step.run(frame.variables).condition()
            return bool(answer), answer
        if wait.names:
            found = hear(wait.names)
            return found is not None, found
        return now >= wait.due, None

    def _resume(self, result: Any) -> None:
        """What was awaited is over: its result goes where the innermost function wants it."""
        frame = self.frames[-1]
        step = frame.program.steps[frame.place]
        assert isinstance(step, Await)
        try:
            _store(step.store, frame.variables, result)
        except Exception as error:
            self._fail(error)
        else:
            frame.place += 1

    def _run(self, now: int, ticks_in: Callable[[float], int]) -> None:
        while self.frames:
            frame = self.frames[-1]
            try:
                awaited = _run_frame(frame)
            except Exception as error:
                self._fail(error)
                continue
            if isinstance(awaited, _Returned):
                self.frames.pop()
                if not self.frames:
                    self.is_done, self.result = True, awaited.value
                    return
                self._resume(awaited.value)
            elif isinstance(awaited, Call):
                if len(self.frames) >= DEEPEST:
                    self._fail(RecursionError(f"{DEEPEST} async functions await one another"))
                    continue
                self.frames.append(_begun(awaited))
            else:
                self.wait = _wait_for(awaited, now, ticks_in)
                return

    def _fail(self, error: Exception) -> None:
        """An error leaves functions until one has a guard."""
        while self.frames:
            frame = self.frames[-1]
            if frame.guards:
                frame.place, depth = frame.guards.pop()
                frame.errors = [*frame.errors[:depth], error]
                return
            self.frames.pop()
        raise error


@dataclass(frozen=True, slots=True)
class _Returned:
    value: Any


def hear_nothing(names: tuple[str | type[Any], ...]) -> None:
    """No event was told in this tick."""


def _begun(call: Call) -> Frame:
    return Frame(call.program, call.program.bind(*call.arguments, **call.named))


def _wait_for(awaited: Awaited, now: int, ticks_in: Callable[[float], int]) -> Wait:
    match awaited:
        case Seconds(duration=duration):
            return Wait(due=now + max(1, ticks_in(duration)))
        case Ticks(count=count):
            return Wait(due=now + max(1, count))
        case EventNamed(names=names):
            return Wait(names=names)
        case Until():
            return Wait(asks=True)
        case Several(parts=parts, is_first=is_first):
            return Wait(parts=[Task.of(part, now, ticks_in) for part in parts], is_first=is_first)
        case Call():
            return Wait(parts=[Task.of(awaited, now, ticks_in)])


def _run_frame(frame: Frame) -> Awaited | _Returned:
    """Runs steps until one waits, calls or returns; the place is then that of an Await."""
    steps, variables = frame.program.steps, frame.variables
    while True:
        match steps[frame.place]:
            case Do(run=run):
                _run_block(frame, run)
            case Await(run=run, store=store):
                awaited = run(variables)
                require_awaited(awaited, "await")
                if not (isinstance(awaited, Until) and (answer := awaited.condition())):
                    return awaited
                _store(store, variables, answer)
            case Jump(target=target):
                frame.place = target
                continue
            case Unless(run=run, target=target):
                if not _run_block(frame, run):
                    frame.place = target
                    continue
            case Begin(run=run, slot=slot):
                variables[slot] = [list(_run_block(frame, run)), 0]
            case Next(slot=slot, store=store, target=target):
                items, number = variables[slot]
                if number >= len(items):
                    del variables[slot]
                    frame.place = target
                    continue
                variables[slot][1] = number + 1
                _store(store, variables, items[number])
            case Guard(target=target):
                frame.guards.append((target, len(frame.errors)))
            case Unguard():
                frame.guards.pop()
            case Catch(kinds=kinds, store=store, target=target):
                if kinds is not None and not isinstance(frame.errors[-1], _run_block(frame, kinds)):
                    frame.place = target
                    continue
                _store(store, variables, frame.errors[-1])
            case Forget(name=name):
                frame.errors.pop()
                variables.pop(name, None)
            case Reraise():
                raise frame.errors.pop()
            case Return(run=run):
                return _Returned(None if run is None else run(variables))
        frame.place += 1


def _store(store: Block | None, variables: Locals, result: Any) -> None:
    if store is not None:
        variables[RESULT] = result
        try:
            store(variables)
        finally:
            del variables[RESULT]


def _run_block(frame: Frame, run: Callable[[Locals], Any]) -> Any:
    if not frame.errors:
        return run(frame.variables)
    try:
        raise frame.errors[-1]  # so that a bare `raise` means it, and a new error names it as its context
    except BaseException:
        return run(frame.variables)
