"""What is copied is the text of a scene file, and what is pasted names what it means, whatever scene it comes to."""

from __future__ import annotations

import json

import pytest

from elys.bus.asset_service import serve_assets
from elys.common.assets.store import AssetStore, reference_of
from elys.common.components import component_from
from elys.common.errors import SceneError
from elys.common.scene import EntityRecord, expand, open_scene, parse_scene
from elys.editor_node.scene_clipboard import copy_text, read_fragment
from tests.unit.editor_node.scene_host import tree_of

DOORS = [
    EntityRecord(name="House", components={"Transform": {"position": [1, 0, 0]}, "RigidBody": {}}),
    EntityRecord(
        name="Door",
        parent=0,
        components={"Transform": {"position": [0, 1, 0]}, "RigidBody": {}, "Joint": {"kind": "hinge"}},
        references={"Joint.other": 0},
    ),
    EntityRecord(name="Bolt ★", parent=1, components={"Joint": {}}, references={"Joint.other": 1}),
    EntityRecord(name="Fence", components={"RigidBody": {}}),
    EntityRecord(name="Gate", components={"RigidBody": {}, "Joint": {}}, references={"Joint.other": 3}),
]


def told(stage) -> str:
    return "\n".join(line.text for line in stage.model.console)


def test_what_is_copied_is_a_scene_file_and_comes_back_the_same(on_stage, tmp_path):
    async def scenario(stage):
        model = stage.model
        model.selection.replace([stage.named("House"), stage.named("Fence"), stage.named("Gate")])
        assert model.tree.copy()
        text = model.tree.clipboard.read()
        path = tmp_path / "part.scene.json"
        path.write_text(text, encoding="utf-8")
        opened = open_scene(path, AssetStore())  # as `elys run` would
        assert [record.name for record in opened.records] == [record.name for record in DOORS]
        assert [record.references for record in opened.records] == [record.references for record in DOORS]
        before = tree_of(stage.host.mirror)
        model.selection.clear()
        outcome = await model.tree.paste(directory=tmp_path)
        assert outcome.accepted == 1 and len(outcome.spawned) == 3
        assert model.selection.entities == outcome.spawned
        names = [entity.name for entity in stage.host.mirror.in_order()]
        assert names[5:] == ["House 2", "Door", "Bolt ★", "Fence 2", "Gate 2"]
        house, fence, gate = outcome.spawned
        (door,) = stage.host.mirror.children_of(house)
        (bolt,) = stage.host.mirror.children_of(door)
        entities = stage.host.mirror.entities
        assert entities[door].components["Joint"].other == house
        assert entities[bolt].components["Joint"].other == door
        assert entities[gate].components["Joint"].other == fence
        await model.history.undo()
        assert tree_of(stage.host.mirror) == before
        await model.history.redo()
        assert [entity.name for entity in stage.host.mirror.in_order()] == names

    on_stage(scenario, DOORS)


def test_references_to_others_are_kept_by_name_or_dropped_with_a_sentence(on_stage, tmp_path):
    async def scenario(stage):
        model = stage.model
        model.selection.replace([stage.named("Gate")])
        model.tree.copy()
        assert json.loads(model.tree.clipboard.read())["entities"][0]["components"]["Joint"] == {"other": "Fence"}
        outcome = await model.tree.paste(directory=tmp_path)
        entities = stage.host.mirror.entities
        assert entities[outcome.spawned[0]].components["Joint"].other == stage.named("Fence")
        # Beside what was selected.
        assert stage.host.mirror.roots[-2:] == [stage.named("Gate"), outcome.spawned[0]]

        await model.edit.rename(stage.named("Fence"), "Hedge")
        outcome = await model.tree.paste(directory=tmp_path)
        assert entities[outcome.spawned[0]].components["Joint"].other == 0
        assert "Joint.other of 'Gate' is left out: nobody here is called 'Fence'" in told(stage)

        # One of the same name among what is copied would be taken for it.
        await model.edit.rename(stage.named("Hedge"), "Gate")
        model.selection.replace([entity for entity in entities if "Joint" in entities[entity].components][-1:])
        model.tree.copy()
        assert "Gate" in model.tree.clipboard.read()

    on_stage(scenario, DOORS)


def test_a_name_within_what_is_copied_is_not_taken_for_one_outside(on_stage):
    async def scenario(stage):
        inner = stage.named("Yard")
        copied = copy_text(stage.model.scene, [inner])
        assert "Joint" in copied.text and "other" not in copied.text
        assert copied.losses == ("Joint.other of 'Latch' is left out: a copied entity is called 'Post' as well",)

    records = [
        EntityRecord(name="Post", components={"RigidBody": {}}),
        EntityRecord(name="Yard"),
        EntityRecord(name="Post", parent=1),
        EntityRecord(name="Latch", parent=1, components={"Joint": {}}, references={"Joint.other": 0}),
    ]
    on_stage(scenario, records)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "the clipboard is empty"),
        ("  \n", "the clipboard is empty"),
        ("Dear Anna, see you on Monday", "the clipboard holds no entities of a scene: 1:1: not JSON"),
        ("[1, 2]", "must be an object"),
        ('{"a": 1}', 'not a scene of ELYS: it has no "elys_scene": 1 at its top'),
        ('{"elys_scene": 1}', "the scene on the clipboard has no entities"),
        ('{"elys_scene": 99, "entities": []}', "newer than this ELYS reads"),
        ('{"elys_scene": 1, "entities": [{"components": {"RigidBdy": {}}}]}', "did you mean 'RigidBody'?"),
        ('{"elys_scene": 1, "entities": [{"prefab": "gone.prefab.json"}]}', "there is no scene file"),
        ('{"elys_scene": 1, "entities": [{"components": {"MeshRenderer": {"mesh": "gone.glb"}}}]}', "cannot be pasted"),
    ],
)
def test_nonsense_is_refused_in_one_sentence(on_stage, tmp_path, text, sentence):
    async def scenario(stage):
        before = tree_of(stage.host.mirror)
        stage.model.tree.clipboard.write(text)
        assert await stage.model.tree.paste(directory=tmp_path) is None
        assert stage.model.error.startswith("cannot paste: ")
        assert sentence in stage.model.error and "\n" not in stage.model.error
        assert tree_of(stage.host.mirror) == before

    on_stage(scenario)


def test_instances_of_prefabs_stay_instances_where_their_file_is(on_stage, tmp_path):
    lamp = tmp_path / "lamp.prefab.json"
    lamp.write_text(
        '{"elys_scene": 1, "entities": [{"name": "Lamp", "components": {"RigidBody": {"mass": 2}}, "children": '
        '[{"name": "Bulb", "components": {"Light": {}, "Joint": {"other": "Lamp"}}}]}]}',
        encoding="utf-8",
    )
    document = parse_scene(f'{{"elys_scene": 1, "entities": [{{"prefab": "{lamp}"}}]}}')
    records = expand(document, directory=tmp_path, assets=AssetStore())

    async def scenario(stage):
        model = stage.model
        model.selection.replace([stage.named("Lamp")])
        await model.edit.set_fields([stage.named("Bulb")], "Light", {"intensity": 7.0})
        model.tree.copy()
        node = json.loads(model.tree.clipboard.read())["entities"][0]
        assert node["prefab"] == str(lamp)
        assert node["overrides"] == {"Bulb": {"Light": {"intensity": 7}}}
        outcome = await model.tree.paste(directory=tmp_path)
        (copy,) = outcome.spawned
        (bulb,) = stage.host.mirror.children_of(copy)
        entities = stage.host.mirror.entities
        assert entities[copy].prefab == str(lamp)
        assert entities[bulb].components["Light"].intensity == 7.0
        assert entities[bulb].components["Joint"].other == copy
        lamp.unlink()  # written out in full then, so that nothing is lost
        model.tree.copy()
        assert "prefab" not in json.loads(model.tree.clipboard.read())["entities"][0]
        outcome = await model.tree.paste(directory=tmp_path)
        (bulb,) = stage.host.mirror.children_of(outcome.spawned[0])
        assert entities[bulb].components["Light"].intensity == 7.0

    on_stage(scenario, records)


def test_content_comes_along_or_is_named_as_missing(on_stage, tmp_path, monkeypatch):
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))
    here, gone = b"a mesh that this machine has", b"one that nobody has"

    async def scenario(stage):
        host_store = AssetStore()
        serve_assets(stage.host.session, host_store)
        AssetStore(tmp_path / "cache" / "assets").put(here, kind="mesh")
        entities = [
            {"name": "There", "components": {"MeshRenderer": {"mesh": reference_of(here)}}},
            {"name": "Gone", "components": {"Material": {"base_color_texture": f"{reference_of(gone)}?scale=2,2"}}},
        ]
        stage.model.tree.clipboard.write(json.dumps({"elys_scene": 1, "entities": entities}))
        outcome = await stage.model.tree.paste(directory=tmp_path)
        assert len(outcome.spawned) == 2
        assert host_store.get(reference_of(here)) == here
        assert f"1 assets of what was pasted are missing here, so that is not drawn: {reference_of(gone)}" in told(
            stage
        )
        # And out again as it came in.
        stage.model.tree.copy()
        fragment = read_fragment(stage.model.tree.clipboard.read(), stage.model.scene, directory=tmp_path)
        assert fragment.content == [reference_of(here), reference_of(gone)]

    on_stage(scenario)


def test_entities_nested_too_deep_for_a_file_are_refused(on_stage):
    async def scenario(stage):
        with pytest.raises(SceneError, match="nested"):
            copy_text(stage.model.scene, [stage.named("Node 0")])
        stage.model.selection.replace([stage.named("Node 0")])
        assert not stage.model.tree.copy()
        assert "cannot copy" in stage.model.error

    on_stage(scenario, [EntityRecord(name=f"Node {n}", parent=n - 1) for n in range(200)])


def test_a_group_stands_amid_its_members_which_stay_where_they_are(on_stage):
    async def scenario(stage):
        model, mirror = stage.model, stage.host.mirror
        boxes = [stage.named(f"Box {number}") for number in (1, 3, 5)]
        before = tree_of(mirror)
        places = {box: mirror.world_pose(box).position for box in boxes}
        index = mirror.roots.index(boxes[0])
        model.selection.replace(boxes)
        await model.tree.group()
        await stage.settle()
        group = stage.named("Group")
        assert mirror.roots[index] == group
        assert mirror.children_of(group) == boxes
        assert mirror.world_pose(group).position == (3.0, 1.0, 0.0)
        for box in boxes:
            assert mirror.world_pose(box).position == pytest.approx(places[box], abs=1e-9)
        assert model.selection.entities == (group,)
        after = tree_of(mirror)
        for _ in range(2):
            await model.history.undo()  # one entry, though it is several commands
            assert tree_of(mirror) == before
            assert not model.history.undo_label
            await model.history.redo()
            assert tree_of(mirror) == after
        assert (
            component_from("Transform", {"position": (3, 1, 0)})
            == mirror.entities[mirror.roots[index]].components["Transform"]
        )

    on_stage(scenario)
