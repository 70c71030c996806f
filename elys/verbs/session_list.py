"""sessions: those of this machine, those behind an endpoint, those of the local network; and how each does, asked of it."""

from __future__ import annotations

import asyncio
import contextlib
import time
from functools import partial
from typing import Final

import msgspec

from elys.bus import topics
from elys.bus.access.roles import signed_id
from elys.bus.beacon import FoundSession, look_around
from elys.bus.discovery import choose_endpoint, credentials_at, find_sessions, join_session, split_place
from elys.bus.handshake import all_welcomes, names_of
from elys.bus.messages.vitals import VitalsRequest
from elys.bus.session import HOST_KINDS, Node, Session, node_id
from elys.bus.transports.zenoh import ZenohTransport
from elys.common.errors import BusError
from elys.verbs.host_facts import client_count
from elys.verbs.output import print_json, print_table

PATIENCE: Final = 1.5  # [s] that a session has to say how it does


class SessionRow(msgspec.Struct, frozen=True, kw_only=True):
    """A session and how it does; below 0 stands for what it did not say."""

    name: str
    endpoint: str
    kind: str = ""
    scene: str = ""
    age: float = -1.0  # [s]
    pid: int = 0  # of this machine
    tick_rate: float = -1.0  # [Hz]
    realtime_factor: float = -1.0
    load: float = -1.0  # share of a tick's time that a tick takes
    clients: int = -1
    is_local: bool = False  # of this machine
    needs_secret: bool = False
    answers: bool = False


def sessions(connect: str | None, *, discover: bool, seconds: float, json: bool) -> None:
    """Prints them."""
    rows = asyncio.run(_all(connect, discover=discover, seconds=seconds))
    if json:
        print_json(rows)
    elif not rows:
        print(_none_text(connect, discover=discover))
    else:
        columns = ("session", "kind", "endpoint", "scene", "age", "rate", "load", "clients", "process")
        print_table(columns, map(_cells, rows))


async def _all(connect: str | None, *, discover: bool, seconds: float) -> list[SessionRow]:
    if connect:
        rows = await _behind(connect)
    else:
        now = time.time()
        rows = [
            SessionRow(
                name=record.name,
                endpoint=record.endpoint,
                kind=record.kind,
                scene=record.scene,
                age=now - record.started,
                pid=record.pid,
                is_local=True,
            )
            for record in find_sessions()
        ]
    found = await look_around(seconds) if discover else []
    asked = list(await asyncio.gather(*map(_asked, rows)))
    return [*asked, *(_row_of(session) for session in found)]


async def _behind(connect: str) -> list[SessionRow]:
    """Those that answer at an endpoint. ConnectionLost: nobody is there."""
    name, endpoint = split_place(choose_endpoint(connect))
    endpoints = endpoint.split(",")
    shown = await asyncio.to_thread(credentials_at, endpoints[0])
    transport = await asyncio.to_thread(partial(ZenohTransport.connect, endpoints, credentials=shown))
    try:
        node = Node("tool", signed_id(node_id("tool"), transport.user))
        welcomes = await all_welcomes(transport, node=node, name=name or "*", timeout=PATIENCE)
    finally:
        await asyncio.to_thread(transport.close)
    return [SessionRow(name=name, endpoint=endpoint) for name in names_of(welcomes)]


async def _asked(row: SessionRow) -> SessionRow:
    """The row, with what its host says if it does."""
    with contextlib.suppress(BusError, TimeoutError):
        session = await join_session(f"{row.name}@{row.endpoint}", kind="tool", timeout=PATIENCE)
        try:
            return await _told(row, session)
        finally:
            await session.close()
    return row


async def _told(row: SessionRow, session: Session) -> SessionRow:
    async with asyncio.timeout(PATIENCE):
        while not (hosts := [node for node in session.nodes.values() if node.kind in HOST_KINDS]):
            await asyncio.sleep(0.01)  # tokens come one by one
    vitals = await session.request(topics.VITALS, VitalsRequest(), key=hosts[0].id, timeout=PATIENCE)
    told = msgspec.structs.replace(row, kind=vitals.kind, answers=True, clients=client_count(session) - 1)
    if (facts := vitals.host) is None:
        return told
    return msgspec.structs.replace(
        told,
        scene=facts.scene,
        age=max(0.0, vitals.clock / 1e9 - facts.started),
        tick_rate=facts.tick_rate or -1.0,
        realtime_factor=facts.realtime_factor,
        load=facts.load,
    )


def _row_of(found: FoundSession) -> SessionRow:
    return SessionRow(
        name=found.name,
        endpoint=found.endpoint,
        kind=found.kind,
        scene=found.scene,
        age=found.age,
        load=found.load,
        clients=found.clients,
        needs_secret=found.needs_secret,
        answers=True,
    )


def _none_text(connect: str | None, *, discover: bool) -> str:
    if connect:
        return f"No session is behind {connect} now."
    where = "on this machine, and none answers on the local network" if discover else "on this machine"
    return f"No session is running {where}. Start one: elys run SCENE" + (" --discover" if discover else "")


def _cells(row: SessionRow) -> tuple[str, ...]:
    rate = f"{row.tick_rate:g} Hz" if row.tick_rate > 0.0 else ""
    factor = f" x {row.realtime_factor:.2f}" if rate and row.realtime_factor >= 0.0 else ""
    return (
        row.name,
        row.kind + ("" if row.answers else " (silent)"),
        row.endpoint + (" (secret)" if row.needs_secret else ""),
        row.scene,
        f"{row.age:.0f} s" if row.age >= 0.0 else "",
        rate + factor,
        f"{100 * row.load:.0f} %" if row.load >= 0.0 else "",
        str(row.clients) if row.clients >= 0 else "",
        str(row.pid) if row.is_local else "",
    )
