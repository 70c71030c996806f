"""render: a scene, simulated in this process, or a recording, into a picture or a video."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.common.errors import ElysError
from elys.render_node.offline import OfflineRenderer, output_kind
from elys.verbs.output import size_text

if TYPE_CHECKING:
    from elys.common.assets.store import AssetStore
    from elys.common.scene import OpenedScene

SCENE_DURATION: Final = 5.0  # [s] of a video of a scene when nobody says how long


@dataclass(frozen=True, slots=True, kw_only=True)
class Footage:
    """What is to be drawn: a mirror that `frames` leads through time, and where assets come from."""

    mirror: SceneMirror
    frames: Iterator[StateFrame]
    fetch: Callable[[str], bytes]
    duration: float  # [s] from the first frame


def render(
    source: str, output: Path, *, size: str, time: float, duration: float, fps: float, environment: bool = True
) -> None:
    """Draws `source` into `output`, whose suffix says whether it is a picture or a video.

    Raises:
        ElysError: the size or the output cannot be; SceneError, RecordingError: the source; DisplayError: no OpenGL.
    """
    kind = output_kind(output)
    width, height = _parse_size(size)
    with _footage(source, time, duration) as footage:
        first = next(footage.frames)
        footage.mirror.keep_frame(first)
        with OfflineRenderer(
            footage.mirror, footage.fetch, width=width, height=height, environment=environment
        ) as renderer:
            if kind == "picture":
                renderer.write_picture(output)
                count = 1
            else:
                count = _film(renderer, output, footage, first, fps=fps)
    what = f"{width}x{height}" if kind == "picture" else f"{count} pictures of {width}x{height}"
    print(f"{output}: {what}, {size_text(output.stat().st_size)}")


def _film(renderer: OfflineRenderer, output: Path, footage: Footage, first: StateFrame, *, fps: float) -> int:
    from rich.console import Console
    from rich.progress import Progress

    def frames() -> Iterator[StateFrame]:
        yield first
        yield from footage.frames

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(f"Drawing {output.name}", total=None)
        return renderer.write_video(
            output,
            frames(),
            fps=fps,
            duration=footage.duration,
            progress=lambda drawn, total: bar.update(task, completed=drawn, total=total or None),
        )


def _parse_size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text)
    if not match:
        raise ElysError(f"'{text}' is no size: write WIDTHxHEIGHT, for instance 1280x720")
    return int(match[1]), int(match[2])


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
