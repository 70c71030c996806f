"""Saving: what was opened, edited and saved can be opened again and is the same, or nothing is written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from elys.common.assets import AssetStore
from elys.common.components import component_from
from elys.common.errors import SceneError
from elys.common.scene import EntityNode, SceneDocument, open_scene, write_scene
from elys.editor_node.scene_file import scene_records

PNG = b"\x89PNG\r\n\x1a\n" + bytes(16)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """The editor works in a folder in which nothing is, with a cache that knows nothing yet."""
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))


def meaning(records):
    return [
        (r.name, r.parent, r.enabled, r.prefab, {n: component_from(n, v) for n, v in r.components.items()})
        for r in records
    ]


def helmet_scene(folder: Path, helmet: Path) -> Path:
    """Two helmets by relative name, one with an override inside, and one of its meshes on its own."""
    (folder / "models").symlink_to(helmet.parent)
    (folder / "skin.png").write_bytes(PNG)
    model = "models/FlightHelmet.gltf"
    nodes = [
        EntityNode(name="Left", prefab=model, overrides={"Hose_low": {"Material": {"roughness": 0.9}}}),
        EntityNode(prefab=model, components={"Transform": {"position": [2, 0, 0]}}),
        EntityNode(name="Hose", components={"MeshRenderer": {"mesh": f"{model}#0/0"}}),
        EntityNode(name="Sign", components={"Material": {"base_color_texture": "skin.png"}}),
    ]
    path = folder / "yard.scene.json"
    write_scene(SceneDocument(name="The yard", entities=nodes), path)
    return path


def test_a_bare_model_that_was_edited_is_saved_as_an_instance_of_its_file(on_stage, shared_assets, tmp_path):
    opened = open_scene(shared_assets / "FlightHelmet" / "FlightHelmet.gltf", AssetStore())
    target = tmp_path / "helmet.scene.json"

    async def scenario(stage):
        model = stage.model
        await model.edit.set_fields([stage.named("FlightHelmet")], "Transform", {"position": (0.0, 3.0, 0.0)})
        await model.edit.set_fields([stage.named("Hose_low")], "Material", {"roughness": 0.125})
        await model.edit.spawn("Box", parent=stage.named("FlightHelmet"))
        model.selection.replace([stage.named("Lenses_low")])
        await model.edit.duplicate()  # beside the original, and so below the instance's root: an entity of its own
        await model.save(str(target))
        assert meaning(open_scene(target, AssetStore()).records) == meaning(scene_records(model.scene))

    on_stage(scenario, opened.records)
    assert "blake2b" not in target.read_text()
    instance = json.loads(target.read_text())["entities"][0]
    assert instance["overrides"] == {"Hose_low": {"Material": {"roughness": 0.125}}}


@pytest.mark.parametrize("folder", [".", "copies/deep"])
def test_prefabs_of_a_scene_in_another_folder_are_named_from_where_it_is_saved(
    on_stage, shared_assets, tmp_path, folder
):
    path = helmet_scene(tmp_path, shared_assets / "FlightHelmet" / "FlightHelmet.gltf")
    before = path.read_text()
    opened = open_scene(path, AssetStore())
    target = tmp_path / folder / path.name
    target.parent.mkdir(parents=True, exist_ok=True)

    async def scenario(stage):
        model = stage.model
        model.status = None
        model.file.save(path, name="The yard")
        assert path.read_text() == before  # nothing was edited, nothing changes
        await model.edit.rename(stage.named("Left"), "First")
        model.file.save(target)
        assert meaning(open_scene(target, AssetStore()).records) == meaning(scene_records(model.scene))

    on_stage(scenario, opened.records)
    assert "blake2b" not in target.read_text()
    assert '"prefab": "' + ("" if folder == "." else "../../") + 'models/FlightHelmet.gltf"' in target.read_text()


def test_what_could_not_be_opened_again_is_not_written(on_stage, shared_assets, tmp_path):
    path = helmet_scene(tmp_path, shared_assets / "FlightHelmet" / "FlightHelmet.gltf")
    opened = open_scene(path, AssetStore())
    target = tmp_path / "other.scene.json"

    async def scenario(stage):
        file = stage.model.file
        with pytest.raises(
            SceneError, match=r"'Sign' cannot be saved: no file is known .* Material\.base_color_texture"
        ):
            file.save(target)
        (tmp_path / "models").unlink()  # as on a machine that has not got the model
        with pytest.raises(SceneError, match=r"'Left' cannot be saved, its prefab cannot be read here: .*FlightHelmet"):
            file.save(target)
        assert not target.exists() and file.path is None
        stage.model.selection.replace([stage.named(name) for name in ("Left", "FlightHelmet", "Hose", "Sign")])
        await stage.model.edit.delete()
        await stage.model.edit.spawn("Box")
        box = stage.named("Box")
        await stage.model.edit.set_fields([box], "MeshRenderer", {"mesh": "blob"})
        with pytest.raises(SceneError, match="'blob' is no mesh that is built in"):
            file.save(target)
        assert not target.exists() and file.is_dirty

    on_stage(scenario, opened.records)


def test_a_saved_scene_keeps_its_name_and_the_person_is_told(on_stage, tmp_path):
    async def scenario(stage):
        model = stage.model
        model.say("error", "something else went wrong")
        await model.save(str(tmp_path / "first-try"))
        path = tmp_path / "first-try.scene.json"
        assert open_scene(path, AssetStore()).name == "yard"  # as the session calls it
        assert model.notice == f"Saved {path}" and not model.error
        assert next(reversed(list(model.console))).text == f"Saved {path}"

    on_stage(scenario)


def test_a_copy_is_joined_within_itself_and_saved_by_name(on_stage, tmp_path):
    """A swing whose seat hangs from its beam, and a dog on a lead to the seat: copied, deleted and brought back, saved."""
    seat = EntityNode(name="Seat", components={"Joint": {"kind": "distance", "other": "Swing"}})
    dog = EntityNode(name="Dog", components={"Joint": {"other": "Seat"}})
    path = tmp_path / "park.scene.json"
    write_scene(SceneDocument(name="Park", entities=[EntityNode(name="Swing", children=[seat]), dog]), path)
    target = tmp_path / "copy.scene.json"

    async def scenario(stage):
        model = stage.model
        model.selection.replace([stage.named("Swing")])
        await model.edit.duplicate()
        model.selection.replace([stage.named("Swing 2")])
        await model.edit.delete()
        model.undo()
        await model.history.settle()
        await model.save(str(target))

    on_stage(scenario, open_scene(path, AssetStore()).records)
    records = open_scene(target, AssetStore()).records
    paths = [f"{records[r.parent].name if r.parent >= 0 else ''}/{r.name}" for r in records]
    joined = {path: paths[r.references["Joint.other"]] for path, r in zip(paths, records, strict=True) if r.references}
    assert joined == {"Swing/Seat": "/Swing", "Swing 2/Seat": "/Swing 2", "/Dog": "Swing/Seat"}
