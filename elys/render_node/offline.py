"""Pictures and films of a scene into files, without a window: what `elys render` draws."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self, get_args

import numpy as np
from numpy.typing import NDArray

from elys.bus.ghost_track import GhostTrack
from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import Debug, Shows, ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.components import Camera
from elys.common.errors import ElysError
from elys.render_node.data_colors import data_pixels, depth_unit_of
from elys.render_node.debug_drawing import DebugDrawing
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.film import VideoWriter as VideoWriter
from elys.render_node.ghost_worlds import GhostWorlds, ShownGhost
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.lettering import write_on
from elys.render_node.marks import LETTERS, NO_MARKS, Marks, stamp_text
from elys.render_node.overlays import FIRST_PLAYER, OverlayBoard
from elys.render_node.passes.bloom import Glow
from elys.render_node.passes.data import DataKind
from elys.render_node.picture_files import PICTURE_SUFFIXES, holds_numbers, output_kind, save_picture, save_values
from elys.render_node.picture_files import load_picture as load_picture
from elys.render_node.picture_parts import Part, parts_of, reach_of
from elys.render_node.quality import EXACT, FULL, Quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_classes import SceneClass, SceneClasses
from elys.render_node.scene_reader import SceneReader
from elys.render_node.sound.film_sound import FilmSound

MAX_EDGE: Final = 32768  # [pixels]
MAX_PIXELS: Final = 1 << 27  # of a picture; two gibibytes as numbers
TILE_EDGE: Final = 4096  # [pixels]; what is larger is drawn in parts
VIEWS: Final[tuple[str, ...]] = get_args(Shows)
CameraAt = Callable[[float], ViewCamera]  # by simulation time [s]
Progress = Callable[[int, int], None]  # pictures drawn, pictures in all (0: not known)


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlay:
    """What is drawn over pictures: debug drawing of some kinds, of some entities or of all, and a stamp of tick and time."""

    drawing: DebugDrawing | None = None
    kinds: tuple[Debug, ...] = ()
    entities: tuple[int, ...] = ()
    stamp: bool = False

    def marks(self, world: RenderWorld, ghosts: list[ShownGhost]) -> Marks:
        """The debug drawing of a world, and of the ghosts beside it, as they are placed."""
        if self.drawing is None:
            return NO_MARKS
        return self.drawing.marks(world, self.kinds, self.entities, ghosts=ghosts)


NOTHING_OVER: Final = Overlay()
NO_GHOSTS: Final[Mapping[str, GhostTrack]] = {}


class OfflineRenderer:
    """Draws a mirror's scene. Bodies stand where the mirror's latest state frame says, or the frames given to a video.

    Use it as a context manager. The camera is the scene's, or the entity chosen by `look_through`; where there is none, one
    that shows all there was at first.
    """

    def __init__(
        self,
        mirror: SceneMirror,
        fetch: Callable[[str], bytes] | None = None,
        *,
        width: int = 1280,
        height: int = 720,
        shows: Shows = "shaded",
        quality: Quality = FULL,
        environment: bool = True,
        sampled: bool = False,
        overlay: Overlay = NOTHING_OVER,
        ghosts: Mapping[str, GhostTrack] = NO_GHOSTS,
        context: Context | None = None,
        tile_edge: int = TILE_EDGE,
        source_of: Callable[[str], str] = lambda _: "",
    ) -> None:
        """`fetch` gives the bytes of an asset and `source_of` its file, as `get` and `source` of an AssetStore do. Without
        `environment` only lamps and what glows give light, and behind everything it is black; `sampled` is as
        RenderWorld has it. Raises DisplayError where nothing can be drawn.
        """
        check_size(width, height)
        if shows not in VIEWS:
            raise ElysError(f"there is no view '{shows}': views are {', '.join(VIEWS)}")
        self.width, self.height = width, height
        self.mirror = mirror
        self.world = RenderWorld(
            DrawableAssets(fetch, source_of=source_of), environment=environment, sampled=sampled, exact_bounds=True
        )
        self.overlay = overlay
        self._tracks, self._ghost_worlds = ghosts, GhostWorlds()
        self._ghosts: list[ShownGhost] = []  # of pictures of light
        self._shows = shows
        self._reader = SceneReader(mirror)
        self._classes = SceneClasses(mirror)
        self._overlays = OverlayBoard(mirror)
        self._player = FIRST_PLAYER  # whose picture it is
        self._owns_context = context is None
        self._context = context if context is not None else offscreen_context()
        self._tile_edge = min(tile_edge, self._context.max_size)
        self._quality = quality
        self._renderers: dict[Quality, Renderer] = {}
        self._framing: ViewCamera | None = None
        self._depth_unit = 0.0  # [m] by which depth is seen; the first picture's, so that a film does not flicker
        self._settled: tuple[Renderer, tuple[int, str]] | None = None  # whose images are all there, of which scene

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Frees everything."""
        self._reader.close()
        self._ghost_worlds.close()
        self.world.assets.close()
        if self._owns_context:
            self._context.release()

    def look_through(self, entity: int) -> None:
        """Draws from where a camera of the scene stands from now on, as long as it is there, with what its player is shown."""
        self.world.prefer_camera(entity)
        found = self.mirror.entities.get(entity)
        camera = found.components.get("Camera") if found is not None else None
        self._player = (camera.player if isinstance(camera, Camera) else 0) or FIRST_PLAYER

    def place(self, time: float | None = None, *, exact: bool = False) -> RenderWorld:
        """The world as it is in the newest state, or between the newest two at a simulation time [s], all of it ready to draw."""
        self.world.read_scene(self._reader)
        newest = self.mirror.latest_frame
        if newest is not None:
            self.world.take_state(newest)
        renderer = self._renderer(EXACT if exact else self._quality)
        scene = (self.world.scene_version, self.world.sky_image)
        if self._settled != (renderer, scene):
            renderer.settle(self.world)
            self._settled = (renderer, scene)
        renderer.settle_images(self.world, self._overlays.images)
        self.world.place(simulation_time=time)
        if self._tracks and self._shows == "shaded":
            self._ghosts = self._ghost_worlds.shown(self._tracks, self.world, settled=True)
        return self.world

    def picture(self, *, camera: ViewCamera | None = None, time: float | None = None) -> NDArray[np.uint8]:
        """RGBA (H, W, 4) for a screen, the upper row first, of the newest state or at a simulation time [s]."""
        self.place(time)
        pixels = np.full((self.height, self.width, 4), 255, np.uint8)
        if self._shows == "shaded":
            self._draw_shaded(pixels, camera or self._camera())
        elif self._shows == "segmentation":
            pixels[..., :3] = self._classes.pixels(self._seen_classes(camera)[..., 0])
        else:
            values = self._data(self._shows, camera)
            if self._shows == "depth":
                self._depth_unit = self._depth_unit or depth_unit_of(values)
            pixels[..., :3] = data_pixels(values, self._shows, depth_unit=self._depth_unit)
        if self.overlay.stamp:
            write_on(pixels, (self._stamp(),), LETTERS)
        return pixels

    def values(self, *, camera: ViewCamera | None = None, time: float | None = None) -> NDArray[Any]:
        """The numbers behind a picture (H, W, C), the upper row first.

        Of the view "shaded": linear radiance R, G, B f32 along the rays through the pixels' middles, neither exposed, nor
        tone-mapped, nor averaged over the pixel. Of "segmentation": u32 [1], see `legend`. Of others see `DataPass.draw`.
        """
        self.place(time, exact=self._shows == "shaded")
        if self._shows == "segmentation":
            return self._seen_classes(camera)
        if self._shows != "shaded":
            return self._data(self._shows, camera)
        renderer = self._renderer(EXACT)
        light = np.empty((self.height, self.width, 3), np.float32)
        parts, glow = self._parts(renderer, camera or self._camera(), NO_MARKS)
        for part in parts:
            renderer.draw(self.world, camera or self._camera(), self.width, self.height, region=part.drawn, glow=glow)
            _put(light, part, renderer.read_light(part.drawn[2], part.drawn[3]))
        return light

    def legend(self) -> tuple[SceneClass, ...]:
        """What the numbers and colours of the view "segmentation" mean."""
        return self._classes.legend()

    def write_picture(self, path: Path, *, camera: ViewCamera | None = None) -> None:
        """Draws what is now into a PNG, EXR or .npy file. Raises ElysError where it cannot be written."""
        if output_kind(path) != "picture":
            raise ElysError(f"{path} is no picture: give it the suffix {' or '.join(PICTURE_SUFFIXES)}")
        if not holds_numbers(path):
            save_picture(path, self.picture(camera=camera))
            return
        save_values(path, self.values(camera=camera), view=self._shows)

    def write_video(
        self,
        path: Path,
        frames: Iterable[StateFrame],
        *,
        fps: float = 30.0,
        duration: float | None = None,
        camera_at: CameraAt | None = None,
        sound: FilmSound | None = None,
        progress: Progress = lambda drawn, total: None,
    ) -> int:
        """Films `frames` in the time of their simulation, `fps` pictures a second; returns how many there are.

        Whoever gives the frames may let the mirror follow the scene meanwhile. Pictures between two frames are interpolated:
        the same frames always give the same film. With `sound` it has a track. Raises ElysError where it cannot be written.
        """
        total = max(1, round(duration * fps)) if duration is not None else 0
        drawn, start = 0, None
        with VideoWriter(path, self.width, self.height, fps=fps, sound=sound is not None) as video:
            for frame in frames:
                self.mirror.keep_frame(frame)
                start = frame.simulation_time if start is None else start
                self.world.read_scene(self._reader)
                self.world.take_state(frame)
                while start + drawn / fps <= frame.simulation_time + 1e-9 and (not total or drawn < total):
                    moment = start + drawn / fps
                    camera = camera_at(moment) if camera_at else None
                    video.add(self.picture(time=moment, camera=camera))
                    if sound is not None:
                        video.add_sound(sound.until(moment, camera or self._camera(), self.world))
                    drawn += 1
                    progress(drawn, total)
                if total and drawn >= total:
                    break
        return drawn

    def _draw_shaded(self, pixels: NDArray[np.uint8], camera: ViewCamera) -> None:
        renderer, marks = self._renderer(self._quality), self.overlay.marks(self.world, self._ghosts)
        parts, glow = self._parts(renderer, camera, marks)
        overlays = self._overlays.shown(self.world, player=self._player)
        for part in parts:
            target = renderer.draw(
                self.world,
                camera,
                self.width,
                self.height,
                marks=marks,
                ghosts=self._ghosts,
                overlays=overlays,
                region=part.drawn,
                glow=glow,
            )
            _put(pixels, part, renderer.read_pixels(target))

    def _stamp(self) -> str:
        bodies = self.world.bodies()
        if bodies.tick < 0:
            return stamp_text(self.mirror.tick, self.mirror.simulation_time)
        return stamp_text(bodies.tick, bodies.time)

    def _data(self, kind: DataKind, camera: ViewCamera | None) -> NDArray[Any]:
        whole: NDArray[Any] | None = None
        for part in parts_of(self.width, self.height, edge=self._tile_edge, reach=0):
            values = self._renderer(self._quality).draw_data(
                self.world, camera or self._camera(), self.width, self.height, kind, region=part.drawn
            )
            if part.kept[2:] == (self.width, self.height):
                return values
            if whole is None:
                whole = np.empty((self.height, self.width, values.shape[-1]), values.dtype)
            _put(whole, part, values)
        assert whole is not None
        return whole

    def _seen_classes(self, camera: ViewCamera | None) -> NDArray[np.uint32]:
        return self._classes.seen(self._data("entity", camera))

    def _parts(self, renderer: Renderer, camera: ViewCamera, marks: Marks) -> tuple[tuple[Part, ...], Glow | None]:
        """The parts in which the picture is drawn; one, unless it is larger than the card or its memory takes. And what light
        spreads from each into others.
        """
        reach = reach_of(self.world.settings.picture)
        parts = parts_of(self.width, self.height, edge=self._tile_edge, reach=reach)
        if len(parts) == 1:
            return parts, None
        return parts, renderer.gather_glow(
            self.world, camera, self.width, self.height, parts, marks=marks, ghosts=self._ghosts
        )

    def _camera(self) -> ViewCamera:
        aspect = self.width / self.height
        if self.world.has_camera:
            return self.world.camera(aspect)
        self._framing = self._framing or self.world.camera(aspect)
        return self._framing

    def _renderer(self, quality: Quality) -> Renderer:
        if quality not in self._renderers:
            self._renderers[quality] = Renderer(self._context, quality=replace(quality, stand_ins=False))
        return self._renderers[quality]


def check_size(width: int, height: int) -> None:
    """Raises ElysError for a picture that cannot be drawn."""
    if not (1 <= width <= MAX_EDGE and 1 <= height <= MAX_EDGE):
        raise ElysError(f"a picture of {width} x {height} pixels cannot be drawn: edges go from 1 to {MAX_EDGE}")
    if width * height > MAX_PIXELS:
        raise ElysError(
            f"a picture of {width} x {height} pixels cannot be drawn: it may have {MAX_PIXELS >> 20} Mi pixels,"
            f" this one has {width * height / (1 << 20):.0f} Mi"
        )


def _put(whole: NDArray[Any], part: Part, drawn: NDArray[Any]) -> None:
    x, y, width, height = part.kept
    whole[y : y + height, x : x + width] = drawn[part.kept_rows, part.kept_columns, : whole.shape[-1]]
