"""Fields that name clips, by hand: the real widgets, a small host behind them that serves the clips."""

from __future__ import annotations

import json
import shutil

import pytest

from elys.bus.asset_service import AssetOffer, serve_assets
from elys.common.assets.clip import Clip, encode_clips
from elys.common.assets.store import AssetStore, reference_of
from elys.common.scene import EntityRecord
from elys.editor_node import clip_names
from elys.editor_node.keys import Key
from elys.editor_node.scene_file import open_scene
from elys.samples import figure
from tests.unit.editor_node.hand import by_hand as by_hand
from tests.unit.editor_node.person import CTRL

pytestmark = pytest.mark.gl

GAITS = ("Idle", "Walk", "Run ## fast", "A, b")
DANCES = (*(f"Dance {number}" for number in range(40)), "Walk", "Idle")
CLIP, MIX, MARKERS = "inspector/Animation/clip", "inspector/AnimationBlend/mix", "inspector/AnimationMarkers/markers"


def clips(names) -> bytes:
    return encode_clips([Clip(name=name, channels=()) for name in names])


def player(name: str, names=(), **components) -> EntityRecord:
    """An entity with an Animation of clips of these names."""
    animation = {"clips": reference_of(clips(names)) if names else "", **components.pop("Animation", {})}
    return EntityRecord(name=name, components={"Transform": {}, "Animation": animation, **components})


@pytest.fixture
def at_clips(by_hand, tmp_path, monkeypatch):
    """Runs `await scenario(hand)` with one selected of some who play clips."""
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))
    store = AssetStore()
    for names in (GAITS, DANCES):
        store.put(clips(names), kind="clips")

    def play(scenario, select: str = "Ada", records=None) -> None:
        async def with_assets(hand):
            serve_assets(hand.person.stage.host.session, store)
            await hand.person.frames(2)
            await hand.fold("Transform")
            await scenario(hand)

        blend, markers = {"mix": "Idle 0, Walk 1.2", "by": "value"}, {"markers": "Walk: step 0.1 0.6"}
        some = [
            player("Ada", GAITS, AnimationBlend=blend, AnimationMarkers=markers),
            player("Bob", DANCES, Animation={"clip": "Walk"}, AnimationBlend={"mix": "Idle 1"}),
            player("Cleo", GAITS, Animation={"clip": "Gone"}),
            player("Dan", GAITS, AnimationBlend=blend),
            player("Eve"),
            player("Finn", ("Nobody", "serves", "these")),
        ]
        by_hand(with_assets, select, some if records is None else records)

    return play


async def known(hand, names=GAITS) -> None:
    """Waits until the host has told what the clips are called."""
    await hand.person.until(lambda: hand.model.clip_names.of(reference_of(clips(names))))
    await hand.person.frames(2)


async def offered(hand, opener: str, field: str) -> list[str]:
    """What the open list of a field has; Escape closes it again."""
    await hand.person.click(opener)
    await hand.person.frames(3)
    lines = [name.removeprefix(f"{field}/pick/") for name in await hand.shown() if name.startswith(f"{field}/pick/")]
    await hand.person.press(Key.ESCAPE)
    await hand.person.frames(2)
    return sorted(lines)


def test_a_clip_is_chosen_from_those_that_the_asset_has_and_undo_takes_it_back(at_clips, screenshot_directory):
    async def scenario(hand):
        person = hand.person
        await known(hand)
        await person.click(CLIP)
        await person.frames(3)
        shown = await hand.shown()
        assert {f"{CLIP}/pick/{name}" for name in ("(none)", *GAITS)} <= shown
        assert f"{CLIP}/search" not in shown  # there are few
        await person.point(f"{CLIP}/pick/Walk")
        person.editor.screenshot(screenshot_directory / "inspector-clips.png")
        await person.click(f"{CLIP}/pick/Run ## fast")
        await hand.settle()
        assert hand.value("Ada", "Animation", "clip") == "Run ## fast"
        person.editor.screenshot(screenshot_directory / "inspector-clip-chosen.png")
        await person.click(CLIP)
        await person.frames(3)
        await person.click(f"{CLIP}/pick/(none)")
        await hand.settle()
        assert hand.value("Ada", "Animation", "clip") == ""
        await person.press(Key.Z, CTRL)
        await hand.settle()
        assert hand.value("Ada", "Animation", "clip") == "Run ## fast"
        await person.press(Key.Z, CTRL)
        await hand.settle()
        assert hand.value("Ada", "Animation", "clip") == "" and not hand.model.history.undo_label

    at_clips(scenario)


def test_many_clips_are_searched(at_clips, screenshot_directory):
    async def scenario(hand):
        person = hand.person
        await known(hand, DANCES)
        await person.click(CLIP)
        await person.frames(3)
        assert f"{CLIP}/search" in await hand.shown()
        await person.type("dance 3")
        await person.frames(2)
        shown = await hand.shown()
        assert f"{CLIP}/pick/Dance 33" in shown and f"{CLIP}/pick/Walk" not in shown
        person.editor.screenshot(screenshot_directory / "inspector-clips-searched.png")
        await person.press(Key.ENTER)
        await hand.settle()
        assert hand.value("Bob", "Animation", "clip") == "Dance 3"
        await person.click(CLIP)
        await person.frames(3)
        assert f"{CLIP}/pick/(none)" in await hand.shown()  # nothing is searched any more

    at_clips(scenario, "Bob")


def test_a_name_that_is_not_among_the_clips_stays_until_another_is_chosen(at_clips, screenshot_directory):
    async def scenario(hand):
        person = hand.person
        await known(hand)
        await offered(hand, CLIP, CLIP)
        await person.point(CLIP)
        await person.frames(3)
        person.editor.screenshot(screenshot_directory / "inspector-clip-missing.png")
        assert person.stage.host.received == [] and hand.value("Cleo", "Animation", "clip") == "Gone"
        await person.click(CLIP)
        await person.frames(3)
        await person.click(f"{CLIP}/pick/Idle")
        await hand.settle()
        assert hand.value("Cleo", "Animation", "clip") == "Idle"

    at_clips(scenario, "Cleo")


@pytest.mark.parametrize("name", ["Eve", "Finn"])
def test_where_clips_are_not_known_their_names_are_typed(at_clips, name):
    async def scenario(hand):
        await hand.enter("Animation/clip", "Jump")
        assert hand.value(name, "Animation", "clip") == "Jump"

    at_clips(scenario, name)


def test_clips_are_asked_for_again_until_they_can_be_had(at_clips, monkeypatch):
    monkeypatch.setattr(clip_names, "ASK_AGAIN", 0.0)
    late = ("Nobody", "serves", "these")

    async def scenario(hand):
        await hand.person.frames(6)
        assert hand.model.clip_names.of(reference_of(clips(late))) == ()
        store = AssetStore()
        assert await AssetOffer(hand.model.session).bring(store.put(clips(late), kind="clips"), store)
        await known(hand, late)
        assert await offered(hand, CLIP, CLIP) == ["(none)", "Nobody", "serves", "these"]

    at_clips(scenario, "Finn")


def test_several_are_offered_what_all_have_and_all_take_it(at_clips, screenshot_directory):
    async def scenario(hand):
        person = hand.person
        await person.click("hierarchy/Ada", held=CTRL)
        await known(hand)
        await known(hand, DANCES)
        person.editor.screenshot(screenshot_directory / "inspector-clips-several.png")
        assert await offered(hand, CLIP, CLIP) == ["(none)", "Idle", "Walk"]
        await person.click(f"{MIX}/pick")  # they differ: there is no text to add to
        await person.frames(3)
        assert not [name for name in await hand.shown() if name.startswith(f"{MIX}/pick/")]
        await person.click(CLIP)
        await person.frames(3)
        await person.click(f"{CLIP}/pick/Walk")
        await hand.settle()
        assert [hand.value(name, "Animation", "clip") for name in ("Ada", "Bob")] == ["Walk", "Walk"]
        await person.press(Key.Z, CTRL)
        await hand.settle()
        assert [hand.value(name, "Animation", "clip") for name in ("Ada", "Bob")] == ["", "Walk"]
        await person.click("hierarchy/Eve", held=CTRL)  # who has no clips at all
        await person.frames(3)
        assert await offered(hand, CLIP, CLIP) == []

    at_clips(scenario, "Bob")


def test_clips_are_added_to_mixes_and_markers(at_clips, screenshot_directory):
    async def scenario(hand):
        person = hand.person
        await known(hand)
        assert await offered(hand, f"{MIX}/pick", MIX) == ["Run ## fast"]  # no name with a comma, none twice
        await person.click(f"{MIX}/pick")
        await person.frames(3)
        person.editor.screenshot(screenshot_directory / "inspector-clip-added.png")
        await person.click(f"{MIX}/pick/Run ## fast")
        await hand.settle()
        assert hand.value("Ada", "AnimationBlend", "mix") == "Idle 0, Walk 1.2, Run ## fast 2.2"
        assert hand.value("Dan", "AnimationBlend", "mix") == "Idle 0, Walk 1.2"
        await person.click(f"{MARKERS}/pick")
        await person.frames(3)
        await person.type("idle")
        await person.frames(2)
        await person.press(Key.ENTER)
        await hand.settle()
        assert hand.value("Ada", "AnimationMarkers", "markers") == "Walk: step 0.1 0.6; Idle:"
        for _ in range(2):
            await person.press(Key.Z, CTRL)
            await hand.settle()
        assert hand.value("Ada", "AnimationBlend", "mix") == "Idle 0, Walk 1.2"
        await hand.enter("AnimationBlend/mix", "Walk 0.5")  # it is typed as before
        assert hand.value("Ada", "AnimationBlend", "mix") == "Walk 0.5"

    at_clips(scenario)


def test_mixes_that_are_alike_are_longer_together(at_clips):
    async def scenario(hand):
        person = hand.person
        await person.click("hierarchy/Dan", held=CTRL)
        await known(hand)
        await person.click(f"{MIX}/pick")
        await person.frames(3)
        await person.click(f"{MIX}/pick/Run ## fast")
        await hand.settle()
        mixes = {hand.value(name, "AnimationBlend", "mix") for name in ("Ada", "Dan")}
        assert mixes == {"Idle 0, Walk 1.2, Run ## fast 2.2"}
        await person.press(Key.Z, CTRL)
        await hand.settle()
        assert not hand.model.history.undo_label  # one edit

    at_clips(scenario)


def test_a_clip_of_a_prefabs_instance_is_marked_and_reverted(at_clips, tmp_path):
    shutil.copy(figure.FILE, tmp_path / "figure.glb")
    animation = {"clips": "figure.glb#clips", "clip": "Walk"}
    body = {"name": "Body", "components": {"Transform": {}, "Animation": animation}}
    prefab = {"elys_scene": 1, "entities": [body]}
    (tmp_path / "body.prefab.json").write_text(json.dumps(prefab), encoding="utf-8")
    scene = {"elys_scene": 1, "entities": [{"name": "Gwen", "prefab": "body.prefab.json"}]}
    (tmp_path / "stage.scene.json").write_text(json.dumps(scene), encoding="utf-8")
    store = AssetStore()
    records = open_scene(tmp_path / "stage.scene.json", store).records
    reference = records[0].components["Animation"]["clips"]
    AssetStore(tmp_path / "cache" / "assets").put(store.get(reference), kind="clips")  # the host here has it not

    async def scenario(hand):
        person = hand.person
        await person.until(lambda: hand.model.clip_names.of(reference))
        await person.until(lambda: hand.model.prefabs.of(person.stage.named("Gwen")) is not None)
        await person.frames(2)
        assert "inspector/revert_all" not in await hand.shown()
        await person.click(CLIP)
        await person.frames(3)
        await person.click(f"{CLIP}/pick/Run")
        await hand.settle()
        assert hand.value("Gwen", "Animation", "clip") == "Run" and "inspector/revert_all" in await hand.shown()
        await hand.right_click(f"{CLIP}/label")
        await person.click(f"{CLIP}/menu/revert")
        await hand.settle()
        assert hand.value("Gwen", "Animation", "clip") == "Walk"

    at_clips(scenario, "Gwen", records)
