"""render: a scene simulated in this process, a recording or a running session, into a picture or a video."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, cast

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.physics import DebugLines
from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import Debug, Shows
from elys.bus.mirror import SceneMirror
from elys.common.errors import ElysError
from elys.render_node.debug_drawing import PHYSICS_LINES, DebugDrawing, parsed_kinds
from elys.render_node.film import check_video
from elys.render_node.offline import VIEWS, CameraAt, OfflineRenderer, Overlay, check_size
from elys.render_node.picture_files import holds_numbers, legend_path, output_kind, save_legend
from elys.render_node.trails import TRAIL_SECONDS
from elys.verbs.footage import SCENE_DURATION, Footage, LinesByTick, film_sound, opened_footage, recorded
from elys.verbs.ghosts import recorded_tracks
from elys.verbs.output import size_text
from elys.verbs.viewpoint import Viewpoint, named_entities

if TYPE_CHECKING:
    from elys.bus.session import Session

STATE_PATIENCE: Final = 1.0  # [s] for a state from a session; one that is paused may send none
STALL_PATIENCE: Final = 10.0  # [s] without a new state while a session is filmed


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What is wanted of it."""

    output: Path
    kind: Literal["picture", "video", "recording"]
    width: int
    height: int
    shows: Shows
    viewpoint: Viewpoint
    fps: float
    environment: bool = True
    sampled: bool = False
    debug: tuple[Debug, ...] = ()
    debug_of: tuple[str, ...] = ()
    stamp: bool = False
    ghosts: tuple[Path, ...] = ()
    sound: bool = False


def render(
    source: str | None,
    output: Path,
    *,
    size: str,
    time: float,
    duration: float,
    fps: float,
    view: str = "shaded",
    camera: str = "",
    path: Path | None = None,
    orbit: float = 0.0,
    connect: str | None = None,
    environment: bool = True,
    sampled: bool = False,
    debug: str = "",
    debug_of: Sequence[str] = (),
    stamp: bool = False,
    ghosts: Sequence[Path] = (),
    sound: bool = False,
) -> None:
    """Draws `source`, or without one the session at `connect`, into `output`: a picture or a video, by its suffix.

    Raises:
        ElysError: the order or the output cannot be; SceneError, RecordingError, BusError: the source; DisplayError: no OpenGL.
    """
    order = replace(
        _order(output, size=size, view=view, viewpoint=Viewpoint.asked(camera, path, orbit), fps=fps),
        environment=environment,
        sampled=sampled,
        debug=parsed_kinds(debug),
        debug_of=tuple(debug_of),
        stamp=stamp,
        ghosts=tuple(ghosts),
        sound=sound,
    )
    _check_overlay(order)
    if order.kind == "recording" and (source is None or Path(source).suffix != ".mcap"):
        raise ElysError(
            f"{output} is to be a recording with pictures: name the recording it is made of, or use `elys record --view`"
        )
    if source is None:
        if time:
            raise ElysError("a running session is drawn as it is now: leave --time out, or name a scene or a recording")
        _draw_session(connect, order, duration or SCENE_DURATION)
        return
    if connect is not None:
        raise ElysError(f"--connect names a session, {source} is another source: give one of them")
    with opened_footage(source, time, duration, order.debug, hears=order.sound) as footage:
        _draw(footage, order)


def _check_overlay(order: Order) -> None:
    if order.debug and order.shows != "shaded":
        raise ElysError(f"--debug draws over pictures of light: leave --view {order.shows} out")
    if (order.debug or order.stamp) and holds_numbers(order.output):
        what = "--debug" if order.debug else "--stamp"
        raise ElysError(f"{what} draws over pictures, and {order.output} is to hold numbers: write a .png or .mp4")
    if order.ghosts and (order.shows != "shaded" or holds_numbers(order.output)):
        raise ElysError("--ghost is drawn into pictures of light: write a .png or .mp4 of --view shaded")
    if order.sound and order.kind != "video":
        raise ElysError(f"--sound gives a film its track, and {order.output} is none: write an .mp4")
    if order.debug_of and not order.debug:
        raise ElysError("--debug-of says of whom, but not what is to be drawn: give --debug as well")


def _order(output: Path, *, size: str, view: str, viewpoint: Viewpoint, fps: float) -> Order:
    """Everything that can be wrong with it is found here, before any work."""
    kind: Literal["picture", "video", "recording"] = "recording" if output.suffix == ".mcap" else output_kind(output)
    width, height = parsed_size(size)
    check_size(width, height)
    if kind != "picture":
        check_video(width, height, fps)
    if view not in VIEWS:
        raise ElysError(f"there is no view '{view}': views are {', '.join(VIEWS)}")
    return Order(
        output=output, kind=kind, width=width, height=height, shows=cast(Shows, view), viewpoint=viewpoint, fps=fps
    )


def _draw(footage: Footage, order: Order) -> None:
    """Draws it and says what has come of it."""
    entity = order.viewpoint.entity_in(footage.mirror)  # first: what is asked in vain should cost nothing
    overlay = Overlay(
        drawing=footage.drawing if order.debug else None,
        kinds=order.debug,
        entities=named_entities(footage.mirror, order.debug_of),
        stamp=order.stamp,
    )
    first = next(footage.frames, None)
    if first is not None:
        footage.mirror.keep_frame(first)
    with (
        recorded_tracks(order.ghosts) as ghosts,
        OfflineRenderer(
            footage.mirror,
            footage.fetch,
            width=order.width,
            height=order.height,
            shows=order.shows,
            environment=order.environment,
            sampled=order.sampled,
            overlay=overlay,
            ghosts=ghosts,
            source_of=footage.source_of,
        ) as renderer,
    ):
        renderer.look_through(entity)
        camera_at = order.viewpoint.camera_at(renderer, footage.origin)
        if order.kind == "picture":
            now = first.simulation_time if first is not None else footage.mirror.simulation_time
            renderer.write_picture(order.output, camera=camera_at(now) if camera_at else None)
            what = f"{order.width}x{order.height}"
        elif order.kind == "recording":
            assert first is not None
            count = _into_recording(renderer, order, footage, first, camera_at)
            what = f"{count} pictures of {order.width}x{order.height} beside what was recorded"
        else:
            assert first is not None
            count = _film(renderer, order, footage, first, camera_at)
            what = f"{count} pictures of {order.width}x{order.height}"
        if order.shows == "segmentation":
            legend = legend_path(order.output)
            save_legend(legend, renderer.legend())
            what += f", classes in {legend.name}"
    print(f"{order.output}: {what}, {size_text(order.output.stat().st_size)}")


def _film(
    renderer: OfflineRenderer,
    order: Order,
    footage: Footage,
    first: StateFrame,
    camera_at: CameraAt | None,
) -> int:
    from rich.console import Console
    from rich.progress import Progress

    def frames() -> Iterator[StateFrame]:
        yield first
        yield from footage.frames

    console = Console(stderr=True)
    with (
        film_sound(footage, wanted=order.sound) as sound,
        Progress(console=console, transient=True, disable=not console.is_terminal) as bar,
    ):
        task = bar.add_task(f"Drawing {order.output.name}", total=None)
        return renderer.write_video(
            order.output,
            frames(),
            fps=order.fps,
            duration=footage.duration,
            camera_at=camera_at,
            sound=sound,
            progress=lambda drawn, total: bar.update(task, completed=drawn, total=total or None),
        )


def _into_recording(
    renderer: OfflineRenderer, order: Order, footage: Footage, first: StateFrame, camera_at: CameraAt | None
) -> int:
    from rich.console import Console
    from rich.progress import Progress

    from elys.verbs.recording_child import require_recordable
    from elys.verbs.video_recording import Strip, with_pictures

    assert footage.recording is not None
    require_recordable(order.output)
    name = order.viewpoint.camera or "view"
    strip = Strip(name=name, width=order.width, height=order.height, fps=order.fps, duration=footage.duration)

    def draw(frame: StateFrame) -> NDArray[np.uint8]:
        footage.mirror.keep_frame(frame)
        return renderer.picture(camera=camera_at(frame.simulation_time) if camera_at else None)

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(f"Drawing {order.output.name}", total=round(footage.duration * order.fps))
        frames = itertools.chain([first], footage.frames)
        return with_pictures(footage.recording, order.output, strip, frames, draw, lambda: bar.advance(task))


def parsed_size(text: str) -> tuple[int, int]:
    """Width and height [pixels] of WIDTHxHEIGHT. Raises ElysError."""
    match = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text)
    if not match:
        raise ElysError(f"'{text}' is no size: write WIDTHxHEIGHT, for instance 1280x720")
    return int(match[1]), int(match[2])


# --- a running session ---------------------------------------------------------------------------------------------


def _draw_session(connect: str | None, order: Order, duration: float) -> None:
    """A picture of what is now; a video of what comes, which is recorded first: drawing may be slower than the simulation."""
    from elys.bus.discovery import choose_endpoint

    endpoint = choose_endpoint(connect)
    if order.kind == "picture":
        asyncio.run(_draw_now(endpoint, order))
        return
    with tempfile.TemporaryDirectory(prefix="elys-") as folder:
        recording = Path(folder, "session.mcap")
        told = asyncio.run(_record_for(endpoint, order, recording, duration))
        with recorded(recording, 0.0, duration, order.debug, told, hears=order.sound) as footage:
            _draw(footage, order)


async def _draw_now(endpoint: str, order: Order) -> None:
    from elys.bus.asset_service import AssetClient, open_asset_cache
    from elys.bus.following import follow_scene, follow_state
    from elys.render_node.debug_listening import DebugListener
    from elys.verbs.nodes import joined

    async with joined(endpoint, kind="tool") as session:
        assets = AssetClient(session, open_asset_cache())
        loop = asyncio.get_running_loop()
        mirror, arrived = SceneMirror(), asyncio.Event()
        drawing, listens = DebugDrawing(mirror), DebugPatience(order.debug)

        def heard(frame: StateFrame) -> None:
            arrived.set()
            drawing.take_state(frame)
            listens.heard_state(frame)

        listener = DebugListener(session, drawing, lambda key: listens.heard_lines(key, drawing.told_tick(key)))
        closers = [follow_state(session, mirror, heard), listener.close]
        closers.append(await follow_scene(session, mirror))
        listener.want(order.debug)
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(arrived.wait(), STATE_PATIENCE)
        await listens.enough()
        for close in closers:
            close()  # the scene must not change while it is drawn
        frame = mirror.latest_frame
        footage = Footage(
            mirror=mirror,
            frames=iter([frame] if frame is not None and frame.epoch == mirror.epoch else []),
            fetch=lambda name: asyncio.run_coroutine_threadsafe(assets.fetch(name), loop).result(timeout=60.0),
            duration=0.0,
            origin=frame.simulation_time if frame is not None else mirror.simulation_time,
            drawing=drawing,
        )
        await asyncio.to_thread(_draw, footage, order)


class DebugPatience:
    """Waits until a session has said what debug drawing needs, as long as it goes on to say anything.

    Lines of physics are enough when all kinds are of the tick in which things are seen.
    """

    def __init__(self, kinds: tuple[Debug, ...]) -> None:
        self._wants_trails = "trajectories" in kinds
        self._told = {PHYSICS_LINES[kind]: -1 for kind in kinds if kind in PHYSICS_LINES}  # of which tick
        self._tick = -1
        self._since: float | None = None
        self._news = asyncio.Event()

    def heard_state(self, frame: StateFrame) -> None:
        """Notes when things are seen, and how long a way is known."""
        self._tick = frame.tick
        self._since = frame.simulation_time if self._since is None else min(self._since, frame.simulation_time)
        if frame.simulation_time - self._since >= TRAIL_SECONDS:
            self._wants_trails = False
        self._news.set()

    def heard_lines(self, key: str, tick: int) -> None:
        """Notes that lines of a kind are here."""
        if key in self._told:
            self._told[key] = tick
        self._news.set()

    @property
    def is_enough(self) -> bool:
        """Whether nothing is missing that is to be expected."""
        ticks = self._told.values()
        return not self._wants_trails and all(tick >= 0 and self._tick in (-1, tick) for tick in ticks)

    async def enough(self) -> None:
        """Returns when all is there, or when it can be expected no more: who is paused or replays says little."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(TRAIL_SECONDS + 2.0 * STATE_PATIENCE if self._wants_trails else STATE_PATIENCE):
                while not self.is_enough:
                    self._news.clear()
                    await asyncio.wait_for(self._news.wait(), STATE_PATIENCE)


async def _record_for(endpoint: str, order: Order, path: Path, duration: float) -> LinesByTick:
    """Records so many seconds of the simulation's time; returns the lines for debug drawing that were heard meanwhile.

    Raises ElysError for a session that is paused or hangs.
    """
    from elys.bus import topics
    from elys.bus.following import follow_scene
    from elys.bus.recorder import record_session
    from elys.verbs.nodes import joined

    async with joined(endpoint, kind="recorder") as session:
        mirror = SceneMirror()
        (await follow_scene(session, mirror))()
        order.viewpoint.entity_in(mirror)  # what is asked in vain should cost nothing
        named_entities(mirror, order.debug_of)
        told: LinesByTick = {}

        def heard(lines: DebugLines, key: str) -> None:
            told.setdefault(lines.tick, {})[key] = lines

        for kind in order.debug:
            if kind in PHYSICS_LINES:
                session.subscribe(topics.DEBUG_LINES, heard, key=PHYSICS_LINES[kind])
        stop = asyncio.Event()
        recording = asyncio.ensure_future(record_session(session, path, stop))
        try:
            await _pass(session, duration)
        finally:
            stop.set()
            await recording
        return told


async def _pass(session: Session, duration: float) -> None:
    """Returns when the session has simulated for `duration` [s]."""
    from elys.bus import topics

    times: asyncio.Queue[float] = asyncio.Queue()
    unsubscribe = session.subscribe(topics.STATE, lambda frame, _: times.put_nowait(frame.simulation_time))
    try:
        start, now = None, 0.0
        while start is None or now - start < duration + 0.1:  # the last picture lies between two frames
            before, now = now, await asyncio.wait_for(times.get(), STALL_PATIENCE)
            start = now if start is None or now < before else start
    except TimeoutError as error:
        raise ElysError(
            f"the session {session.name} does not go on: a video needs one that is playing; a picture (.png) does not"
        ) from error
    finally:
        unsubscribe()
