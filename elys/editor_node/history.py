"""Undo and redo: every edit goes to the host as commands, one edit after the other, and leaves behind what takes it back.

    perform ─> queue ─> send ─> replies ─> wait for the echo ─> entry in `undoable`
                                                                    │ undo: its commands are an edit too,
                                              entry in `redoable` <─┘ whose inverse is what redoes it

One edit is under way at a time, so that an inverse is always computed from a mirror that shows the edits before it. Edits of
one stroke (a drag, from button down to button up) make one entry, and of those that wait only the newest is sent.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from elys.bus.messages.commands import Command, CommandReply, Despawn, Reparent, Spawn
from elys.common.errors import BusError, RequestError
from elys.editor_node import edits
from elys.editor_node.scene_mirror import EditorScene

ECHO_TIMEOUT: Final = 0.2  # [s] after which an edit that changed nothing visible is taken as done
ENTRY_LIMIT: Final = 500

Send = Callable[[Command], Awaitable[CommandReply]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """An edit that can be taken back (or made again): what to send, and what the menu calls it."""

    label: str
    commands: tuple[Command, ...]
    stroke: object = None
    respawned: tuple[tuple[int, ...], ...] = ()  # for each Spawn among the commands the ids its entities had before


@dataclass(slots=True, kw_only=True)
class Outcome:
    """What became of an edit."""

    label: str
    accepted: int = 0
    refusals: list[str] = field(default_factory=list)
    spawned: tuple[int, ...] = ()  # the topmost of the entities that came to be
    tick: int = -1
    stroke: object = None


@dataclass(slots=True, kw_only=True)
class _Work:
    kind: Literal["do", "undo", "redo"]
    label: str = ""
    commands: tuple[Command, ...] = ()
    stroke: object = None
    done: asyncio.Future[Outcome]

    @property
    def targets(self) -> list[tuple[Any, ...]]:
        """What it changes."""
        return [edits.target_of(command) for command in self.commands]


class History:
    """The edits of this editor. `run` must be running for anything to be sent."""

    def __init__(
        self,
        send: Send,
        scene: EditorScene,
        *,
        on_outcome: Callable[[Outcome], None] = lambda outcome: None,
        on_new_ids: Callable[[dict[int, int]], None] = lambda new_ids: None,
    ) -> None:
        self._send = send
        self._scene = scene
        self._on_outcome = on_outcome
        self._on_new_ids = on_new_ids
        self._queue: deque[_Work] = deque()
        self._wake = asyncio.Event()
        self._under_way: _Work | None = None
        self._undoable: list[Entry] = []
        self._redoable: list[Entry] = []
        self.version = 0  # rises with every edit that was accepted

    @property
    def undo_label(self) -> str:
        """What undo would take back; empty when there is nothing."""
        return self._undoable[-1].label if self._undoable else ""

    @property
    def redo_label(self) -> str:
        """What redo would make again; empty when there is nothing."""
        return self._redoable[-1].label if self._redoable else ""

    @property
    def is_busy(self) -> bool:
        """Whether an edit is under way or waits."""
        return self._under_way is not None or bool(self._queue)

    def is_stroke_busy(self, stroke: object) -> bool:
        """Whether an edit of this stroke is not answered and echoed yet."""
        under_way = self._under_way
        return (under_way is not None and under_way.stroke == stroke) or any(w.stroke == stroke for w in self._queue)

    def perform(self, label: str, commands: tuple[Command, ...], *, stroke: object = None) -> asyncio.Future[Outcome]:
        """Makes an edit; its outcome may be awaited. With the `stroke` of the last one it joins that one's entry."""
        last = self._queue[-1] if self._queue else None
        targets = [edits.target_of(command) for command in commands]
        if last is not None and stroke is not None and last.stroke == stroke and last.targets == targets:
            last.commands = commands
            return last.done
        return self._enqueue(_Work(kind="do", label=label, commands=commands, stroke=stroke, done=_future()))

    def undo(self) -> asyncio.Future[Outcome]:
        """Takes the last edit back, after those that are still under way."""
        return self._enqueue(_Work(kind="undo", done=_future()))

    def redo(self) -> asyncio.Future[Outcome]:
        """Makes again what was taken back last."""
        return self._enqueue(_Work(kind="redo", done=_future()))

    def forget(self) -> None:
        """Drops all entries: another scene, whose ids mean others."""
        self._undoable.clear()
        self._redoable.clear()

    async def settle(self) -> None:
        """Waits until nothing is under way."""
        while self.is_busy:
            work = self._queue[-1] if self._queue else self._under_way
            assert work is not None
            await asyncio.wait([work.done])
            await asyncio.sleep(0)

    async def run(self) -> None:
        """Sends what is enqueued, until cancelled."""
        while True:
            while not self._queue:
                self._wake.clear()
                await self._wake.wait()
            work = self._under_way = self._queue.popleft()
            try:
                outcome = await self._carry_out(work)
                work.done.set_result(outcome)
            finally:
                self._under_way = None
                if not work.done.done():
                    work.done.cancel()
            self._on_outcome(outcome)

    def _enqueue(self, work: _Work) -> asyncio.Future[Outcome]:
        self._queue.append(work)
        self._wake.set()
        return work.done

    async def _carry_out(self, work: _Work) -> Outcome:
        match work.kind:
            case "do":
                outcome, inverse = await self._apply(Entry(label=work.label, commands=work.commands))
                outcome.stroke = work.stroke
                if inverse.commands:
                    self._remember(inverse, work.stroke)
                    self._redoable.clear()
            case "undo" | "redo":
                source, target = self._undoable, self._redoable
                if work.kind == "redo":
                    source, target = target, source
                if not source:
                    return Outcome(label="")
                entry = source.pop()
                outcome, inverse = await self._apply(entry)
                outcome.label = f"{work.kind.capitalize()} {entry.label}"
                if inverse.commands:
                    target.append(inverse)
        if outcome.accepted:
            self.version += 1
        return outcome

    async def _apply(self, entry: Entry) -> tuple[Outcome, Entry]:
        """Sends an entry's commands; its outcome, and the entry that takes back what was accepted of it."""
        outcome = Outcome(label=entry.label)
        inverses: list[Command] = []
        respawned: list[tuple[int, ...]] = []
        old_ids = deque(entry.respawned)
        renamed: dict[int, int] = {}
        for batch in _batches(entry.commands, self._scene):
            if renamed:  # what came back a moment ago may be what the next are about
                batch = tuple(edits.with_new_ids(command, renamed) for command in batch)
            befores = [edits.watched_value(command, self._scene) for command in batch]
            backs = [edits.inverse_of(command, self._scene) for command in batch]
            gone = [self._ids_below(command) for command in backs]
            replies = await self._send_all(batch, outcome)
            new_ids: dict[int, int] = {}
            for command, reply, back, ids in zip(batch, replies, backs, gone, strict=True):
                before_ids = old_ids.popleft() if isinstance(command, Spawn) and old_ids else ()
                if reply is None:
                    continue
                new_ids.update(zip(before_ids, reply.entities, strict=False))
                inverses[:0] = back or edits.inverse_of_reply(command, reply)
                respawned[:0] = ids
                outcome.spawned += edits.roots_of(command, reply)
            await self._echo(batch, replies, befores)
            if new_ids:
                renamed |= new_ids
                self._follow(new_ids)
                inverses = [edits.with_new_ids(command, new_ids) for command in inverses]
        return outcome, Entry(label=entry.label, commands=tuple(inverses), respawned=tuple(respawned))

    async def _send_all(self, batch: tuple[Command, ...], outcome: Outcome) -> list[CommandReply | None]:
        answers = await asyncio.gather(*(self._send(command) for command in batch), return_exceptions=True)
        replies: list[CommandReply | None] = []
        for answer in answers:
            if isinstance(answer, CommandReply):
                outcome.tick = max(outcome.tick, answer.tick)
                if answer.accepted:
                    outcome.accepted += 1
                else:
                    outcome.refusals.append(answer.reason)
                replies.append(answer if answer.accepted else None)
            elif isinstance(answer, RequestError):
                outcome.refusals.append(str(answer))
                replies.append(None)
            elif isinstance(answer, BusError):
                outcome.refusals.append(f"not sent: {answer}")
                replies.append(None)
            else:
                raise answer
        return replies

    async def _echo(
        self, batch: tuple[Command, ...], replies: list[CommandReply | None], befores: list[object]
    ) -> None:
        """Waits until the mirror shows what was accepted; what changes nothing shows nothing, so not for long."""

        def is_seen() -> bool:
            return all(
                reply is None or edits.is_echoed(command, reply, self._scene, before)
                for command, reply, before in zip(batch, replies, befores, strict=True)
            )

        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(ECHO_TIMEOUT):
                while not is_seen():
                    await self._scene.wait_for_change()

    def _ids_below(self, back: tuple[Command, ...]) -> list[tuple[int, ...]]:
        """For each Spawn that would bring entities back the ids they have now."""
        return [
            edits.records_of(self._scene, self._scene.children_of(command.parent)[command.index])[1]
            for command in back
            if isinstance(command, Spawn)
        ]

    def _remember(self, inverse: Entry, stroke: object) -> None:
        last = self._undoable[-1] if self._undoable else None
        if last is not None and stroke is not None and last.stroke == stroke:
            # The values from before the stroke are the ones to return to; only targets that are new to it are added.
            known = {edits.target_of(command) for command in last.commands}
            added = tuple(command for command in inverse.commands if edits.target_of(command) not in known)
            self._undoable[-1] = Entry(label=last.label, commands=added + last.commands, stroke=stroke)
            return
        self._undoable.append(
            Entry(label=inverse.label, commands=inverse.commands, stroke=stroke, respawned=inverse.respawned)
        )
        del self._undoable[:-ENTRY_LIMIT]

    def _follow(self, new_ids: dict[int, int]) -> None:
        """Renames entities in all that is remembered and all that waits."""
        for stack in (self._undoable, self._redoable):
            stack[:] = [
                Entry(
                    label=entry.label,
                    commands=tuple(edits.with_new_ids(command, new_ids) for command in entry.commands),
                    stroke=entry.stroke,
                    respawned=tuple(tuple(new_ids.get(i, i) for i in ids) for ids in entry.respawned),
                )
                for entry in stack
            ]
        for work in self._queue:
            work.commands = tuple(edits.with_new_ids(command, new_ids) for command in work.commands)
        self._on_new_ids(new_ids)


def _batches(commands: tuple[Command, ...], scene: EditorScene) -> list[tuple[Command, ...]]:
    """Commands that may be under way together: their inverses are computed from the scene before any of them."""
    if any(isinstance(command, Reparent) for command in commands):
        return [(command,) for command in commands]  # a change of parent moves the places that others are told by
    if all(isinstance(command, Despawn) for command in commands):
        # The last first: brought back in reverse, each finds those before it in their places.
        commands = tuple(sorted(commands, key=lambda despawn: _order(despawn, scene), reverse=True))
    return [commands] if commands else []


def _order(command: Command, scene: EditorScene) -> tuple[int, ...]:
    entity = getattr(command, "entity", 0)
    return scene.order_of(entity) if scene.exists(entity) else ()


def _future() -> asyncio.Future[Outcome]:
    return asyncio.get_running_loop().create_future()
