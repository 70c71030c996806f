"""Pictures and films of a scene into files, without a window: what `elys render` draws."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Literal, Self

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.errors import AssetError, ElysError
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.quality import EXACT, FULL, Quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import SceneReader

MAX_EDGE: Final = 8192  # [pixels]
CONSTANT_RATE_FACTOR: Final = "20"  # of H.264: hardly told from the original
PICTURE_SUFFIXES: Final = (".png", ".npy")
LINEAR_SUFFIXES: Final = (".npy",)
VIDEO_SUFFIXES: Final = (".mp4",)
Progress = Callable[[int, int], None]  # pictures drawn, pictures in all (0: not known)


class OfflineRenderer:
    """Draws a mirror's scene. Bodies stand where the mirror's latest state frame says, or the frames given to a video.

    Use it as a context manager. The camera is the scene's; where it has none, one that shows all there was at first.
    """

    def __init__(
        self,
        mirror: SceneMirror,
        fetch: Callable[[str], bytes] | None = None,
        *,
        width: int = 1280,
        height: int = 720,
        quality: Quality = FULL,
        environment: bool = True,
        context: Context | None = None,
    ) -> None:
        """`fetch` gives the bytes of an asset, as `AssetStore.get` does. Without `environment` only lamps and what glows give
        light, and behind everything it is black. Raises DisplayError where nothing can be drawn.
        """
        if not (1 <= width <= MAX_EDGE and 1 <= height <= MAX_EDGE):
            raise ElysError(f"a picture of {width} x {height} pixels cannot be drawn: edges go from 1 to {MAX_EDGE}")
        self.width, self.height = width, height
        self.mirror = mirror
        self.world = RenderWorld(DrawableAssets(fetch), environment=environment)
        self._reader = SceneReader(mirror)
        self._owns_context = context is None
        self._context = context if context is not None else offscreen_context()
        self._quality = quality
        self._renderers: dict[Quality, Renderer] = {}
        self._framing: ViewCamera | None = None
        self._settled: tuple[Renderer, int] | None = None  # whose images are all there, of which scene

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Frees everything."""
        self._reader.close()
        self.world.assets.close()
        if self._owns_context:
            self._context.release()

    def picture(self, *, camera: ViewCamera | None = None, time: float | None = None) -> NDArray[np.uint8]:
        """RGBA (H, W, 4), the upper row first, of the newest state, or between the newest two at a simulation time [s]."""
        renderer = self._renderer(self._quality)
        self._place(renderer, time)
        target = renderer.draw(self.world, camera or self._camera(), self.width, self.height)
        return renderer.read_pixels(target)

    def light(self, *, camera: ViewCamera | None = None, time: float | None = None) -> NDArray[np.float32]:
        """Linear radiance RGB (H, W, 3) along the rays through the pixels' middles, the upper row first: neither exposed, nor
        tone-mapped, nor averaged over the pixel.
        """
        renderer = self._renderer(EXACT)
        self._place(renderer, time)
        renderer.draw(self.world, camera or self._camera(), self.width, self.height)
        return np.ascontiguousarray(renderer.read_light(self.width, self.height)[..., :3])

    def write_picture(self, path: Path, *, camera: ViewCamera | None = None) -> None:
        """Draws what is now: a .png holds what a screen shows, a .npy `light`. Raises ElysError where it cannot be written."""
        if output_kind(path) != "picture":
            raise ElysError(f"{path} is no picture: give it the suffix {' or '.join(PICTURE_SUFFIXES)}")
        if path.suffix.lower() in LINEAR_SUFFIXES:
            save_light(path, self.light(camera=camera))
        else:
            save_picture(path, self.picture(camera=camera))

    def write_video(
        self,
        path: Path,
        frames: Iterable[StateFrame],
        *,
        fps: float = 30.0,
        duration: float | None = None,
        progress: Progress = lambda drawn, total: None,
    ) -> int:
        """Films `frames` in the time of their simulation, `fps` pictures a second; returns how many there are.

        Whoever gives the frames may let the mirror follow the scene meanwhile. Pictures between two frames are interpolated:
        the same frames always give the same film. Raises ElysError where it cannot be written.
        """
        total = max(1, round(duration * fps)) if duration is not None else 0
        drawn, start = 0, None
        with VideoWriter(path, self.width, self.height, fps=fps) as video:
            for frame in frames:
                self.mirror.keep_frame(frame)
                start = frame.simulation_time if start is None else start
                self.world.read_scene(self._reader)
                self.world.take_state(frame)
                while start + drawn / fps <= frame.simulation_time + 1e-9 and (not total or drawn < total):
                    video.add(self.picture(time=start + drawn / fps))
                    drawn += 1
                    progress(drawn, total)
                if total and drawn >= total:
                    break
        return drawn

    def _camera(self) -> ViewCamera:
        aspect = self.width / self.height
        if self.world.has_camera:
            return self.world.camera(aspect)
        self._framing = self._framing or self.world.camera(aspect)
        return self._framing

    def _renderer(self, quality: Quality) -> Renderer:
        if quality not in self._renderers:
            self._renderers[quality] = Renderer(self._context, quality=quality)
        return self._renderers[quality]

    def _place(self, renderer: Renderer, time: float | None) -> None:
        self.world.read_scene(self._reader)
        newest = self.mirror.latest_frame
        if newest is not None:
            self.world.take_state(newest)
        if self._settled != (renderer, self.world.scene_version):
            renderer.settle(self.world)
            self._settled = (renderer, self.world.scene_version)
        self.world.place(simulation_time=time)


class VideoWriter:
    """An H.264 film in an mp4 file. Edges that are odd lose a pixel, as the format wants them even."""

    def __init__(self, path: Path, width: int, height: int, *, fps: float = 30.0) -> None:
        """Raises ElysError where the file cannot be written or is no video by its suffix."""
        if output_kind(path) != "video":
            raise ElysError(f"{path} is no video: give it the suffix {' or '.join(VIDEO_SUFFIXES)}")
        if not (0.1 <= fps <= 1000.0):
            raise ElysError(f"a video has between 0.1 and 1000 pictures a second, not {fps:g}")
        self.width, self.height = max(width & ~1, 2), max(height & ~1, 2)
        self._path = path
        self._is_broken = False
        rate = Fraction(fps).limit_denominator(1001)
        try:
            self._container = av.open(str(path), "w", options={"movflags": "faststart"})
            stream: Any = self._container.add_stream("libx264", rate=rate)
        except (OSError, ValueError, av.FFmpegError) as error:
            raise ElysError(f"the video {path} cannot be written: {error}") from error
        stream.width, stream.height, stream.pix_fmt = self.width, self.height, "yuv420p"
        stream.options = {"crf": CONSTANT_RATE_FACTOR, "preset": "veryfast"}
        self._stream = stream

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Appends a picture: RGBA (H, W, 4), the upper row first, at least as large as the video."""
        picture = np.ascontiguousarray(pixels[: self.height, : self.width, :3])
        if picture.shape != (self.height, self.width, 3):
            raise ElysError(f"a picture of {picture.shape[1]} x {picture.shape[0]} is too small for the video")
        self._mux(av.VideoFrame.from_ndarray(picture, format="rgb24"))

    def close(self) -> None:
        """Finishes the file."""
        try:
            if not self._is_broken:
                self._mux(None)
        finally:
            self._container.close()

    def _mux(self, frame: Any) -> None:
        try:
            self._container.mux(self._stream.encode(frame))
        except (OSError, ValueError, av.FFmpegError) as error:
            self._is_broken = True
            raise ElysError(f"the video {self._path} cannot be written: {error}") from error


def output_kind(path: Path) -> Literal["picture", "video"]:
    """What a file of this name is to be; ElysError for other suffixes and where there is no place to write it."""
    suffix = path.suffix.lower()
    if suffix not in PICTURE_SUFFIXES + VIDEO_SUFFIXES:
        known = ", ".join(PICTURE_SUFFIXES + VIDEO_SUFFIXES)
        raise ElysError(
            f"{path} has the suffix {suffix or '(none)'}; pictures and videos that can be written are {known}"
        )
    if path.is_dir():
        raise ElysError(f"{path} is a directory: name a file in it")
    if not path.parent.is_dir():
        raise ElysError(f"{path} cannot be written: there is no directory {path.parent}")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise ElysError(f"{path} cannot be written: permission denied")
    return "picture" if suffix in PICTURE_SUFFIXES else "video"


def save_picture(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Writes RGBA or RGB pixels (H, W, 3 or 4), the upper row first, as an opaque PNG. Raises ElysError."""
    try:
        Image.fromarray(np.ascontiguousarray(pixels[:, :, :3])).save(path, format="PNG")
    except OSError as error:
        raise ElysError(f"{path} cannot be written: {error.strerror or error}") from error


def save_light(path: Path, light: NDArray[np.float32]) -> None:
    """Writes radiance (H, W, 3), the upper row first, as a .npy file. Raises ElysError."""
    try:
        with path.open("wb") as file:
            np.save(file, light)
    except OSError as error:
        raise ElysError(f"{path} cannot be written: {error.strerror or error}") from error


def load_picture(path: Path) -> NDArray[np.uint8]:
    """The RGB pixels (H, W, 3) of a picture file, the upper row first. Raises AssetError."""
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except OSError as error:
        raise AssetError(f"{path} cannot be read: {error}") from error
