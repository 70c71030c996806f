"""play, record, info: what is done with recordings."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import sys
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from elys.bus.access.listening import Listening
from elys.bus.log import start_logging
from elys.bus.recording_plan import PLAIN, RecordingPlan, files_of
from elys.bus.session import Session
from elys.common.errors import RecordingError
from elys.launch import before_exec
from elys.verbs.nodes import hosted, joined, run_until_asked
from elys.verbs.output import print_json, print_table, size_text
from elys.verbs.playback import Playback

if TYPE_CHECKING:
    from elys.bus.recording_sources import Sources
    from elys.bus.view_recording import RecordedView

_log = logging.getLogger(__name__)


def play(recording: Path, playback: Playback, *, listen: Listening, editor: bool) -> None:
    """Serves a recording in this process, or under the supervisor with an editor on it."""
    playback.part()  # times that are none are said here, and not by a node
    start_logging()
    if not editor:
        run_until_asked(serve_recording(recording, playback, listen=listen))
        return
    from elys.bus.recording_info import recording_info
    from elys.render_node.window import probe_display
    from elys.verbs.ghosts import require_recordings
    from elys.verbs.run import start

    require_recordings([Path(ghost) for ghost in playback.ghosts])
    recording_info(recording)  # what is no recording is one line here and not a crash of a node
    probe_display()
    extra = {"player": [*playback.options(), *listen.words()]}
    sys.exit(start("replay", {"recording": str(recording)}, endpoint=listen.endpoint, extra=extra))


async def serve_recording(recording: Path, playback: Playback, *, listen: Listening) -> None:
    """Hosts a recording as a session until it is told to end.

    Raises:
        RecordingError: it is none, or a ghost is. RequestError: it is not there from `start` to `end`.
        BusError: the endpoint cannot be listened at.
    """
    from elys.bus.player import Player
    from elys.bus.recording import opened_to_show
    from elys.verbs.ghosts import served

    part = playback.part()
    begins = -math.inf if part.start is None else part.start
    with await asyncio.to_thread(opened_to_show, recording, begins) as opened:
        scene = opened.mirror_at(0).scene
        async with hosted(listen, name=scene, kind="replay", scene=scene, epoch=time.time_ns()) as (session, endpoint):
            _log.info("playing %s at %s: attach with `elys view` or `elys edit`", recording, endpoint)
            player = Player(
                opened,
                session,
                playing=not playback.paused,
                rate=playback.rate,
                loop=playback.loop,
                part=part,
            )
            async with served(session, [Path(ghost) for ghost in playback.ghosts]):
                await player.run()


def record(
    output: Path,
    *,
    connect: str | None,
    seconds: float,
    views: Sequence[str] = (),
    view_size: str = "1280x720",
    view_fps: float = 30.0,
    plan: RecordingPlan = PLAIN,
    patience: float = 5.0,
) -> None:
    """Records a session from outside: until Ctrl-C, for so many seconds, or until its host was gone for `patience` seconds, as
    long as which it is waited for at the beginning too; with pictures through the cameras named by `views`.
    """
    from elys.bus.recorder import record_session
    from elys.verbs.recording_child import claimed_file, require_recordable

    require_recordable(output, overwrites=plan.overwrites)
    start_logging()
    endpoint = _endpoint_for_views(connect) if views else connect
    path: Path | None = None

    async def work() -> None:
        nonlocal path
        async with joined(endpoint, kind="recorder", timeout=patience) as session, contextlib.AsyncExitStack() as stack:
            kept = await _recorded_views(session, views, view_size, view_fps)
            if kept and endpoint is not None:
                await stack.enter_async_context(_render_node(session, endpoint))
            path = claimed_file(output, plan)  # not before there is something to record
            _log.info("recording %s to %s; end with Ctrl-C", session.name, path)
            stop = asyncio.Event()
            _stop_when_host_is_gone(session, stop, patience)
            recording = asyncio.ensure_future(record_session(session, path, stop, kept, plan))
            with contextlib.suppress(asyncio.CancelledError, TimeoutError):
                await asyncio.wait_for(asyncio.shield(recording), seconds or None)
            stop.set()
            await recording

    earlier = set(files_of(output))
    run_until_asked(work())
    if path is None:  # ended while it waited for the session
        raise RecordingError("nothing was recorded")
    for file in [file for file in files_of(output) if file not in earlier] if plan.rotates else [path]:
        info(file, json=False)


def _endpoint_for_views(connect: str | None) -> str:
    from elys.bus.discovery import choose_endpoint

    return choose_endpoint(connect)


async def _recorded_views(session: Session, names: Sequence[str], size: str, fps: float) -> list[RecordedView]:
    """The cameras of these names. Raises ElysError, before anything is recorded, for one that there is not."""
    if not names:
        return []
    from elys.bus.following import follow_scene
    from elys.bus.mirror import SceneMirror
    from elys.bus.view_recording import RecordedView
    from elys.render_node.film import check_video
    from elys.verbs.render import parsed_size
    from elys.verbs.viewpoint import camera_entity

    width, height = parsed_size(size)
    check_video(width, height, fps)
    mirror = SceneMirror()
    (await follow_scene(session, mirror))()
    return [
        RecordedView(name=name, entity=camera_entity(mirror, name), width=width, height=height, fps=fps)
        for name in dict.fromkeys(names)
    ]


@contextlib.asynccontextmanager
async def _render_node(session: Session, endpoint: str) -> AsyncIterator[None]:
    """The session's render node; where it has none, a process with one, as long as this lasts."""
    if session.nodes_of("render"):
        yield
        return
    command = (sys.executable, "-m", "elys", "node", "render", "--connect", endpoint)
    process = await asyncio.create_subprocess_exec(
        *command, stdin=asyncio.subprocess.DEVNULL, preexec_fn=before_exec(10), start_new_session=True
    )
    try:
        yield
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        await process.wait()


def _stop_when_host_is_gone(session: Session, stop: asyncio.Event, patience: float) -> None:
    """A host that is restarted is back within seconds, and recording goes on; one that stays away has ended the session."""
    loop = asyncio.get_running_loop()
    ending: list[asyncio.TimerHandle] = []

    def link_changed(connected: bool) -> None:
        while ending:
            ending.pop().cancel()
        if not connected:
            _log.info("the session is gone; the recording ends unless it is back within %g s", patience)
            ending.append(loop.call_later(patience, stop.set))

    session.on_link(link_changed)


def info(recording: Path, *, json: bool) -> None:
    """Prints what a recording holds."""
    from elys.bus.recording_info import recording_info
    from elys.bus.recording_storage import describe

    facts = recording_info(recording)
    if json:
        print_json(facts)
        return
    state = "complete" if facts.complete else "cut off: read as far as it goes"
    if facts.health.damage:
        state = "damaged: read without what is lost"
    print(f"{recording}: {facts.scene}, {facts.duration:.2f} s, ticks {facts.first_tick} to {facts.last_tick}, {state}")
    contents = f"{facts.body_count} bodies, {facts.entity_count} entities, {facts.asset_count} assets"
    print(f"{contents}, {size_text(facts.size)}; ELYS {facts.elys_version}, protocol {facts.protocol}")
    print(describe(facts.states))
    if facts.sources is not None:
        print("\n".join(_source_lines(facts.sources)))
    if facts.lineage:
        print(f"a fork of {facts.lineage.get('parent', 'another recording')} at {facts.lineage.get('time', '?')} s")
    if facts.health.sentence:
        print(f"health: {facts.health.sentence}")
    print()
    rows = [(c.name, c.count, f"{c.rate:.1f}", size_text(c.bytes)) for c in facts.channels]
    print_table(("channel", "messages", "per second", "size"), rows)


def _source_lines(sources: Sources, indent: str = "") -> Iterator[str]:
    """What a recording was made of, and what that was made of."""
    for source in sources.of:
        yield (
            f"{indent}made by {sources.made_by} of {source.file}, {source.start:.2f} s to {source.end:.2f} s "
            f"(ticks {source.first_tick} to {source.last_tick}){'; ' * bool(sources.text)}{sources.text}"
        )
        if source.sources is not None:
            yield from _source_lines(source.sources, indent + "  ")
