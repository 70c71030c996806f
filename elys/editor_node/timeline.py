"""What a person does with time: the bar's view of it, loops, bookmarks and markers. Needs no ImGui to be tested.

A recording and the flight recorder of a simulation are one thing here: a span of time in which the host can go to any instant.
Only a simulation can also go on from the past as a fork.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, Protocol, get_args

from elys.bus import topics
from elys.bus.marker_log import MarkerLog
from elys.bus.messages.commands import Command, KeepLast, Resume, Seek, SetLoop, SetPlaying, SetRange
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.timeline import Marker, MarkerKind, MarkersRequest
from elys.bus.session import Session
from elys.common.errors import BusError
from elys.editor_node.bookmarks import Bookmark, Bookmarks
from elys.editor_node.language import tr

ASK_EVERY: Final = 1.0  # [s] for new markers, while somebody looks
NARROWEST: Final = 0.05  # [s] that the bar shows at least
NEAR: Final = 5.0  # [pixels] within which markers are one mark
_WEIGHT: Final[dict[MarkerKind, int]] = {"error": 4, "edit": 3, "event": 2, "trigger": 1, "collision": 0}


class Host(Protocol):
    """What the timeline needs of the editor's model."""

    session: Session
    status: SessionStatus | None
    request_redraw: Callable[[float], None]

    @property
    def is_playing(self) -> bool: ...
    def command(self, label: str, command: Command) -> asyncio.Task[None]: ...
    def seek(self, time: float) -> None: ...


class Cluster(NamedTuple):
    """Markers that are one mark on the bar, the weightiest first."""

    x: float  # [pixels] from the bar's left
    markers: tuple[Marker, ...]

    @property
    def impulse(self) -> float:
        """Of its hardest collision [N s]; 0 without one."""
        return max(marker.strength for marker in self.markers)


class Timeline:
    """The time of one session, as its bar shows it.

    Attributes:
        loop_start, loop_end: [s] what is played again and again, None for the span's own end.
        is_looping: whether it is.
        shown_kinds, least_impulse: which markers are to be seen; of collisions those of at least that impulse [N s].
    """

    def __init__(self, host: Host, *, clock: Callable[[], float]) -> None:
        self._host = host
        self._clock = clock
        self._view: tuple[float, float] | None = None  # [s] what the bar shows; None: all there is
        self._log = MarkerLog()
        self._log.line = 0
        self._asking: asyncio.Task[None] | None = None
        self._asked_at = -ASK_EVERY
        self._jumping: asyncio.Task[None] | None = None
        self._shown: tuple[object, list[Marker]] = (None, [])  # what it was made of, and it
        self._clusters: tuple[object, list[Cluster]] = (None, [])
        self._bookmarks: tuple[str, Bookmarks] | None = None
        self.loop_start: float | None = None
        self.loop_end: float | None = None
        self.is_looping = False
        self.shown_kinds: set[MarkerKind] = set(get_args(MarkerKind))
        self.least_impulse = 1.0

    # --- where the host is, and can go -----------------------------------------------------------------------------

    @property
    def span(self) -> tuple[float, float]:
        """From when to when the host can go [s]."""
        status = self._host.status
        return (status.start_time, status.end_time) if status is not None else (0.0, 0.0)

    @property
    def now(self) -> float:
        """Where it is [s]."""
        status = self._host.status
        return status.simulation_time if status is not None else 0.0

    @property
    def can_wind(self) -> bool:
        """Whether there is any other time to go to."""
        start, end = self.span
        return end > start

    @property
    def _is_replay(self) -> bool:
        status = self._host.status
        return status is not None and status.kind == "replay"

    @property
    def is_rewound(self) -> bool:
        """Whether a simulation shows its past."""
        status = self._host.status
        return status is not None and status.is_rewound

    def go_to(self, time: float) -> None:
        """Goes to a time [s] within the span."""
        start, end = self.span
        self._host.seek(min(max(time, start), end))

    def go_to_start(self) -> None:
        """Goes to the oldest instant."""
        self._host.seek(self.span[0])

    def go_to_end(self) -> None:
        """Goes to the newest instant: of a simulation, to its present."""
        self._host.seek(self.span[1])

    def go_on_from_here(self) -> None:
        """A rewound simulation goes on as a fork: what it kept of later is forgotten."""
        if self.is_rewound:
            self._host.command("Go on from here", Resume())

    @property
    def is_live(self) -> bool:
        """Whether it is a simulation's."""
        status = self._host.status
        return status is not None and status.kind == "simulation"

    def keep_last(self) -> None:
        """Has the last seconds of a simulation written down as a recording."""
        self._host.command("Keep last", KeepLast())

    # --- the bar's view --------------------------------------------------------------------------------------------

    @property
    def view(self) -> tuple[float, float]:
        """What the bar shows [s]: from, to."""
        if self._view is not None:
            return self._view
        start, end = self.span
        return start, max(end, start + NARROWEST)

    @property
    def is_zoomed(self) -> bool:
        """Whether the bar shows a part."""
        return self._view is not None

    def x_of(self, time: float, width: float) -> float:
        """Where a time [s] stands on a bar of a width [pixels]."""
        first, last = self.view
        return width * (time - first) / (last - first)

    def time_at(self, x: float, width: float) -> float:
        """The time [s] at a place [pixels] of a bar."""
        first, last = self.view
        return first + (last - first) * x / width

    def zoom(self, factor: float, around: float) -> None:
        """Shows a span `factor` times as long; what is at `around` [s] stays where it is. All of it where that is shorter."""
        first, last = self.view
        start, end = self.span
        length = max((last - first) * factor, NARROWEST)
        if length >= end - start:
            self._view = None
            return
        share = (around - first) / (last - first)
        self._look(around - share * length, length)

    def pan(self, seconds: float) -> None:
        """Shows what is later by so much, or earlier; nothing beyond the ends."""
        if self._view is not None:
            first, last = self._view
            self._look(first + seconds, last - first)

    def show_all(self) -> None:
        """Shows the whole span."""
        self._view = None

    def _look(self, first: float, length: float) -> None:
        start, end = self.span
        first = min(max(first, start), max(end - length, start))
        self._view = (first, first + length)

    # --- loop ------------------------------------------------------------------------------------------------------

    def set_loop_start(self) -> None:
        """The loop begins here."""
        self.loop_start = self.now
        if self.loop_end is not None and self.loop_end <= self.loop_start:
            self.loop_end = None
        self._loop_now()

    def set_loop_end(self) -> None:
        """The loop ends here."""
        self.loop_end = self.now
        if self.loop_start is not None and self.loop_start >= self.loop_end:
            self.loop_start = None
        self._loop_now()

    def _loop_now(self) -> None:
        self.is_looping = True
        self._tell_replay()

    def forget_loop(self) -> None:
        """No loop any more."""
        self.loop_start = self.loop_end = None
        self.is_looping = False
        self._tell_replay()

    def _tell_replay(self) -> None:
        """A replay loops by itself, to the frame; a simulation has to be sent back."""
        if self._is_replay:
            part = SetRange(start=self.loop_start, end=self.loop_end) if self.is_looping else SetRange()
            self._host.command("Set loop", part)
            self._host.command("Set loop", SetLoop(loop=self.is_looping))

    @property
    def loops(self) -> bool:
        """Whether it loops, or the host does by itself."""
        status = self._host.status
        return self.is_looping or (status is not None and status.loop)

    def toggle_loop(self) -> None:
        """Loops or does not: a recording from end to end, a simulation over what is kept now, where no ends were set."""
        self.is_looping = not self.loops
        if self._is_replay:
            self._tell_replay()
        elif self.is_looping:
            self.loop_start, self.loop_end = self.loop

    @property
    def loop(self) -> tuple[float, float]:
        """From when to when is played [s]."""
        start, end = self.span
        first = start if self.loop_start is None else max(self.loop_start, start)
        last = end if self.loop_end is None else min(self.loop_end, end)
        return first, last

    def follow(self, time: float) -> None:
        """The host shows a time [s], playing: at the end of the loop a simulation is sent back to its beginning."""
        if self._is_replay:
            return
        first, last = self.loop
        is_there = time >= last - 1e-9 or time < first - 1e-9
        if not (self.is_looping and self._host.is_playing and is_there and last > first):
            return
        if self._jumping is None or self._jumping.done():
            self._jumping = self._host.session.start(self._jump(first))

    async def _jump(self, time: float) -> None:
        await self._host.command("Loop", Seek(time=time))
        await self._host.command("Loop", SetPlaying(playing=True))

    # --- bookmarks -------------------------------------------------------------------------------------------------

    @property
    def bookmarks(self) -> Bookmarks:
        """Those of the session."""
        status = self._host.status
        owner = f"{status.kind if status is not None else 'session'}-{self._host.session.name}"
        if self._bookmarks is None or self._bookmarks[0] != owner:
            self._bookmarks = (owner, Bookmarks(owner))
        return self._bookmarks[1]

    def add_bookmark(self, name: str = "") -> Bookmark:
        """Names this instant."""
        number = len(self.bookmarks.all) + 1
        return self.bookmarks.add(name or tr("Bookmark {number}", number=number), self.now)

    # --- markers ---------------------------------------------------------------------------------------------------

    @property
    def markers(self) -> list[Marker]:
        """Those that are to be seen, in the order of time."""
        key = (self._log.version, frozenset(self.shown_kinds), self.least_impulse)
        if key != self._shown[0]:
            self._shown = (key, [marker for marker in self._log.markers if self._is_shown(marker)])
        return self._shown[1]

    @property
    def marker_count(self) -> int:
        """How many there are, seen or not."""
        return len(self._log.markers)

    def clusters(self, width: float) -> list[Cluster]:
        """Marks for a bar of a width [pixels]: markers that would stand on one another are one."""
        markers = self.markers
        key = (self._shown[0], self.view, width)
        if key != self._clusters[0]:
            self._clusters = (key, self._clustered(markers, width))
        return self._clusters[1]

    def _clustered(self, markers: list[Marker], width: float) -> list[Cluster]:
        found: list[tuple[float, list[Marker]]] = []
        for marker in markers:
            x = self.x_of(marker.time, width)
            if not -NEAR <= x <= width + NEAR:
                continue
            if found and x - found[-1][0] < NEAR:
                found[-1][1].append(marker)
            else:
                found.append((x, [marker]))
        return [Cluster(x, tuple(sorted(near, key=_weight, reverse=True))) for x, near in found]

    def go_to_next(self, direction: int) -> None:
        """Goes to the next marker or bookmark: later with 1, earlier with -1; stays where there is none."""
        start, end = self.span
        times: Sequence[float] = sorted(
            {marker.time for marker in self.markers} | {bookmark.time for bookmark in self.bookmarks.all}
        )
        half = 0.5 / (self._host.status.tick_rate if self._host.status is not None else 60.0)
        if direction > 0:
            following = next((time for time in times if time > self.now + half and time <= end + half), None)
        else:
            following = next((time for time in reversed(times) if start - half <= time < self.now - half), None)
        if following is not None:
            self.go_to(following)

    def ask_for_markers(self) -> None:
        """Asks the host for what is new, if it is time and nobody asks already. Call it while somebody looks."""
        is_asking = self._asking is not None and not self._asking.done()
        if is_asking or self._clock() - self._asked_at < ASK_EVERY:
            return
        self._asked_at = self._clock()
        self._asking = self._host.session.start(self._ask())

    async def _ask(self) -> None:
        request = MarkersRequest(from_tick=self._log.last_tick, line=self._log.line)
        try:
            reply = await self._host.session.request(topics.MARKERS, request, timeout=5.0)
        except BusError:
            return  # the host is gone, or keeps none: the bar does without
        version = self._log.version
        self._log.take(reply)
        if self._log.version != version:
            self._host.request_redraw(0.0)

    def forget(self) -> None:
        """The host is another: its markers and its loop are its own."""
        self._log.clear()
        self._log.line = 0
        self._view = None
        self.forget_loop()

    def _is_shown(self, marker: Marker) -> bool:
        if marker.kind not in self.shown_kinds:
            return False
        return marker.kind != "collision" or marker.strength >= self.least_impulse


def _weight(marker: Marker) -> tuple[int, float]:
    return _WEIGHT[marker.kind], marker.strength


def round_times(first: float, last: float, width: float, distance: float) -> list[float]:
    """Round times [s] for labels on a bar of a width, at least `distance` apart [pixels]."""
    room = max(width / distance, 1.0)
    least = max((last - first) / room, 1e-3)
    step = next(
        (base * 10.0**power for power in range(-3, 7) for base in (1.0, 2.0, 5.0) if base * 10.0**power >= least), 1e7
    )
    begin = -(-first // step) * step
    return [round(begin + place * step, 6) for place in range(int((last - begin) / step + 1e-6) + 1)]
