"""What one picture draws, decided with arrays before OpenGL hears of it: who is seen, who throws shadows, in which order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.ghosts import Color
from elys.common.scene import PictureSettings
from elys.render_node.batch_terms import GLOWING
from elys.render_node.camera import View, frustum_planes
from elys.render_node.crowd import Crowd
from elys.render_node.draw_calls import DrawCall, RowCollector
from elys.render_node.ghost_worlds import ShownGhost
from elys.render_node.gpu import INSTANCE_DTYPE, PLAIN_INSTANCE_DTYPE
from elys.render_node.lamp_shadows import LampShadows, fit_lamp_shadows
from elys.render_node.marks import NO_MARKS, Marks
from elys.render_node.overlays import NO_OVERLAYS, Overlays
from elys.render_node.picture_lights import LeftOut, shining_lights
from elys.render_node.render_world import PlacedLight, RenderWorld
from elys.render_node.scene_tables import Rows
from elys.render_node.shadow_fit import MOST_CASCADES, ShadowFit, fit_cascades, reached
from elys.render_node.surroundings import Surroundings


@dataclass(frozen=True, slots=True, kw_only=True)
class PicturePlan:
    """All that the passes need to know. Instances of the calls stand one behind the other in `rows`."""

    view: View
    world: RenderWorld
    rows: NDArray[np.uint32]  # [N] instances of the world; the same array while the same are drawn
    layout: np.dtype[np.void]  # as what they are read: INSTANCE_DTYPE or PLAIN_INSTANCE_DTYPE
    opaque: list[DrawCall]
    transparent: list[DrawCall]  # farthest first
    casters: list[list[DrawCall]]  # of each stale cascade
    selected: list[DrawCall]
    sun: PlacedLight | None  # the one whose shadows are drawn, if it throws any
    further_suns: list[PlacedLight]
    lamps: list[PlacedLight]
    left_out: LeftOut
    cascades: tuple[ShadowFit, ...]  # what the sun's maps cover, the finest first; none where the sun throws no shadows
    stale_cascades: tuple[int, ...]  # those of them whose maps do not hold what they should
    lamp_shadows: LampShadows | None
    lamp_casters: list[list[DrawCall]]  # of each of their squares; none while the atlas drawn last still holds
    hidden: tuple[int, ...]  # entities that are left out, with all below them
    grid: bool
    surroundings: Surroundings
    marks: Marks
    ghosts: tuple[GhostPlan, ...] = ()
    overlays: Overlays = NO_OVERLAYS

    @property
    def picture(self) -> PictureSettings:
        """What the scene asks of its pictures."""
        return self.world.settings.picture


class GhostPlan(NamedTuple):
    """What is drawn of a ghost: nothing but its `opaque` and `transparent`, all of it in one colour."""

    plan: PicturePlan
    color: Color


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
    left_out, crowd = world.instances_of(hidden), world.crowd
    planes = frustum_planes(view.clip_from_relative)
    relative = (crowd.centre - view.eye[:, None]).astype(np.float32)
    margin = _margin(planes, relative)
    seen = np.flatnonzero(margin > -crowd.radius)
    lights = shining_lights(world.lights(), view.eye, planes, with_shadows=lamp_shadow_size > 0)
    cascades = (
        _cascades(world, view, lights.sun, shadow_size, MOST_CASCADES if long_views else 1) if shadow_size else ()
    )
    stale = _stale(shadow_states(world, cascades, hidden), drawn_cascades)
    rows = RowCollector(world, crowd, left_out)
    opaque = rows.add_seen(
        seen, _depth(view, relative), _outside(crowd, view, planes, seen[_is_cut(crowd, margin, seen)])
    )
    blended, blended_places = _blended(world, view, planes, left_out)
    transparent = rows.add_sorted(blended, _distance(view, blended_places))
    all_casters = np.flatnonzero(crowd.casts) if stale or lamp_shadow_size else seen[:0]
    casters = [rows.add_groups(_reached(crowd, view, cascades, place, all_casters)) for place in stale]
    around = (
        fit_lamp_shadows(crowd, lights.lamps, all_casters, lamp_shadow_size, view.eye)
        if lamp_shadow_size and lights.lamps
        else None
    )
    holds = around is not None and drawn_lamp_shadows == ShadowState(
        world.scene_version, world.pose_version, around.key, hidden
    )
    lamp_casters = [rows.add_groups(found) for found in around.casters] if around is not None and not holds else []
    chosen = np.setdiff1d(_selected(world, crowd, selection, seen, blended), left_out) if selection else seen[:0]
    selected = rows.add_rows(chosen)
    return PicturePlan(
        view=view,
        world=world,
        rows=rows.all(),
        layout=PLAIN_INSTANCE_DTYPE if for_light and _is_plain(world) else INSTANCE_DTYPE,
        opaque=opaque,
        transparent=transparent,
        casters=casters,
        selected=selected,
        sun=lights.sun,
        further_suns=lights.further_suns,
        lamps=lights.lamps,
        left_out=lights.left_out,
        cascades=cascades,
        stale_cascades=stale,
        lamp_shadows=around,
        lamp_casters=lamp_casters,
        hidden=hidden,
        grid=grid or marks.grid,
        marks=marks,
        surroundings=world.surroundings(None if lights.sky_sun is None else -lights.sky_sun.direction),
    )


def plan_ghosts(view: View, ghosts: Sequence[ShownGhost]) -> tuple[GhostPlan, ...]:
    """What a picture in this view shows of ghosts; those of which nothing has parted are not in it."""
    plans = (
        GhostPlan(plan_picture(ghost.world, view, hidden=ghost.left_out), ghost.color)
        for ghost in ghosts
        if len(ghost.parting.entity)
    )
    return tuple(ghost for ghost in plans if ghost.plan.opaque or ghost.plan.transparent)


def _depth(view: View, relative_centre: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far (N,) things are along the way the camera looks [m]."""
    return -view.world_from_view[:, 2].astype(np.float32) @ relative_centre


def _distance(view: View, relative_centre: NDArray[np.float32]) -> NDArray[np.float32]:
    """What see-through things (N,), of centres (3, N), are sorted by: the distance to the eye, squared, or the depth in a
    parallel view.
    """
    if view.camera.ortho_height > 0.0:
        return _depth(view, relative_centre)
    return np.asarray(np.einsum("ij,ij->j", relative_centre, relative_centre))


def _margin(planes: NDArray[np.float64], centre: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far (N,) places (3, N) are within the space that six planes enclose [m]; spheres reach into it while that is more than
    minus their radius.
    """
    distance = planes[:, :3].astype(np.float32) @ centre
    distance += planes[:, 3:].astype(np.float32)
    return np.asarray(distance.min(axis=0))


def _is_cut(crowd: Crowd, margin: NDArray[np.float32], groups: Rows) -> NDArray[np.bool_]:
    """Which of some groups reach out of the view, given how far all are within, and may have members that are not seen."""
    return np.asarray((margin[groups] < crowd.radius[groups]) & (crowd.size[groups] > 1))


def _outside(crowd: Crowd, view: View, planes: NDArray[np.float64], cut: Rows) -> Rows:
    """The instances of some groups that are not in the view."""
    if not len(cut):
        return cut
    rows = crowd.listed(cut)
    relative = (crowd.item_centre.T[:, rows] - view.eye[:, None]).astype(np.float32)
    return rows[_margin(planes, relative) <= -crowd.item_radius[rows] - np.float32(crowd.slack * (1.0 + 1e-6))].astype(
        np.intp
    )


def _blended(
    world: RenderWorld, view: View, planes: NDArray[np.float64], left_out: Rows
) -> tuple[Rows, NDArray[np.float32]]:
    """The see-through instances (N,) that are seen, and where from the eye (3, N)."""
    standing = world.standing
    first = int(np.searchsorted(standing.led, world.instances.first_blended))
    rows = standing.led[first:]
    if not len(rows):
        return rows, np.zeros((3, 0), np.float32)
    relative = (standing.led_centre[first:].T - view.eye[:, None]).astype(np.float32)
    seen = _margin(planes, relative) > -world.radius[rows]
    if len(left_out):
        seen &= ~np.isin(rows, left_out)
    return rows[seen], relative[:, seen]


def _selected(world: RenderWorld, crowd: Crowd, selection: tuple[int, ...], seen: Rows, blended: Rows) -> Rows:
    """The instances that are selected and, as far as bounds tell, in view."""
    rows = world.instances_of(selection)
    is_seen = np.zeros(len(crowd.size) + 1, np.bool_)  # the last one: of who is in no group
    is_seen[seen] = True
    return rows[is_seen[crowd.groups_of(rows)] | np.isin(rows, blended)]


def _is_plain(world: RenderWorld) -> bool:
    """Whether nobody glows, has holes, or is bent or morphed."""
    return not any(
        GLOWING in batch.terms or batch.look.alpha_mode == "mask" or batch.look.deformation for batch in world.batches
    )


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


def _reached(crowd: Crowd, view: View, cascades: tuple[ShadowFit, ...], place: int, casters: Rows) -> Rows:
    """Which groups are drawn into a map; into that of all, all."""
    return casters if place == len(cascades) - 1 else reached(crowd, cascades[place], view, casters)
