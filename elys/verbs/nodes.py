"""The nodes as processes: each joins or hosts a session, runs, and leaves it cleanly when it is asked to end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import signal
import sys
from collections.abc import AsyncIterator, Callable, Coroutine
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elys.bus.access.listening import LOOPBACK, Listening
from elys.bus.access.roles import Role, role_of_user
from elys.bus.log import log_to_session, start_logging
from elys.bus.recording_plan import RecordingPlan
from elys.bus.session import Session
from elys.common.errors import AccessError, BusError, ContextLost
from elys.verbs.playback import Playback

if TYPE_CHECKING:
    from elys.bus.transports.zenoh import ZenohTransport

_ROUTER_PATIENCE = 20.0  # [s] for a router that starts beside

_log = logging.getLogger(__name__)


def run_until_asked(work: Coroutine[Any, Any, None]) -> None:
    """Runs a node; SIGINT, SIGTERM and SIGHUP cancel it, and it ends as if it had come to its own end."""

    async def guarded() -> None:
        task = asyncio.ensure_future(work)
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, task.cancel)
        with contextlib.suppress(asyncio.CancelledError):
            await task

    asyncio.run(guarded())


@contextlib.asynccontextmanager
async def joined(connect: str | None, *, kind: str, timeout: float = 5.0) -> AsyncIterator[Session]:
    """A session somebody else hosts: at `connect`, or the newest of this machine.

    Raises:
        ConnectionLost: there is none. ProtocolError: it speaks another version.
    """
    from elys.bus.discovery import join_session

    session = await join_session(connect, kind=kind, timeout=timeout)
    handler = log_to_session(session)
    try:
        yield session
    finally:
        await asyncio.sleep(0)  # what was logged last goes out: it tells others why this node ends
        handler.detach()
        await session.close()


@contextlib.asynccontextmanager
async def hosted(
    listen: Listening,
    *,
    name: str,
    kind: str,
    scene: str,
    epoch: int,
    router: str | None = None,
    is_chosen: bool = False,
) -> AsyncIterator[tuple[Session, str]]:
    """A session of one's own and the endpoint it is found at, by others of this machine without being told where.

    With `router` it listens nowhere and is reached through the router at that endpoint, as others may be.

    One whose name was chosen by nobody gets another where the name is taken.

    Raises:
        BusError: the endpoint cannot be listened at, or the chosen name is taken here or behind the router.
        AccessError: there is nowhere to keep the keys of who may come in, or the router does not take this user's.
        ConnectionLost: there is no router.
    """
    from elys.bus.discovery import advertise, loopback_endpoint
    from elys.bus.session_names import claimed_name
    from elys.bus.transports.reaching import is_near
    from elys.verbs.invitation import invite
    from elys.verbs.streaming_child import StreamingChild

    transport = await asyncio.to_thread(_host_transport(listen, router))
    try:
        with claimed_name(session_name(name), is_chosen=is_chosen) as free_name:
            session = await Session.host(transport, name=free_name, kind=kind, epoch=epoch)
            withdraw = advertise(
                name=free_name, kind=kind, endpoint=transport.endpoint, scene=scene, is_behind_router=bool(router)
            )
    except BaseException:
        await asyncio.to_thread(transport.close)
        raise
    handler = log_to_session(session)
    own = loopback_endpoint(transport.endpoint)
    streaming = StreamingChild(session, f"{session.name}@{own}" if router else own)
    invite(listen, transport.endpoint)
    try:
        if not is_near(transport.endpoint):
            await streaming.start()
        yield session, transport.endpoint
    finally:
        handler.detach()
        withdraw()
        await asyncio.shield(streaming.close())
        await session.close()


def _host_transport(listen: Listening, router: str | None) -> Callable[[], ZenohTransport]:
    from elys.bus.access.listening import access_of
    from elys.bus.discovery import complete_endpoint
    from elys.bus.transports.zenoh import ZenohTransport

    if router:
        if listen != LOOPBACK:
            raise BusError("a session listens itself or is reached through a router: give --listen or --router")
        return partial(_below_router, complete_endpoint(router))
    if listen.endpoint is None:
        return lambda: ZenohTransport.listen_on_free_port(access=access_of(listen))
    endpoint = listen.endpoint
    return lambda: ZenohTransport.listen(endpoint, access=access_of(listen))


def _below_router(router: str) -> ZenohTransport:
    """A host's connection to a router, which must be of the owner's: nobody else may say what a session's state is."""
    from elys.bus.discovery import credentials_at
    from elys.bus.transports.zenoh import ZenohTransport

    shown = credentials_at(router)
    transport = ZenohTransport.connect(router, timeout=_ROUTER_PATIENCE, credentials=shown, hosts=True)
    if role_of_user(transport.user) < Role.OWNER:
        transport.close()
        raise AccessError(
            f"a session behind a router needs the key of its owner, not of a {role_of_user(transport.user).title}"
        )
    return transport


def session_name(text: str) -> str:
    """A name as sessions have it: letters, digits, '.', '_' and '-' only."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", text).strip("-") or "session"


def simulation(
    scene: str,
    *,
    listen: Listening,
    router: str | None,
    discover: bool,
    step_limit: int,
    record: Path | None,
    realtime: bool,
    paused: bool,
    name: str,
    threads: int,
    guard: float,
    keep: float,
    plan: RecordingPlan,
    at: str = "",
) -> None:
    """The simulation's process."""
    from elys.verbs.simulate import prepare, simulate

    start_logging()
    opened, origin = prepare(scene, record=record, plan=plan, threads=threads, at=at)
    run_until_asked(
        simulate(
            opened,
            listen=listen,
            router=router,
            discover=discover,
            step_limit=step_limit,
            record=record,
            realtime=realtime,
            paused=paused,
            name=name,
            guard=guard,
            keep=keep,
            plan=plan,
            origin=origin,
        )
    )


def render(connect: str | None) -> None:
    """A render node's process."""
    from elys.render_node.node import serve_views

    lost: list[ContextLost] = []

    async def work() -> None:
        async with joined(connect, kind="render", timeout=60.0) as session:
            try:
                await serve_views(session)
            except ContextLost as error:
                _log.error("%s", error)  # here: an editor's console is to tell why its picture stands still
                lost.append(error)

    start_logging()
    run_until_asked(work())
    if lost:
        sys.exit(1)  # who looks after it starts it again


def editor(connect: str | None, *, starts_alone: bool = False, frame_limit: int) -> None:
    """The editor's process; one that starts alone begins with its start page."""
    from elys.editor_node.node import run_editor
    from elys.verbs.openers import ChildProcesses

    async def work() -> None:
        openers = ChildProcesses()
        try:
            if starts_alone:
                await run_editor(None, openers=openers, frames=frame_limit or None)
                return
            async with joined(connect, kind="editor", timeout=60.0) as session:
                await run_editor(session, openers=openers, frames=frame_limit or None)
        finally:
            await openers.close()

    start_logging()
    run_until_asked(work())


def view(connect: str | None, *, debug: str, frame_limit: int, plays: bool = False) -> None:
    """A viewer's process, which waits for its session."""
    from elys.common.input_bindings import FollowedBindings
    from elys.render_node.debug_drawing import parsed_kinds
    from elys.render_node.game_input import Seating
    from elys.render_node.view_window import run_view

    bindings = FollowedBindings()
    seating = Seating(bindings=bindings, plays_at_once=plays, keep=bindings.keep)

    async def work() -> None:
        async with joined(connect, kind="viewer", timeout=60.0) as session:
            await run_view(session, frames=frame_limit or None, debug=parsed_kinds(debug), seating=seating)

    start_logging()
    run_until_asked(work())


def player(recording: Path, playback: Playback, *, listen: Listening) -> None:
    """A player's process."""
    from elys.verbs.replay import serve_recording

    start_logging()
    run_until_asked(serve_recording(recording, playback, listen=listen))
