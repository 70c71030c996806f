"""The scene as a renderer wants it: instances by mesh and material, lamps, cameras, and where all of it stands right now.

    SceneTables ──rebuild──> batches, instance arrays        only when the scene changed
    StateFrames ──place────> position, linear                each picture, arrays only

Instances stand in the order of their batches, opaque ones first, so that what is seen of a batch is always one run of rows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import ViewCamera
from elys.common.components import Camera, Environment, Light, Material
from elys.common.math import quaternion
from elys.common.math.aabb import transform_bounds
from elys.common.scene import SceneSettings
from elys.render_node.batch_terms import Terms, evenly_scaled, terms_of_batches
from elys.render_node.camera import camera_of, framing_camera
from elys.render_node.deformation import Deformation, bent_rows, morphed_rows
from elys.render_node.drawable_assets import UNKNOWN_EXTENT, DrawableAssets
from elys.render_node.instance_rows import InstanceRows
from elys.render_node.look import Look, look_of
from elys.render_node.placement import Placement
from elys.render_node.scene_tables import Rows, SceneReader, SceneTables, tables_of
from elys.render_node.surroundings import Surroundings, surroundings_of
from elys.render_node.timeline import Timeline

PLAIN: Final = Material()
BLACK: Final = (0.0, 0.0, 0.0)
UNTURNED: Final = np.array((0.0, 0.0, 0.0, 1.0))
GIANT: Final = 1.6  # times larger than all smaller things together: neither cameras nor shadow maps are fitted to it
_CORNER_SIGNS: Final = np.array([(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)], np.float64)
# What is drawn where a mesh cannot be had.
MISSING: Final = Material(base_color=(0.0, 0.0, 0.0), emissive=(0.8, 0.0, 0.6))


class Batch(NamedTuple):
    """Instances that are drawn together."""

    mesh: str
    look: Look
    first: int  # instance
    instance_count: int
    terms: Terms = ()  # what of their numbers has to be compiled in

    @property
    def is_blended(self) -> bool:
        """Whether what is behind shows through."""
        return self.look.alpha_mode == "blend"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedLight:
    """A lamp where it is now."""

    light: Light
    position: NDArray[np.float64]  # (3,) world [m]
    direction: NDArray[np.float64]  # (3,) the way it shines


class Bodies(NamedTuple):
    """The B bodies of the newest state frame where they are placed."""

    entity: NDArray[np.uint32]  # (B,)
    position: NDArray[np.float64]  # (B, 3) world [m]
    linear_velocity: NDArray[np.float32]  # (B, 3) [m/s]
    time: float  # [s] of simulation at which they are there
    tick: int  # the last one that is over by then


class RenderWorld:
    """What can be drawn of a scene. Feed it with `set_scene` and `take_state`, then `place` it in time and draw.

    Attributes:
        entity: [M] u32. radius: [M] f32 m, around `centre`. casts: [M] throws shadows. surface: [M, 3, 4] f32, the numbers of the
            materials as `instance.glsl` has them. pose: [M, 2] i4, where joints and weights begin in `pose_texels`. Of the M
            instances.
        batches: runs of the instances.
        scene_version: rises when batches change; pose_version when anything stands elsewhere.
    """

    def __init__(self, assets: DrawableAssets | None = None, *, environment: bool = True) -> None:
        """Without `environment` nothing but the scene's lamps and what glows gives light, whatever its settings say."""
        self._has_environment = environment
        self.assets = assets if assets is not None else DrawableAssets()
        self.timeline = Timeline()
        self.instance_rows = InstanceRows()
        self.scene_version = 0
        self.pose_version = 0
        self._tables = tables_of([], [], [])
        self._bodies = self._animated = np.zeros(0, np.uint32)
        self._assets_version = -1
        self._placed = (-1, -1.0)
        self._rests = False  # placed as the newest frame says, not on the way there
        self._preferred_camera = 0
        self._rebuild()

    # --- feeding ---------------------------------------------------------------------------------------------------

    def set_scene(self, tables: SceneTables, *, only_moved: bool = False) -> None:
        """Takes the scene as it is now; `only_moved` says that nothing but transforms differs from the one before."""
        before, self._tables = self._tables, tables
        if only_moved and np.array_equal(_is_mirrored(before), _is_mirrored(tables)):
            self._place_anew()
        else:
            self._rebuild()

    def read_scene(self, reader: SceneReader) -> bool:
        """Takes what a reader has that is new; False if that is nothing."""
        read = reader.read()
        if read is None:
            return False
        self.set_scene(read[0], only_moved=read[1])
        return True

    def take_state(self, frame: StateFrame, now: float = 0.0) -> bool:
        """Takes where bodies are, as it came at `now` [s]; False if it told nothing new."""
        if not self.timeline.take(frame, now):
            return False
        if not (np.array_equal(frame.entity, self._bodies) and np.array_equal(frame.local_entity, self._animated)):
            self._place_anew()
        return True

    def forget_state(self) -> None:
        """Lets everything stand as the scene says, as when another host took over."""
        self.timeline.forget()
        self._place_anew()

    def place(self, now: float | None = None, *, simulation_time: float | None = None) -> None:
        """Moves everything to where it is between the newest two frames: at `now` [s] by the clock of `take_state`, or at a
        simulation time [s]; without either, exactly where the newest frame says.
        """
        self.place_if_assets_came()
        newest = self.timeline.newest
        if newest is None:
            return
        fraction = 1.0 if now is None else self.timeline.fraction(now)
        if simulation_time is not None:
            fraction = self.timeline.fraction_at(simulation_time)
        moment = (newest.published_at, fraction)
        if moment == self._placed:
            return
        self._placed = moment
        rested, self._rests = self._rests, self.timeline.is_still or fraction == 1.0
        if rested and self.timeline.is_still:
            return  # everything stands where it was placed last
        self._placement.follow(self.timeline, fraction)
        self._deform(fraction)
        self._centre()
        self.pose_version += 1

    def place_if_assets_came(self) -> None:
        """Takes the size of meshes that have come since."""
        if self._assets_version != self.assets.version:
            self._rebuild()

    def prefer_camera(self, entity: int) -> None:
        """Chooses an entity whose camera, while there is one that is on, goes before all others; 0 for none."""
        self._preferred_camera = entity
        self._rebuild()

    # --- asking ----------------------------------------------------------------------------------------------------

    @property
    def settings(self) -> SceneSettings:
        """What holds for the whole scene."""
        return self._settings

    @property
    def tick(self) -> int:
        """Of the newest state, -1 before there is any."""
        return self.timeline.newest.tick if self.timeline.newest is not None else -1

    @property
    def state_published_at(self) -> int:
        """Wall clock [ns] of the sender of the newest state, 0 before there is any."""
        return self.timeline.newest.published_at if self.timeline.newest is not None else 0

    @property
    def instance_count(self) -> int:
        """How many things can be drawn."""
        return len(self.entity)

    @property
    def pose_texels(self) -> NDArray[np.float32]:
        """What bends and morphs meshes (K, 4), see `deformation.py`."""
        return self._deformation.texels

    @property
    def position(self) -> NDArray[np.float64]:
        """World positions [M, 3] of the instances' origins [m]."""
        return self._placement.position[: self.instance_count]

    @property
    def linear(self) -> NDArray[np.float32]:
        """Rotation and scale [M, 3, 3] of world_from_local."""
        return self._placement.linear[: self.instance_count]

    def bodies(self) -> Bodies:
        """What moves, where it is seen now; nobody before there is any state."""
        newest = self.timeline.newest
        if newest is None:
            return Bodies(np.zeros(0, np.uint32), np.zeros((0, 3)), np.zeros((0, 3), np.float32), 0.0, -1)
        fraction = 1.0 if self._placed[1] < 0.0 else self._placed[1]
        position, _, _ = self.timeline.poses(newest.entity, fraction)
        return Bodies(
            newest.entity,
            position,
            newest.linear_velocity,
            self.timeline.time_at(fraction),
            self.timeline.tick_at(fraction),
        )

    def entities_below(self, entities: tuple[int, ...]) -> NDArray[np.uint32]:
        """These entities and all below them, ascending."""
        return np.sort(self._tables.entity[self._tables.subtree(entities)])

    @property
    def switched_off(self) -> NDArray[np.uint32]:
        """The entities that are disabled, or below one that is, ascending."""
        return np.sort(self._tables.entity[~self._tables.enabled])

    def local_boxes(self, rows: Rows) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corners (N, 3) of a box along each of these instances' own axes, in its own space."""
        return self._lower[rows].astype(np.float64), self._upper[rows].astype(np.float64)

    @property
    def measured_rows(self) -> Rows:
        """The instances whose size is known."""
        return np.flatnonzero(self._is_measured)

    def instances_of(self, entities: tuple[int, ...]) -> Rows:
        """The instances of these entities and of all below them, ascending."""
        if not entities:
            return np.zeros(0, np.intp)
        return np.flatnonzero(self._tables.subtree(entities)[self._rows])

    def lights(self) -> list[PlacedLight]:
        """All lamps that are on."""
        first = self.instance_count
        return [self._placed_light(light, first + i) for i, light in enumerate(self._lights)]

    def surroundings(self, to_sun: NDArray[np.float64] | None) -> Surroundings:
        """What is all around, under a sun in that direction."""
        rotation = UNTURNED
        if self._environment is not None:
            item = self.instance_count + len(self._lights) + (self._camera is not None)
            turned = _axes(self._placement.linear[item].astype(np.float64))
            rotation = np.asarray(quaternion.from_matrix(turned), np.float64)
        return surroundings_of(self._settings, self._environment, rotation, to_sun, self.assets)

    def camera(self, aspect: float = 16 / 9) -> ViewCamera:
        """The view of the scene's enabled camera of highest priority, or one that shows everything."""
        if self._camera is None:
            return framing_camera(*self.bounds(), aspect=aspect)
        item = self.instance_count + len(self._lights)
        rotation = quaternion.from_matrix(_axes(self._placement.linear[item].astype(np.float64)))
        return camera_of(self._camera, tuple(self._placement.position[item].tolist()), tuple(rotation.tolist()))

    @property
    def has_camera(self) -> bool:
        """Whether the scene says from where it wants to be seen."""
        return self._camera is not None

    def bounds(self, rows: Rows | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corners (3,) of a box around instances, all by default, but without what dwarfs the others, as a floor does."""
        chosen = np.flatnonzero(self._is_measured) if rows is None else rows[self._is_measured[rows]]
        if not len(chosen):
            return np.full(3, np.inf), np.full(3, -np.inf)
        fitting = chosen[without_giants(self.centre[chosen], self.radius[chosen].astype(np.float64))]
        lower, upper = self.boxes(fitting)
        return lower.min(axis=0), upper.max(axis=0)

    def boxes(self, rows: Rows) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corners (N, 3) of a box along the world's axes around each of these instances."""
        world_from_local = np.append(self.linear[rows], self.position[rows, :, None], axis=2)
        lower, upper = transform_bounds(world_from_local, self._lower[rows], self._upper[rows])
        return np.asarray(lower, np.float64), np.asarray(upper, np.float64)

    # --- inside ----------------------------------------------------------------------------------------------------

    def _rebuild(self) -> None:
        tables = self._tables
        self._settings = tables.settings if self._has_environment else _without_environment(tables.settings)
        self._assets_version = self.assets.version
        self._gather_instances(tables)
        lights = [row for row in tables.lights if tables.enabled[row]]
        cameras = [row for row in tables.cameras if tables.enabled[row]]
        # max keeps the first of equals: the one that stands first in the scene.
        chosen = [max(cameras, key=self._camera_rank)] if cameras else []
        around = [row for row in tables.environments if tables.enabled[row] and self._has_environment][:1]
        self._environment: Environment | None = tables.environments[around[0]] if around else None
        self._lights = [tables.lights[row] for row in lights]
        self._camera: Camera | None = tables.cameras[chosen[0]] if chosen else None
        others = np.array(lights + chosen + around, np.intp)
        self._items = np.concatenate([self._stand_rows, others, self._deformation.joint_rows])
        self.scene_version += 1
        self._place_anew()

    def _camera_rank(self, row: int) -> tuple[bool, float]:
        tables = self._tables
        return int(tables.entity[row]) == self._preferred_camera, tables.cameras[row].priority

    def _place_anew(self) -> None:
        newest, nobody = self.timeline.newest, np.zeros(0, np.uint32)
        self._bodies = newest.entity if newest is not None else nobody
        self._animated = newest.local_entity if newest is not None else nobody
        self._placement = Placement(self._tables, self._items, self._bodies, self._animated)
        articulated = self._placement.articulated
        articulated = articulated[articulated < self.instance_count]
        self._stretching = np.setdiff1d(articulated, self._deformation.bent)
        self._placement.follow(self.timeline, 1.0)
        self._placed, self._rests = (-1, -1.0), False
        self._measure_instances()
        self._deform(1.0)
        self._centre()
        self.pose_version += 1

    def _gather_instances(self, tables: SceneTables) -> None:
        """Finds the visible, sorts them into batches and keeps what does not change with time."""
        mirrored = _is_mirrored(tables)
        bent, morphed = bent_rows(tables, self.assets), morphed_rows(tables, self.assets)
        grouped: dict[tuple[str, Look], list[tuple[int, Material]]] = {}
        for row, renderer in tables.meshes.items():
            if not (renderer.visible and tables.enabled[row]):
                continue
            mesh, material = renderer.mesh, tables.materials.get(row, PLAIN)
            if mesh in self.assets.failed:
                mesh, material = "box", MISSING
            look = look_of(material, bool(bent[row].is_mirrored if row in bent else mirrored[row]), renderer.tangents)
            if row in bent or row in morphed:
                look = look._replace(is_skinned=row in bent, is_morphed=row in morphed)
            grouped.setdefault((mesh, look), []).append((row, material))
        batches: list[Batch] = []
        members: list[tuple[int, Material]] = []
        for mesh, look in sorted(grouped, key=lambda key: key[1].alpha_mode == "blend"):
            batches.append(Batch(mesh, look, len(members), len(grouped[mesh, look])))
            members += grouped[mesh, look]
        rows = [row for row, _ in members]
        self.batches = tuple(batches)
        self._rows = np.array(rows, np.intp)
        self._deformation = Deformation(tables, rows, bent, morphed, self.assets)
        self.pose = self._deformation.pose
        self._stand_rows = np.array([bent[row].root if row in bent else row for row in rows], np.intp)
        self.entity = tables.entity[self._rows]
        self.batch_of = np.repeat(np.arange(len(batches)), [batch.instance_count for batch in batches])
        self.surface = _surfaces([material for _, material in members])
        self.casts = np.array([tables.meshes[row].cast_shadows for row in rows], np.bool_)

    def _measure_instances(self) -> None:
        extents = [self.assets.extent_of(batch.mesh) for batch in self.batches]
        of_batch = self.batch_of
        self._lower = np.array([extent.lower for extent in extents], np.float32).reshape(-1, 3)[of_batch]
        self._upper = np.array([extent.upper for extent in extents], np.float32).reshape(-1, 3)[of_batch]
        self._rest_lower, self._rest_upper = self._lower.copy(), self._upper.copy()
        self._is_measured = np.array([extent is not UNKNOWN_EXTENT for extent in extents], np.bool_)[of_batch]
        self._extent_radius = np.array([extent.radius for extent in extents], np.float32)[of_batch]
        linear = self._tables.world_from_local[self._rows, :, :3]
        self.radius = self._radii(np.arange(len(of_batch)), linear)
        self._find_middles()
        is_even = evenly_scaled(linear)
        is_even[self._stretching] = False  # their scale may be animated
        terms = terms_of_batches(np.array([batch.first for batch in self.batches], np.intp), self.surface, is_even)
        self.batches = tuple(batch._replace(terms=found) for batch, found in zip(self.batches, terms, strict=True))

    def _radii(self, rows: Rows, linear: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
        """Of spheres around instances (N,) that are scaled and sheared so (N, 3, 3)."""
        gram = np.einsum("nki,nkj->nij", linear, linear)
        # A scale alone leaves the Gram matrix diagonal; with shear its row sums bound the largest eigenvalue (Gershgorin).
        stretch = np.sqrt(np.abs(gram).sum(axis=2).max(axis=1, initial=0.0))
        # What is long and thin is better enclosed by its box; four of the corners do, the others lie opposite.
        half = (self._upper[rows] - self._lower[rows]) / 2
        corners = np.einsum("nij,nkj->nki", linear, half[:, None, :] * _CORNER_SIGNS)
        corner = np.sqrt(np.einsum("nki,nki->nk", corners, corners).max(axis=1, initial=0.0))
        corner = np.where(self._is_measured[rows], corner, np.inf)
        return np.minimum(self._extent_radius[rows] * stretch, corner).astype(np.float32)

    def _deform(self, fraction: float) -> None:
        """Brings joints and weights, and the boxes around what they move, to where things are placed."""
        deformation = self._deformation
        if deformation.is_none:
            return
        morphed, bent = deformation.morphed, deformation.bent
        if len(morphed):
            deformation.morph(self.timeline, fraction)
            reach = deformation.reach[morphed]
            self._lower[morphed], self._upper[morphed] = (
                self._rest_lower[morphed] - reach,
                self._rest_upper[morphed] + reach,
            )
            self._extent_radius[morphed] = np.inf  # the box tells
            self.radius[morphed] = self._radii(morphed, self.linear[morphed])
        if len(bent):
            joints = slice(len(self._items) - len(deformation.joint_rows), None)
            boxes = deformation.bend(self._placement.linear[joints], self._placement.position[joints], self.position)
            self.linear[bent] = np.eye(3)
            self._lower[bent], self._upper[bent] = boxes
            self.radius[bent] = np.linalg.norm(boxes[1] - boxes[0], axis=1) / 2
        self._find_middles()

    def _find_middles(self) -> None:
        """Whose boxes are not around their origins, and where the boxes' middles are."""
        middle = (self._lower + self._upper) / 2
        self._aside = np.flatnonzero(middle.any(axis=1))
        self._middle = middle[self._aside]

    def _centre(self) -> None:
        articulated = self._stretching
        if len(articulated):  # their scale may be animated
            self.radius[articulated] = self._radii(articulated, self.linear[articulated])
        columns = self.position.T.copy()
        if len(self._aside):
            columns[:, self._aside] += np.einsum("nij,nj->in", self.linear[self._aside], self._middle)
        self.centre = columns.T  # as columns, like positions

    def _placed_light(self, light: Light, item: int) -> PlacedLight:
        backward = self._placement.linear[item][:, 2].astype(np.float64)
        length = np.linalg.norm(backward)
        direction = -backward / length if length > 0 else np.array((0.0, 0.0, -1.0))
        return PlacedLight(light=light, position=self._placement.position[item], direction=direction)


def without_giants(centre: NDArray[np.float64], radius: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Who of N spheres is left without those that dwarf everything smaller together; all, if that leaves none."""
    everybody = np.ones(len(radius), np.bool_)
    # Only where sizes leap can a giant be: a sphere's own box reaches sqrt(3) times its radius.
    if radius.max(initial=0.0) <= GIANT * math.sqrt(3.0) * radius.min(initial=np.inf):
        return everybody
    sizes = np.sort(radius)
    for last in np.flatnonzero(sizes[1:] > GIANT * math.sqrt(3.0) * sizes[:-1]).tolist():
        smaller = radius <= sizes[last]
        reach = radius[smaller, None]
        box = (centre[smaller] + reach).max(axis=0) - (centre[smaller] - reach).min(axis=0)
        if sizes[last + 1] > GIANT * np.linalg.norm(box) / 2:
            # One pebble does not make the house a giant: at least a few things must be left.
            return smaller if last + 1 >= min(4, len(radius)) else everybody
    return everybody


def _without_environment(settings: SceneSettings) -> SceneSettings:
    return msgspec.structs.replace(settings, background=BLACK, ambient=BLACK)


def _surfaces(materials: list[Material]) -> NDArray[np.float32]:
    """The numbers (M, 3, 4) of one material an instance; the same material is looked at once."""
    rows = {material: row for row, material in enumerate(dict.fromkeys(materials))}
    table = np.array([_surface(material) for material in rows], np.float32).reshape(-1, 3, 4)
    return table[np.array([rows[material] for material in materials], np.intp)]


def _surface(material: Material) -> tuple[tuple[float, ...], ...]:
    opacity = 1.0 if material.alpha_mode == "opaque" else material.opacity
    return (
        (*material.base_color, opacity),
        (*material.emissive, material.alpha_cutoff),
        (material.metallic, material.roughness, 0.0, 0.0),
    )


def _is_mirrored(tables: SceneTables) -> NDArray[np.bool_]:
    return np.asarray(np.linalg.det(tables.world_from_local[:, :, :3]) < 0)


def _axes(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation in a transform whose scale does not matter, as a camera's."""
    length = np.linalg.norm(linear, axis=0)
    return linear / np.where(length > 0, length, 1.0)
