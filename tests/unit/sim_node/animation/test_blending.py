"""Clips that come in and go out, several in step, and layers over them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from elys.common.assets.clip import Clip
from elys.common.components import Animation, AnimationBlend, AnimationLayer, Morph, Transform
from elys.common.components.animation_texts import markers_of, markers_with, mix_of, mix_text, mix_with
from elys.common.errors import ComponentError
from tests.unit.sim_node.animation.stage import ARM, HIPS, SPINE, Puppet, constant, track, turn

LEFT = constant("Left", ARM, (-1.0, 0.0, 0.0))
RIGHT = constant("Right", ARM, (1.0, 0.0, 0.0))
UP = constant("Up", ARM, (0.0, 3.0, 0.0))


def test_another_clip_comes_in_evenly() -> None:
    puppet = Puppet(LEFT, RIGHT, fade=0.4)
    puppet.run(3)
    puppet.set(clip="Right")
    seen = []
    for _ in range(22):
        puppet.run()
        seen.append(puppet.place(puppet.arm)[0])
    np.testing.assert_allclose(seen, [min(-1.0 + 0.1 * tick, 1.0) for tick in range(1, 23)], atol=1e-6)
    assert len(puppet.simulation.animations.voices) == 1


def test_without_a_fade_it_is_there_at_once() -> None:
    puppet = Puppet(LEFT, RIGHT)
    puppet.set(clip="Right")
    puppet.simulation.settle()
    assert puppet.place(puppet.arm)[0] == 1.0


def test_a_fade_that_is_broken_off_goes_on_from_where_it_is() -> None:
    puppet = Puppet(LEFT, RIGHT, UP, fade=0.4)
    puppet.run()
    puppet.set(clip="Right")
    puppet.run(10)  # half of the way
    puppet.set(clip="Up")
    seen = [puppet.place(puppet.arm)]
    for _ in range(20):
        puppet.run()
        seen.append(puppet.place(puppet.arm))
    steps = np.linalg.norm(np.diff(seen, axis=0), axis=1)
    np.testing.assert_allclose(steps, 3.0 / 20, atol=1e-6)
    assert seen[-1] == pytest.approx((0.0, 3.0, 0.0))


def test_what_leaves_goes_on_at_its_own_pace() -> None:
    slide = Clip(name="Slide", channels=(track(ARM, [(0, 0, 0), (1, 0, 0)]),))
    puppet = Puppet(slide, UP, fade=1.0, speed=0.5)
    puppet.run(10)
    assert puppet.place(puppet.arm)[0] == pytest.approx(0.1)
    puppet.set(clip="Up", time=0.0, speed=3.0)
    puppet.run(25)
    assert puppet.place(puppet.arm)[0] == pytest.approx(0.5 * 0.35)


def test_what_only_one_clip_moves_comes_from_how_it_rests() -> None:
    puppet = Puppet(LEFT, constant("Bow", HIPS, (0.0, 0.0, 0.0)), fade=0.4)
    puppet.run()
    puppet.set(clip="Bow")
    puppet.run(5)
    assert puppet.place(puppet.arm)[0] == pytest.approx(0.75 * -1.0 + 0.25 * 0.25)
    assert puppet.place(puppet.hips)[1] == pytest.approx(0.75)
    puppet.run(20)
    assert puppet.place(puppet.hips)[1] == pytest.approx(0.0)
    assert puppet.place(puppet.arm)[0] == pytest.approx(0.25)


def test_weights_mix_clips_and_change_over_the_fade() -> None:
    puppet = Puppet(LEFT, RIGHT, UP, more=(AnimationBlend(mix="Left 1, Right 3"),))
    puppet.run()
    assert puppet.place(puppet.arm)[0] == pytest.approx(0.5)
    puppet.set(fade=0.2)
    puppet.set(AnimationBlend, mix="Left 3, Right 1")
    puppet.run(5)
    assert puppet.place(puppet.arm)[0] == pytest.approx(0.0, abs=1e-7)
    puppet.run(5)
    assert puppet.place(puppet.arm)[0] == pytest.approx(-0.5)
    puppet.set(AnimationBlend, mix="Up 1")
    puppet.run(5)
    assert puppet.place(puppet.arm) == pytest.approx((-0.25, 1.5, 0.0))


def test_a_value_goes_from_clip_to_clip() -> None:
    puppet = Puppet(LEFT, RIGHT, UP, more=(AnimationBlend(mix="Left 0, Right 2, Up 4", by="value"),))
    for value, expected in ((-1, (-1, 0)), (0, (-1, 0)), (0.5, (-0.5, 0)), (2, (1, 0)), (3, (0.5, 1.5)), (9, (0, 3))):
        puppet.set(AnimationBlend, value=float(value))
        puppet.run()
        assert puppet.place(puppet.arm)[:2] == pytest.approx(expected)


def test_clips_of_a_mix_go_in_step() -> None:
    slow = Clip(name="Slow", channels=(track(ARM, [(0, 0, 0), (1, 0, 0)], duration=2.0),))
    fast = Clip(name="Fast", channels=(track(SPINE, [(0, 0, 0), (1, 0, 0)], duration=0.5),))
    puppet = Puppet(slow, fast, more=(AnimationBlend(mix="Slow 1, Fast 1"),))
    puppet.run(25)  # half a second of a round of 1.25 s
    assert puppet.animation().time == pytest.approx(0.4 * 2.0)  # of the longest
    assert puppet.place(puppet.arm)[0] == pytest.approx(0.5 * 0.4 + 0.5 * 0.25)
    assert puppet.place(puppet.spine)[0] == pytest.approx(0.5 * 0.4)
    puppet.set(fade=0.1)
    puppet.set(AnimationBlend, mix="Fast 1")  # goes on in the same step, although it is the shorter one
    puppet.simulation.settle()
    assert puppet.animation().time == pytest.approx(0.4 * 0.5)


@pytest.mark.parametrize(("degrees", "most"), [(30.0, 0.036), (60.0, 0.28), (90.0, 0.95), (120.0, 2.3), (179.0, 8.4)])
def test_how_far_a_blend_is_from_the_even_turn(degrees: float, most: float) -> None:
    """The most at any share [degrees] as docs/animation.md has it, against SciPy's Slerp; and nearly all of it is there."""
    ends = turn((1, 2, 3), 10.0), -turn((1, 2, 3), 10.0 + degrees)  # the other sign is the same turn
    clips = [constant(name, ARM, end, of="rotation") for name, end in zip(("A", "B"), ends, strict=True)]
    puppet = Puppet(*clips, more=(AnimationBlend(mix="A 0, B 1", by="value"),))
    shares = np.linspace(0.0, 1.0, 41)
    found = []
    for share in shares:
        puppet.set(AnimationBlend, value=float(share))
        puppet.run()
        found.append(puppet.rotation(puppet.arm))
    even = Slerp([0.0, 1.0], Rotation.from_quat(np.array(ends)))(shares)
    off = np.degrees((Rotation.from_quat(np.array(found)) * even.inv()).magnitude()).max()
    assert 0.8 * most < off < most


def test_three_rotations_are_mixed_alike_in_any_order() -> None:
    turns = [turn((1, 0, 0), 40), -turn((0, 1, 0), 50), turn((0, 0, 1), 30)]
    clips = [constant(name, ARM, each, of="rotation") for name, each in zip("ABC", turns, strict=True)]
    seen = []
    for order in ("ABC", "CAB", "BCA"):
        mix = ", ".join(f"{name} {ord(name) - 64}" for name in order)
        puppet = Puppet(*clips, more=(AnimationBlend(mix=mix),))
        puppet.run()
        seen.append(Rotation.from_quat(puppet.rotation(puppet.arm)).as_matrix())
    np.testing.assert_allclose(seen[1], seen[0], atol=1e-6)
    np.testing.assert_allclose(seen[2], seen[0], atol=1e-6)
    weighted = Rotation.from_quat(turns).mean([1, 2, 3]).as_matrix()  # the chordal mean, by another way
    np.testing.assert_allclose(seen[0], weighted, atol=0.02)


def test_morph_weights_are_mixed_with_what_the_component_says() -> None:
    smile = Clip(name="Smile", channels=(track(ARM, [(1.0, 0.0), (1.0, 0.0)], name="weights"),))
    puppet = Puppet(LEFT, smile, fade=0.4)
    puppet.world.add(puppet.arm, Morph(weights="0 0.5"))
    puppet.run()
    puppet.set(clip="Smile")
    puppet.run(5)
    animated = puppet.simulation.animated()
    assert animated.weight_entity.tolist() == [puppet.arm] * 2
    assert animated.weight.tolist() == pytest.approx([0.25, 0.375])


def layered(mode: str, clip: Clip, **values: object) -> tuple[Puppet, int]:
    puppet = Puppet(LEFT, clip, clip="Left")
    parts = [Animation(clips=puppet.clips, clip=clip.name), AnimationLayer(mode=mode, **values)]
    layer = puppet.world.spawn(parts, name="Layer", parent=puppet.player)
    return puppet, layer


def test_a_layer_takes_the_place_of_what_is_below() -> None:
    puppet, layer = layered("replace", UP, weight=0.25)
    puppet.run()
    assert puppet.place(puppet.arm) == pytest.approx((-0.75, 0.75, 0.0))
    puppet.set(AnimationLayer, layer, weight=1.0)
    puppet.run()
    assert puppet.place(puppet.arm) == pytest.approx((0.0, 3.0, 0.0))


def test_a_layer_adds_how_its_clip_differs_from_its_beginning() -> None:
    wave = Clip(
        name="Wave",
        channels=(
            track(ARM, [(5, 5, 5), (5, 6, 5)]),
            track(SPINE, [turn((0, 0, 1), 30), turn((0, 0, 1), 70)], name="rotation"),
        ),
    )
    puppet, _ = layered("add", wave, weight=0.5)
    puppet.world.set_fields(puppet.spine, Transform, {"rotation": tuple(turn((1, 0, 0), 90).tolist())})
    puppet.run(25)
    assert puppet.place(puppet.arm) == pytest.approx((-1.0, 0.25, 0.0))
    expected = Rotation.from_quat(turn((1, 0, 0), 90)) * Rotation.from_quat(turn((0, 0, 1), 10))
    off = (Rotation.from_quat(puppet.rotation(puppet.spine)) * expected.inv()).magnitude()
    assert np.degrees(off) < 0.05


def test_a_mask_leaves_what_it_names_and_all_below() -> None:
    both = Clip(name="Both", channels=(track(HIPS, [(9, 9, 9)] * 2), track(ARM, [(0, 3, 0)] * 2)))
    puppet, layer = layered("replace", both, mask="Spine")
    puppet.run()
    assert puppet.place(puppet.hips) == (0.0, 1.0, 0.0)
    assert puppet.place(puppet.arm) == pytest.approx((0.0, 3.0, 0.0))
    puppet.set(AnimationLayer, layer, mask="Nobody")
    puppet.run()
    assert puppet.place(puppet.arm) == pytest.approx((-1.0, 0.0, 0.0))
    assert "has nobody below it called 'Nobody'" in puppet.problems()[0]


def test_layers_lie_over_one_another_in_their_order() -> None:
    puppet, layer = layered("replace", UP, order=2)
    parts = [Animation(clips=puppet.clips, clip="Left"), AnimationLayer(order=1)]
    puppet.world.spawn(parts, parent=puppet.player)
    puppet.run()
    assert puppet.place(puppet.arm) == pytest.approx((0.0, 3.0, 0.0))
    puppet.set(AnimationLayer, layer, order=0)
    puppet.run()
    assert puppet.place(puppet.arm) == pytest.approx((-1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ((AnimationBlend(mix="Left"),), "a mix is clips with numbers, as 'Walk 0.3, Run 0.7', not 'Left'"),
        ((AnimationBlend(mix="Left 1, Jump 1"),), "leaves a clip out of its mix: there is no clip 'Jump'"),
        ((AnimationBlend(mix="Left 1, Right -1"),), "a weight must be at least 0, not -1"),
        ((AnimationLayer(),), "lays its clips over nobody"),
    ],
)
def test_what_is_wrong_is_told(more, words: str) -> None:
    puppet = Puppet(LEFT, RIGHT, more=more)
    puppet.run()
    (problem,) = puppet.problems()
    assert words in problem


def test_texts_of_mixes_and_markers() -> None:
    assert mix_of(" Walk 0.3,Run fast 0.7 , ") == {"Walk": 0.3, "Run fast": 0.7}
    assert mix_of(mix_text({"A b": 1 / 3, "C": 2.0})) == pytest.approx({"A b": 1 / 3, "C": 2.0}, abs=1e-8)
    with pytest.raises(ComponentError, match="stands twice"):
        mix_of("A 1, A 2")
    with pytest.raises(ComponentError, match="may have no comma"):
        mix_text({"A,b": 1.0})
    found = markers_of("Walk: step 0.1 0.6, breathe 0.3; all 0.5")
    assert found == (("Walk", "step", 0.1), ("Walk", "step", 0.6), ("Walk", "breathe", 0.3), ("", "all", 0.5))
    for text in ("Walk: 0.1", "Walk: step", "Walk: step -1", "step x"):
        with pytest.raises(ComponentError, match="markers are a name and its times"):
            markers_of(text)


def test_a_clip_is_added_to_the_text_of_a_mix() -> None:
    assert mix_with("", "Walk", by_value=False) == "Walk 1"
    assert mix_with("Walk 0.3, ", "Run fast", by_value=False) == "Walk 0.3, Run fast 1"
    assert mix_with(" ", "Idle", by_value=True) == "Idle 0"
    assert mix_with("Idle 0, Run 3.45, Back -1", "Sprint", by_value=True) == "Idle 0, Run 3.45, Back -1, Sprint 4.45"
    assert mix_with("Walk", "Run", by_value=False) == "Walk, Run 1"  # what is wrong stays to be mended
    full = ", ".join(f"C{number} 1" for number in range(32))
    for text, name, words in [
        ("Walk 2", "Walk", "already"),
        ("", "A,b", "no comma"),
        ("", "A ", "space"),
        ("", "", "no comma"),
        (full, "D", "32"),
    ]:
        with pytest.raises(ComponentError, match=words):
            mix_with(text, name, by_value=False)


def test_a_clip_is_added_to_the_text_of_markers() -> None:
    assert markers_with("", "Walk") == "Walk:" and markers_of("Walk:") == ()
    assert markers_with("Walk: step 0.1; ", "Jump: high") == "Walk: step 0.1; Jump: high:"
    assert markers_of("Walk: step 0.1; Jump: high: off 1") == (("Walk", "step", 0.1), ("Jump: high", "off", 1.0))
    for text, name in [("Walk: step 0.1", "Walk"), ("Walk:", "Walk"), ("", "A;b"), ("", " A"), ("", "")]:
        with pytest.raises(ComponentError):
            markers_with(text, name)


def test_a_run_that_was_wound_back_goes_on_with_the_same_bits() -> None:
    moving = Clip(name="Moving", channels=(track(ARM, [(0, 0, 0), (1, 2, 0), (0, 0, 1)], duration=0.77),))
    puppet = Puppet(LEFT, moving, UP, fade=0.5, speed=1.3)
    puppet.run(7)
    puppet.set(clip="Moving")
    puppet.run(9)
    state = puppet.simulation.capture()
    puppet.set(clip="Up")
    puppet.run(20)
    expected = puppet.simulation.state_hash(), puppet.simulation.animations.voices.weight.tobytes()
    puppet.simulation.restore(state)
    puppet.set(clip="Up")
    puppet.run(20)
    assert (puppet.simulation.state_hash(), puppet.simulation.animations.voices.weight.tobytes()) == expected


def test_a_state_of_before_clips_were_blended_is_taken_too() -> None:
    puppet = Puppet(LEFT, RIGHT)
    puppet.run(5)
    state = puppet.simulation.capture()
    later = ("voices/", "rest/", "walks/", "/fade", "/passes")
    old = {key: value for key, value in state.values.items() if not any(word in key for word in later)}
    assert len(old) < len(state.values)
    puppet.set(clip="Right", fade=1.0)
    puppet.run(3)
    puppet.simulation.restore(type(state)(tick=state.tick, time=state.time, values=old, is_ours=True))
    assert puppet.animation().fade == 0.0 and puppet.animation().clip == ""
    puppet.run()
    assert puppet.place(puppet.arm)[0] == -1.0
