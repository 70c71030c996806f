"""What one picture draws, decided with arrays before OpenGL hears of it: who is seen, who throws shadows, in which order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.render_node.camera import View, frustum_planes
from elys.render_node.gpu import INSTANCE_DTYPE
from elys.render_node.render_world import Batch, PlacedLight, RenderWorld
from elys.render_node.scene_tables import Rows
from elys.render_node.shadow_fit import ShadowFit, fit_shadow

MAX_LAMPS: Final = 8  # point and spot lights in one picture: those that matter most
EXPOSURE: Final = 1.0  # a sun of pi lx makes white white, see `frame_block`


class DrawCall(NamedTuple):
    """A run of instances of one batch in the picture's instance buffer."""

    batch: Batch
    first: int
    instance_count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PicturePlan:
    """All that the passes need to know. Instances of the calls stand one behind the other in `instances`."""

    view: View
    world: RenderWorld
    instances: NDArray[np.void]  # [N] of INSTANCE_DTYPE
    opaque: list[DrawCall]
    transparent: list[DrawCall]  # farthest first
    casters: list[DrawCall]
    selected: list[DrawCall]
    sun: PlacedLight | None
    lamps: list[PlacedLight]
    shadow: ShadowFit | None
    shadow_is_fresh: bool  # the map drawn for the last picture still holds
    grid: bool


class ShadowState(NamedTuple):
    """What a shadow map was drawn from."""

    scene_version: int
    pose_version: int
    key: tuple[float, ...]


def plan_picture(
    world: RenderWorld,
    view: View,
    *,
    selection: tuple[int, ...] = (),
    grid: bool = False,
    drawn_shadow: ShadowState | None = None,
    shadow_size: int = 0,
) -> PicturePlan:
    """Decides what a picture of the world in this view consists of; `drawn_shadow` is what the shadow map, of `shadow_size`
    texels an edge (0 for none), holds already.
    """
    relative_centre = (world.centre - view.eye).astype(np.float32)
    seen = _within(frustum_planes(view.clip_from_relative), relative_centre, world.radius)
    lights = world.lights()
    sun = _brightest_sun(lights)
    shadow = _shadow(world, view, sun, shadow_size) if shadow_size else None
    is_fresh = shadow is not None and drawn_shadow == ShadowState(world.scene_version, world.pose_version, shadow.key)
    rows = _RowCollector(world)
    seen_rows = np.flatnonzero(seen)
    first_blended = next((batch.first for batch in world.batches if batch.is_blended), world.instance_count)
    opaque = rows.add_grouped(seen_rows[seen_rows < first_blended])
    transparent = rows.add_sorted(seen_rows[seen_rows >= first_blended], _distance(view, relative_centre))
    casters = rows.add_grouped(_caster_rows(world, first_blended)) if shadow is not None and not is_fresh else []
    selected = rows.add_grouped(np.intersect1d(world.instances_of(selection), seen_rows, assume_unique=True))
    return PicturePlan(
        view=view,
        world=world,
        instances=_instances(world, rows.all(), view.eye),
        opaque=opaque,
        transparent=transparent,
        casters=casters,
        selected=selected,
        sun=sun,
        lamps=_nearest_lamps(lights, view.eye),
        shadow=shadow,
        shadow_is_fresh=is_fresh,
        grid=grid,
    )


class _RowCollector:
    """Lines up the instances of all draw calls of a picture."""

    def __init__(self, world: RenderWorld) -> None:
        self._world = world
        self._starts = np.array([batch.first for batch in world.batches], np.intp)
        self._parts: list[Rows] = []
        self._count = 0

    def add_grouped(self, rows: Rows) -> list[DrawCall]:
        """Ascending rows, one call a batch."""
        if not len(rows):
            return []
        bounds = np.append(np.searchsorted(rows, self._starts), len(rows))
        calls = [
            DrawCall(
                self._world.batches[batch], self._count + int(bounds[batch]), int(bounds[batch + 1] - bounds[batch])
            )
            for batch in np.flatnonzero(np.diff(bounds)).tolist()
        ]
        self._keep(rows)
        return calls

    def add_sorted(self, rows: Rows, distance: NDArray[np.float32]) -> list[DrawCall]:
        """Farthest first by the distances of all instances, a call for each run of one batch."""
        if not len(rows):
            return []
        rows = rows[np.argsort(-distance[rows], kind="stable")]
        batch = self._world.batch_of[rows]
        starts = np.flatnonzero(np.append(True, batch[1:] != batch[:-1]))
        ends = np.append(starts[1:], len(rows))
        calls = [
            DrawCall(self._world.batches[batch[start]], self._count + int(start), int(end - start))
            for start, end in zip(starts.tolist(), ends.tolist(), strict=True)
        ]
        self._keep(rows)
        return calls

    def all(self) -> Rows:
        """The rows of all calls in order."""
        return np.concatenate(self._parts) if self._parts else np.zeros(0, np.intp)

    def _keep(self, rows: Rows) -> None:
        self._parts.append(rows)
        self._count += len(rows)


def _distance(view: View, relative_centre: NDArray[np.float32]) -> NDArray[np.float32]:
    """What (N,) see-through things are sorted by: the distance to the eye, squared, or the depth in a parallel view."""
    if view.camera.ortho_height > 0.0:
        return relative_centre @ -view.world_from_view[:, 2].astype(np.float32)
    return np.asarray(np.einsum("ij,ij->i", relative_centre, relative_centre))


def _within(planes: NDArray[np.float64], centre: NDArray[np.float32], radius: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Which spheres (N,) reach into the space that six planes enclose."""
    distance = centre @ planes[:, :3].T.astype(np.float32) + planes[:, 3].astype(np.float32)
    return np.asarray((distance > -radius[:, None]).all(axis=1))


def _instances(world: RenderWorld, rows: Rows, eye: NDArray[np.float64]) -> NDArray[np.void]:
    instances = np.empty(len(rows), INSTANCE_DTYPE)
    instances["affine"][:, :, :3] = world.linear[rows]
    instances["affine"][:, :, 3] = world.position[rows] - eye  # in 64 bits, before what is left fits into 32
    instances["surface"] = world.surface[rows]
    instances["entity"] = world.entity[rows]
    instances["pose"] = world.pose[rows]
    return instances


def _caster_rows(world: RenderWorld, first_blended: int) -> Rows:
    return np.flatnonzero(world.casts[:first_blended])


def _shadow(world: RenderWorld, view: View, sun: PlacedLight | None, map_size: int) -> ShadowFit | None:
    if sun is None or not sun.light.cast_shadows:
        return None
    return fit_shadow(world, view, sun.direction, map_size=map_size)


def _brightest_sun(lights: list[PlacedLight]) -> PlacedLight | None:
    suns = [light for light in lights if light.light.kind == "directional" and light.light.intensity > 0.0]
    return max(suns, key=lambda placed: placed.light.intensity) if suns else None


def _nearest_lamps(lights: list[PlacedLight], eye: NDArray[np.float64]) -> list[PlacedLight]:
    """Those that give most light near the eye, in a stable order."""
    lamps = [placed for placed in lights if placed.light.kind != "directional" and placed.light.intensity > 0.0]
    if len(lamps) <= MAX_LAMPS:
        return lamps
    return sorted(
        lamps, key=lambda placed: -placed.light.intensity / (1.0 + float(np.sum((placed.position - eye) ** 2)))
    )[:MAX_LAMPS]
