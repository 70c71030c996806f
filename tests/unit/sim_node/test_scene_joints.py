"""Joints of a scene: physics joins what components say, tells what it cannot, and components say what broke."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest

from elys.bus.messages.commands import AddComponent, Despawn, RemoveComponent, SetComponent, Spawn
from elys.common.components import Collider, Joint, RigidBody, Transform, values_of
from elys.common.ids import Entity
from elys.common.scene import EntityRecord, SceneSettings
from elys.sim_node.scene.delta import scene_changes
from elys.sim_node.scene.loading import load_records, records_of
from elys.sim_node.scene.snapshot import restore, take_snapshot
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_commands import apply_command

ABOUT_Z = (0.0, 0.0, 1.0)


@pytest.fixture
def simulation() -> Simulation:
    return Simulation()


def run(simulation: Simulation, seconds: float) -> None:
    for _ in range(round(60 * seconds)):
        simulation.step()


def box(simulation: Simulation, name: str, position: tuple[float, float, float], *more: Any, **body: Any) -> Entity:
    components = [Transform(position=position), RigidBody(**body), Collider(), *more]
    return simulation.world.spawn(components, name=name)


def height(simulation: Simulation, entity: Entity) -> float:
    return simulation.world.transforms.world_pose(entity)[0][1]


def change(simulation: Simulation, entity: Entity, **fields: Any) -> None:
    joint = simulation.world.get(entity, Joint)
    simulation.world.set(entity, msgspec.structs.replace(joint, **fields))


def texts(simulation: Simulation) -> list[str]:
    return [event.values["text"] for event in simulation.take_events()]


def test_a_body_hangs_where_it_stood_when_it_was_joined(simulation) -> None:
    hook = simulation.world.spawn([Transform(position=(3.0, 5.0, 0.0)), Collider()], name="Hook")
    lamp = box(simulation, "Lamp", (3.0, 3.0, 0.0), Joint(kind="fixed", other=hook))
    run(simulation, 1.0)
    assert height(simulation, lamp) == pytest.approx(3.0, abs=1e-6)
    joint = simulation.world.get(lamp, Joint)
    assert (joint.fit, joint.other_anchor) == (False, (0.0, -2.0, 0.0))
    assert simulation.take_events() == []


def test_what_was_fitted_is_told_to_those_who_follow(simulation) -> None:
    lamp = box(simulation, "Lamp", (0.0, 3.0, 0.0))
    simulation.step()
    simulation.take_changes()
    apply_command(simulation, AddComponent(entity=lamp, component="Joint", values={"anchor": [0.0, 0.5, 0.0]}))
    simulation.settle()
    told = [c.values for c in scene_changes(simulation.world, simulation.take_changes()) if c.entity == lamp]
    fallen = height(simulation, lamp) + 0.5
    assert [(values["fit"], values["other_anchor"][1]) for values in told if "fit" in values] == [(False, fallen)]


def test_limits_hold_and_survive_a_body_that_is_made_anew(simulation) -> None:
    """A door on a hinge, pushed by its motor against its stop; what is edited meanwhile changes neither angle nor stop."""
    hinge = Joint(kind="hinge", anchor=(-0.5, 0.0, 0.0), axis=(0.0, 1.0, 0.0), limited=True, lower=-0.3, upper=1.2)
    door = box(simulation, "Door", (0.5, 1.0, 0.0), hinge)
    run(simulation, 0.2)
    change(simulation, door, motor_speed=2.0, motor_limit=50.0)
    run(simulation, 0.3)
    before = simulation.physics.joints.coordinate[0]
    assert 0.4 < before < 0.7
    simulation.world.set(door, Collider(friction=0.1))
    simulation.settle()
    assert simulation.physics.joints.coordinate[0] == pytest.approx(before, abs=1e-6)
    run(simulation, 2.0)
    assert simulation.physics.joints.coordinate[0] == pytest.approx(1.2, abs=2e-3)
    change(simulation, door, motor_speed=-2.0)
    run(simulation, 2.0)
    assert simulation.physics.joints.coordinate[0] == pytest.approx(-0.3, abs=2e-3)


def test_turns_are_counted_on_when_a_body_is_made_anew(simulation) -> None:
    wheel = box(simulation, "Wheel", (0.0, 1.0, 0.0), Joint(kind="hinge", motor_speed=10.0, motor_limit=1e3))
    run(simulation, 2.0)
    turned = simulation.physics.joints.coordinate[0]
    assert turned > 5.0 * math.pi
    simulation.world.set(wheel, Collider(restitution=0.1))
    simulation.step()
    assert simulation.physics.joints.coordinate[0] == pytest.approx(turned + 10.0 / 60.0, abs=0.02)


def test_another_motor_speed_joins_nothing_anew(simulation) -> None:
    """What a joint remembers of the last step stays, and with it the load it carries."""
    beam = box(simulation, "Beam", (0.5, 1.0, 0.0), Joint(kind="hinge", anchor=(-0.5, 0.0, 0.0), axis=ABOUT_Z))
    run(simulation, 0.1)
    carried = simulation.physics.snapshot()["joints"]["impulse"].copy()
    change(simulation, beam, motor_speed=0.5, motor_limit=100.0)
    simulation.settle()
    assert np.abs(carried).max() > 0.0
    assert np.array_equal(simulation.physics.snapshot()["joints"]["impulse"], carried)


def test_an_anchor_below_a_stretched_body_holds_its_far_end(simulation) -> None:
    place = Transform(position=(0.0, 2.0, 0.0), scale=(4.0, 0.1, 1.0))
    near_end = Joint(kind="ball", anchor=(-0.5, 0.0, 0.0))
    plank = simulation.world.spawn([place, RigidBody(), Collider(), near_end], name="Plank")
    simulation.world.spawn([Joint(kind="ball", anchor=(0.5, 0.0, 0.0))], name="Far end", parent=plank)
    run(simulation, 1.0)
    assert simulation.physics.joints.joint.tolist() == [1, 2]
    assert height(simulation, plank) == pytest.approx(2.0, abs=1e-4)
    first, second = (simulation.world.get(Entity(e), Joint).other_anchor for e in (1, 2))
    assert (first, second) == (pytest.approx((-2.0, 2.0, 0.0)), pytest.approx((2.0, 2.0, 0.0)))


def test_what_is_given_explicitly_is_drawn_together(simulation) -> None:
    box(simulation, "Still", (0.0, 5.0, 0.0), motion="static")
    given = Joint(kind="fixed", other=1, fit=False, anchor=(0.0, 1.0, 0.0), other_anchor=(0.0, -1.0, 0.0))
    hung = box(simulation, "Hung", (0.0, 2.95, 0.0), given)
    run(simulation, 1.0)
    assert height(simulation, hung) == pytest.approx(3.0, abs=1e-3)


@pytest.mark.parametrize("rope", [False, True])
def test_a_distance_joint_without_limits_keeps_the_length_it_has(simulation, rope) -> None:
    limits = {"limited": True, "upper": 4.0} if rope else {}
    weight = box(simulation, "Weight", (0.0, 7.0, 0.0), Joint(kind="distance", other_anchor=(0.0, 10.0, 0.0), **limits))
    run(simulation, 2.0)
    assert height(simulation, weight) == pytest.approx(6.0 if rope else 7.0, abs=1e-3)


def test_a_gear_couples_two_joints_and_comes_back_with_them(simulation) -> None:
    wheel = Joint(kind="hinge", axis=ABOUT_Z)
    one = box(simulation, "One", (0.0, 2.0, 0.0), msgspec.structs.replace(wheel, motor_speed=3.0, motor_limit=1e3))
    two = box(simulation, "Two", (3.0, 2.0, 0.0), wheel)
    simulation.world.spawn([Joint(kind="gear", joint_a=one, joint_b=two, ratio=-2.0)], name="Gear")
    run(simulation, 1.0)
    assert simulation.physics.joints.speed[:2].tolist() == pytest.approx([3.0, -6.0], abs=1e-3)
    simulation.world.set(two, Collider(friction=0.1))  # made anew
    run(simulation, 0.5)
    assert simulation.physics.joints.speed[:2].tolist() == pytest.approx([3.0, -6.0], abs=1e-3)
    turned = simulation.physics.joints.coordinate[:2]
    assert turned[1] == pytest.approx(-2.0 * turned[0], abs=1e-2)
    simulation.world.remove(two, Joint)
    simulation.step()
    assert simulation.physics.joints.joint.tolist() == [one]
    assert "'Gear' joins nothing: its joint_b is no entity with a Joint" in texts(simulation)[0]


# ---------------------------------------------------------------- sleep


@pytest.fixture
def sleepers(simulation) -> tuple[Entity, Entity]:
    """Two boxes side by side on the ground, joined, fast asleep."""
    simulation.world.spawn([Transform(), Collider(shape="plane")], name="Ground")
    left = box(simulation, "Left", (0.0, 0.5, 0.0))
    right = box(simulation, "Right", (1.5, 0.5, 0.0), Joint(kind="fixed", other=left))
    run(simulation, 3.0)
    assert awake(simulation) == []
    return left, right


def awake(simulation: Simulation) -> list[int]:
    rows = simulation.physics.snapshot()["bodies"]
    entity = simulation.physics.bodies.entity
    return entity[(rows["asleep"] == 0) & (simulation.physics.bodies.motion == 0)].tolist()


def test_a_pair_that_sleeps_wakes_when_one_is_pushed(simulation, sleepers) -> None:
    left, right = sleepers
    simulation.physics.apply_impulse([left], [-1.0, 0.0, 0.0])
    simulation.step()
    assert awake(simulation) == [left, right]
    assert simulation.moving_bodies().linear_velocity[1, 0] < -0.1  # it is pulled along


@pytest.mark.parametrize(
    "end",
    [
        lambda right: RemoveComponent(entity=right, component="Joint"),
        lambda right: SetComponent(entity=right, component="Joint", values={"motor_speed": 1.0}),
        lambda right: SetComponent(entity=right, component="Joint", values={"kind": "ball"}),
        lambda right: SetComponent(entity=right, component="Joint", values={"broken": True}),
    ],
    ids=["removed", "driven", "of another kind", "broken"],
)
def test_a_joint_that_changes_wakes_both(simulation, sleepers, end) -> None:
    apply_command(simulation, end(sleepers[1]))
    simulation.step()
    assert awake(simulation) == list(sleepers)


def test_the_other_wakes_when_one_is_destroyed(simulation, sleepers) -> None:
    apply_command(simulation, Despawn(entity=sleepers[1]))
    simulation.step()
    assert awake(simulation) == [sleepers[0]]


# ---------------------------------------------------------------- what cannot be joined


def test_a_joint_waits_for_a_body_and_says_so_once(simulation) -> None:
    hook = simulation.world.spawn([Transform(position=(0.0, 4.0, 0.0))], name="Hook")
    lamp = box(simulation, "Lamp", (0.0, 3.0, 0.0), Joint(kind="ball", other=hook, anchor=(0.0, 1.0, 0.0)))
    run(simulation, 0.2)
    fallen = height(simulation, lamp)
    assert fallen < 2.9
    assert texts(simulation) == [
        "entity 2 'Lamp' joins nothing: entity 1 'Hook' has no body; give it a RigidBody or a Collider, or enable it"
    ]
    change(simulation, lamp, frequency=0.5)
    simulation.step()
    change(simulation, lamp, frequency=0.0)
    simulation.step()
    fallen = height(simulation, lamp)
    simulation.world.add(hook, Collider(size=(0.1, 0.1, 0.1)))
    simulation.settle()
    assert texts(simulation) == []
    assert simulation.physics.joints.entity_a.tolist() == [hook]
    assert simulation.world.get(lamp, Joint).other_anchor[1] == pytest.approx(fallen + 1.0 - 4.0)


def test_a_joint_ends_with_the_other_body_and_names_who_is_gone(simulation) -> None:
    hook = simulation.world.spawn([Transform(position=(0.0, 4.0, 0.0)), Collider()], name="Hook")
    lamp = box(simulation, "Lamp", (0.0, 2.0, 0.0), Joint(kind="ball", other=hook))
    run(simulation, 0.2)
    simulation.world.despawn(hook)
    run(simulation, 0.5)
    assert height(simulation, lamp) < 1.5
    assert texts(simulation) == [
        "entity 2 'Lamp' joins nothing: entity 1, which it is to be joined to, is not there any more; choose another"
    ]
    assert len(simulation.physics.joints.joint) == 0


def test_a_body_that_is_disabled_is_joined_again_when_it_is_back(simulation) -> None:
    hook = simulation.world.spawn([Transform(position=(0.0, 4.0, 0.0)), Collider()], name="Hook")
    lamp = box(simulation, "Lamp", (0.0, 2.0, 0.0), Joint(kind="fixed", other=hook), gravity_scale=0.0)
    simulation.step()
    simulation.world.set_enabled(hook, False)
    simulation.step()
    assert len(simulation.physics.joints.joint) == 0
    simulation.world.set_enabled(hook, True)
    simulation.step()
    assert simulation.physics.joints.joint.tolist() == [lamp]


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"other": 2}, "both ends are the same body, that of entity 2 'Body'"),
        ({"kind": "hinge", "axis": (0.0, 0.0, 0.0)}, "axis_a must have a length"),
        ({"limited": True, "lower": 2.0, "upper": 1.0, "kind": "hinge"}, "lower must not be above upper"),
        ({"kind": "gear", "joint_a": 1, "joint_b": 2}, "its joint_a is no entity with a Joint"),
        ({"kind": "gear", "joint_a": 3, "joint_b": 4}, "is a gear on joint 3, which must be a hinge"),
        ({"other": 4_000_000_000}, "is not there any more"),
    ],
)
def test_a_joint_that_cannot_be_is_told_and_others_hold(simulation, values, sentence) -> None:
    box(simulation, "Post", (5.0, 0.0, 0.0), motion="static")
    body = box(simulation, "Body", (0.0, 0.0, 0.0))
    good = [box(simulation, "Good", (3.0 * k, 3.0, 0.0), Joint()) for k in range(2)]
    record = EntityRecord(name="Wrong", components={"Joint": values})
    apply_command(simulation, Spawn(records=(record,), parent=body))
    simulation.step()
    (text,) = texts(simulation)
    assert text.startswith("entity 5 'Wrong' joins nothing: ")
    assert sentence in text
    run(simulation, 0.2)
    assert texts(simulation) == []
    assert simulation.physics.joints.joint.tolist() == good


def test_limits_that_cross_while_it_runs_leave_it_joined(simulation) -> None:
    door = box(
        simulation, "Door", (0.0, 1.0, 0.0), Joint(kind="hinge", axis=ABOUT_Z, limited=True, lower=-1.0, upper=1.0)
    )
    simulation.step()
    change(simulation, door, lower=2.0)
    simulation.step()
    (text,) = texts(simulation)
    assert text.startswith("entity 1 'Door' is joined as before: lower must not be above upper")
    change(simulation, door, lower=0.5)
    run(simulation, 1.0)
    assert simulation.physics.joints.coordinate[0] == pytest.approx(0.5, abs=2e-3)


def test_a_part_of_no_body_joins_nothing(simulation) -> None:
    simulation.world.spawn([Transform(), Joint()], name="Ghost")
    simulation.step()
    assert "'Ghost' joins nothing: it is part of no body" in texts(simulation)[0]


# ---------------------------------------------------------------- breaking


@pytest.fixture
def overloaded(simulation) -> Entity:
    """A weight of 200 kg on a joint that holds 1500 N."""
    hook = simulation.world.spawn([Transform(position=(0.0, 4.0, 0.0)), Collider()], name="Hook")
    return box(simulation, "Weight", (0.0, 2.0, 0.0), Joint(other=hook, break_force=1500.0), mass=200.0)


def test_a_joint_that_breaks_says_so_and_is_an_event(simulation, overloaded) -> None:
    simulation.step()
    (event,) = simulation.take_events()
    assert (event.kind, event.entity, event.other) == ("joint_broken", overloaded, 1)
    assert event.values["force"] == pytest.approx(200.0 * 9.81, rel=0.01)
    assert simulation.world.get(overloaded, Joint).broken
    told = [c for c in scene_changes(simulation.world, simulation.take_changes()) if c.entity == overloaded]
    assert told[-1].components["Joint"]["broken"] is True
    assert len(simulation.physics.joints.joint) == 0
    run(simulation, 0.5)
    assert height(simulation, overloaded) < 1.5
    assert simulation.take_events() == []


def test_what_broke_can_be_joined_again_where_it_was(simulation, overloaded) -> None:
    run(simulation, 0.1)
    change(simulation, overloaded, broken=False, break_force=0.0)
    run(simulation, 3.0)
    assert height(simulation, overloaded) == pytest.approx(2.0, abs=1e-3)


# ---------------------------------------------------------------- scenes, snapshots, settings


def jointed_scene() -> list[EntityRecord]:
    """A chain of four from a post, with a driven door and a gear, whose parts name others before and after them."""
    place = [{"Transform": {"position": [1.2 * k, 3.0, 0.0]}, "RigidBody": {}, "Collider": {}} for k in range(5)]
    joints: list[dict[str, Any]] = [
        {},
        {
            "kind": "hinge",
            "axis": [0.0, 0.0, 1.0],
            "anchor": [-0.6, 0.0, 0.0],
            "limited": True,
            "lower": -0.8,
            "upper": 0.4,
        },
        {"kind": "hinge", "axis": [0.0, 0.0, 1.0], "anchor": [-0.6, 0.0, 0.0], "motor_speed": 1.0, "motor_limit": 4.0},
        {"kind": "cone_twist", "anchor": [-0.6, 0.0, 0.0], "swing_limit": 0.3},
        {"kind": "slider", "spring_frequency": 2.0, "break_force": 60.0},
    ]
    coupled = {"Joint.joint_a": 2, "Joint.joint_b": 3}
    records = [EntityRecord(name="Gear", components={"Joint": {"kind": "gear", "ratio": 0.5}}, references=coupled)]
    for k in range(5):
        components = {**place[k], **({"Joint": joints[k]} if k else {"RigidBody": {"motion": "static"}})}
        references = {"Joint.other": k} if k else {}
        records.append(EntityRecord(name=f"Link {k}", components=components, references=references))
    return records


def loaded(records: list[EntityRecord], settings: SceneSettings | None = None) -> Simulation:
    simulation = Simulation(settings=settings)
    load_records(simulation.world, records)
    simulation.settle()
    return simulation


def hashes(simulation: Simulation, ticks: int) -> list[int]:
    """State hashes while commands come in."""
    told = []
    for tick in range(ticks):
        if tick == 20:
            apply_command(simulation, SetComponent(entity=4, component="Joint", values={"motor_speed": -3.0}))
        if tick == 40:
            apply_command(simulation, SetComponent(entity=5, component="Collider", values={"friction": 0.1}))
        if tick == 60:
            apply_command(simulation, Despawn(entity=6))
        simulation.step()
        told.append(simulation.physics.state_hash())
    return told


def test_the_same_scene_and_commands_give_the_same_bits() -> None:
    one, two = loaded(jointed_scene()), loaded(jointed_scene())
    assert len(one.physics.joints.joint) == 5
    assert hashes(one, 120) == hashes(two, 120)
    assert one.take_events() == two.take_events()


def test_from_a_snapshot_of_physics_the_scene_goes_on_with_the_same_bits() -> None:
    simulation = loaded(jointed_scene())
    hashes(simulation, 70)
    kept = simulation.physics.snapshot()
    expected = []
    for _ in range(30):
        simulation.step()
        expected.append(simulation.physics.state_hash())
    simulation.physics.restore(kept)
    for state in expected:
        simulation.step()
        assert simulation.physics.state_hash() == state


def test_a_snapshot_of_the_scene_and_its_records_join_as_before() -> None:
    """Anchors, angles' zero and lengths stand in the components: a scene that is opened again hangs together as it did."""
    simulation = loaded(jointed_scene())
    for _ in range(50):
        simulation.step()
    snapshot = take_snapshot(
        simulation.world, epoch=1, tick=50, simulation_time=0.0, sequence=0, scene="", settings=simulation.settings
    )
    restored = Simulation()
    restore(restored.world, snapshot)
    restored.settle()
    reloaded = loaded(records_of(simulation.world))
    was = simulation.physics.joints
    for other in (restored, reloaded):
        assert other.take_events() == []
        joints = other.physics.joints
        assert joints.joint.tolist() == was.joint.tolist()
        np.testing.assert_allclose(joints.coordinate, was.coordinate, atol=1e-5)
    for entity in simulation.world.entities().tolist():
        joint = simulation.world.try_get(Entity(entity), Joint)
        if joint is not None:
            assert values_of(reloaded.world.get(Entity(entity), Joint)) == values_of(joint)


def test_a_copy_is_joined_within_itself(simulation) -> None:
    load_records(simulation.world, jointed_scene())
    records = records_of(simulation.world)
    assert records[2].references == {"Joint.other": 1}
    copies = load_records(simulation.world, records)
    assert simulation.world.get(copies[2], Joint).other == copies[1]
    assert simulation.world.get(copies[0], Joint).joint_b == copies[3]


@pytest.mark.parametrize(
    ("references", "sentence"),
    [
        ({"Joint.other": 1}, "refers to record 1 by Joint.other; there is none"),
        ({"Joint.anchor": 0}, "refers to another by Joint.anchor, which it has not"),
        ({"Light.other": 0}, "refers to another by Light.other, which it has not"),
    ],
)
def test_a_reference_to_nobody_spawns_nothing(simulation, references, sentence) -> None:
    record = EntityRecord(name="X", components={"Joint": {}}, references=references)
    with pytest.raises(Exception, match=sentence):
        apply_command(simulation, Spawn(records=(record,)))
    assert simulation.world.entity_count == 0


def test_attractors_of_the_scene_attract() -> None:
    """At rest 10 m from a point of 500 m^3/s^2: a = 5 m/s^2 at first, and the velocity after 0.1 s is 0.5 m/s."""
    settings = msgspec.convert(
        {"gravity": [0.0, 0.0, 0.0], "attractors": [{"position": [10.0, 0.0, 0.0], "strength": 500.0}]}, SceneSettings
    )
    simulation = loaded(
        [EntityRecord(name="A", components={"Transform": {}, "RigidBody": {}, "Collider": {}})], settings
    )
    run(simulation, 0.1)
    assert simulation.moving_bodies().linear_velocity[0].tolist() == pytest.approx([0.5, 0.0, 0.0], abs=2e-3)
