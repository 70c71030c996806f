"""Hosts races one after the other in a session: puts levels in place, records each race, keeps times, and has ghosts run along.

What it knows of a race it hears as anybody could: from the events that the level's scripts tell.
"""

from __future__ import annotations

import asyncio
import contextlib
import getpass
import logging
import time
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Protocol

import msgspec

from elys.bus import topics
from elys.bus.ghost_service import GhostServer
from elys.bus.messages.commands import CommandRequest, LoadScene
from elys.bus.messages.ghosts import GHOST_COLORS, UNTIL_TOLD, Span
from elys.bus.recording import Recording
from elys.common.errors import ElysError
from elys.game.board import GHOSTS, KEPT, Board, Entry, since
from elys.game.scene_level import SceneLevel
from elys.game.settings import CHOICES, Settings, lines
from elys.samples.game.levels import LEVELS, Level

if TYPE_CHECKING:
    from elys.bus.messages.session import Event, EventBatch
    from elys.bus.session import Session
    from elys.common.scene import OpenedScene
    from elys.sim_node.node import SimulationNode

AFTERGLOW: Final = 2.0  # [s] of simulation that a recording goes on after the finish
LONGEST: Final = 1e6  # [s] that a race may take
# What is believed here, and decides about times, so that scripts alone may tell it.
HEARD: Final = frozenset(("race_go", "race_gate", "race_finished", "race_wanted", "race_paused", "race_resumed"))
WISHES: Final = ("restart", "level", "setting")
AnyLevel = Level | SceneLevel
_log = logging.getLogger(__name__)


class Recorder(Protocol):
    """What records a race, from the moment at which it is made until it is finished."""

    path: Path

    async def finish(self) -> int:
        """Ends it."""
        ...


_Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=LONGEST)]


class Passed(msgspec.Struct, frozen=True):
    """What `race_gate` says."""

    player: int
    time: _Seconds


class Finished(msgspec.Struct, frozen=True):
    """What `race_finished` says."""

    player: int
    time: _Seconds
    medal: str = ""


class Resumed(msgspec.Struct, frozen=True):
    """What `race_resumed` says."""

    held: _Seconds


@dataclass(slots=True, kw_only=True)
class Attempt:
    """A race that is on."""

    recorder: Recorder
    players: int
    began: float = -1.0  # [s] of simulation time at which the countdown ended
    finished: dict[int, Finished] = field(default_factory=dict)  # by player
    splits: dict[int, list[float]] = field(default_factory=dict)
    ended_at: dict[int, float] = field(default_factory=dict)  # [s] of simulation time of the finish, by player
    pauses: list[Span] = field(default_factory=list)  # of simulation time


class Referee:
    """Runs races in a simulation's session.

    Args:
        levels: those to choose from, by their names.
        record: begins to record into a file what happens from now on.
        open_level: a level as a scene, its meshes in the simulation's store, with these values of its scripts.
        has_menu: begins with the menu, and comes back to it after each race.
        prove: gives the verdict on the recording of an entry, see `elys.game.proof`; takes its time.
    """

    def __init__(
        self,
        node: SimulationNode,
        session: Session,
        *,
        level: AnyLevel,
        levels: Mapping[str, AnyLevel] = LEVELS,
        players: int = 1,
        person: str = "",
        folder: Path | None = None,
        record: Callable[[Path], Recorder],
        open_level: Callable[[AnyLevel, int, Mapping[str, Mapping[str, Any]]], OpenedScene],
        prove: Callable[[Path, Entry], Awaitable[str]],
        race_limit: int = 0,
        has_ghosts: bool = True,
        has_menu: bool = False,
    ) -> None:
        self._node, self._session = node, session
        node.untold |= HEARD
        self.level, self._levels = level, levels
        self._wanted_players = players
        self._person = person or getpass.getuser()
        self._folder = folder
        self._record, self._open_level, self._proof_of = record, open_level, prove
        self._race_limit = race_limit
        self._has_ghosts = has_ghosts
        self.settings = Settings.load(folder)
        self._has_menu = has_menu
        self.board = self._board_of(level)
        self._result = ""  # of the race before
        self.attempt: Attempt | None = None
        self.races = 0
        self._is_begun = False
        self._wishes: asyncio.Queue[tuple[str, dict[str, Any]]] = asyncio.Queue()
        self._ghosts: dict[GhostServer, asyncio.Task[None]] = {}
        self._beside: set[asyncio.Task[None]] = set()  # what goes on while others race

    async def run(self) -> None:
        """Until `race_limit` races were finished, or for ever."""
        close = self._session.subscribe(topics.EVENTS, self._heard)
        try:
            await self._begin(opens_menu=self._has_menu)
            while True:
                wish, values = await self._wishes.get()
                if wish == "finished":
                    await self._end()
                    self.races += 1
                    if self._race_limit and self.races >= self._race_limit:
                        return
                    await self._begin(opens_menu=self._has_menu)
                elif wish == "restart":
                    await self._begin()
                elif wish == "level" and str(values.get("name", "")) in self._levels:
                    self.level = self._levels[str(values["name"])]
                    await self._begin()
                elif wish == "setting":
                    self._set(str(values.get("name", "")), str(values.get("value", "")))
        finally:
            close()
            await asyncio.shield(self._leave())

    async def prove(self) -> None:
        """Waits for the verdicts that are still out. Time need not go on for that."""
        await asyncio.gather(*self._beside, return_exceptions=True)

    async def _leave(self) -> None:
        await self._drop()
        await self._end_ghosts()

    def _set(self, name: str, value: str) -> None:
        """Something was chosen in the menu: the next race begins with it."""
        if name == "players" and value in CHOICES[name]:
            self._wanted_players = int(value)
            return
        changed = self.settings.changed(name, value)
        if changed != self.settings:
            self.settings = changed
            changed.save(self._folder)

    async def _begin(self, *, opens_menu: bool = False) -> None:
        """Another race: the level as it was made, a recording that begins with it, and ghosts.

        Not while somebody has edits that no file has: they would be gone.
        """
        history = self._node.history
        if self._is_begun and history.content != history.saved:
            _log.warning("%s has edits that are not saved: save it in the editor, then begin again", self.level.title)
            return
        self._is_begun = True
        await self._drop()
        await self._end_ghosts()
        self.level = self.level.renewed(self._node.simulation.assets)
        self._levels = {**self._levels, self.level.name: self.level}
        self.board = self._board_of(self.level)
        players = self._players
        opened = self._open_level(self.level, players, self._told(opens_menu=opens_menu))
        path = str(opened.path) if isinstance(self.level, SceneLevel) else ""
        command = LoadScene(name=opened.name, records=tuple(opened.records), settings=opened.settings, path=path)
        reply = await self._node.put(CommandRequest(origin=self._session.node.id, command=command))
        if not reply.accepted:
            raise ElysError(f"the level {self.level.name} cannot be begun: {reply.reason}")
        stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S-%f")
        self.board.folder.mkdir(parents=True, exist_ok=True)
        self.attempt = Attempt(recorder=self._record(self.board.folder / f"{stamp}.mcap"), players=players)

    @property
    def _players(self) -> int:
        return min(self._wanted_players, self.level.seats)

    def _board_of(self, level: AnyLevel) -> Board:
        return Board(level.board, self._folder, players=min(self._wanted_players, level.seats))

    @property
    def _rivals(self) -> list[Board]:
        """Whose times are to be beaten: those of races of so many, then of who raced alone."""
        alone = Board(self.level.board, self._folder)
        return [self.board, *([alone] if alone.folder != self.board.folder else [])]

    def _told(self, *, opens_menu: bool) -> dict[str, dict[str, Any]]:
        """What the level's scripts are told: the menu all best times, the displays the times at gates that are to be beaten."""
        rows = []
        for name, level in self._levels.items():
            best = self._board_of(level).best()
            told_best = f"{best.time:.2f} s" if best is not None else ""
            rows.append(f"{name}|{level.title}|{told_best}|{best.medal if best is not None else ''}")
        best = next((found for board in self._rivals if (found := board.best(self._person) or board.best())), None)
        splits = ",".join(map(str, best.splits)) if best is not None else ""
        menu: dict[str, Any] = {"levels": "\n".join(rows), "level": self.level.name, "is_open": opens_menu}
        menu["players"] = self._players
        menu["result"] = self._result if opens_menu else ""
        menu["settings"] = lines(self.settings, self._players)
        told: dict[str, dict[str, Any]] = {"Menu": menu}
        for number in range(1, self._players + 1):
            told |= {f"Display {number}": {"best": splits}, f"Ball {number}": self.settings.of_ball()}
        return told

    async def _drop(self) -> None:
        """A race that was not finished leaves nothing behind."""
        attempt, self.attempt = self.attempt, None
        if attempt is not None:
            await attempt.recorder.finish()
            attempt.recorder.path.unlink(missing_ok=True)

    async def _end(self) -> None:
        """A finished race becomes entries: one recording, the fastest of its players' times."""
        attempt, self.attempt = self.attempt, None
        if attempt is None:
            return
        await attempt.recorder.finish()
        best = min(attempt.finished.values(), key=lambda one: one.time)
        ended_at = attempt.ended_at[best.player]
        entry = Entry(
            file=attempt.recorder.path.name,
            player=self._person if attempt.players == 1 else f"{self._person} {best.player}",
            time=round(best.time, 4),
            medal=best.medal,
            date=datetime.now(UTC).isoformat(timespec="seconds"),
            began=attempt.began,
            splits=tuple(round(split, 4) for split in attempt.splits.get(best.player, ())),
            pauses=tuple(pause for pause in attempt.pauses if pause[0] < ended_at),  # one behind the finish counts not
        )
        place = self.board.add(entry)
        _log.info("%s: %s", self.level.title, told(entry, place))
        self._result = result_of(attempt, place)
        if place:
            self._keep(asyncio.create_task(self._verify(entry, self.board)))

    def _keep(self, task: asyncio.Task[None]) -> None:
        self._beside.add(task)
        task.add_done_callback(self._beside.discard)

    async def _verify(self, entry: Entry, board: Board) -> None:
        began = time.monotonic()
        verdict = await self._proof_of(board.path_of(entry), entry)
        board.prove(entry.file, verdict)
        _log.info("%s: %.3f s is %s (%.1f s)", self.level.title, entry.time, verdict, time.monotonic() - began)

    def _heard(self, batch: EventBatch, _: str) -> None:
        for event in batch.events:
            if event.kind in HEARD:
                try:
                    self._take(event, batch.tick)
                except msgspec.ValidationError as error:  # a script of the level's own, which may tell what it likes
                    _log.warning("%s of %s is not heard: %s", event.kind, self.level.title, error)

    def _take(self, event: Event, tick: int) -> None:
        """ValidationError for an event with other values than a race has."""
        attempt, simulation = self.attempt, self._node.simulation
        told_at = simulation.time_at(tick - 1)
        if event.kind == "race_wanted":
            if (what := event.values.get("what")) in WISHES:
                self._wishes.put_nowait((what, event.values))
        elif attempt is None:
            return
        elif event.kind == "race_go":
            attempt.began = simulation.time_at(tick)
            self._send_ghosts(attempt)
        elif event.kind == "race_paused":
            # It was told in the step before, and the one after that was the first that was held.
            attempt.pauses.append((told_at, UNTIL_TOLD))
            self._let_ghosts_wait(attempt)
        elif event.kind == "race_resumed" and attempt.pauses:
            attempt.pauses[-1] = (attempt.pauses[-1][0], msgspec.convert(event.values, Resumed).held)
            self._let_ghosts_wait(attempt)
        elif event.kind == "race_gate":
            passed = msgspec.convert(event.values, Passed)
            attempt.splits.setdefault(passed.player, []).append(passed.time)
        elif event.kind == "race_finished":
            finished = msgspec.convert(event.values, Finished)
            if not 1 <= finished.player <= attempt.players or finished.player in attempt.finished:
                return
            attempt.finished[finished.player] = finished
            attempt.ended_at[finished.player] = told_at
            if len(attempt.finished) == attempt.players:
                self._keep(asyncio.create_task(self._finish_soon(attempt)))

    async def _finish_soon(self, attempt: Attempt) -> None:
        """What comes right after the finish belongs to the race as well."""
        ended_at = max(attempt.ended_at.values())
        while self.attempt is attempt and self._node.simulation.time < ended_at + AFTERGLOW:
            await asyncio.sleep(0.02)
        if self.attempt is attempt:
            self._wishes.put_nowait(("finished", {}))

    @property
    def _wants_ghosts(self) -> bool:
        return self._has_ghosts and self.settings.ghosts == "on"

    def _let_ghosts_wait(self, attempt: Attempt) -> None:
        """They stand while the race does, and go on with it."""
        for server in self._ghosts:
            server.wait(since(attempt.began, attempt.pauses))

    def _send_ghosts(self, attempt: Attempt) -> None:
        """Lets those who were fast run along, from the start that all have in common."""
        former = [(board.path_of(entry), entry) for board in self._rivals for entry in board.ghosts(self._person)]
        for number, (path, entry) in enumerate(former[:GHOSTS] if self._wants_ghosts else ()):
            try:
                recording = Recording(path, checked=True)
            except ElysError as error:
                _log.warning("no ghost of %s: %s", entry.player, error)
                continue
            server = GhostServer(
                recording,
                self._session,
                color=GHOST_COLORS[number % len(GHOST_COLORS)],
                title=f"{entry.player} {entry.time:.2f} s",
                offset=entry.began - attempt.began,
                leaves_out=since(entry.began, entry.pauses),
            )
            self._ghosts[server] = asyncio.create_task(_served(server, recording))

    async def _end_ghosts(self) -> None:
        ghosts, self._ghosts = self._ghosts, {}
        for ghost in ghosts.values():
            ghost.cancel()
        await asyncio.gather(*ghosts.values(), return_exceptions=True)


async def _served(server: GhostServer, recording: Recording) -> None:
    with contextlib.closing(recording):
        await server.run()


def told(entry: Entry, place: int) -> str:
    """An entry as a person reads it."""
    return f"{entry.player} {entry.time:.3f} s{_worth(entry.medal, place)}"


def result_of(attempt: Attempt, place: int) -> str:
    """A race that was finished as the menu tells it: the time of one, or those of all, fastest first."""
    fastest, *others = sorted(attempt.finished.values(), key=lambda one: one.time)
    if not others:
        return f"{fastest.time:.2f} s{_worth(fastest.medal, place)}"
    return "   ".join(f"P{one.player}  {one.time:.2f} s" for one in (fastest, *others))


def _worth(medal: str, place: int) -> str:
    rank = f", place {place}" if place else f", not among the {KEPT} fastest"
    return f", {medal} medal{rank}" if medal else rank
