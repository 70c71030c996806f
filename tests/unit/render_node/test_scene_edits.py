"""What edits leave of a world, beside one that is made anew of the same scene: equal to the last bit, and at what cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.bus.messages.scene import (
    ComponentRemoved,
    ComponentSet,
    Despawned,
    EnabledSet,
    Renamed,
    Reparented,
    SceneChange,
    SceneDelta,
    SettingsSet,
    Spawned,
)
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.common.assets import AssetStore, encode_mesh
from elys.common.assets.skin import SkinBinding, encode_skin
from elys.common.components import Camera, Component, Environment, Light, Material, MeshRenderer, Skin, Transform
from elys.common.scene import SceneSettings
from elys.render_node import render_world, scene_reader
from elys.render_node.caster_bounds import caster_bounds
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import Context
from elys.render_node.quality import FULL
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_reader import SceneReader
from elys.render_node.scene_tables import SceneTables, tables_of_mirror
from tests.unit.render_node.test_deformation import BIND, tube

WIDTH, HEIGHT = 120, 80
TICK = 1 / 60
LIGHT = Rotation.from_rotvec((0.9, 0.3, 0.1)).as_matrix()
MESHES = ("box", "sphere", "cone")


class Edited:
    """A scene that is edited change by change, and a world that follows it."""

    def __init__(self, seed: int = 0, *, exact: bool = False, assets: DrawableAssets | None = None) -> None:
        self.random = np.random.default_rng(seed)
        self.mirror = SceneMirror()
        self.assets = assets
        self.world = RenderWorld(assets, exact_bounds=exact)
        self.reader = SceneReader(self.mirror)
        self.next = 1
        self.frames: list[StateFrame] = []
        self.poses: dict[int, tuple[int, Any, Any]] = {}  # of bodies, and the scene delta that put them there

    def change(self, *changes: SceneChange) -> None:
        sequence = self.mirror.sequence + 1
        self.mirror.apply_delta(SceneDelta(epoch=0, sequence=sequence, tick=0, changes=changes))

    def add(self, *components: Component, parent: int = 0, name: str = "") -> int:
        entity, self.next = self.next, self.next + 1
        values = {type(value).__name__: msgspec.structs.asdict(value) for value in components}
        self.change(Spawned(entity=entity, name=name or f"e{entity}", parent=parent, enabled=True, components=values))
        return entity

    def set(self, entity: int, component: Component) -> None:
        values = msgspec.structs.asdict(component)
        self.change(ComponentSet(entity=entity, component=type(component).__name__, values=values))

    def read(self) -> RenderWorld:
        self.world.read_scene(self.reader)
        self.world.place(simulation_time=self.moment)
        return self.world

    def anew(self, *, exact: bool = False) -> RenderWorld:
        """Another world of the same scene at the same moment."""
        world = RenderWorld(self.assets, exact_bounds=exact)
        world.timeline = self.world.timeline
        world.set_scene(tables_of_mirror(self.mirror))
        world.place(simulation_time=self.moment)
        return world

    @property
    def moment(self) -> float | None:
        return self.frames[-1].simulation_time - TICK / 3 if self.frames else None

    def having(self, kind: type[Component]) -> list[int]:
        return [entity.id for entity in self.mirror.entities.values() if kind.__name__ in entity.components]

    # --- by chance -------------------------------------------------------------------------------------------------

    def transform(self) -> Transform:
        random = self.random
        scale = np.full(3, random.choice((0.5, 1.0, 1.0, 2.0)))
        if random.random() < 0.3:
            scale = random.uniform(0.3, 1.5, 3) * random.choice((1, 1, 1, -1))
        rotation = Rotation.random(random_state=int(random.integers(1 << 30))).as_quat()
        place, turn, size = (tuple(value.tolist()) for value in (random.uniform(-3, 3, 3), rotation, scale))
        return Transform(position=place, rotation=turn, scale=size)

    def material(self) -> Material:
        random = self.random
        structure: dict[str, Any] = {}
        if random.random() < 0.15:
            structure = {"alpha_mode": str(random.choice(("blend", "mask"))), "clearcoat": float(random.random() < 0.3)}
        return Material(
            base_color=tuple(random.random(3).tolist()),
            opacity=float(random.choice((0.4, 1.0))),
            metallic=float(random.choice((0.0, 0.7))),
            roughness=float(random.random()),
            emissive=tuple((random.random(3) * (random.random() < 0.3)).tolist()),
            **structure,
        )

    def light(self) -> Light:
        random = self.random
        kind = random.choice(("directional", "point", "spot"))
        return Light(kind=kind, intensity=float(random.uniform(0, 4)), color=tuple(random.random(3).tolist()))

    def populate(self, count: int) -> None:
        for _ in range(count):
            self.spawn()
        for kind in (self.light, self.light, Camera, lambda: Camera(priority=1)):
            self.add(self.transform(), kind())
        self.add(Transform(), Environment(kind="color", intensity=0.3))
        self.add(Transform(position=(0.0, -5.0, 0.0), scale=(900.0, 0.1, 900.0)), MeshRenderer(mesh="box"), Material())

    def spawn(self) -> None:
        parent = self.some(Transform) if self.mirror.entities and self.random.random() < 0.4 else 0
        renderer = MeshRenderer(mesh=str(self.random.choice(MESHES)), cast_shadows=bool(self.random.random() < 0.7))
        self.add(self.transform(), renderer, self.material(), parent=parent)

    def some(self, kind: type[Component]) -> int:
        return int(self.random.choice(self.having(kind)))

    def edit(self, *, structure: float) -> None:
        """One edit; with that chance one that changes who is drawn with whom."""
        random = self.random
        if random.random() < structure:
            self.restructure()
            return
        match random.integers(8):
            case 0 | 1 | 2:
                self.set(self.some(Transform), self.transform())
            case 3 | 4:
                self.set(self.some(Material), self.material())
            case 5:
                self.set(self.some(Light), self.light())
            case 6:
                self.set(self.some(Camera), Camera(field_of_view=0.5, priority=int(random.integers(3))))
            case 7:
                self.set(self.some(Environment), Environment(kind="color", intensity=float(random.random())))

    def restructure(self) -> None:
        entity = self.some(Transform)
        match self.random.integers(8):
            case 0:
                self.spawn()
            case 1 if len(self.having(MeshRenderer)) > 3 and not self.mirror.entities[entity].children:
                if {"MeshRenderer"} <= self.mirror.entities[entity].components.keys():
                    self.change(Despawned(entity=entity))
            case 2:
                below = self.mirror.descendants(entity)
                parents = [0, *(other for other in self.having(Transform) if other not in below)]
                self.change(Reparented(entity=entity, parent=int(self.random.choice(parents)), index=0))
            case 3:
                self.change(EnabledSet(entity=entity, enabled=bool(self.random.random() < 0.6)))
            case 4:
                self.change(ComponentRemoved(entity=self.some(MeshRenderer), component="Material"))
                self.set(self.some(MeshRenderer), self.material())
            case 5:
                self.set(self.some(MeshRenderer), MeshRenderer(mesh=str(self.random.choice(MESHES))))
            case 6:
                self.change(SettingsSet(settings=SceneSettings(ambient=tuple(self.random.random(3).tolist()))))
            case 7:
                self.change(Renamed(entity=entity, name=f"n{self.random.integers(99)}"))

    def step(self, bodies: list[int], animated: list[int], *, is_at_rest: bool) -> None:
        """A state frame that knows of the edits so far, or not yet: then bodies go on from where they were."""
        tick, random, mirror = len(self.frames), self.random, self.mirror
        known = [entity for entity in bodies if entity in mirror.entities]
        led = [entity for entity in animated if entity in mirror.entities]
        before = self.frames[-1].delta_sequence if self.frames else 0
        sequence = max(mirror.sequence - int(random.integers(3)), before)
        for entity in known:
            told, place, turn = self.poses.get(entity, (-1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
            if told < mirror.entities[entity].pose_sequence <= sequence or told < 0:
                place, turn, _ = mirror.world_pose(entity)
                told = mirror.entities[entity].pose_sequence
            if not is_at_rest:
                spin = Rotation.from_quat(turn) * Rotation.from_rotvec(random.normal(size=3) * 0.1)
                place, turn = (
                    tuple(np.add(place, random.normal(size=3) * 0.02).tolist()),
                    tuple(spin.as_quat().tolist()),
                )
            self.poses[entity] = (told, place, turn)
        nothing = np.zeros((len(known), 3), np.float32)
        self.frames.append(
            StateFrame(
                epoch=0,
                tick=tick,
                simulation_time=tick * TICK,
                published_at=tick + 1,
                delta_sequence=sequence,
                state_hash=0,
                playing=True,
                position=np.array([self.poses[entity][1] for entity in known]).reshape(-1, 3),
                rotation=np.array([self.poses[entity][2] for entity in known], np.float32).reshape(-1, 4),
                linear_velocity=nothing,
                angular_velocity=nothing,
                entity=np.array(known, np.uint32),
                local_entity=np.array(led, np.uint32),
                local_position=random.normal(size=(len(led), 3)).astype(np.float32),
                local_rotation=np.tile(np.array((0, 0, 0, 1), np.float32), (len(led), 1)),
                local_scale=np.ones((len(led), 3), np.float32),
            )
        )
        self.world.take_state(self.frames[-1], tick * TICK)


def assert_same_tables(found: SceneTables, expected: SceneTables) -> None:
    for name in (field.name for field in fields(SceneTables)):
        one, other = getattr(found, name), getattr(expected, name)
        if isinstance(one, dict):
            assert list(one.items()) == list(other.items()), name
        elif name in ("local", "levels"):
            assert len(one) == len(other)
            for column, same in zip(one, other, strict=True):
                np.testing.assert_array_equal(column, same, name)
        elif isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, other, name)
        else:
            assert one == other, name


def assert_same_world(found: RenderWorld, expected: RenderWorld, *, exact: bool) -> None:
    assert found.batches == expected.batches
    assert found.settings == expected.settings
    for name in ("rows", "stand_rows", "entity", "batch_of", "surface", "casts", "first_blended"):
        np.testing.assert_array_equal(getattr(found.instances, name), getattr(expected.instances, name), name)
    items, same = found.standing.card_rows(), expected.standing.card_rows()
    np.testing.assert_array_equal(items.items, same.items)
    assert items.rides == same.rides
    for name in ("position", "linear", "centre", "radius"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), name)
    for name in ("lower", "upper", "radius", "is_measured", "is_even", "aside", "middle"):
        np.testing.assert_array_equal(getattr(found.extents, name), getattr(expected.extents, name), name)
    np.testing.assert_array_equal(found.standing.led, expected.standing.led)
    np.testing.assert_array_equal(found.standing.led_centre, expected.standing.led_centre)
    np.testing.assert_array_equal(found.standing.led_texels, expected.standing.led_texels)
    for lamp, other in zip(found.lights(), expected.lights(), strict=True):
        assert lamp.light == other.light
        np.testing.assert_array_equal(lamp.position, other.position)
        np.testing.assert_array_equal(lamp.direction, other.direction)
    assert found.camera() == expected.camera()
    assert found.surroundings(None).key == expected.surroundings(None).key
    assert_same_crowd(found, expected, exact=exact)


def assert_same_crowd(found: RenderWorld, expected: RenderWorld, *, exact: bool) -> None:
    crowd, other = found.crowd, expected.crowd
    is_still = found.timeline.newest is None
    if is_still or exact:
        assert_same_shadows(found, expected)
    if (is_still and exact) or (not crowd.is_grouped and (is_still or exact)):  # groups stay while their members go
        for name in ("centre", "radius", "batch", "casts", "size"):
            np.testing.assert_array_equal(getattr(crowd, name), getattr(other, name), name)
    assert_groups_hold_their_members(found)


def assert_same_shadows(found: RenderWorld, expected: RenderWorld) -> None:
    bounds = (caster_bounds(world.crowd, LIGHT) for world in (found, expected))
    for one, other in zip(*bounds, strict=True):
        np.testing.assert_array_equal(one, other)


def assert_groups_hold_their_members(world: RenderWorld) -> None:
    crowd, everybody = world.crowd, []
    for group in range(len(crowd.size)):
        rows = crowd.listed(np.array([group])).astype(int)
        far = np.linalg.norm(world.centre[rows] - crowd.centre[:, group], axis=1) + world.radius[rows]
        assert far.max() <= crowd.radius[group] * (1 + 1e-5) + 1e-6
        everybody += rows.tolist()
    assert sorted(everybody) == list(range(world.instances.first_blended))


@pytest.mark.parametrize("structure", [0.0, 0.15])
@pytest.mark.parametrize("seed", range(6))
def test_a_world_that_was_edited_is_the_one_that_is_made_anew(seed: int, structure: float) -> None:
    scene = Edited(seed)
    scene.populate(25)
    scene.read()
    for _ in range(40):
        for _ in range(int(scene.random.integers(1, 4))):
            scene.edit(structure=structure)
        world = scene.read()
        assert_same_tables(world._tables, tables_of_mirror(scene.mirror))
        assert_same_world(world, scene.anew(), exact=False)


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_so_it_is_while_bodies_and_animations_move(seed: int, exact: bool) -> None:
    scene = Edited(seed, exact=exact)
    scene.populate(25)
    bodies, animated = scene.having(MeshRenderer)[0:20:3], scene.having(MeshRenderer)[1:20:7]
    scene.read()
    for round_ in range(40):
        for _ in range(int(scene.random.integers(0, 3))):
            scene.edit(structure=0.05)
        world = scene.read()
        if scene.random.random() < 0.6:
            scene.step(bodies, animated, is_at_rest=round_ % 20 > 12)
            world = scene.read()
        assert_same_world(world, scene.anew(exact=exact), exact=exact)


@pytest.mark.parametrize("exact", [False, True])
def test_so_it_is_where_neighbours_are_told_by_groups(exact: bool) -> None:
    scene = Edited(2, exact=exact)
    scene.populate(700)
    bodies = scene.having(MeshRenderer)[0:600:3]
    scene.read()
    for round_ in range(12):
        for _ in range(9):
            scene.edit(structure=0.0)
        scene.read()
        if round_ > 3:
            scene.step(bodies, [], is_at_rest=False)
        assert_same_world(scene.read(), scene.anew(exact=exact), exact=exact)


def test_groups_hold_all_their_members_wherever_these_are_edited_to() -> None:
    scene = Edited(3)
    scene.populate(700)
    scene.read()
    for _ in range(12):
        for _ in range(9):
            scene.set(scene.some(MeshRenderer), scene.transform())
        world = scene.read()
        assert_groups_hold_their_members(world)
        assert_same_shadows(world, scene.anew())


def test_who_was_put_by_hand_is_measured_when_frames_know_of_it(make_frame: Callable[..., StateFrame]) -> None:
    """Though none of them tells of a body that has moved."""
    scene = Edited()
    body = scene.add(Transform(), MeshRenderer())
    scene.add(Transform(position=(50.0, 0.0, 0.0)), MeshRenderer())
    world = scene.read()
    for tick, knows in enumerate((True, True, False, False, True)):
        if tick == 2:
            scene.set(body, Transform(position=(9.0, 0.0, 0.0)))
        sequence = scene.mirror.sequence - (not knows)
        frame = make_frame({body: (0.0, 0.0, 0.0)}, tick=tick, published_at=tick, delta_sequence=sequence)
        scene.read()
        world.take_state(frame, tick * TICK)
        world.place(tick * TICK + TICK / 2)
        assert world.position[0, 0] == (0.0 if knows else 9.0)
        assert_groups_hold_their_members(world)


def test_edits_of_joints_and_of_who_is_bent_are_followed() -> None:
    store = AssetStore()
    mesh = store.put(encode_mesh(tube()), kind="mesh")
    binding = SkinBinding(joints=(("A",), ("A", "B")), joint_from_mesh=BIND.astype(np.float32))
    assets = DrawableAssets(store.get)
    scene = Edited(4, assets=assets)
    root = scene.add(Transform(), name="Root")
    joint = scene.add(Transform(), parent=root, name="A")
    tip = scene.add(Transform(position=(0.0, 1.0, 0.0)), parent=joint, name="B")
    skin = Skin(skin=store.put(encode_skin(binding), kind="skin"), root=root)
    bent = scene.add(Transform(), MeshRenderer(mesh=mesh), Material(), skin, parent=root)
    scene.populate(10)
    for _ in range(2):  # the mesh, then what names it
        scene.read()
        assets.settle()
    assert len(scene.read().instances.deformation.bent) == 1
    for entity in (root, joint, tip, bent, *scene.having(MeshRenderer), root, joint):
        scene.set(entity, scene.transform())
        world, expected = scene.read(), scene.anew()
        assert_same_world(world, expected, exact=False)
        np.testing.assert_array_equal(world.pose_texels, expected.pose_texels)


@pytest.fixture(scope="module")
def two(context: Context) -> tuple[Renderer, Renderer]:
    """One for a world that is edited, which keeps what it drew before, and one for worlds that are made anew."""
    return Renderer(context, quality=FULL), Renderer(context, quality=FULL)


@pytest.mark.parametrize("structure", [0.0, 0.15])
def test_pictures_after_edits_are_those_of_a_scene_made_anew(two: tuple[Renderer, Renderer], structure: float) -> None:
    scene = Edited(7)
    scene.populate(25)
    scene.set(scene.having(Camera)[0], Camera(priority=9))
    scene.set(scene.having(Camera)[0], Transform(position=(0.0, 1.0, 9.0)))
    for _ in range(25):
        for _ in range(int(scene.random.integers(1, 3))):
            scene.edit(structure=structure)
        pictures = [drawn(renderer, world) for renderer, world in zip(two, (scene.read(), scene.anew()), strict=True)]
        np.testing.assert_array_equal(*pictures)


def test_pictures_between_frames_are_those_of_a_scene_made_anew(two: tuple[Renderer, Renderer]) -> None:
    scene = Edited(8, exact=True)
    scene.populate(25)
    bodies, animated = scene.having(MeshRenderer)[0:20:3], scene.having(MeshRenderer)[1:20:7]
    scene.read()
    for round_ in range(25):
        scene.edit(structure=0.0)
        scene.read()
        if round_ % 3:
            scene.step(bodies, animated, is_at_rest=round_ > 15)
        worlds = scene.read(), scene.anew(exact=True)
        np.testing.assert_array_equal(*(drawn(renderer, world) for renderer, world in zip(two, worlds, strict=True)))


def drawn(renderer: Renderer, world: RenderWorld) -> np.ndarray:
    renderer.settle(world)
    return renderer.read_pixels(renderer.draw(world, world.camera(WIDTH / HEIGHT), WIDTH, HEIGHT))


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Callable[[], list[str]]:
    """What was made anew as a whole since it was asked last."""
    made: list[str] = []

    def counting(name: str, make: Callable[..., Any]) -> Callable[..., Any]:
        def call(*values: Any, **options: Any) -> Any:
            made.append(name)
            return make(*values, **options)

        return call

    monkeypatch.setattr(scene_reader, "tables_of_mirror", counting("tables", scene_reader.tables_of_mirror))
    for kind in ("Instances", "Standing"):
        monkeypatch.setattr(render_world, kind, counting(kind, getattr(render_world, kind)))
    return lambda: [made.pop(0) for _ in range(len(made))]


def test_an_edit_makes_nothing_anew_that_it_does_not_touch(counted: Callable[[], list[str]]) -> None:
    scene = Edited()
    parent = scene.add(Transform(), MeshRenderer(), Material())
    scene.add(Transform(), MeshRenderer(mesh="sphere"), Material(alpha_mode="blend"), parent=parent)
    lamp = scene.add(Transform(), Light())
    eye = scene.add(Transform(), Camera())
    world = scene.read()
    versions = world.scene_version, len(counted()) > 0
    for entity, component in (
        (parent, Material(base_color=(1.0, 0.0, 0.0), roughness=0.2, metallic=1.0, emissive=(0.0, 1.0, 0.0))),
        (parent, Transform(position=(1.0, 2.0, 3.0), scale=(1.0, 2.0, 1.0))),
        (lamp, Light(intensity=9.0, kind="spot")),
        (lamp, Transform(position=(1.0, 2.0, 3.0))),
        (eye, Camera(field_of_view=0.3)),
        (eye, Transform(position=(1.0, 2.0, 3.0))),
    ):
        value, pose = world.value_version, world.pose_version
        scene.set(entity, component)
        scene.read()
        assert counted() == [], component
        assert world.value_version > value
        assert (world.pose_version > pose) == (entity == parent and isinstance(component, Transform))
    assert versions == (world.scene_version, True)
    assert "METALLIC" in world.batches[0].terms
    for change, made in (
        (Material(alpha_mode="mask"), ["Instances", "Standing"]),
        (Material(clearcoat=1.0), ["Instances", "Standing"]),
        (Transform(scale=(-1.0, 1.0, 1.0)), ["Instances", "Standing"]),
        (MeshRenderer(mesh="cone"), ["tables", "Instances", "Standing"]),
    ):
        scene.set(parent, change)
        scene.read()
        assert counted() == made


def test_the_holes_of_a_mask_are_holes_of_its_shadow_as_well() -> None:
    scene = Edited()
    leaf = scene.add(Transform(), MeshRenderer(), Material(alpha_mode="mask", opacity=0.6))
    world = scene.read()
    before = world.pose_version
    scene.set(leaf, Material(alpha_mode="mask", opacity=0.4))
    assert scene.read().pose_version > before


def test_the_card_is_sent_what_changed() -> None:
    scene = Edited()
    for _ in range(9):
        scene.add(Transform(), MeshRenderer(), Material())
    rows = scene.read().standing.card_rows()
    seen = rows.version
    scene.set(3, Transform(position=(1.0, 0.0, 0.0)))
    scene.set(5, Material(roughness=0.1))
    scene.read()
    scene.set(3, Material(roughness=0.2))
    scene.read()
    np.testing.assert_array_equal(rows.changed_since(seen), [2, 4])
    assert rows.changed_since(seen - 1) is None
    for _ in range(99):
        scene.set(3, Material(roughness=scene.random.random()))
        scene.read()
    assert rows.changed_since(seen) is None
