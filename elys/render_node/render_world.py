"""The scene as a renderer wants it: instances by mesh and material, lamps, cameras, and where all of it stands right now.

    SceneTables ──rebuild──> batches, rows for the card        only when who is drawn with whom has changed
    SceneEdits  ──edit─────> the rows that they touch
    StateFrames ──place────> where who is led stands           each picture; all others are placed by the card

Instances stand in the order of their batches, opaque ones first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import ViewCamera
from elys.common.components import Light
from elys.common.components.curve import repeated_value_at
from elys.common.math import quaternion
from elys.common.math.aabb import transform_bounds
from elys.common.scene import SceneSettings
from elys.render_node.camera import camera_of, framing_camera
from elys.render_node.crowd import Crowd, without_giants
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.extents import Extents
from elys.render_node.fixtures import Fixtures
from elys.render_node.instance_rows import InstanceRows
from elys.render_node.instances import Batch, Instances
from elys.render_node.scene_reader import SceneEdits, SceneReader
from elys.render_node.scene_tables import Rows, SceneTables, tables_of
from elys.render_node.standing import Standing
from elys.render_node.surroundings import Surroundings, surroundings_of
from elys.render_node.timeline import Timeline

BLACK: Final = (0.0, 0.0, 0.0)
UNTURNED: Final = np.array((0.0, 0.0, 0.0, 1.0))


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
        instances: the M things that can be drawn. batches: runs of them. standing: where they are.
        scene_version: rises when batches change. pose_version: when anything stands elsewhere, or may throw another shadow there.
        value_version: when something was edited.
    """

    def __init__(
        self,
        assets: DrawableAssets | None = None,
        *,
        environment: bool = True,
        sampled: bool = False,
        exact_bounds: bool = False,
    ) -> None:
        """Without `environment` nothing but the scene's lamps and what glows gives light, whatever its settings say. `sampled`:
        light from around is sampled for each pixel, as `PictureSettings.sampled_surroundings` asks for.

        With `exact_bounds` maps of shadows are fitted to where things are, not to where they may be by now: a picture then does
        not depend on those before it, and costs some passes over all instances.
        """
        self._has_environment, self._is_sampled, self._has_exact_bounds = environment, sampled, exact_bounds
        self.assets = assets if assets is not None else DrawableAssets()
        self.timeline = Timeline()
        self._instance_rows = InstanceRows()
        self.batches: tuple[Batch, ...] = ()
        self.scene_version = 0
        self.pose_version = 0
        self.value_version = 0
        self._tables = tables_of([], [], [])
        self._bodies = self._animated = np.zeros(0, np.uint32)
        self._assets_version = -1
        self._placed = (-1, -1.0)
        self.player = 1  # whose cameras are looked through; said before there is a scene
        self._seen_time = 0.0  # [s] of the simulation, of what is placed
        self._rests = False  # placed as the newest frame says, not on the way there
        self._preferred_camera = 0
        self._rebuild()

    # --- feeding ---------------------------------------------------------------------------------------------------

    def set_scene(self, tables: SceneTables, edits: SceneEdits | None = None) -> None:
        """Takes the scene as it is now; with `edits` nothing but what these say, and settings, differs from the one before."""
        self._tables = tables
        if edits is None:
            self._rebuild()
        else:
            self._take_settings()
            self._edit(edits)

    def read_scene(self, reader: SceneReader) -> bool:
        """Takes what a reader has that is new; False if that is nothing."""
        read = reader.read()
        if read is None:
            return False
        self.set_scene(read.tables, read.edits)
        return True

    def take_state(self, frame: StateFrame, now: float = 0.0, *, first: float | None = None) -> bool:
        """Takes where bodies are, as it came at `now` [s], see `Timeline.take`; False if it told nothing new."""
        if not self.timeline.take(frame, now, first=first):
            return False
        self._place_others()
        return True

    def take_pair(self, before: StateFrame, after: StateFrame) -> None:
        """Takes the frames between which everything is to be placed, as of a ghost; one twice where it is the only one."""
        self.timeline.lay(before, after)
        self._rests = False
        if not (np.array_equal(after.entity, self._bodies) and np.array_equal(after.local_entity, self._animated)):
            self._place_anew()

    def forget_state(self) -> None:
        """Lets everything stand as the scene says, as when another host took over."""
        self.timeline.forget()
        self._place_anew()

    def place(self, now: float | None = None, *, simulation_time: float | None = None) -> None:
        """Moves everything to where it is between the newest two frames: at `now` [s] by the clock of `take_state`, or at a
        simulation time [s]; without either, exactly where the newest frame says.
        """
        self.place_if_assets_came()
        if self.timeline.newest is None:
            return
        if now is None:
            self.timeline.show_latest()
        fraction = 1.0 if now is None else self.timeline.fraction(now)
        if simulation_time is not None:
            fraction = self.timeline.fraction_at(simulation_time)
        self._seen_time = self.timeline.time_at(fraction)
        self._place_others()
        newest = self.timeline.newest
        moment = (newest.published_at, fraction)
        if moment == self._placed:
            return
        self._placed = moment
        rested, self._rests = self._rests, self.timeline.is_still or fraction == 1.0
        if rested and self.timeline.is_still:
            return  # everything stands where it was placed last
        self.standing.lead(fraction)
        self.pose_version += 1

    def _place_others(self) -> None:
        """Sees to it that those stand who are in the frame that is gone to."""
        newest = self.timeline.newest
        if newest is not None and not (
            np.array_equal(newest.entity, self._bodies) and np.array_equal(newest.local_entity, self._animated)
        ):
            self._place_anew()

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
    def seen_time(self) -> float | None:
        """The simulation time [s] at which everything is placed; None before there is any state."""
        return self.timeline.time_at(self.standing.fraction) if self.timeline.newest is not None else None

    @property
    def state_published_at(self) -> int:
        """Wall clock [ns] of the sender of the newest state, 0 before there is any."""
        return self.timeline.newest.published_at if self.timeline.newest is not None else 0

    @property
    def instance_count(self) -> int:
        """How many things can be drawn."""
        return len(self.instances.rows)

    @property
    def entity(self) -> NDArray[np.uint32]:
        """Of the instances (M,)."""
        return self.instances.entity

    @property
    def extents(self) -> Extents:
        """How large the instances are."""
        return self.standing.extents

    @property
    def pose_texels(self) -> NDArray[np.float32]:
        """What bends and morphs meshes (K, 4), see `deformation.py`."""
        return self.instances.deformation.texels

    @property
    def position(self) -> NDArray[np.float64]:
        """World positions [M, 3] of the instances' origins [m]; worked out when asked for."""
        return self.standing.everybody.position

    @property
    def linear(self) -> NDArray[np.float32]:
        """Rotation and scale [M, 3, 3] of world_from_local; worked out when asked for."""
        return self.standing.everybody.linear

    @property
    def centre(self) -> NDArray[np.float64]:
        """Middles [M, 3] of spheres of `radius` around the instances [m]; worked out when asked for."""
        return self.standing.middles(self.standing.everybody)

    @property
    def radius(self) -> NDArray[np.float32]:
        """[M] [m]"""
        return self.extents.radius

    @property
    def crowd(self) -> Crowd:
        """The solid instances in groups, with bounds that hold for where they are."""
        return self.standing.crowd(exact=self._has_exact_bounds)

    def bodies(self) -> Bodies:
        """What moves, where it is seen now; nobody before there is any state."""
        newest = self.timeline.newest
        if newest is None:
            return Bodies(np.zeros(0, np.uint32), np.zeros((0, 3)), np.zeros((0, 3), np.float32), 0.0, -1)
        fraction = self.standing.fraction
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
        return self.extents.lower[rows].astype(np.float64), self.extents.upper[rows].astype(np.float64)

    @property
    def measured_rows(self) -> Rows:
        """The instances whose size is known."""
        return np.flatnonzero(self.extents.is_measured)

    def instances_of(self, entities: tuple[int, ...]) -> Rows:
        """The instances of these entities and of all below them, ascending."""
        if not entities:
            return np.zeros(0, np.intp)
        return np.flatnonzero(self._tables.subtree(entities)[self.instances.rows])

    def lights(self) -> list[PlacedLight]:
        """All lamps that are on."""
        return [self._placed_light(light, number) for number, light in enumerate(self._fixtures.lights)]

    @property
    def sky_image(self) -> str:
        """The image all around, "" for none; it may not have come yet."""
        environment = self._fixtures.environment
        return environment.image if environment is not None and environment.kind == "image" else ""

    def surroundings(self, to_sun: NDArray[np.float64] | None) -> Surroundings:
        """What is all around, under a sun in that direction."""
        rotation, fixtures = UNTURNED, self._fixtures
        if fixtures.environment is not None:
            _, linear = self.standing.fixture(len(fixtures.lights) + (fixtures.camera is not None))
            turned = _axes(linear.astype(np.float64))
            rotation = np.asarray(quaternion.from_matrix(turned), np.float64)
        return surroundings_of(self._settings, fixtures.environment, rotation, to_sun, self.assets)

    def camera(self, aspect: float = 16 / 9) -> ViewCamera:
        """The view of the scene's enabled camera of highest priority, a player's own first; or one that shows everything."""
        fixtures = self._fixtures
        if fixtures.camera is None:
            return framing_camera(*self.bounds(), aspect=aspect)
        position, linear = self.standing.fixture(len(fixtures.lights))
        rotation = quaternion.from_matrix(_axes(linear.astype(np.float64)))
        return camera_of(fixtures.camera, tuple(position.tolist()), tuple(rotation.tolist()))

    @property
    def has_camera(self) -> bool:
        """Whether the scene says from where it wants to be seen."""
        return self._fixtures.camera is not None

    def bounds(self, rows: Rows | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corners (3,) of a box around instances, all by default, but without what dwarfs the others, as a floor does."""
        chosen = np.flatnonzero(self.extents.is_measured) if rows is None else rows[self.extents.is_measured[rows]]
        if not len(chosen):
            return np.full(3, np.inf), np.full(3, -np.inf)
        fitting = chosen[without_giants(self.centre[chosen], self.radius[chosen].astype(np.float64))]
        lower, upper = self.boxes(fitting)
        return lower.min(axis=0), upper.max(axis=0)

    def boxes(self, rows: Rows) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corners (N, 3) of a box along the world's axes around each of these instances."""
        world_from_local = np.append(self.linear[rows], self.position[rows, :, None], axis=2)
        lower, upper = transform_bounds(world_from_local, self.extents.lower[rows], self.extents.upper[rows])
        return np.asarray(lower, np.float64), np.asarray(upper, np.float64)

    # --- inside ----------------------------------------------------------------------------------------------------

    def _rebuild(self) -> None:
        self._assets_version = self.assets.version
        self._take_settings()
        self.instances = Instances(self._tables, self.assets)
        self.scene_version += 1
        self._place_anew()

    def _edit(self, edits: SceneEdits) -> None:
        """Takes an edit at the cost of what it touches, as far as batches stay what they are and nothing intricate moves."""
        tables, instances = self._tables, self.instances
        self.value_version += 1
        painted = instances.paint(tables, edits.materials)
        if painted is None or not instances.keeps_batches(tables, edits.moved):
            self._rebuild()
            return
        moved = self.standing.move(tables, edits.moved) if self._fixtures.follow(tables, edits) else None
        if moved is None:
            self._place_anew()
            return
        if len(painted):
            self._instance_rows.paint(instances, painted)
        self.batches = instances.with_terms_of(np.concatenate([painted, moved]), self.batches, self.extents.is_even)
        if len(moved) or any(self.batches[batch].look.alpha_mode == "mask" for batch in instances.batch_of[painted]):
            self.pose_version += 1

    def _take_settings(self) -> None:
        settings = self._tables.settings
        if not self._has_environment:
            settings = _without_environment(settings)
        self._settings = _with_sampled_light(settings) if self._is_sampled else settings

    def _place_anew(self) -> None:
        instances, newest = self.instances, self.timeline.newest
        nobody = np.zeros(0, np.uint32)
        self._bodies = newest.entity if newest is not None else nobody
        self._animated = newest.local_entity if newest is not None else nobody
        self._fixtures = Fixtures(
            self._tables,
            player=self.player,
            preferred=self._preferred_camera,
            has_environment=self._has_environment,
        )
        self.standing = Standing(
            self._tables, instances, self._fixtures.rows, self.timeline, self.assets, self._instance_rows
        )
        self.batches = instances.with_terms(self.extents.is_even)
        self._placed, self._rests = (-1, -1.0), False
        self.pose_version += 1

    def _placed_light(self, light: Light, number: int) -> PlacedLight:
        position, linear = self.standing.fixture(number)
        backward = linear[:, 2].astype(np.float64)
        length = np.linalg.norm(backward)
        direction = -backward / length if length > 0 else np.array((0.0, 0.0, -1.0))
        if light.over_time:
            factor = repeated_value_at(light.over_time, self._seen_time)
            # Between two keys a curve may fall below the values of both.
            light = msgspec.structs.replace(light, intensity=light.intensity * max(factor, 0.0))
        return PlacedLight(light=light, position=position, direction=direction)


def _without_environment(settings: SceneSettings) -> SceneSettings:
    return msgspec.structs.replace(settings, background=BLACK, ambient=BLACK)


def _with_sampled_light(settings: SceneSettings) -> SceneSettings:
    picture = msgspec.structs.replace(settings.picture, sampled_surroundings=True)
    return msgspec.structs.replace(settings, picture=picture)


def _axes(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation in a transform whose scale does not matter, as a camera's."""
    length = np.linalg.norm(linear, axis=0)
    return linear / np.where(length > 0, length, 1.0)
