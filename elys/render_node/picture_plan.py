"""What one picture draws, decided with arrays before OpenGL hears of it: who is seen, who throws shadows, in which order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.scene import PictureSettings
from elys.render_node.camera import View, frustum_planes
from elys.render_node.lamp_shadows import LampShadows, fit_lamp_shadows
from elys.render_node.marks import NO_MARKS, Marks
from elys.render_node.render_world import Batch, PlacedLight, RenderWorld
from elys.render_node.scene_tables import Rows
from elys.render_node.shadow_fit import MOST_CASCADES, ShadowFit, fit_cascades, reached
from elys.render_node.surroundings import Surroundings

MAX_LAMPS: Final = 8  # point and spot lights in one picture: those that matter most


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
    instances: NDArray[np.void]  # [N] of INSTANCE_DTYPE or PLAIN_INSTANCE_DTYPE, until the next plan of the same world
    opaque: list[DrawCall]
    transparent: list[DrawCall]  # farthest first
    casters: list[list[DrawCall]]  # of each stale cascade
    selected: list[DrawCall]
    sun: PlacedLight | None
    lamps: list[PlacedLight]
    cascades: tuple[ShadowFit, ...]  # what the sun's maps cover, the finest first; none where the sun throws no shadows
    stale_cascades: tuple[int, ...]  # those of them whose maps do not hold what they should
    lamp_shadows: LampShadows | None
    lamp_casters: list[list[DrawCall]]  # of each of their squares; none while the atlas drawn last still holds
    hidden: tuple[int, ...]  # entities that are left out, with all below them
    grid: bool
    surroundings: Surroundings
    marks: Marks

    @property
    def picture(self) -> PictureSettings:
        """What the scene asks of its pictures."""
        return self.world.settings.picture


class ShadowState(NamedTuple):
    """What a shadow map was drawn from."""

    scene_version: int
    pose_version: int
    key: tuple[float, ...]
    hidden: tuple[int, ...]


def shadow_states(
    world: RenderWorld, cascades: tuple[ShadowFit, ...], hidden: tuple[int, ...]
) -> tuple[ShadowState, ...]:
    """What maps of these hold once they are drawn."""
    return tuple(ShadowState(world.scene_version, world.pose_version, fit.key, hidden) for fit in cascades)


def plan_picture(
    world: RenderWorld,
    view: View,
    *,
    selection: tuple[int, ...] = (),
    hidden: tuple[int, ...] = (),
    grid: bool = False,
    drawn_cascades: tuple[ShadowState, ...] = (),
    shadow_size: int = 0,
    long_views: bool = False,
    lamp_shadow_size: int = 0,
    drawn_lamp_shadows: ShadowState | None = None,
    for_light: bool = False,
    marks: Marks = NO_MARKS,
) -> PicturePlan:
    """Decides what a picture of the world in this view consists of; `drawn_cascades` is what the sun's maps, of `shadow_size`
    texels an edge (0 for none), hold already, and `drawn_lamp_shadows` the same of the atlas of lamps. With
    `long_views` finer maps around the eye are added where one would be coarse. `hidden` entities, and all below them, are
    neither seen nor throw shadows; lamps among them shine. A plan `for_light` cannot tell who is seen.
    """
    left_out = world.instances_of(hidden)
    # (3, N): numpy is quick along rows, which is how the world keeps them.
    relative_centre = (world.centre.T - view.eye[:, None]).astype(np.float32)
    seen = _within(frustum_planes(view.clip_from_relative), relative_centre, world.radius)
    seen[left_out] = False
    lights = world.lights()
    sun = _brightest_sun(lights)
    cascades = _cascades(world, view, sun, shadow_size, MOST_CASCADES if long_views else 1) if shadow_size else ()
    stale = _stale(shadow_states(world, cascades, hidden), drawn_cascades)
    rows = _RowCollector(world)
    seen_rows = np.flatnonzero(seen)
    first_blended = next((batch.first for batch in world.batches if batch.is_blended), world.instance_count)
    opaque = rows.add_grouped(seen_rows[: np.searchsorted(seen_rows, first_blended)], _depth(view, relative_centre))
    blended = seen_rows[np.searchsorted(seen_rows, first_blended) :]
    transparent = rows.add_sorted(blended, _distance(view, relative_centre)) if len(blended) else []
    all_casters = _caster_rows(world, first_blended, left_out) if stale or lamp_shadow_size else seen_rows[:0]
    casters = [rows.add_grouped(_reached(world, view, cascades, place, all_casters)) for place in stale]
    lamps = _nearest_lamps(lights, view.eye)
    around = fit_lamp_shadows(world, lamps, all_casters, lamp_shadow_size) if lamp_shadow_size and lamps else None
    holds = around is not None and drawn_lamp_shadows == ShadowState(
        world.scene_version, world.pose_version, around.key, hidden
    )
    lamp_casters = [rows.add_grouped(found) for found in around.casters] if around is not None and not holds else []
    chosen = (
        np.intersect1d(world.instances_of(selection), seen_rows, assume_unique=True) if selection else seen_rows[:0]
    )
    selected = rows.add_grouped(chosen)
    return PicturePlan(
        view=view,
        world=world,
        instances=world.instance_rows.seen_from(world, rows.all(), view.eye, for_light=for_light),
        opaque=opaque,
        transparent=transparent,
        casters=casters,
        selected=selected,
        sun=sun,
        lamps=lamps,
        cascades=cascades,
        stale_cascades=stale,
        lamp_shadows=around,
        lamp_casters=lamp_casters,
        hidden=hidden,
        grid=grid or marks.grid,
        marks=marks,
        surroundings=world.surroundings(None if sun is None else -sun.direction),
    )


class _RowCollector:
    """Lines up the instances of all draw calls of a picture."""

    def __init__(self, world: RenderWorld) -> None:
        self._world = world
        self._starts = np.array([batch.first for batch in world.batches], np.intp)
        self._parts: list[Rows] = []
        self._grouped: list[tuple[int, Rows]] = []
        self._count = 0

    def add_grouped(self, rows: Rows, depth: NDArray[np.float32] | None = None) -> list[DrawCall]:
        """Ascending rows, one call a batch, of which the least deep come first where the `depth` of all instances is given.
        Rows that stand there already, as of casters that are all seen, are used again.
        """
        if not len(rows):
            return []
        first = self._keep_grouped(rows, depth)
        bounds = np.append(np.searchsorted(rows, self._starts), len(rows))
        return [
            DrawCall(self._world.batches[batch], first + int(bounds[batch]), int(bounds[batch + 1] - bounds[batch]))
            for batch in np.flatnonzero(np.diff(bounds)).tolist()
        ]

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

    def _keep_grouped(self, rows: Rows, depth: NDArray[np.float32] | None) -> int:
        """Where these rows stand among all."""
        for first, kept in self._grouped:
            if len(kept) == len(rows) and np.array_equal(kept, rows):
                return first
        self._grouped.append((self._count, rows))
        self._keep(rows if depth is None else _nearest_first(rows, self._world.batch_of, depth))
        return self._grouped[-1][0]

    def _keep(self, rows: Rows) -> None:
        self._parts.append(rows)
        self._count += len(rows)


def _nearest_first(rows: Rows, batch_of: Rows, depth: NDArray[np.float32]) -> Rows:
    """Ascending rows with those of each batch by their depth, for what is hidden by something drawn before is not shaded.

    By one of 2^16 steps: such numbers are sorted in linear time, and order changes no picture but where surfaces coincide.
    """
    batches = batch_of[rows]
    is_single_batch = batches[0] == batches[-1]
    if len(rows) == 1 or not (is_single_batch or (batches[1:] == batches[:-1]).any()):
        return rows
    deep = depth[rows]
    nearest, farthest = deep.min(), deep.max()
    if not 0.0 < farthest - nearest < np.inf:
        return rows
    order = np.argsort(((deep - nearest) * (65535.0 / (farthest - nearest))).astype(np.uint16), kind="stable")
    if not is_single_batch:
        order = order[np.argsort(batches[order], kind="stable")]
    return rows[order]


def _depth(view: View, relative_centre: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far (N,) things are along the way the camera looks [m]."""
    return -view.world_from_view[:, 2].astype(np.float32) @ relative_centre


def _distance(view: View, relative_centre: NDArray[np.float32]) -> NDArray[np.float32]:
    """What (N,) see-through things are sorted by: the distance to the eye, squared, or the depth in a parallel view."""
    if view.camera.ortho_height > 0.0:
        return _depth(view, relative_centre)
    return np.asarray(np.einsum("ij,ij->j", relative_centre, relative_centre))


def _within(planes: NDArray[np.float64], centre: NDArray[np.float32], radius: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Which spheres, of centres (3, N), reach into the space that six planes enclose."""
    distance = planes[:, :3].astype(np.float32) @ centre
    distance += planes[:, 3:].astype(np.float32)
    return np.asarray(distance.min(axis=0) > -radius)


def _caster_rows(world: RenderWorld, first_blended: int, left_out: Rows) -> Rows:
    casters = np.flatnonzero(world.casts[:first_blended])
    return np.setdiff1d(casters, left_out, assume_unique=True) if len(left_out) else casters


def _cascades(
    world: RenderWorld, view: View, sun: PlacedLight | None, map_size: int, most: int
) -> tuple[ShadowFit, ...]:
    if sun is None or not sun.light.cast_shadows:
        return ()
    return fit_cascades(world, view, sun.direction, map_size=map_size, most=most)


def _stale(wanted: tuple[ShadowState, ...], drawn: tuple[ShadowState, ...]) -> tuple[int, ...]:
    """The places of maps that must be drawn; all, where there are more or fewer than before, as they then lie elsewhere."""
    if len(wanted) != len(drawn):
        return tuple(range(len(wanted)))
    return tuple(place for place, state in enumerate(wanted) if state != drawn[place])


def _reached(world: RenderWorld, view: View, cascades: tuple[ShadowFit, ...], place: int, casters: Rows) -> Rows:
    """Who is drawn into a map; into that of all, all."""
    return casters if place == len(cascades) - 1 else reached(world, cascades[place], view, casters)


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
