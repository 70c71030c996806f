"""A picture of a RenderWorld: a library that runs in any process with a Context, without a bus or a window.

RenderWorld ──plan_picture──> PicturePlan ──passes──> light (RGBA16F, 4 samples) ──tonemap──> picture (RGBA8)
"""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.views import ViewCamera
from elys.common.errors import ShaderError
from elys.render_node.camera import Region, View
from elys.render_node.frame_block import frame_block
from elys.render_node.ghost_worlds import ShownGhost
from elys.render_node.gpu import BLOCK_BINDINGS, Context, Framebuffer
from elys.render_node.marks import NO_MARKS, Marks
from elys.render_node.overlays import NO_OVERLAYS, Overlays
from elys.render_node.passes.backdrop import GridPass, SkyPass
from elys.render_node.passes.bloom import BloomPass, Glow
from elys.render_node.passes.data import DataKind, DataPass
from elys.render_node.passes.environment import EnvironmentPass, mirror_tiles
from elys.render_node.passes.finishing import FxaaPass, OutlinePass, TonemapPass
from elys.render_node.passes.ghosts import GhostPass
from elys.render_node.passes.marks import LetterPass, LinePass
from elys.render_node.passes.occlusion import OcclusionPass
from elys.render_node.passes.overlay import OverlayPass
from elys.render_node.passes.picking import PickingPass
from elys.render_node.passes.shading import OpaquePass, TransparentPass
from elys.render_node.passes.shadow import LampShadowPass, ShadowPass
from elys.render_node.picture_lights import MOST_FURTHER_SUNS, MOST_LAMPS
from elys.render_node.picture_parts import Part
from elys.render_node.picture_plan import PicturePlan, plan_ghosts, plan_picture
from elys.render_node.quality import FULL, Quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.resources import Resources
from elys.render_node.targets import Targets

_log = logging.getLogger(__name__)

MAGENTA: Final = (1.0, 0.0, 1.0, 1.0)
KEPT_SIZES: Final = 4  # picture sizes whose framebuffers are kept: views of several sizes take turns


class Renderer:
    """Draws worlds. All calls on the thread of its context.

    Attributes:
        timings: milliseconds that the processor spent on each stage of the last picture. Drivers may draw later than that.
        planned: what the last picture consisted of.
    """

    def __init__(self, context: Context, *, quality: Quality = FULL) -> None:
        self.context = context
        self.resources = Resources(context)
        self.resources.programs.gives_stand_ins = quality.stand_ins
        self.timings: dict[str, float] = {}
        self.planned: PicturePlan | None = None
        self._quality = quality
        self._targets: dict[tuple[int, int, bool], Targets] = {}
        self._shadow_world: RenderWorld | None = None
        self._told_worlds: WeakSet[RenderWorld] = WeakSet()  # of which was said that they have too many lights
        self._shadow = ShadowPass(self.resources)
        self._lamp_shadows = LampShadowPass(self.resources)
        self._environment = EnvironmentPass(self.resources, quality)
        self._opaque = OpaquePass(self.resources, quality)
        self._sky = SkyPass(self.resources, quality)
        self._grid = GridPass(self.resources, quality)
        self._transparent = TransparentPass(self.resources, quality)
        self._ghosts = GhostPass(self.resources, quality)
        self._occlusion = OcclusionPass(self.resources)
        self._bloom = BloomPass(self.resources)
        self._fxaa = FxaaPass(self.resources)
        self._tonemap = TonemapPass(self.resources)
        self._outline = OutlinePass(self.resources)
        self._lines = LinePass(self.resources, quality)
        self._letters = LetterPass(self.resources)
        self._overlays = OverlayPass(self.resources)
        self._picking: PickingPass | None = None
        self._data: DataPass | None = None

    def draw(
        self,
        world: RenderWorld,
        camera: ViewCamera,
        width: int,
        height: int,
        *,
        selection: tuple[int, ...] = (),
        hidden: tuple[int, ...] = (),
        grid: bool = False,
        marks: Marks = NO_MARKS,
        ghosts: Sequence[ShownGhost] = (),
        overlays: Overlays = NO_OVERLAYS,
        target: Framebuffer | None = None,
        region: Region | None = None,
        glow: Glow | None = None,
    ) -> Framebuffer:
        """Draws the world as it is placed now; returns the picture, which the next one of that size overwrites.

        `hidden` entities, and all below them, are not drawn and throw no shadows. `target` is where it goes instead, a
        framebuffer of that size, such as a window's. With a `region` only that part of the picture is drawn, into a framebuffer
        of its size; `glow` is what `gather_glow` made of all parts. What a shader should have drawn that is refused is magenta,
        the whole picture where nothing can stand in for it.

        Raises:
            ShaderError: a shader is refused, and the quality is one that has no stand-ins. DisplayError: there is no memory.
        """
        self._reload()
        with self._timed("plan"):
            view = View.of(camera, width, height)
            whole = self._plan(world, view, selection=selection, hidden=hidden, grid=grid, marks=marks)
            whole = replace(whole, ghosts=plan_ghosts(view, ghosts)) if ghosts else whole
            whole = replace(whole, overlays=overlays) if overlays else whole
            self.planned = whole
            if any(whole.left_out) and world not in self._told_worlds:
                self._tell_left_out(whole)
        try:
            picture = self._drawn(whole, region, glow, target)
        except ShaderError:  # the log has said it
            if not self._quality.stand_ins:
                raise
            size = region[2:] if region is not None else (width, height)
            picture = target if target is not None else self._targets_of(*size, to_screen=False).picture
            picture.use()
            picture.clear(MAGENTA)
        self.context.collect()
        self.context.check("drawing a picture")
        return picture

    def _drawn(
        self, whole: PicturePlan, region: Region | None, glow: Glow | None, target: Framebuffer | None
    ) -> Framebuffer:
        plan, targets = self._draw_light(whole, region)
        picture = target if target is not None else targets.picture
        with self._timed("finish"):
            if self._bloom.is_needed(plan):
                if glow is not None and region is not None:
                    self._bloom.mix_into(plan, targets.light, glow, region)
                else:
                    self._bloom.draw(plan, targets.light)
            if self._fxaa.is_needed(plan):
                self._show(plan, targets, self._fxaa.source(plan))
                self._fxaa.draw(plan, picture)
            else:
                self._show(plan, targets, picture)
            if self._outline.is_needed(plan):
                self._outline.draw(plan, picture)
        with self._timed("overlays"):
            if self._overlays.is_needed(plan):
                self._overlays.draw(plan, whole.view, region, picture)
            if self._letters.is_needed(plan):
                self._letters.draw(plan, whole.view, region, picture)
        return picture

    def gather_glow(
        self,
        world: RenderWorld,
        camera: ViewCamera,
        width: int,
        height: int,
        parts: Sequence[Part],
        *,
        marks: Marks = NO_MARKS,
        ghosts: Sequence[ShownGhost] = (),
    ) -> Glow | None:
        """What bright light spreads over a picture that is drawn in parts; None where the scene wants none.

        All parts are drawn for it, and drawn again with it: their light together would be too large to be kept.
        """
        glow: Glow | None = None
        for part in parts:
            view = View.of(camera, width, height)
            whole = self._plan(world, view, selection=(), hidden=(), grid=False, marks=marks)
            whole = replace(whole, ghosts=plan_ghosts(view, ghosts)) if ghosts else whole
            if not self._bloom.is_needed(whole):
                return None
            glow = glow if glow is not None else Glow(self.context, width, height)
            _, targets = self._draw_light(whole, part.drawn)
            self._bloom.gather(glow, targets.light, part.drawn, part.kept)
        if glow is not None:
            self._bloom.spread(glow)
        return glow

    def _draw_light(self, whole: PicturePlan, region: Region | None) -> tuple[PicturePlan, Targets]:
        """Draws the light of a planned picture, or of a region of it; returns the plan of what was drawn, and where it is."""
        # Planned as a whole, so that shadows are the same in all parts.
        plan = whole if region is None else replace(whole, view=whole.view.of_region(region))
        targets = self._targets_of(
            plan.view.width, plan.view.height, to_screen=self._quality.writes_screen(plan.picture)
        )
        with self._timed("environment"):
            if self._environment.is_needed(plan):
                self._environment.draw(plan)
        with self._timed("upload"):
            self._upload(plan)
        with self._timed("shadow"):
            if self._shadow.is_needed(plan):
                self._shadow.draw(plan)
            if self._lamp_shadows.is_needed(plan):
                self._lamp_shadows.draw(plan)
        with self._timed("occlusion"):
            if self._occlusion.is_needed(plan):
                self._occlusion.draw(plan)
                self._occlusion.use()
        self._shadow.use()
        self._lamp_shadows.use()
        self._environment.use(plan)
        targets.drawn.use()
        targets.drawn.clear()
        with self._timed("opaque"):
            if self._opaque.is_needed(plan):
                self._opaque.draw(plan, targets.drawn)
        with self._timed("backdrop"):
            if self._sky.is_needed(plan):
                self._sky.draw(plan, targets.drawn)
            if self._grid.is_needed(plan):
                self._grid.draw(plan, targets.drawn)
        with self._timed("transparent"):
            if self._transparent.is_needed(plan):
                self._transparent.draw(plan, targets.drawn)
        if self._ghosts.is_needed(plan):
            with self._timed("ghosts"):
                self._ghosts.draw(plan, targets.drawn)
        with self._timed("marks"):
            if self._lines.is_needed(plan):
                self._lines.draw(plan, targets.drawn)
        with self._timed("resolve"):
            targets.resolve()
        return plan, targets

    def pick(
        self,
        world: RenderWorld,
        camera: ViewCamera,
        width: int,
        height: int,
        x: int,
        y: int,
        *,
        passed_over: tuple[int, ...] = (),
    ) -> tuple[int, tuple[float, float, float]]:
        """The entity (0: none) seen at a pixel, from the upper left, or behind those passed over; and the point hit [m]."""
        if not (0 <= x < width and 0 <= y < height):
            return 0, (0.0, 0.0, 0.0)
        view = View.of(camera, width, height).of_pixel(x, y)
        plan = plan_picture(world, view, hidden=passed_over)
        self.resources.placing.place(plan)
        self.resources.show_poses(plan.world)
        if self._picking is None:
            self._picking = PickingPass(self.resources)
        with self.resources.programs.exact():
            entity, relative = self._picking.draw(plan)
        self.context.check("looking what is at a pixel")
        if not entity:
            return 0, (0.0, 0.0, 0.0)
        place = view.eye + relative
        return entity, (float(place[0]), float(place[1]), float(place[2]))

    def draw_data(
        self,
        world: RenderWorld,
        camera: ViewCamera,
        width: int,
        height: int,
        kind: DataKind,
        *,
        hidden: tuple[int, ...] = (),
        region: Region | None = None,
    ) -> NDArray[Any]:
        """Values (H, W, C) of what is seen in a picture or a region of it, the upper row first, as `DataPass.draw` tells.

        Raises:
            ShaderError: a shader is refused.
        """
        self._reload()
        view = View.of(camera, width, height)
        plan = plan_picture(world, view if region is None else view.of_region(region), hidden=hidden)
        self._upload(plan)
        if self._data is None:
            self._data = DataPass(self.resources)
        with self.resources.programs.exact():
            values = self._data.draw(plan, kind)
        self.context.collect()
        self.context.check("drawing a view of data")
        return values

    def read_pixels(self, picture: Framebuffer) -> NDArray[np.uint8]:
        """RGBA (H, W, 4) of a picture, the upper row first."""
        pixels: NDArray[np.uint8] = picture.read()
        return np.ascontiguousarray(pixels[::-1])

    def read_light(self, width: int, height: int) -> NDArray[np.float32]:
        """Linear radiance RGBA (H, W, 4) of the last picture of that size, before tone mapping, the upper row first.

        Of a Quality that goes to the screen directly: what the screen shows.
        """
        light = next(kept for size, kept in reversed(self._targets.items()) if size[:2] == (width, height)).light.read()
        return np.ascontiguousarray(light[::-1].astype(np.float32))

    def settle(self, world: RenderWorld, *, timeout: float = 60.0) -> None:
        """Waits for the meshes and images that the world's batches name, so that the next picture shows all of them."""
        looks = dict.fromkeys(batch.look for batch in world.batches if batch.look.is_textured)
        for look in looks:
            self.resources.takes_textures(world, look)  # images take longest: they are asked for first
        for batch in world.batches:
            self.resources.geometry(world, batch)
        world.surroundings(None)
        end = time.monotonic() + timeout
        # What has been decoded goes to the card while others are decoded still. An image that is sampled in two ways is asked for
        # once more when the first has taken it.
        while [look for look in looks if not self.resources.takes_textures(world, look)] and time.monotonic() < end:
            world.assets.wait_for_one(end - time.monotonic())
        world.assets.settle(max(end - time.monotonic(), 0.0))
        world.place_if_assets_came()

    def settle_images(self, world: RenderWorld, images: Sequence[str], *, timeout: float = 60.0) -> None:
        """Waits for images of overlays likewise."""
        end = time.monotonic() + timeout
        self.resources.overlay_images.begin(world.assets)
        while [name for name in images if self.resources.overlay_images.size(name) is None]:
            if time.monotonic() >= end or not world.assets.wait_for_one(end - time.monotonic()):
                return

    def _reload(self) -> None:
        """Takes shaders that have changed; what older ones have drawn and is kept is drawn anew."""
        if self.resources.programs.reload_changed():
            self._environment.drawn = ()
            self._shadow_world = None

    def _tell_left_out(self, plan: PicturePlan) -> None:
        """Once of each world: who is left out may change with every step of the eye."""
        self._told_worlds.add(plan.world)
        _log.warning(
            "a picture has room for %d suns and %d lamps: left out, as they give the eye least light, are %d suns and %d lamps",
            MOST_FURTHER_SUNS + 1,
            MOST_LAMPS,
            *plan.left_out,
        )

    def _show(self, plan: PicturePlan, targets: Targets, picture: Framebuffer) -> None:
        """Turns light into what the screen shows, unless the passes did so already."""
        if not self._quality.writes_screen(plan.picture):
            self._tonemap.draw(plan, targets.light, picture)
        elif picture is not targets.light:
            targets.light.resolve_into(picture)

    def _plan(
        self,
        world: RenderWorld,
        view: View,
        *,
        selection: tuple[int, ...],
        hidden: tuple[int, ...],
        grid: bool,
        marks: Marks,
    ) -> PicturePlan:
        is_same = self._shadow_world is world
        self._shadow_world = world
        return plan_picture(
            world,
            view,
            selection=selection,
            hidden=hidden,
            grid=grid,
            marks=marks,
            drawn_cascades=self._shadow.drawn if is_same else (),
            shadow_size=self._quality.shadow_size,
            long_views=not self._quality.single_shadow_tap,
            lamp_shadow_size=self._quality.lamp_shadow_size,
            drawn_lamp_shadows=self._lamp_shadows.drawn if is_same else None,
            for_light=True,
        )

    def _upload(self, plan: PicturePlan) -> None:
        self.resources.placing.place(plan)
        self.resources.show_poses(plan.world)
        self.resources.forget_unused(plan.world)
        self.resources.frame.write(frame_block(plan, self._environment.harmonics, mirror_tiles()))
        self.resources.frame.bind_block(BLOCK_BINDINGS["Frame"])

    def _targets_of(self, width: int, height: int, *, to_screen: bool) -> Targets:
        targets = self._targets.pop((width, height, to_screen), None)
        if targets is None:
            targets = Targets(self.context, width, height, self._quality, to_screen=to_screen)
        self._targets[width, height, to_screen] = targets  # the last one used stands last
        while len(self._targets) > KEPT_SIZES:
            del self._targets[next(iter(self._targets))]
        return targets

    def _timed(self, stage: str) -> _Stage:
        return _Stage(self.timings, stage)


class _Stage:
    """Notes how long it lasted; it takes less itself than a generator would, and there are ten of them a picture."""

    __slots__ = ("_name", "_start", "_timings")

    def __init__(self, timings: dict[str, float], name: str) -> None:
        self._timings, self._name = timings, name

    def __enter__(self) -> None:
        self._start = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._timings[self._name] = (time.perf_counter() - self._start) * 1e3
