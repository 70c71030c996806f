"""What a world's steps do and why; that each switch changes no bit, or how much it does where it must."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from elys.common.errors import PhysicsError
from elys.sim_node.physics import BOX, CAPSULE, KINEMATIC, SPHERE, STATIC, PhysicsSettings, PhysicsWorld, stepping
from elys.sim_node.physics.plan import SWITCH_FACTS
from elys.sim_node.physics.settings import SWITCHES

DT = 1.0 / 60.0
TICKS = 240
EXACT = [name for name in SWITCHES if SWITCH_FACTS[name].proof == "same bits"]


def on_ground(settings: PhysicsSettings, **surface) -> PhysicsWorld:
    """A world with a wide floor, entity 1, whose top is at height 0."""
    world = PhysicsWorld(settings)
    world.add_bodies([1], motion=STATIC, position=(0.0, -1.0, 0.0))
    world.add_colliders([1], size=(60.0, 2.0, 60.0), **surface)
    return world


def boxes(settings: PhysicsSettings) -> PhysicsWorld:
    """Towers of cubes, a heavy one on a light one among them, that come to rest and fall asleep."""
    world = on_ground(settings)
    entities = np.arange(2, 20)
    position = np.column_stack((3.0 * (entities // 6), 0.52 + 1.01 * (entities % 6), 0.01 * (entities % 3)))
    world.add_bodies(entities, position=position, mass=np.where(entities == 7, 300.0, 1.0))
    world.add_colliders(entities)
    return world


def balls(settings: PhysicsSettings) -> PhysicsWorld:
    """Balls that drop on one another and roll away."""
    world = on_ground(settings)
    entities = np.arange(2, 22)
    position = np.column_stack((0.3 * (entities % 4), 0.6 + 0.9 * (entities // 2), 0.2 * (entities % 3)))
    world.add_bodies(entities, position=position, angular_velocity=(1.0, 2.0, 0.0))
    world.add_colliders(entities, shape=SPHERE, radius=0.4)
    return world


def mixed(settings: PhysicsSettings) -> PhysicsWorld:
    """Boxes, balls and capsules of many sizes: bouncing, rolling with friction, one that only slides, past a trigger."""
    world = on_ground(settings, restitution=0.5)
    random = np.random.default_rng(5)
    entities = np.arange(2, 26)
    position = random.uniform(-1.5, 1.5, (24, 3)) * (1.0, 0.0, 1.0) + np.outer(
        1.0 + 0.6 * np.arange(24), (0.0, 1.0, 0.0)
    )
    world.add_bodies(entities, position=position, locked=np.outer(entities == 9, (0, 0, 0, 1, 1, 1)).astype(bool))
    shape = np.array((BOX, SPHERE, CAPSULE))[entities % 3]
    world.add_colliders(
        entities,
        shape=shape,
        size=random.uniform(0.3, 1.0, (24, 3)),
        radius=0.3,
        half_length=0.3,
        restitution=np.where(entities % 2, 0.5, 0.0),
        rolling_friction=np.where(entities % 5, 0.0, 0.02),
    )
    world.add_bodies([90], motion=STATIC, position=(0.0, 1.0, 0.0))
    world.add_colliders([90], size=(2.0, 1.0, 2.0), trigger=True)
    return world


def flyers(settings: PhysicsSettings) -> PhysicsWorld:
    """What tumbles freely for long before it lands, bullets, and a platform that moves by itself."""
    world = on_ground(settings)
    entities = np.arange(2, 8)
    position = np.column_stack((4.0 * np.arange(6) - 9.0, np.full(6, 12.0), np.zeros(6)))
    world.add_bodies(entities, position=position, angular_velocity=(3.0, 1.0, 0.5))
    world.add_colliders(entities, size=(0.3, 1.2, 0.5))
    world.add_bodies([20, 21], position=[[-15, 0.5, 0], [-15, 2, 1]], linear_velocity=(150.0, 0.0, 0.0))
    world.add_colliders([20, 21], shape=SPHERE, radius=0.05)
    world.add_bodies([22], motion=STATIC, position=(5.0, 2.0, 0.0))
    world.add_colliders([22], size=(0.1, 4.0, 4.0))
    world.add_bodies([23], motion=KINEMATIC, position=(0.0, 0.2, 5.0), linear_velocity=(0.4, 0.0, 0.0))
    world.add_colliders([23], size=(2.0, 0.4, 2.0))
    return world


def chains(settings: PhysicsSettings) -> PhysicsWorld:
    """A hanging chain beside loose cubes: islands with joints and without."""
    world = boxes(settings)
    links = np.arange(40, 46)
    world.add_bodies(links, position=np.column_stack((0.6 * np.arange(6) - 12.0, np.full(6, 5.0), np.zeros(6))))
    world.add_colliders(links, size=(0.5, 0.2, 0.2))
    anchors = np.column_stack((0.6 * np.arange(6) - 12.3, np.full(6, 5.0), np.zeros(6)))
    world.add_joints(links, kind="ball", entity_a=np.r_[0, links[:-1]], entity_b=links, anchor_a=anchors)
    return world


def scenery(settings: PhysicsSettings) -> PhysicsWorld:
    """Nothing dynamic."""
    world = on_ground(settings)
    world.add_bodies([2], motion=KINEMATIC, position=(0.0, 0.1, 0.0), linear_velocity=(0.2, 0.0, 0.0))
    world.add_colliders([2])
    return world


SCENES = (boxes, balls, mixed, flyers, chains, scenery)


def disturb(world: PhysicsWorld, tick: int) -> None:
    """What happens to a world from outside while it runs: it lands, sleeps, wakes, gains and loses bodies."""
    if tick == 100:
        world.add_bodies([200], position=(0.5, 9.0, 0.2))
        world.add_colliders([200], shape=SPHERE, radius=0.5)
    elif tick == 150:
        world.set_velocities([200], linear=(0.0, 3.0, 0.0))
    elif tick == 190:
        world.remove_bodies([200])


def hashes(scene, settings: PhysicsSettings) -> list[int]:
    """The state hash after each tick."""
    world = scene(settings)
    found = []
    for tick in range(TICKS):
        disturb(world, tick)
        world.step(DT)
        found.append(world.state_hash())
    return found


@pytest.fixture(scope="module")
def unforced():
    """The hashes of every scene as it is."""
    return {scene: hashes(scene, PhysicsSettings()) for scene in SCENES}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("switch", [name for name in EXACT if name != "shared_solver"])
def test_a_switch_changes_no_bit(switch, scene, unforced):
    assert hashes(scene, PhysicsSettings(forced=(switch,))) == unforced[scene]


@pytest.mark.parametrize("scene", SCENES)
def test_all_of_them_together_change_no_bit(scene, unforced):
    forced = tuple(name for name in EXACT if name != "shared_solver")
    assert hashes(scene, PhysicsSettings(forced=forced)) == unforced[scene]


@pytest.mark.parametrize("scene", [boxes, mixed, chains])
def test_two_threads_where_few_contacts_are_change_no_bit(scene, unforced, monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: {0, 1}, raising=False)
    assert hashes(scene, PhysicsSettings(threads=2, forced=("shared_solver",))) == unforced[scene]


@pytest.mark.parametrize("scene", [boxes, mixed, flyers])
def test_whether_events_are_told_changes_no_bit(scene, unforced):
    assert hashes(scene, PhysicsSettings(events=False)) == unforced[scene]
    assert hashes(scene, PhysicsSettings(events=False, forced=("contact_events",))) == unforced[scene]


@pytest.mark.parametrize(
    "switch, kernel",
    [
        ("polytopes", "update_manifolds"),
        ("overlap_check", "find_deep_overlaps"),
        ("solver", "solve_contacts"),
        ("joints", "solve_jointed_contacts"),
        ("continuous_collision", "stop_at_impacts"),
    ],
)
def test_what_is_forced_is_done(switch, kernel, monkeypatch):
    called = []
    function = getattr(stepping, kernel)
    monkeypatch.setattr(stepping, kernel, lambda *given: (called.append(kernel), function(*given))[1])
    for forced in ((), (switch,)):
        world = scenery(PhysicsSettings(forced=forced))
        world.step(DT)  # takes what is new
        called.clear()
        world.step(DT)
        assert bool(called) == bool(forced)
        stage = next(stage for stage in world.plan() if stage.name == switch)
        assert (stage.is_on, stage.is_forced) == (bool(forced), bool(forced))


# The error of an approximation is printed (pytest -s) and held against what it was measured to be, with room for ten times more.
# Scenes for it do not amplify: a heap that tumbles makes metres of any rounding.


def parted(scene, switch: str) -> tuple[float, float]:
    """The largest differences of positions [m] and of quaternions between a scene as it is and with a switch forced."""
    one, other = scene(PhysicsSettings()), scene(PhysicsSettings(forced=(switch,)))
    way = turn = 0.0
    for _ in range(TICKS):
        one.step(DT)
        other.step(DT)
        way = max(way, float(np.abs(one.bodies.position - other.bodies.position).max()))
        turn = max(turn, float(np.abs(one.bodies.rotation - other.bodies.rotation).max()))
    print(f"{switch}, {scene.__name__}, {TICKS * DT:.0f} s: {way:.1e} m, {turn:.1e}")
    return way, turn


def towers(settings: PhysicsSettings) -> PhysicsWorld:
    """Towers of up to ten cubes that stand, one with a cube of ten times the weight on top."""
    world = on_ground(settings)
    entities = np.arange(2, 32)
    place = np.arange(30)
    position = np.column_stack((3.0 * (place // 10), 0.5 + place % 10, np.zeros(30)))
    world.add_bodies(entities, position=position, mass=np.where(place == 19, 10.0, 1.0))
    world.add_colliders(entities)
    return world


def turning_cubes(settings: PhysicsSettings) -> PhysicsWorld:
    """Cubes that spin freely about every axis."""
    world = PhysicsWorld(settings)
    entities = np.arange(2, 12)
    spin = np.random.default_rng(4).uniform(-8.0, 8.0, (10, 3))
    world.add_bodies(entities, position=np.outer(entities, (2.0, 0.0, 0.0)), angular_velocity=spin)
    world.add_colliders(entities)
    return world


def rolling_balls(settings: PhysicsSettings) -> PhysicsWorld:
    """Balls that roll side by side."""
    world = on_ground(settings)
    entities = np.arange(2, 12)
    place = np.column_stack((np.zeros(10), np.full(10, 0.5), 2.0 * np.arange(10) - 9.0))
    world.add_bodies(entities, position=place, linear_velocity=(2.0, 0.0, 0.0))
    world.add_colliders(entities, shape=SPHERE)
    return world


def test_the_gyroscopic_term_of_equal_moments_is_rounding():
    assert max(parted(rolling_balls, "gyroscopic")) < 1e-6
    way, turn = parted(turning_cubes, "gyroscopic")
    assert way == 0.0 and turn < 2e-6


def test_attractors_of_which_there_are_none_are_rounding():
    assert max(parted(turning_cubes, "attractors")) < 1e-9


def test_locked_axes_of_which_there_are_none_are_rounding():
    assert max(parted(towers, "locked_axes")) < 1e-3
    assert 0.0 < max(parted(balls, "locked_axes")) < 1e-2


def test_the_cheap_solver_is_an_approximation_of_the_strong_one():
    assert 1e-7 < max(parted(rolling_balls, "strong_solver")) < 1e-2
    assert 1e-7 < max(parted(towers, "strong_solver")) < 2e-2


def test_sleeping_is_an_approximation_of_staying_awake():
    assert 0.0 < max(parted(towers, "sleepers")) < 1e-3


# What the plan says.


def told(world: PhysicsWorld) -> dict[str, tuple[bool, str]]:
    world.step(DT)
    return {stage.name: (stage.is_on, stage.why) for stage in world.plan()}


def test_every_switch_is_told_once_in_one_sentence():
    for scene in SCENES:
        plan = scene(PhysicsSettings()).plan()
        assert [stage.name for stage in plan] == list(SWITCHES)
        assert all(stage.why and "\n" not in stage.why and not stage.is_forced for stage in plan)


def test_the_plan_gives_reasons_with_numbers():
    plan = told(boxes(PhysicsSettings()))
    assert plan["polytopes"] == (False, "no shapes but boxes and balls among 19 colliders")
    assert plan["joints"] == (False, "no joints")
    assert plan["gyroscopic"] == (False, "no unequal moments of inertia among 18 dynamic bodies")
    assert plan["bounces"] == (False, "no collider has restitution")
    assert plan["strong_solver"][0]  # 300 kg on 1 kg
    plan = told(mixed(PhysicsSettings()))
    assert plan["polytopes"] == (True, "shapes other than boxes and balls among 26 colliders: 8 capsules")
    assert plan["bounces"][0] and plan["rolling"][0] and plan["gyroscopic"][0]
    assert plan["locked_axes"] == (True, "1 body with locked axes")
    assert told(scenery(PhysicsSettings()))["solver"] == (False, "no dynamic bodies")
    world = flyers(PhysicsSettings())
    assert any(told(world)["continuous_collision"][0] for _ in range(12))  # until the bullets are at the wall
    assert told(chains(PhysicsSettings()))["joints"] == (True, "6 joints")


def test_the_plan_follows_the_world():
    world = boxes(PhysicsSettings())
    world.add_bodies([90], motion=STATIC, position=(0.0, 3.0, 0.0))
    world.add_colliders([90], size=(2.0, 1.0, 2.0), trigger=True)
    before = told(world)
    assert not before["joints"][0] and not before["polytopes"][0] and before["triggers"][0]
    world.add_joints([1], kind="fixed", entity_a=2, entity_b=3)
    assert told(world)["joints"] == (True, "1 joint")
    world.remove_joints([1])
    assert told(world)["joints"] == (False, "no joints")
    hull = world.add_hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    world.add_bodies([91], position=(0.0, 20.0, 0.0))
    world.add_colliders([91], shape=4, geometry=hull)
    assert told(world)["polytopes"] == (True, "shapes other than boxes and balls among 21 colliders: 1 hull")
    world.remove_bodies([91])
    assert not told(world)["polytopes"][0]
    world.remove_bodies([90])
    assert told(world)["triggers"] == (False, "no triggers")


def test_what_sleeps_is_told():
    world = boxes(PhysicsSettings())
    for _ in range(400):
        world.step(DT)
    plan = told(world)
    assert plan["sleepers"] == (False, "18 of 18 dynamic bodies at rest and not stepped")
    assert plan["solver"] == (False, "nobody of 18 dynamic bodies is awake")


def test_nothing_is_solved_where_nothing_touches():
    world = turning_cubes(PhysicsSettings())
    for _ in range(2):
        profile: dict[str, float] = {}
        world.step(DT, profile)
    assert not {"build_islands", "prepare_bodies", "solve_contacts"} & set(profile)


def test_a_switch_that_is_not_there_is_refused_with_the_one_that_was_meant():
    with pytest.raises(PhysicsError, match=r"names no switch 'joint'; did you mean 'joints'\?"):
        PhysicsSettings(forced=("joint",))
    with pytest.raises(PhysicsError, match="there are polytopes, "):
        PhysicsSettings(forced=("xyz",))


def test_forcing_can_begin_and_end_while_a_world_runs():
    one, other = boxes(PhysicsSettings()), boxes(PhysicsSettings())
    for tick in range(60):
        if tick in (20, 40):
            other.settings = msgspec.structs.replace(
                other.settings, forced=("joints", "polytopes") if tick == 20 else ()
            )
        one.step(DT)
        other.step(DT)
        assert other.state_hash() == one.state_hash()
