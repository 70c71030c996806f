"""Prefabs, overrides and references: what a document becomes, and back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from elys.common.assets import AssetStore, is_reference
from elys.common.errors import AssetError, SceneError
from elys.common.scene import (
    EntityNode,
    EntityRecord,
    SceneDocument,
    SceneSettings,
    collapse,
    expand,
    format_scene,
    open_scene,
    read_scene,
    write_scene,
)

PNG = b"\x89PNG\r\n\x1a\n" + bytes(16)


def write(path: Path, *entities: dict[str, Any], **fields: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"elys_scene": 1, **fields, "entities": list(entities)}))
    return path


def expanded(directory: Path, *nodes: EntityNode, assets: AssetStore | None = None) -> list[EntityRecord]:
    return expand(SceneDocument(entities=list(nodes)), directory=directory, assets=assets or AssetStore())


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A prefab of a root, an arm and a hand, beside its picture."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "skin.png").write_bytes(PNG)
    hand = {"name": "Hand", "components": {"MeshRenderer": {"mesh": "sphere"}, "Light": {"kind": "point"}}}
    arm = {"name": "Arm", "components": {"Transform": {"position": [1, 0, 0]}}, "children": [hand]}
    root = {
        "name": "Robot",
        "components": {"RigidBody": {"mass": 5, "gravity_scale": 0.5}, "Material": {"base_color_texture": "skin.png"}},
        "children": [arm],
    }
    return write(tmp_path / "parts" / "robot.prefab.json", root)


def test_children_follow_their_parents(tmp_path: Path) -> None:
    tree = EntityNode(
        name="A", children=[EntityNode(name="B", children=[EntityNode()]), EntityNode(name="C", enabled=False)]
    )
    records = expanded(tmp_path, tree, EntityNode(name="D"))
    assert [(r.name, r.parent, r.enabled) for r in records] == [
        ("A", -1, True),
        ("B", 0, True),
        ("Entity", 1, True),
        ("C", 0, False),
        ("D", -1, True),
    ]


def test_an_instance_is_the_prefab_with_changes_laid_over(tmp_path: Path, robot: Path) -> None:
    assets = AssetStore()
    node = EntityNode(
        name="R2",
        enabled=False,
        prefab="parts/robot.prefab.json",
        components={"RigidBody": {"mass": 9.0}, "Collider": {}},
        overrides={"Arm/Hand": {"MeshRenderer": {"mesh": "cone"}, "Light": None}},
        children=[EntityNode(name="Hat")],
    )
    robot_2, arm, hand, hat = expanded(tmp_path, node, assets=assets)
    assert (robot_2.name, robot_2.enabled, robot_2.prefab) == ("R2", False, robot.as_posix())
    assert robot_2.components["RigidBody"] == {"mass": 9.0, "gravity_scale": 0.5}
    assert "Collider" in robot_2.components
    assert assets.get(robot_2.components["Material"]["base_color_texture"]) == PNG
    assert (arm.parent, hand.parent, hat.parent) == (0, 1, 0)
    assert hand.components == {"MeshRenderer": {"mesh": "cone"}}
    assert (arm.prefab, hand.prefab) == ("", "")


def test_two_instances_share_nothing(tmp_path: Path, robot: Path) -> None:
    node = EntityNode(prefab="parts/robot.prefab.json")
    changed = EntityNode(prefab="parts/robot.prefab.json", overrides={"Arm": {"Transform": {"position": [2, 0, 0]}}})
    records = expanded(tmp_path, changed, node)
    assert [records[i].components["Transform"]["position"] for i in (1, 4)] == [[2, 0, 0], [1, 0, 0]]


def test_prefabs_inside_prefabs_are_found_from_their_own_folder(tmp_path: Path, robot: Path) -> None:
    write(tmp_path / "squads" / "pair.prefab.json", {
        "name": "Pair",
        "children": [{"prefab": "../parts/robot.prefab.json"}, {"name": "Second", "prefab": "../parts/robot.prefab.json"}],
    })  # fmt: skip
    records = expanded(tmp_path, EntityNode(prefab="squads/pair.prefab.json", overrides={"Second/Arm": {"Camera": {}}}))
    assert [r.name for r in records] == ["Pair", "Robot", "Arm", "Hand", "Second", "Arm", "Hand"]
    assert records[1].prefab == robot.as_posix()
    assert "Camera" in records[5].components


def test_prefabs_that_contain_themselves_are_found_out(tmp_path: Path) -> None:
    write(tmp_path / "a.prefab.json", {"children": [{"prefab": "b.prefab.json"}]})
    write(tmp_path / "b.prefab.json", {"children": [{"prefab": "a.prefab.json"}]})
    with pytest.raises(SceneError, match=r"contain themselves: a\.prefab\.json -> b\.prefab\.json -> a\.prefab\.json"):
        expanded(tmp_path, EntityNode(prefab="a.prefab.json"))


def test_prefabs_that_multiply_are_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("elys.common.scene_expansion.MAX_EXPANDED", 1000)
    write(tmp_path / "0.prefab.json", {})
    for level in range(1, 30):
        write(tmp_path / f"{level}.prefab.json", {"children": [{"prefab": f"{level - 1}.prefab.json"}] * 10})
    with pytest.raises(SceneError, match="more than 1000 entities"):
        expanded(tmp_path, EntityNode(prefab="29.prefab.json"))


@pytest.mark.parametrize(
    "node, expected",
    [
        (EntityNode(prefab="gone.prefab.json"), r"entities\[0\].prefab: there is no scene file .*gone"),
        (EntityNode(prefab="gone.gltf"), r"entities\[0\].prefab: .*gone\.gltf does not exist"),
        (EntityNode(prefab="robot.txt"), r"entities\[0\].prefab: robot.txt is no prefab; prefabs are"),
        (EntityNode(prefab="a\0.gltf"), r"is not a path"),
        (
            EntityNode(prefab="parts/robot.prefab.json", overrides={"Arm/Hnd": {}}),
            r'overrides\["Arm/Hnd"\]: the prefab has nobody at this path; did you mean \'Arm/Hand\'',
        ),
        (
            EntityNode(components={"MeshRenderer": {"mesh": "spere"}}),
            r"components.MeshRenderer.mesh: 'spere' is no mesh that is built in, no model and no image; did you mean 'sphere'",
        ),
        (EntityNode(components={"MeshRenderer": {"mesh": "gone.glb#0/0"}}), r"mesh: .*gone\.glb does not exist"),
        (EntityNode(components={"MeshRenderer": {"mesh": "parts/skin.png"}}), r"parts/skin.png holds no heights"),
        (
            EntityNode(components={"Material": {"normal_texture": "gone.png"}}),
            r"normal_texture: .*gone\.png does not exist",
        ),
        (
            EntityNode(components={"MeshRenderer": {"mesh": "blake2b:" + "0" * 32}}),
            r"mesh: there is no asset blake2b:0+; name the file it comes from",
        ),
        (EntityNode(children=[EntityNode(prefab="x.gltf")]), r"entities\[0\].children\[0\].prefab: "),
    ],
)
def test_what_is_missing_is_named_with_its_place(tmp_path: Path, robot: Path, node: EntityNode, expected: str) -> None:
    with pytest.raises(SceneError, match=expected):
        expanded(tmp_path, node)


def test_a_path_that_names_two_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "twins.prefab.json", {"children": [{"name": "T"}, {"name": "T"}]})
    with pytest.raises(SceneError, match="2 entities at this path; give siblings different names"):
        expanded(tmp_path, EntityNode(prefab="twins.prefab.json", overrides={"T": {}}))


def test_a_prefab_must_have_one_root_whatever_its_suffix(tmp_path: Path) -> None:
    write(tmp_path / "two.scene.json", {"name": "A"}, {"name": "B"})
    with pytest.raises(SceneError, match="2 root entities; a prefab has exactly one"):
        expanded(tmp_path, EntityNode(prefab="two.scene.json"))


def test_scripts_and_built_in_meshes_stay_names(tmp_path: Path) -> None:
    (record,) = expanded(
        tmp_path, EntityNode(components={"Script": {"source": "door.py:Door"}, "MeshRenderer": {"mesh": "cone"}})
    )
    assert record.components == {"Script": {"source": "door.py:Door"}, "MeshRenderer": {"mesh": "cone"}}


def test_opening_says_file_place_and_reason(tmp_path: Path) -> None:
    path = write(tmp_path / "x.scene.json", {"prefab": "gone.gltf"})
    with pytest.raises(SceneError, match=r"x\.scene\.json: entities\[0\].prefab: .*gone.gltf"):
        open_scene(path, AssetStore())
    (tmp_path / "x.txt").write_text("hello")
    with pytest.raises(SceneError, match=r"x\.txt is no scene; ELYS opens"):
        open_scene(tmp_path / "x.txt", AssetStore())
    with pytest.raises(SceneError, match="there is no scene file"):
        open_scene(tmp_path / "y.scene.json", AssetStore())
    with pytest.raises(AssetError, match="does not exist"):
        open_scene(tmp_path / "y.glb", AssetStore())


def test_an_opened_scene_has_a_name_settings_and_records(tmp_path: Path) -> None:
    path = write(tmp_path / "My yard.scene.json", {"name": "A"}, settings={"tick_rate": 120})
    opened = open_scene(path, AssetStore())
    assert (opened.name, opened.settings.tick_rate, opened.path, len(opened.records)) == ("My yard", 120, path, 1)


def collapsed(records: list[EntityRecord], directory: Path, assets: AssetStore) -> SceneDocument:
    return collapse(records, name="S", settings=SceneSettings(), directory=directory, assets=assets)


def test_collapsing_undoes_expanding(tmp_path: Path, robot: Path) -> None:
    path = tmp_path / "s.scene.json"
    document = SceneDocument(
        name="S",
        entities=[
            EntityNode(
                name="Plain", components={"Transform": {"position": [1, 2, 3]}}, children=[EntityNode(name="Child")]
            ),
            EntityNode(
                name="R2",
                prefab="parts/robot.prefab.json",
                components={"RigidBody": {"mass": 9}},
                overrides={"Arm/Hand": {"Light": None, "Camera": {}}},
                children=[EntityNode(name="Hat", components={"Material": {"normal_texture": "parts/skin.png"}})],
            ),
            EntityNode(prefab="parts/robot.prefab.json"),
        ],
    )
    write_scene(document, path)
    assets = AssetStore()
    records = expand(read_scene(path), directory=tmp_path, assets=assets)
    assert format_scene(collapsed(records, tmp_path, assets)) == path.read_text()


def test_collapsing_into_another_folder_names_files_from_there(tmp_path: Path, robot: Path) -> None:
    assets = AssetStore()
    records = expanded(tmp_path, EntityNode(prefab="parts/robot.prefab.json"), assets=assets)
    document = collapsed(records, tmp_path / "a/b", assets)
    assert document.entities[0].prefab == "../../parts/robot.prefab.json"
    (tmp_path / "a/b").mkdir(parents=True)
    assert expand(document, directory=tmp_path / "a/b", assets=assets) == records


@pytest.mark.parametrize("change", ["missing", "disabled", "nested", "twins"])
def test_what_is_no_instance_any_more_is_written_out_and_means_the_same(
    tmp_path: Path, robot: Path, change: str
) -> None:
    assets = AssetStore()
    records = expanded(tmp_path, EntityNode(prefab="parts/robot.prefab.json"), assets=assets)
    root, arm, hand = records
    match change:
        case "missing":
            records = [root, arm]
        case "disabled":
            records = [root, EntityRecord(name="Arm", parent=0, enabled=False, components=arm.components), hand]
        case "nested":
            records = [*records, EntityRecord(name="Glove", parent=2)]
        case "twins":
            records = [*records, EntityRecord(name="Arm", parent=0)]
    again = expand(collapsed(records, tmp_path, assets), directory=tmp_path, assets=assets)
    assert [(r.name, r.parent, r.enabled) for r in again] == [(r.name, r.parent, r.enabled) for r in records]
    assert again[0].prefab == ""


def test_a_texture_keeps_how_it_is_laid(tmp_path: Path, robot: Path) -> None:
    def tile(text: str) -> EntityNode:
        return EntityNode(name="Tile", components={"Material": {"base_color_texture": text}})

    assets, named = AssetStore(), tile("parts/skin.png?scale=4,2&wrap=clamp")
    records = expanded(tmp_path, named, assets=assets)
    reference, _, options = records[0].components["Material"]["base_color_texture"].partition("?")
    assert is_reference(reference)
    assert options == "scale=4,2&wrap=clamp"
    assert collapsed(records, tmp_path, assets).entities[0].components == named.components
    with pytest.raises(SceneError, match=r"base_color_texture: the texture .* has no option 'tiles'"):
        expanded(tmp_path, tile("parts/skin.png?tiles=4"))


def test_what_no_file_gives_is_refused_and_named(tmp_path: Path, robot: Path) -> None:
    prefab, skin = EntityNode(prefab="parts/robot.prefab.json"), {"base_color_texture": "parts/skin.png"}
    records = expanded(tmp_path, EntityNode(name="Painted", components={"Material": skin}), prefab)
    # The store that is saved with need not have seen the scene: a later entity's prefab names the same picture.
    document = collapsed(records, tmp_path, AssetStore())
    assert document.entities[0].components == {"Material": skin}
    with pytest.raises(
        SceneError, match=r"'Painted' cannot be saved: no file is known .* Material\.base_color_texture, blake"
    ):
        collapsed(records[:1], tmp_path, AssetStore())
    robot.unlink()
    with pytest.raises(
        SceneError, match=r"'Robot' cannot be saved, its prefab cannot be read here: .*robot\.prefab\.json"
    ):
        collapsed(records[1:2], tmp_path, AssetStore())


def test_values_that_went_through_32_bits_are_written_short(tmp_path: Path) -> None:
    record = EntityRecord(name="A", components={"Material": {"roughness": 0.30000001192092896, "metallic": 0.0}})
    assert '"Material": {"roughness": 0.3}' in format_scene(collapsed([record], tmp_path, AssetStore()))


def test_records_out_of_order_or_too_deep_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="before its parent"):
        collapsed([EntityRecord(name="A", parent=0)], tmp_path, AssetStore())
    with pytest.raises(SceneError, match="nested more than 128 deep"):
        collapsed([EntityRecord(name="A", parent=row - 1) for row in range(200)], tmp_path, AssetStore())


def test_a_model_as_prefab_and_as_mesh(tmp_path: Path, shared_assets: Path) -> None:
    assets = AssetStore()
    helmet = shared_assets / "FlightHelmet" / "FlightHelmet.gltf"
    scale = {"Transform": {"scale": [2, 2, 2]}}
    node = EntityNode(prefab=str(helmet), components=scale, overrides={"Hose_low": {"Material": {"roughness": 0.9}}})
    borrowed = EntityNode(name="Hose", components={"MeshRenderer": {"mesh": f"{helmet}#0/0"}})
    records = expanded(tmp_path, node, borrowed, assets=assets)
    hose = next(r for r in records if r.name == "Hose_low")
    assert records[0].components == scale
    assert hose.components["Material"]["roughness"] == 0.9
    assert is_reference(hose.components["MeshRenderer"]["mesh"])
    assert records[-1].components["MeshRenderer"] == hose.components["MeshRenderer"]
    document = collapsed(records, tmp_path, assets)
    assert document.entities[0].overrides == {"Hose_low": {"Material": {"roughness": 0.9}}}
    assert expand(document, directory=tmp_path, assets=assets) == records
    with pytest.raises(SceneError, match=r"FlightHelmet.gltf has no part '9/9'; it has FlightHelmet.gltf#0/0"):
        expanded(tmp_path, EntityNode(components={"MeshRenderer": {"mesh": f"{helmet}#9/9"}}))
