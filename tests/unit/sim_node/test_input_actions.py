"""Actions, axes and vectors of a scene: what they answer, what players bind, and that states hold what counts of them."""

from __future__ import annotations

import math

import pytest

from elys.bus.messages.commands import AddComponent, Input, LoadScene, SetComponent, SetEnabled
from elys.common.assets.store import AssetStore
from elys.common.components import InputMap
from elys.common.errors import RequestError, StateError
from elys.common.scene import EntityRecord, SceneSettings
from elys.sim_node.inputs import Inputs
from elys.sim_node.scene.loading import load_records
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State
from elys.sim_node.systems.apply_edits import apply_again

DRIVING = {
    "actions": {"fire": "mouse_left, pad_right_trigger, wheel_y", "horn": ""},
    "axes": {"steer": "a/d, pad_left_x", "gas": "w, -s, pad_right_trigger", "zoom": "wheel_y scale=2", "lift": "q/e"},
    "vectors": {"move": "a/d/s/w, pad_left curve=1", "look": "pointer, pad_right flip=y"},
    "stick_dead_zone": 0.2,
}


def played(**what) -> Input:
    return Input(**{"player": 1, "source": "pad", **what})


def down(*names: str) -> tuple[tuple[str, bool], ...]:
    return tuple((name, True) for name in names)


def up(*names: str) -> tuple[tuple[str, bool], ...]:
    return tuple((name, False) for name in names)


def driven(**values) -> Simulation:
    simulation = Simulation(assets=AssetStore())
    load_records(simulation.world, [EntityRecord(name="Input", components={"InputMap": {**DRIVING, **values}})])
    simulation.settle()
    return simulation


def test_every_scene_has_the_usual_map() -> None:
    inputs = Inputs()
    inputs.take(played(changes=down("space", "d", "w")))
    player = inputs[1]
    assert player.action("jump") and player.action("jump").was_pressed
    assert not player.action("run")
    assert player.vector("move") == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
    inputs.end_tick()
    assert inputs[1].action("jump").is_down and not inputs[1].action("jump").was_pressed
    inputs.take(played(lets_go=True))
    assert inputs[1].action("jump").was_released and inputs[1].vector("move") == (0.0, 0.0)


def test_a_tap_within_a_tick_counts_and_a_second_key_changes_nothing() -> None:
    inputs = Inputs()
    inputs.take(played(changes=(("space", True), ("space", False))))
    jump = inputs[1].action("jump")
    assert (jump.is_down, jump.was_pressed, jump.was_released) == (False, True, True)
    inputs.end_tick()
    assert inputs.actions.players == ()
    inputs.take(played(changes=down("space")))
    inputs.end_tick()
    inputs.take(played(changes=(*down("pad_a"), *up("pad_a")), source="other"))
    jump = inputs[1].action("jump")
    assert (jump.is_down, jump.was_pressed, jump.was_released) == (True, False, False)


def test_names_that_the_scene_has_not_are_errors_that_list_those_it_has() -> None:
    player = driven().inputs[1]
    for ask, words in (
        (player.action, "there is no action 'jump': there are fire, horn"),
        (player.axis, "there is no axis 'jump': there are gas, lift, steer, zoom"),
        (player.vector, "there is no vector 'jump': there are look, move"),
    ):
        with pytest.raises(ValueError, match=words):
            ask("jump")
    assert player.axis("pad_left_x") == 0.0  # a device's own name still is one
    with pytest.raises(ValueError, match="there is no axis 'x': the scene declares none"):
        Inputs()[1].axis("x")


def test_sticks_have_a_round_dead_zone_and_triggers_one_of_their_own() -> None:
    simulation = driven()
    simulation.inputs.take(played(axes={"pad_left_x": 0.12, "pad_left_y": -0.16, "pad_right_trigger": 0.04}))
    player = simulation.inputs[1]
    assert player.vector("move") == (0.0, 0.0)  # exactly 0.2 long
    assert player.axis("steer") == 0.0 and player.axis("gas") == 0.0
    simulation.inputs.take(played(axes={"pad_left_x": 0.36, "pad_left_y": -0.48, "pad_right_trigger": 0.525}))
    player = simulation.inputs[1]
    assert player.vector("move") == pytest.approx((0.6 * 0.5**3, 0.8 * 0.5**3))  # up is up
    assert player.axis("steer") == pytest.approx((0.36 - 0.2) / 0.8)  # alone: its own interval, straight
    assert player.axis("gas") == pytest.approx(0.5)
    simulation.inputs.take(played(changes=down("a", "d", "w", "s"), axes={"pad_left_x": 1.0}))
    assert simulation.inputs[1].axis("steer") == 1.0
    simulation.inputs.take(played(changes=(*up("a"), *up("s"))))
    assert simulation.inputs[1].axis("steer") == 1.0 and simulation.inputs[1].axis("gas") == 1.0  # clipped


def test_a_stick_is_taken_from_one_device() -> None:
    inputs = Inputs()
    inputs.take(played(axes={"pad_left_x": 0.9}))
    inputs.take(played(axes={"pad_left_y": -1.0}, source="other"))
    assert inputs[1].vector("move") == (0.0, 1.0)


@pytest.mark.parametrize("rate", [30.0, 60.0, 240.0])
def test_motions_turn_as_far_at_every_tick_rate_and_beyond_one(rate: float) -> None:
    simulation = driven(pointer_speed=500.0)
    simulation.change_settings(SceneSettings(tick_rate=rate))
    simulation.inputs.take(played(moved={"pointer_x": 200.0, "pointer_y": -50.0, "wheel_y": -3.0}))
    player = simulation.inputs[1]
    turn, rise = player.vector("look")
    assert (turn / rate, rise / rate) == pytest.approx((0.4, 0.1))
    assert player.axis("zoom") / rate == pytest.approx(-0.6)
    assert abs(turn) > 1.0
    simulation.inputs.take(played(axes={"pad_right_y": -1.0}))
    assert simulation.inputs[1].vector("look")[1] == pytest.approx(rise - 1.0)  # flipped


def test_a_motion_that_the_scene_did_not_give_goes_no_farther_than_a_stick() -> None:
    simulation = driven()
    simulation.inputs.take(
        played(bindings={"steer": "pointer_x scale=100", "move": "pointer"}, moved={"pointer_x": 900.0})
    )
    assert simulation.inputs[1].axis("steer") == 1.0
    assert simulation.inputs[1].vector("move") == (1.0, 0.0)


def test_triggers_and_wheels_are_buttons_too() -> None:
    simulation = driven()

    def fire(**what) -> tuple[bool, bool, bool]:
        simulation.inputs.take(played(**what))
        action = simulation.inputs[1].action("fire")
        simulation.step()
        return action.is_down, action.was_pressed, action.was_released

    assert fire(axes={"pad_right_trigger": 0.45}) == (False, False, False)
    assert fire(axes={"pad_right_trigger": 0.55}) == (True, True, False)
    assert fire(axes={"pad_right_trigger": 0.45}) == (True, False, False)  # it trembles
    assert fire(axes={"pad_right_trigger": 0.3}) == (False, False, True)
    assert fire(moved={"wheel_y": 1.0}) == (False, True, True)
    assert fire(moved={"wheel_y": -1.0}) == (False, False, False)


def test_the_map_is_that_of_the_first_entity_that_is_on_and_may_be_edited() -> None:
    simulation = driven()
    other = {"actions": {"sing": "space"}, "axes": {}, "vectors": {}}
    load_records(simulation.world, [EntityRecord(name="Other", components={"InputMap": other})])
    entity = int(simulation.world.query(InputMap).entities[0])
    assert "fire" in simulation.inputs.actions.meaning(1).controls["action"]
    apply_again(simulation, SetEnabled(entity=entity, enabled=False))
    assert list(simulation.inputs.actions.meaning(1).controls["action"]) == ["sing"]
    apply_again(simulation, SetEnabled(entity=entity, enabled=True))
    apply_again(simulation, SetComponent(entity=entity, component="InputMap", values={"actions": {"roar": "e"}}))
    simulation.inputs.take(played(changes=down("e")))
    assert simulation.inputs[1].action("roar")
    with pytest.raises(Exception, match=r"InputMap\.actions\.roar: 'ee' is no control"):
        apply_again(simulation, SetComponent(entity=entity, component="InputMap", values={"actions": {"roar": "ee"}}))
    assert simulation.inputs[1].action("roar")
    apply_again(simulation, LoadScene(name="none", records=(), settings=SceneSettings()))
    assert simulation.inputs[1].action("use")  # the usual map, and the key is still held
    spawned = simulation.world.spawn([])
    apply_again(simulation, AddComponent(entity=int(spawned), component="InputMap", values={}))
    assert simulation.inputs[1].action("use")


def test_a_player_binds_and_a_key_that_is_held_meanwhile_is_let_go() -> None:
    simulation = driven(actions={"jump": "space", "run": "e"})
    simulation.inputs.take(played(changes=down("space", "k")))
    simulation.inputs.take(played(player=2, changes=down("space")))
    simulation.step()
    assert simulation.inputs[1].action("jump") and simulation.inputs[2].action("jump")
    simulation.inputs.take(played(bindings={"jump": "x", "fly": "a/d/s/w"}))
    jump = simulation.inputs[1].action("jump")
    assert (jump.is_down, jump.was_pressed, jump.was_released) == (False, False, True)
    assert simulation.inputs[2].action("jump").is_down and not simulation.inputs[2].action("jump").was_released
    simulation.step()
    simulation.inputs.take(played(bindings={"jump": "k"}))
    assert simulation.inputs[1].action("jump").was_pressed  # held already: it begins now
    simulation.step()
    assert simulation.inputs.actions.bindings(1) == {"jump": "k"}
    simulation.inputs.take(played(bindings={}))
    assert simulation.inputs[1].action("jump").is_down  # by the scene's own key
    simulation.inputs.take(played(changes=down("w")))
    assert simulation.inputs.actions.bindings(1) == {}  # None says nothing of them


@pytest.mark.parametrize(
    ("bindings", "words"),
    [
        ({"jump": "a/d"}, "jump: 'a/d' is no control of an action"),
        ({"jump": "spaec"}, "jump: 'spaec' is no control"),
        ({"no name": "k"}, "'no name' is no name"),
        ({"jump": "k" * 301}, "jump: controls are told in at most 300 characters"),
        ({f"n{number}": "k" for number in range(65)}, "a player may bind 64 names, not 65"),
    ],
)
def test_bindings_that_are_none_are_refused_and_nothing_changes(bindings, words: str) -> None:
    simulation = driven(actions={"jump": "space"})
    simulation.inputs.take(played(bindings={"jump": "k"}))
    before = simulation.capture().to_bytes()
    with pytest.raises(RequestError, match=words):
        simulation.inputs.take(played(bindings=bindings, changes=down("w")))
    assert simulation.capture().to_bytes() == before


def test_what_is_bound_for_a_name_of_another_sort_waits() -> None:
    simulation = driven(actions={"boost": "e"})
    simulation.inputs.take(played(bindings={"boost": "q, pad_a"}))
    entity = int(simulation.world.query(InputMap).entities[0])
    values = {"actions": {}, "vectors": {"boost": "pad_left"}}
    apply_again(simulation, SetComponent(entity=entity, component="InputMap", values=values))
    simulation.inputs.take(played(axes={"pad_left_x": 1.0}))
    assert simulation.inputs[1].vector("boost") == (1.0, 0.0)  # as the scene says


def test_states_hold_bindings_and_what_was_down() -> None:
    simulation = driven(actions={"jump": "space"})
    simulation.inputs.take(played(bindings={"jump": "k"}, changes=down("k"), player=3))
    simulation.step()
    state = State.from_bytes(simulation.capture().to_bytes())
    other = driven()
    other.restore(state)
    assert other.inputs.actions.bindings(3) == {"jump": "k"}
    jump = other.inputs[3].action("jump")
    assert jump.is_down and not jump.was_pressed
    old = State(tick=0, time=0.0, values={k: v for k, v in state.values.items() if "inputs/actions" not in k})
    other.restore(State.from_bytes(old.to_bytes()))  # of before there were actions
    assert other.inputs.actions.bindings(3) == {}
    wrong = State(tick=0, time=0.0, values={**state.values, "inputs/actions/down": {"x": 3}})
    with pytest.raises(StateError, match="inputs/actions cannot be used"):
        other.restore(State.from_bytes(wrong.to_bytes()))
