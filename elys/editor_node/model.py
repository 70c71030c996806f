"""The editor without its window: what is shown, what is selected and what can be done. Needs no display to be tested.

Nothing here changes the scene. Every operation is a command to the host; what the panels show is what the host echoed.
"""

from __future__ import annotations

import asyncio
import getpass
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.bus import topics
from elys.bus.asset_service import AssetOffer
from elys.bus.messages.commands import (
    Command,
    CommandRecord,
    CommandReply,
    CommandRequest,
    LoadScene,
    NoteSaved,
    Seek,
    SetPlaying,
    SetRate,
    StepTicks,
)
from elys.bus.messages.history import HistoryReply, HistoryRequest
from elys.bus.messages.session import LogLevel, LogLine, SessionStatus
from elys.bus.session import Session
from elys.common.errors import BusError, ConnectionLost
from elys.editor_node.clip_names import ClipNames
from elys.editor_node.console_log import ConsoleLog
from elys.editor_node.ghost_list import GhostList
from elys.editor_node.history import History, Outcome
from elys.editor_node.language import tr
from elys.editor_node.operations import Operations
from elys.editor_node.prefab_values import PrefabValues
from elys.editor_node.recovery import Recovery
from elys.editor_node.scene_documents import SceneDocuments
from elys.editor_node.scene_mirror import EditorScene
from elys.editor_node.script_forms import ScriptForms
from elys.editor_node.selection import Selection
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.set_values import SetValues
from elys.editor_node.timeline import Timeline
from elys.editor_node.tree_edits import TreeEdits
from elys.editor_node.tree_walk import TreeWalk

COMMAND_TIMEOUT: Final = 5.0  # [s]
POINT_RADIUS: Final = 1.0  # [m] around an entity without extent, to be looked at
MESSAGE_TIME: Final = 8.0  # [s] for which the status bar says what went wrong, or well


class EditorModel:
    """Everything the panels read, and the operations they call; those on the scene are in `edit`.

    `run` must be running: it sends the edits and follows the scene.
    """

    def __init__(
        self,
        session: Session,
        *,
        request_redraw: Callable[[float], None] = lambda within: None,
        recovery: Recovery | None = None,
        clock: Callable[[], float] = time.monotonic,
        listened: Callable[[], float] | None = None,
    ) -> None:
        """`listened` is the clock by which pauses in typing are measured; the other one if there is none of its own."""
        self.session = session
        self.request_redraw = request_redraw
        self.console = ConsoleLog()
        self.selection = Selection()
        self.timeline = Timeline(self, clock=clock)
        self.ghosts = GhostList(
            session,
            say=lambda text: self.say("error", text),
            request_redraw=request_redraw,
            clock=clock,
        )
        self.scene = EditorScene(session, on_change=self._scene_changed, on_state=self._state_arrived)
        self.set_values = SetValues(self.scene.mirror)
        self.prefabs = PrefabValues(self.scene, session, on_change=lambda: self.request_redraw(0.0), clock=clock)
        self.script_forms = ScriptForms(session, on_change=lambda: self.request_redraw(0.0), clock=clock)
        self.clip_names = ClipNames(self.scene, session, on_change=lambda: self.request_redraw(0.0), clock=clock)
        self.history = History(
            self._ask,
            self._ask_for_history,
            self.scene,
            node=session.node.id,
            on_outcome=self._tell_outcome,
            on_new_ids=self._follow_new_ids,
            on_attached=self._came_in,
        )
        self.edit = Operations(self.scene, self.selection, self.history)
        self.documents = SceneDocuments(session, self.scene, self._ask_plainly, recovery=recovery, clock=clock)
        self.file = self.documents.file
        self.walk = TreeWalk(self.scene.mirror, self.scene.tree, self.selection, clock=listened or clock)
        self.tree = TreeEdits(
            self.scene, self.selection, self.history, self.edit, offer=AssetOffer(session), say=self.say
        )
        self.status: SessionStatus | None = None
        self.connected = session.connected
        self.scenes_opened = 0  # in the place of another, since this editor listens
        self._known_session = (session.name, session.epoch)  # of which the mirror tells
        self._wanted_paths: list[tuple[str, ...]] = []  # of what was selected before the host started anew
        self._told_stroke: object = None
        self._structure_version = -1
        self._wanted_time: float | None = None  # [s] to seek to
        self._seeking: asyncio.Task[None] | None = None
        self.error = ""  # why what the person tried last did not work, until something else did or a while has passed
        self.notice = ""  # what went well and is worth saying, for as long
        self._clock = clock
        self._message_ends = 0.0
        session.subscribe(topics.STATUS, self._status_arrived)
        session.subscribe(topics.LOG, self._line_arrived)
        session.subscribe(topics.COMMANDS, self._command_seen)
        session.on_link(self._link_changed)

    async def run(self) -> None:
        """Follows the scene and sends the edits, until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.scene.follow())
            group.create_task(self.history.run())
            group.create_task(self.documents.keep_aside())

    # --- time ------------------------------------------------------------------------------------------------------

    @property
    def is_playing(self) -> bool:
        """Whether time goes on, as the host last said."""
        return self.status is not None and self.status.playing

    @property
    def is_replay(self) -> bool:
        """Whether the host shows a recording."""
        return self.status is not None and self.status.kind == "replay"

    def toggle_playing(self) -> None:
        """Play or pause."""
        self.command("Pause" if self.is_playing else "Play", SetPlaying(playing=not self.is_playing))

    def step(self, count: int = 1) -> None:
        """Goes on by `count` ticks; pauses first where it plays."""
        if self.is_playing:
            self.command("Pause", SetPlaying(playing=False))
        self.command("Step", StepTicks(count=count))

    def seek(self, time: float) -> None:
        """Goes to a time [s] that the host keeps. While the host is still on its way the newest wish counts."""
        self._wanted_time = time
        if self._seeking is None or self._seeking.done():
            self._seeking = self.session.start(self._seek())

    async def _seek(self) -> None:
        while self._wanted_time is not None:
            time, self._wanted_time = self._wanted_time, None
            await self.command("Seek", Seek(time=time))

    def set_rate(self, rate: float) -> None:
        """Simulated seconds per second; 0 is as fast as it can."""
        self.command("Set speed", SetRate(rate=rate))

    def command(self, label: str, command: Command) -> asyncio.Task[None]:
        """Sends a command that changes no scene and so is not undone; a refusal is told in the console."""

        async def ask() -> None:
            try:
                reply = await self._ask(command)
            except BusError as error:
                self.say("error", f"{tr(label)}: {error}")
            else:
                if reply.accepted:
                    self.error = ""
                else:
                    why = tr_sentence(reply.reason)
                    self.say("error", tr("{what} refused: {reason}", what=tr(label), reason=why))

        return self.session.start(ask())

    # --- undo ------------------------------------------------------------------------------------------------------

    def undo(self) -> None:
        """Takes the last edit back."""
        if self.history.undo_label or self.history.is_busy:
            self.history.undo()

    def redo(self) -> None:
        """Makes again what was taken back last."""
        if self.history.redo_label or self.history.is_busy:
            self.history.redo()

    # --- looking ---------------------------------------------------------------------------------------------------

    def bounds_of(self, entities: Iterable[int]) -> tuple[NDArray[np.float64], float] | None:
        """Centre [m] and radius [m] of a ball around entities, as far as the mirror knows their shapes; None for none."""
        present = [entity for entity in entities if self.scene.exists(entity)]
        extended = [entity for entity in present if self.scene.has_extent(entity)]
        balls = [self.scene.ball_of(entity) for entity in extended]
        if not balls:  # lights and cameras are nothing to be seen: their surroundings are
            balls = [(self.scene.ball_of(entity)[0], POINT_RADIUS) for entity in present]
        if not balls:
            return None
        centers = np.array([center for center, _ in balls])
        radii = np.array([radius for _, radius in balls])
        lower, upper = (centers - radii[:, None]).min(axis=0), (centers + radii[:, None]).max(axis=0)
        center = (lower + upper) / 2.0
        return center, float(np.max(np.linalg.norm(centers - center, axis=1) + radii))

    # --- telling ---------------------------------------------------------------------------------------------------

    def say(self, level: LogLevel, text: str, *, tick: int = -1) -> None:
        """A line of the editor's own in the console."""
        self.console.add("editor", level, text, tick=tick)
        if level == "error":
            self.error, self.notice, self._message_ends = text, "", self._clock() + MESSAGE_TIME
        self.request_redraw(0.0)

    def fade_messages(self) -> None:
        """Ends `error` and `notice` when their time is over. Call it each frame."""
        if self.error or self.notice:
            left = self._message_ends - self._clock()
            if left <= 0.0:
                self.error = self.notice = ""
            else:
                self.request_redraw(left)

    def praise(self, text: str) -> None:
        """Says what went well, in the console and the status bar."""
        self.say("info", text)
        self.error, self.notice = "", text
        self._message_ends = self._clock() + MESSAGE_TIME

    async def save(self, path: str, *, running: bool = False) -> None:
        """Writes the scene to a file under the name it has, and says so; as it was edited, or a copy of the `running` state.

        Raises:
            ElysError: that cannot be; the file is as it was.
        """
        name = self.status.scene if self.status is not None else ""
        if running:
            saved = await self.documents.save_running(path, name=name)
        else:
            saved = await self.documents.save(path, name=name)
        self.praise(tr("Saved {path}", path=saved))

    def paste(self) -> asyncio.Task[None]:
        """Makes what is on the clipboard."""

        async def paste() -> None:
            await self.tree.paste(directory=self.file.path.parent if self.file.path is not None else Path.cwd())

        return self.session.start(paste())

    def node_label(self, node: str) -> str:
        """What the console calls a node: its kind."""
        known = self.session.nodes.get(node)
        return known.kind if known is not None else node.rsplit("-", 1)[0]

    # --- inside ----------------------------------------------------------------------------------------------------

    async def _ask_for_history(self) -> HistoryReply:
        request = HistoryRequest(person=_person(), node=self.session.node.id)
        return await self.session.request(topics.HISTORY, request, timeout=COMMAND_TIMEOUT)

    def _came_in(self, told: HistoryReply) -> None:
        self.file.learn(told)
        self.documents.look_for_left_behind()
        self.request_redraw(0.0)

    async def _ask_plainly(self, command: Command, *, timeout: float = COMMAND_TIMEOUT) -> CommandReply:
        request = CommandRequest(origin=self.session.node.id, command=command)
        return await self.session.request(topics.COMMAND, request, timeout=timeout)

    async def _ask(self, command: Command, **about: Any) -> CommandReply:
        if not self.connected:
            raise ConnectionLost(tr("the simulation is gone"))
        request = CommandRequest(origin=self.session.node.id, command=command, **about)
        return await self.session.request(topics.COMMAND, request, timeout=COMMAND_TIMEOUT)

    def _tell_outcome(self, outcome: Outcome) -> None:
        for reason in dict.fromkeys(outcome.refusals):
            what, why = tr_sentence(outcome.label), tr_sentence(reason)
            self.say("error", tr("{what} refused: {reason}", what=what, reason=why), tick=outcome.tick)
        if outcome.spawned and not self.selection:
            self.selection.replace(outcome.spawned)  # what an undo brought back
        is_told = outcome.stroke is not None and outcome.stroke is self._told_stroke  # a drag is one line
        self._told_stroke = outcome.stroke
        if outcome.accepted and not outcome.refusals:
            self.error = ""
        if outcome.accepted and not is_told:
            self.say("info", tr_sentence(outcome.label), tick=outcome.tick)

    def _follow_new_ids(self, new_ids: dict[int, int]) -> None:
        self.scene.marks.remap(new_ids)
        self.selection.remap(new_ids)
        if not self.selection:
            self.selection.replace(new_ids.values())

    def _scene_changed(self) -> None:
        if self._wanted_paths and self.scene.mirror.epoch == self.session.epoch:
            found = self.scene.found_paths(self._wanted_paths)
            self._wanted_paths = []
            self.selection.replace(found)
        if self.scene.structure_version != self._structure_version:  # else nobody can be gone
            self._structure_version = self.scene.structure_version
            self.selection.keep_only(self.scene.exists)
        self.request_redraw(0.0)

    def _state_arrived(self) -> None:
        frame = self.scene.frame
        if frame is not None:
            self.timeline.follow(frame.simulation_time)
        self.request_redraw(0.1)

    def _status_arrived(self, status: SessionStatus, _: str) -> None:
        if status != self.status:
            changed = self.status is None or _controls(self.status) != _controls(status)
            if self.status is not None and self.status.is_rewound and not status.is_rewound:
                self.history.forget()  # as a fork there is less to undo: the host is asked
            self.status = status
            self.request_redraw(0.0 if changed else 0.25)

    def _line_arrived(self, line: LogLine, _: str) -> None:
        if line.node != self.session.node.id:
            self.console.add(self.node_label(line.node), line.level, line.text, tick=line.tick, at=line.time)
            self.request_redraw(0.1)

    def _command_seen(self, record: CommandRecord, _: str) -> None:
        self.set_values.command_seen(record)
        if record.accepted and isinstance(record.command, LoadScene):
            self.scenes_opened += 1
            self.history.forget()
        if record.accepted and isinstance(record.command, NoteSaved):
            self.file.saved_content = record.command.content
            self.history.ask_again()
        if record.origin == self.session.node.id:
            return
        level: LogLevel = "info" if record.accepted else "warning"
        told = tr_sentence(_named(record.command))
        if not record.accepted:
            told = tr("{what} refused: {reason}", what=told, reason=tr_sentence(record.reason))
        self.console.add(self.node_label(record.origin), level, told, tick=record.tick)
        self.request_redraw(0.1)

    def _link_changed(self, connected: bool) -> None:
        self.connected = connected
        if connected:
            self._greet(self.session.name, self.session.epoch)
        elif self.session.name:
            self.say("warning", tr("the simulation is gone; waiting for it to return"))
        else:
            self.status, self.error = None, ""
            self.request_redraw(0.0)

    def _greet(self, name: str, epoch: int) -> None:
        """Keeps what still holds: all of it in the same run, names in another run, nothing in another session."""
        known_name, known_epoch = self._known_session
        self._known_session = (name, epoch)
        if epoch != known_epoch:
            self._wanted_paths = [self.scene.path_of(entity) for entity in self.selection if self.scene.exists(entity)]
            self.history.forget()
            self.timeline.forget()
        if known_name and name != known_name:
            self.status = None
            self.file.forget()
        self.error = ""
        if known_name == name:
            self.say("info", tr("the simulation is back"))
        else:
            self.say("info", tr("attached to {name}", name=name))


def _controls(status: SessionStatus) -> tuple[Any, ...]:
    """What a person sets, and wants to see set at once."""
    return (status.playing, status.rate, status.kind, status.scene, status.loop, status.is_rewound)


def _person() -> str:
    """What sentences call who sits here."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # a user that this machine has no name for
        return "somebody"


def _named(command: Command) -> str:
    words = type(command).__struct_config__.tag
    return str(words).replace("_", " ").capitalize()
