"""render: a scene simulated in this process, a recording or a running session, into a picture or a video."""

from __future__ import annotations

import asyncio
import contextlib
import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, cast

from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import Shows
from elys.bus.mirror import SceneMirror
from elys.common.errors import ElysError
from elys.render_node.film import check_video
from elys.render_node.offline import VIEWS, CameraAt, OfflineRenderer, check_size
from elys.render_node.picture_files import output_kind
from elys.verbs.output import size_text
from elys.verbs.viewpoint import Viewpoint

if TYPE_CHECKING:
    from elys.bus.session import Session
    from elys.common.assets.store import AssetStore
    from elys.common.scene import OpenedScene

SCENE_DURATION: Final = 5.0  # [s] of a video of a scene or a session when nobody says how long
STATE_PATIENCE: Final = 1.0  # [s] for a state from a session; one that is paused may send none
STALL_PATIENCE: Final = 10.0  # [s] without a new state while a session is filmed


@dataclass(frozen=True, slots=True, kw_only=True)
class Footage:
    """What is to be drawn: a mirror that `frames` leads through time, and where assets come from."""

    mirror: SceneMirror
    frames: Iterator[StateFrame]
    fetch: Callable[[str], bytes]
    duration: float  # [s] from the first frame
    origin: float = 0.0  # [s] of simulation from which --time and camera paths count


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What is wanted of it."""

    output: Path
    kind: Literal["picture", "video"]
    width: int
    height: int
    shows: Shows
    viewpoint: Viewpoint
    fps: float
    environment: bool = True


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
) -> None:
    """Draws `source`, or without one the session at `connect`, into `output`: a picture or a video, by its suffix.

    Raises:
        ElysError: the order or the output cannot be; SceneError, RecordingError, BusError: the source; DisplayError: no OpenGL.
    """
    order = replace(
        _order(output, size=size, view=view, viewpoint=Viewpoint.asked(camera, path, orbit), fps=fps),
        environment=environment,
    )
    if source is None:
        if time:
            raise ElysError("a running session is drawn as it is now: leave --time out, or name a scene or a recording")
        _draw_session(connect, order, duration or SCENE_DURATION)
        return
    if connect is not None:
        raise ElysError(f"--connect names a session, {source} is another source: give one of them")
    with _footage(source, time, duration) as footage:
        _draw(footage, order)


def _order(output: Path, *, size: str, view: str, viewpoint: Viewpoint, fps: float) -> Order:
    """Everything that can be wrong with it is found here, before any work."""
    kind = output_kind(output)
    width, height = _parse_size(size)
    check_size(width, height)
    if kind == "video":
        check_video(width, height, fps)
    if view not in VIEWS:
        raise ElysError(f"there is no view '{view}': views are {', '.join(VIEWS)}")
    return Order(
        output=output, kind=kind, width=width, height=height, shows=cast(Shows, view), viewpoint=viewpoint, fps=fps
    )


def _draw(footage: Footage, order: Order) -> None:
    """Draws it and says what has come of it."""
    entity = order.viewpoint.entity_in(footage.mirror)  # first: what is asked in vain should cost nothing
    first = next(footage.frames, None)
    if first is not None:
        footage.mirror.keep_frame(first)
    with OfflineRenderer(
        footage.mirror,
        footage.fetch,
        width=order.width,
        height=order.height,
        shows=order.shows,
        environment=order.environment,
    ) as renderer:
        renderer.look_through(entity)
        camera_at = order.viewpoint.camera_at(renderer, footage.origin)
        if order.kind == "picture":
            now = first.simulation_time if first is not None else footage.mirror.simulation_time
            renderer.write_picture(order.output, camera=camera_at(now) if camera_at else None)
            what = f"{order.width}x{order.height}"
        else:
            assert first is not None
            count = _film(renderer, order, footage, first, camera_at)
            what = f"{count} pictures of {order.width}x{order.height}"
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
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(f"Drawing {order.output.name}", total=None)
        return renderer.write_video(
            order.output,
            frames(),
            fps=order.fps,
            duration=footage.duration,
            camera_at=camera_at,
            progress=lambda drawn, total: bar.update(task, completed=drawn, total=total or None),
        )


def _parse_size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text)
    if not match:
        raise ElysError(f"'{text}' is no size: write WIDTHxHEIGHT, for instance 1280x720")
    return int(match[1]), int(match[2])


# --- a scene or a recording ----------------------------------------------------------------------------------------


@contextlib.contextmanager
def _footage(source: str, time: float, duration: float) -> Iterator[Footage]:
    if Path(source).suffix == ".mcap":
        with _recorded(Path(source), time, duration) as footage:
            yield footage
    else:
        yield _simulated(source, time, duration or SCENE_DURATION)


@contextlib.contextmanager
def _recorded(path: Path, time: float, duration: float) -> Iterator[Footage]:
    from elys.bus.recording import Recording

    with Recording(path) as recording:
        start, end = float(recording.time[0]), float(recording.time[-1])
        if not start <= time + start <= end + 1e-9:
            raise ElysError(f"{path} lasts {end - start:.2f} s: there is nothing at {time:g} s")
        position = recording.position_at(start + time)
        mirror = recording.mirror_at(position)

        def frames() -> Iterator[StateFrame]:
            for following in range(position, len(recording)):
                recording.advance(mirror, following)
                yield recording.frame(following)

        yield Footage(
            mirror=mirror,
            frames=frames(),
            fetch=recording.asset,
            duration=min(duration, end - start - time) if duration else end - start - time,
            origin=start,
        )


def _simulated(scene: str, time: float, duration: float) -> Footage:
    from elys.common.assets.store import AssetStore
    from elys.verbs.kernels import compile_with_progress
    from elys.verbs.scenes import open_scene_or_sample

    assets = AssetStore()
    opened = open_scene_or_sample(scene, assets)
    compile_with_progress(opened)
    return simulated(opened, assets, time, duration)


def simulated(scene: OpenedScene, assets: AssetStore, time: float, duration: float = SCENE_DURATION) -> Footage:
    """A scene from `time` [s] on, simulated in this process as it is drawn."""
    from elys.sim_node.scene.snapshot import take_snapshot
    from elys.sim_node.simulation import Simulation
    from elys.sim_node.systems.publish_state import state_frame

    simulation = Simulation.load(scene, assets)
    mirror = SceneMirror()
    mirror.apply_snapshot(
        take_snapshot(
            simulation.world,
            epoch=1,
            tick=0,
            simulation_time=0.0,
            sequence=0,
            scene=simulation.name,
            settings=simulation.settings,
        )
    )

    def frames() -> Iterator[StateFrame]:
        for _ in range(round(time * simulation.settings.tick_rate)):
            simulation.step()
        while True:
            yield state_frame(simulation, epoch=1, delta_sequence=0, playing=True)
            simulation.step()

    return Footage(mirror=mirror, frames=frames(), fetch=assets.get, duration=duration)


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
        asyncio.run(_record_for(endpoint, order, recording, duration))
        with _recorded(recording, 0.0, duration) as footage:
            _draw(footage, order)


async def _draw_now(endpoint: str, order: Order) -> None:
    from elys.bus.asset_service import AssetClient, open_asset_cache
    from elys.bus.following import follow_scene, follow_state
    from elys.verbs.nodes import joined

    async with joined(endpoint, kind="tool") as session:
        assets = AssetClient(session, open_asset_cache())
        loop = asyncio.get_running_loop()
        mirror, arrived = SceneMirror(), asyncio.Event()
        closers = [follow_state(session, mirror, lambda _: arrived.set())]
        closers.append(await follow_scene(session, mirror))
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(arrived.wait(), STATE_PATIENCE)
        for close in closers:
            close()  # the scene must not change while it is drawn
        frame = mirror.latest_frame
        footage = Footage(
            mirror=mirror,
            frames=iter([frame] if frame is not None and frame.epoch == mirror.epoch else []),
            fetch=lambda name: asyncio.run_coroutine_threadsafe(assets.fetch(name), loop).result(timeout=60.0),
            duration=0.0,
            origin=frame.simulation_time if frame is not None else mirror.simulation_time,
        )
        await asyncio.to_thread(_draw, footage, order)


async def _record_for(endpoint: str, order: Order, path: Path, duration: float) -> None:
    """Records so many seconds of the simulation's time. Raises ElysError for a session that is paused or hangs."""
    from elys.bus.following import follow_scene
    from elys.bus.recorder import record_session
    from elys.verbs.nodes import joined

    async with joined(endpoint, kind="recorder") as session:
        mirror = SceneMirror()
        (await follow_scene(session, mirror))()
        order.viewpoint.entity_in(mirror)  # what is asked in vain should cost nothing
        stop = asyncio.Event()
        recording = asyncio.ensure_future(record_session(session, path, stop))
        try:
            await _pass(session, duration)
        finally:
            stop.set()
            await recording


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
