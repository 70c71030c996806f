"""Undo and redo: every edit goes to the host as one command, one after the other; the host keeps what takes them back.

    perform ─> queue ─> send ─> reply ─> wait for the echo ─> entry in `undoable`
                                                                  │ undo: the host takes it back,
                                            entry in `redoable` <─┘ redo makes it again

The lists here mirror the host's, which outlive this editor: whoever comes back to a session that still runs finds them again.
One edit is under way at a time. Edits of one stroke (a drag, from button down to button up) make one entry, and of those that
wait only the newest is sent; all of a stroke count as made from the scene that it began with.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, Final, Literal, Protocol

import msgspec

from elys.bus.messages.commands import Batch, Command, CommandReply, Edit, Redo, Spawn, Undo
from elys.bus.messages.history import HistoryEntry, HistoryReply
from elys.common.errors import BusError, RequestError
from elys.editor_node import edits
from elys.editor_node.scene_mirror import EditorScene
from elys.editor_node.sentences import sentence

ECHO_TIMEOUT: Final = 1.0  # [s] after which an edit counts as done though the scene does not show it
ATTACH_PAUSE: Final = 0.5  # [s] before the host is asked again which edits there are
ENTRY_LIMIT: Final = 500
_log = logging.getLogger(__name__)

Kind = Literal["do", "undo", "redo"]


class Send(Protocol):
    """Asks the host; the keywords are fields of CommandRequest."""

    def __call__(self, command: Command, **about: Any) -> Awaitable[CommandReply]: ...


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
    kind: Kind
    label: str = ""
    edits: tuple[Edit, ...] = ()
    stroke: object = None
    stroke_name: str = ""  # of the stroke, for the host
    made_from: int = -1
    force: bool = False
    done: asyncio.Future[Outcome]

    @property
    def targets(self) -> list[tuple[Any, ...]]:
        """What it changes."""
        return [edits.target_of(edit) for edit in self.edits]


class History:
    """The edits of this editor. `run` must be running for anything to be sent."""

    def __init__(
        self,
        send: Send,
        attach: Callable[[], Awaitable[HistoryReply]],
        scene: EditorScene,
        *,
        node: str = "",
        on_outcome: Callable[[Outcome], None] = lambda outcome: None,
        on_new_ids: Callable[[dict[int, int]], None] = lambda new_ids: None,
        on_attached: Callable[[HistoryReply], None] = lambda reply: None,
    ) -> None:
        self.author = ""  # as whom the host knows this editor
        self.undoable: list[HistoryEntry] = []  # the oldest first
        self.redoable: list[HistoryEntry] = []  # what comes next last
        self.initial = 0  # what names the content before the first of them
        self.conflict: Kind | None = None  # which of undo and redo was refused because of somebody else's edit
        self.is_attached = False
        self._send = send
        self._attach = attach
        self._scene = scene
        self._node = node
        self._on_outcome = on_outcome
        self._on_new_ids = on_new_ids
        self._on_attached = on_attached
        self._queue: deque[_Work] = deque()
        self._wake = asyncio.Event()
        self._under_way: _Work | None = None
        self._stroke: object = None  # of the last edit, its number and the revision that it began with
        self._stroke_number = 0
        self._stroke_from = 0
        self._remembered_stroke: object = None  # of the last entry
        self._forgotten = 0  # times

    @property
    def undo_label(self) -> str:
        """What undo would take back; empty when there is nothing."""
        return self.undoable[-1].label if self.undoable else ""

    @property
    def redo_label(self) -> str:
        """What redo would make again; empty when there is nothing."""
        return self.redoable[-1].label if self.redoable else ""

    @property
    def is_busy(self) -> bool:
        """Whether an edit is under way or waits."""
        return self._under_way is not None or bool(self._queue)

    def is_stroke_busy(self, stroke: object) -> bool:
        """Whether an edit of this stroke is not answered and echoed yet."""
        under_way = self._under_way
        return (under_way is not None and under_way.stroke == stroke) or any(w.stroke == stroke for w in self._queue)

    def perform(self, label: str, commands: tuple[Edit, ...], *, stroke: object = None) -> asyncio.Future[Outcome]:
        """Makes an edit, all of it or nothing; its outcome may be awaited. With the last one's `stroke` it joins its entry."""
        last = self._queue[-1] if self._queue else None
        targets = [edits.target_of(command) for command in commands]
        if last is not None and stroke is not None and last.stroke == stroke and last.targets == targets:
            last.edits = commands
            return last.done
        if stroke is None or stroke != self._stroke:
            self._stroke, self._stroke_from = stroke, self._scene.mirror.revision
            self._stroke_number += 1
        work = _Work(
            kind="do",
            label=label,
            edits=commands,
            stroke=stroke,
            stroke_name=f"{self._node}/{self._stroke_number}" if stroke is not None else "",
            made_from=self._stroke_from,
            done=_future(),
        )
        return self._enqueue(work)

    def undo(self, *, force: bool = False) -> asyncio.Future[Outcome]:
        """Takes the last edit back, after those that are still under way; `force` also over somebody else's later edit."""
        return self._enqueue(_Work(kind="undo", force=force, done=_future()))

    def redo(self, *, force: bool = False) -> asyncio.Future[Outcome]:
        """Makes again what was taken back last; `force` as in `undo`."""
        return self._enqueue(_Work(kind="redo", force=force, done=_future()))

    async def go_to(self, count: int) -> None:
        """Undoes or redoes until `count` of all entries are made, or one is refused."""
        while len(self.undoable) != count:
            outcome = await (self.undo() if len(self.undoable) > count else self.redo())
            if not outcome.accepted:
                return

    def forget(self) -> None:
        """Drops all entries, and asks the host anew which there are: another scene, or another host."""
        self.undoable.clear()
        self.redoable.clear()
        self.conflict = None
        self.ask_again()

    def ask_again(self) -> None:
        """What the host has told, or is about to tell, is out of date: it is asked anew."""
        self.is_attached = False
        self._forgotten += 1
        self._wake.set()

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
            self._wake.clear()
            if not self.is_attached:
                try:
                    await self._come_in()
                except BusError as error:
                    _log.debug("what can be undone is not known, asking again: %s", error)
            if not self._queue:
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._wake.wait(), None if self.is_attached else ATTACH_PAUSE)
                continue
            work = self._under_way = self._queue.popleft()
            try:
                outcome = await self._carry_out(work)
                work.done.set_result(outcome)
            finally:
                self._under_way = None
                if not work.done.done():
                    work.done.cancel()
            self._on_outcome(outcome)

    async def _come_in(self) -> None:
        forgotten = self._forgotten
        told = await self._attach()
        if forgotten != self._forgotten:
            self._wake.set()  # what was told is of the scene before
            return
        self.author, self.initial = told.author, told.initial
        self.undoable, self.redoable = list(told.undoable), list(told.redoable)
        self._remembered_stroke = None
        self.is_attached = True
        self._on_attached(told)

    def _enqueue(self, work: _Work) -> asyncio.Future[Outcome]:
        self._queue.append(work)
        self._wake.set()
        return work.done

    async def _carry_out(self, work: _Work) -> Outcome:
        outcome = Outcome(label=work.label, stroke=work.stroke)
        lists = {"undo": self.undoable, "redo": self.redoable}.get(work.kind)
        if lists is not None:
            if not lists:
                return outcome
            outcome.label = sentence("{verb} {label}", verb=work.kind.capitalize(), label=lists[-1].label)
        try:
            if not self.is_attached:
                await self._come_in()
            reply = await self._ask(work)
        except RequestError as error:
            outcome.refusals.append(str(error))
            return outcome
        except BusError as error:
            outcome.refusals.append(sentence("not sent: {reason}", reason=error))
            return outcome
        outcome.tick = reply.tick
        self.conflict = work.kind if reply.is_conflict and work.kind != "do" else None
        if not reply.accepted:
            outcome.refusals.append(reply.reason)
            return outcome
        outcome.accepted = max(len(work.edits), 1)
        await self._echo(reply)
        self._remember(work, reply)
        outcome.spawned = self._tops(work, reply)
        if reply.new_ids:
            self._on_new_ids(reply.new_ids)
        return outcome

    async def _ask(self, work: _Work) -> CommandReply:
        command: Command
        match work.kind:
            case "do":
                command = work.edits[0] if len(work.edits) == 1 else Batch(edits=work.edits)
            case "undo":
                command = Undo(force=work.force)
            case "redo":
                command = Redo(force=work.force)
        return await self._send(
            command, author=self.author, label=work.label, stroke=work.stroke_name, made_from=work.made_from
        )

    async def _echo(self, reply: CommandReply) -> None:
        """Waits until the mirror shows what was accepted."""
        mirror = self._scene.mirror
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(ECHO_TIMEOUT):
                while mirror.sequence < reply.sequence:
                    await self._scene.wait_for_change()

    def _remember(self, work: _Work, reply: CommandReply) -> None:
        """Does with the lists what the host did with its own."""
        match work.kind:
            case "do":
                self.redoable.clear()
                is_joined = work.stroke is not None and work.stroke == self._remembered_stroke and self.undoable
                if is_joined:
                    self.undoable[-1] = msgspec.structs.replace(self.undoable[-1], content=reply.content)
                else:
                    self.undoable.append(HistoryEntry(label=work.label, content=reply.content))
                    del self.undoable[:-ENTRY_LIMIT]
                self._remembered_stroke = work.stroke
            case "undo" if self.undoable:
                self.redoable.append(self.undoable.pop())
                self._remembered_stroke = None
            case "redo" if self.redoable:
                self.undoable.append(msgspec.structs.replace(self.redoable.pop(), content=reply.content))
                self._remembered_stroke = None

    def _tops(self, work: _Work, reply: CommandReply) -> tuple[int, ...]:
        if work.kind == "do" and not any(isinstance(edit, Spawn) for edit in work.edits):
            return ()
        scene, made = self._scene, set(reply.entities)
        return tuple(e for e in reply.entities if scene.exists(e) and scene.parent_of(e) not in made)


def _future() -> asyncio.Future[Outcome]:
    return asyncio.get_running_loop().create_future()
