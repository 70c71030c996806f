"""top: a live view of a running session in the terminal, one line a second into a pipe, or the figures once."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections import deque
from typing import Any, Final

import msgspec
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from elys.bus import topics
from elys.bus.following import follow_scene
from elys.bus.messages.physics import Diagnostics
from elys.bus.messages.session import EventBatch, SessionStatus, TickProfile
from elys.bus.mirror import SceneMirror
from elys.bus.session import Session
from elys.common.errors import ConnectionLost
from elys.verbs.nodes import joined, run_until_asked
from elys.verbs.output import print_json

REFRESH: Final = 0.25  # [s] between two pictures
LINE_EVERY: Final = 1.0  # [s] between two lines into a pipe
PATIENCE: Final = 2.0  # [s] that `--once` waits for a tick; a paused session has none
_BAR: Final = 30  # characters
_EVENTS: Final = 8


class Overview(msgspec.Struct, frozen=True, kw_only=True):
    """What `elys top` shows, for programs. `drift` is of the energy since it was attached [J]."""

    status: SessionStatus | None
    diagnostics: Diagnostics | None
    profile: TickProfile | None
    drift: float
    names: dict[int, str]  # of the entities that diagnostics name
    events: tuple[str, ...]


class Watch:
    """Listens to a session and keeps what it said last."""

    def __init__(self, session: Session) -> None:
        self.status: SessionStatus | None = None
        self.diagnostics: Diagnostics | None = None
        self.profile: TickProfile | None = None
        self.connected = session.connected
        self.events: deque[str] = deque(maxlen=_EVENTS)
        self.measured = asyncio.Event()  # status, diagnostics and profile have come
        self._mirror = SceneMirror()
        self._session = session
        self._first_energy: float | None = None
        session.subscribe(topics.STATUS, self._take_status)
        session.subscribe(topics.DIAGNOSTICS, self._take_diagnostics)
        session.subscribe(topics.PROFILE, self._take_profile)
        session.subscribe(topics.EVENTS, self._take_events)
        session.on_link(self._link_changed)

    async def follow(self) -> None:
        """Learns the names of entities, and keeps knowing them."""
        await follow_scene(self._session, self._mirror)

    def name(self, entity: int) -> str:
        """An entity as people call it."""
        known = self._mirror.entities.get(entity)
        return known.name if known is not None and known.name else f"entity {entity}"

    def overview(self) -> Overview:
        """All of it at once."""
        found = self.diagnostics
        named = (*found.deepest, *found.restless, found.joint, found.turned_joint) if found is not None else ()
        return Overview(
            status=self.status,
            diagnostics=found,
            profile=self.profile,
            drift=0.0 if found is None or self._first_energy is None else _energy(found) - self._first_energy,
            names={entity: self.name(entity) for entity in named if entity},
            events=tuple(self.events),
        )

    def _take_status(self, status: SessionStatus, _: str) -> None:
        self.status = status
        self._note()

    def _take_diagnostics(self, found: Diagnostics, _: str) -> None:
        if self._first_energy is None:
            self._first_energy = _energy(found)
        self.diagnostics = found
        self._note()

    def _take_profile(self, profile: TickProfile, _: str) -> None:
        self.profile = profile
        self._note()

    def _take_events(self, batch: EventBatch, _: str) -> None:
        for event in batch.events:
            text = (
                str(event.values.get("text", "")) or f"{event.kind} {self.name(event.entity) if event.entity else ''}"
            )
            self.events.append(f"tick {batch.tick}: {text}")

    def _link_changed(self, connected: bool) -> None:
        self.connected = connected
        self._first_energy = None

    def _note(self) -> None:
        if self.status is not None and self.diagnostics is not None and self.profile is not None:
            self.measured.set()


def top(connect: str | None, *, once: bool, json: bool) -> None:
    """Shows a session until Ctrl-C; with `once` or `json` its figures now."""

    async def work() -> None:
        async with joined(connect, kind="tool") as session:
            watch = Watch(session)
            await watch.follow()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(watch.measured.wait(), PATIENCE)
            if watch.status is None and watch.diagnostics is None:
                raise ConnectionLost("the session says nothing: has its host ended?")
            if json:
                print_json(watch.overview())
            elif once:
                Console(highlight=False).print(picture(watch))
            elif sys.stdout.isatty():
                await _show_live(watch)
            else:
                await _print_lines(watch)

    run_until_asked(work())


async def _show_live(watch: Watch) -> None:
    with Live(picture(watch), refresh_per_second=1.0 / REFRESH, transient=False) as live:
        while True:
            await asyncio.sleep(REFRESH)
            live.update(picture(watch))


async def _print_lines(watch: Watch) -> None:
    while True:
        print(line(watch), flush=True)
        await asyncio.sleep(LINE_EVERY)


def line(watch: Watch) -> str:
    """The most important figures in one line."""
    if not watch.connected:
        return "the session is gone; waiting for it to return"
    parts = [_state(watch.status)] if watch.status is not None else []
    found = watch.diagnostics
    if found is not None:
        parts.append(
            f"{found.awake} of {found.bodies} bodies awake, {found.contacts} contacts, {found.islands} islands"
        )
        parts.append(f"energy {_energy(found):.6g} J, overlap {1000 * found.deepest_overlap:.3f} mm")
        parts.append(f"joints {1000 * found.joint_error:.3f} mm, residual {found.residual:.2g} m/s")
    if watch.profile is not None:
        parts.append(f"tick {watch.profile.total:.2f} ms")
    return "; ".join(parts)


def picture(watch: Watch) -> Group:
    """All figures, as the terminal shows them."""
    overview = watch.overview()
    rows: list[Any] = []
    if not watch.connected:
        rows.append(Text("the session is gone; waiting for it to return", style="bold red"))
    if overview.status is not None:
        rows.append(Text(_state(overview.status), style="bold"))
    rows.append(
        _figures(overview) if overview.diagnostics is not None else Text("no tick was measured yet: is it paused?")
    )
    if overview.profile is not None:
        rows.append(_stages(overview.profile))
    if overview.events:
        rows.append(Text("\n".join(overview.events)))
    return Group(*rows)


def _figures(overview: Overview) -> Table:
    found = overview.diagnostics
    assert found is not None
    name = overview.names
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim")
    table.add_column()
    turn = f", {found.joint_angle_error:.2g} rad" + (f" ({name[found.turned_joint]})" if found.turned_joint else "")
    for label, text in (
        ("bodies", f"{found.bodies}, {found.awake} awake in {found.islands} islands, {found.contacts} contacts"),
        (
            "energy",
            f"{_energy(found):.6g} J, of it kinetic {found.kinetic:.4g} J; {overview.drift:+.3g} J since attached",
        ),
        ("momentum", f"{_vector(found.momentum)} kg m/s"),
        ("about the origin", f"{_vector(found.angular_momentum)} kg m²/s"),
        ("deepest overlap", f"{1000.0 * found.deepest_overlap:.3f} mm{_between(name, found.deepest)}"),
        ("residual", f"{found.residual:.2g} m/s{_between(name, found.restless)}"),
        (
            "worst joint",
            f"{1000.0 * found.joint_error:.3f} mm" + (f" ({name[found.joint]})" if found.joint else "") + turn,
        ),
    ):
        table.add_row(label, text)
    return table


def _stages(profile: TickProfile) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim")
    table.add_column(justify="right")
    table.add_column(justify="right")
    table.add_column()
    total = max(profile.total, 1e-9)
    table.add_row("tick", f"{profile.total:.3f} ms", "", "")
    for stage, cost in profile.stages.items():
        share = min(cost / total, 1.0)
        table.add_row(stage.replace("_", " "), f"{cost:.3f} ms", f"{100 * share:.0f} %", "█" * round(_BAR * share))
    return table


def _state(status: SessionStatus) -> str:
    how = "playing" if status.playing else "paused"
    factor = f"{status.realtime_factor:.2f} times real time"
    return f"{status.scene} ({status.kind}), {how}, tick {status.tick}, {status.simulation_time:.2f} s, {factor}"


def _energy(found: Diagnostics) -> float:
    return found.kinetic + found.potential


def _vector(values: tuple[float, float, float]) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"


def _between(names: dict[int, str], pair: tuple[int, int]) -> str:
    return f" between {names[pair[0]]} and {names[pair[1]]}" if all(pair) else ""
