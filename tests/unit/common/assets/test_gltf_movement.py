"""Animations, skins and morph targets of glTF models: what they become, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.common.assets import AssetStore, decode_mesh, encode_mesh
from elys.common.assets.clip import decode_clips
from elys.common.assets.gltf import import_gltf
from elys.common.assets.gltf_schema import parse_gltf
from elys.common.assets.skin import decode_skin, encode_skin
from elys.common.errors import AssetError
from elys.common.scene import EntityNode, SceneDocument, SceneSettings, collapse, expand, open_scene
from elys.sim_node.simulation import Simulation
from tests.unit.common.assets.test_gltf import Model, quad

TIMES = np.array((0.0, 0.5, 2.0), np.float32)


def moving(path: str = "translation", interpolation: str = "LINEAR", values: Any = None, **fields: Any) -> Model:
    """A model whose arm moves."""
    model = quad()
    model.document["nodes"] = [{"name": "Root", "children": [1]}, {"name": "Arm", "mesh": 0}]
    values = np.arange(9, dtype=np.float32).reshape(3, 3) if values is None else values
    sampler = {"input": model.accessor(TIMES), "output": model.accessor(values, **fields)}
    model.document["animations"] = [
        {
            "name": "Wave",
            "samplers": [{**sampler, "interpolation": interpolation}],
            "channels": [{"sampler": 0, "target": {"node": 1, "path": path}}],
        }
    ]
    return model


def imported(model: Model, folder: Path) -> tuple[list[Any], Any]:
    path = folder / "model.gltf"
    path.write_bytes(model.embedded())
    assets = AssetStore()
    records = import_gltf(path, assets)
    animation = records[0].components.get("Animation")
    return records, decode_clips(assets.get(animation["clips"])) if animation else ()


def test_channels_name_their_targets_by_the_way_from_the_root(tmp_path: Path) -> None:
    (clip,) = imported(moving(), tmp_path)[1]
    (channel,) = clip.channels
    assert (clip.name, clip.duration) == ("Wave", 2.0)
    assert (channel.target, channel.property, channel.interpolation) == (("Root", "Arm"), "position", "linear")
    np.testing.assert_array_equal(channel.times, TIMES)
    np.testing.assert_array_equal(channel.values, np.arange(9).reshape(3, 3))


def test_normalised_rotations_and_splines(tmp_path: Path) -> None:
    turns = np.array(((0, 0, 0, 32767), (0, 32767, 0, 0), (0, 0, 0, -32767)), np.int16)
    model = moving("rotation", values=turns, normalized=True)
    (clip,) = imported(model, tmp_path)[1]
    np.testing.assert_array_equal(clip.channels[0].values, np.sign(turns))
    keys = np.arange(27, dtype=np.float32).reshape(9, 3)
    (clip,) = imported(moving("scale", "CUBICSPLINE", keys), tmp_path)[1]
    np.testing.assert_array_equal(clip.channels[0].values, keys.reshape(3, 3, 3))


def test_clips_get_names_of_their_own(tmp_path: Path) -> None:
    model = moving()
    (wave,) = model.document["animations"]
    unnamed = {key: value for key, value in wave.items() if key != "name"}
    model.document["animations"] = [wave, wave, unnamed, {**wave, "channels": []}]
    assert [clip.name for clip in imported(model, tmp_path)[1]] == ["Wave", "Wave 1", "Animation 2"]


def test_a_model_without_movement_has_no_animation(tmp_path: Path) -> None:
    model = moving()
    model.document["animations"][0]["channels"][0]["target"] = {"path": "pointer"}
    records, clips = imported(model, tmp_path)
    assert "Animation" not in records[0].components
    assert clips == ()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a, m: a["samplers"][0].update(input=m.accessor(TIMES[::-1].copy())), "must be times that rise"),
        (lambda a, m: a["samplers"][0].update(output=m.accessor(np.zeros((2, 3), np.float32))), "must hold 3 vectors"),
        (lambda a, m: a["samplers"][0].update(interpolation="CUBICSPLINE"), "must hold 9 vectors of 3"),
        (lambda a, m: a["samplers"][0].update(interpolation="SMOOTH"), "interpolation"),
        (lambda a, m: a["samplers"][0].update(input=99), "99"),
        (lambda a, m: a["channels"][0].update(sampler=3), "sampler"),
        (lambda a, m: a["channels"][0]["target"].update(node=7), "node"),
        (lambda a, m: a["channels"].append(a["channels"][0]), "moves what another channel moves already"),
    ],
)
def test_animations_that_are_wrong_are_refused(change: Any, words: str, tmp_path: Path) -> None:
    model = moving()
    change(model.document["animations"][0], model)
    with pytest.raises(AssetError, match=words) as caught:
        imported(model, tmp_path)
    assert "animations[0]" in str(caught.value)


def test_the_fox_walks_as_its_file_says(shared_assets: Path) -> None:
    assets = AssetStore()
    opened = open_scene(str(shared_assets / "Fox" / "Fox.glb"), assets)
    simulation = Simulation.load(opened, assets)
    clips = decode_clips(assets.get(opened.records[0].components["Animation"]["clips"]))
    assert [clip.name for clip in clips] == ["Survey", "Walk", "Run"]
    for _ in range(60):
        simulation.step()
    for channel in clips[0].channels:
        path = "/".join((opened.records[0].name, *channel.target))
        entity = simulation.world.hierarchy.find(path)
        found = getattr(simulation.world.get(entity, "Transform"), channel.property)
        if channel.property == "position":
            expected = [np.interp(1.0, channel.times, column) for column in channel.values.T]
            np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)
        else:
            key = int(np.searchsorted(channel.times, 1.0, side="right")) - 1
            share = (1.0 - channel.times[key]) / (channel.times[key + 1] - channel.times[key])
            expected = slow_slerp(channel.values[key], channel.values[key + 1], float(share))
            assert abs(np.dot(found, expected)) == pytest.approx(1.0, abs=1e-6)
    document, _ = parse_gltf((shared_assets / "Fox" / "Fox.glb").read_bytes())
    assert len(clips[0].channels) == len(document.animations[0].channels)


def slow_slerp(start: np.ndarray, end: np.ndarray, share: float) -> np.ndarray:
    cosine = float(np.dot(start, end))
    end, angle = (end, np.arccos(min(abs(cosine), 1.0))) if cosine >= 0 else (-end, np.arccos(min(-cosine, 1.0)))
    if angle < 1e-6:
        return start
    return (np.sin((1 - share) * angle) * start + np.sin(share * angle) * end) / np.sin(angle)


def bent() -> Model:
    """A quad on two joints."""
    model = quad()
    model.attribute("JOINTS_0", np.array(((0, 1, 0, 0),) * 4, np.uint8))
    weights = np.array(((255, 0, 0, 0), (0, 255, 0, 0), (85, 170, 0, 0), (0, 0, 0, 0)), np.uint8)
    model.attribute("WEIGHTS_0", weights, normalized=True)
    model.document["nodes"] = [
        {"name": "Root", "children": [1, 2]},
        {"name": "Skin", "mesh": 0, "skin": 0},
        {"name": "Hip", "children": [3]},
        {"name": "Knee"},
    ]
    matrices = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    matrices[1, :3, 3] = (1.0, 2.0, 3.0)
    columns = np.ascontiguousarray(matrices.transpose(0, 2, 1).reshape(2, 16))
    model.document["skins"] = [{"joints": [2, 3], "inverseBindMatrices": matrix_accessor(model, columns)}]
    return model


def matrix_accessor(model: Model, columns: np.ndarray) -> int:
    view = model.view(columns.tobytes())
    entry = {"bufferView": view, "componentType": 5126, "count": len(columns), "type": "MAT4"}
    model.document["accessors"].append(entry)
    return len(model.document["accessors"]) - 1


def opened(model: Model, folder: Path) -> tuple[list[Any], AssetStore]:
    path = folder / "model.gltf"
    path.write_bytes(model.embedded())
    assets = AssetStore()
    return import_gltf(path, assets), assets


def test_a_skin_names_its_joints_below_the_root(tmp_path: Path) -> None:
    records, assets = opened(bent(), tmp_path)
    drawn = next(record for record in records if "Skin" in record.components)
    assert (drawn.name, drawn.references) == ("Skin", {"Skin.root": 0})
    skin = decode_skin(assets.get(drawn.components["Skin"]["skin"]))
    assert skin.joints == (("Root", "Hip"), ("Root", "Hip", "Knee"))
    assert skin.joint_from_mesh[1, :, 3].tolist() == [1.0, 2.0, 3.0]
    mesh = decode_mesh(assets.get(drawn.components["MeshRenderer"]["mesh"]))
    expected = ((1, 0, 0, 0), (0, 1, 0, 0), (1 / 3, 2 / 3, 0, 0), (1, 0, 0, 0))  # without any, the first joint's
    np.testing.assert_allclose(mesh.weights, expected, atol=1e-6)
    np.testing.assert_array_equal(mesh.joints, [(0, 1, 0, 0)] * 4)


def test_without_inverse_bind_matrices_they_are_none(tmp_path: Path) -> None:
    model = bent()
    del model.document["skins"][0]["inverseBindMatrices"]
    records, assets = opened(model, tmp_path)
    (reference,) = [record.components["Skin"]["skin"] for record in records if "Skin" in record.components]
    np.testing.assert_array_equal(decode_skin(assets.get(reference)).joint_from_mesh, [np.eye(3, 4)] * 2)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda m: m.document["skins"][0].update(joints=[2]),
            r"nodes\[1\].skin: its mesh names joint 1, the skin has 1",
        ),
        (lambda m: m.document["skins"][0].update(joints=[2, 9]), r"skins\[0\].joints"),
        (lambda m: m.document["skins"][0].update(joints=[]), r"skins\[0\].joints"),
        (lambda m: m.document["nodes"][1].update(skin=4), r"nodes\[1\].skin"),
        (
            lambda m: m.document["skins"][0].update(inverseBindMatrices=m.primitive["attributes"]["POSITION"]),
            "must hold a 4x4 matrix for each of 2 joints",
        ),
        (
            lambda m: m.attribute("JOINTS_0", np.full((4, 4), -1, np.int8)),
            "JOINTS_0 must be unsigned whole numbers",
        ),
        (
            lambda m: (
                m.attribute("JOINTS_1", np.full((4, 4), -1, np.int8)),
                m.attribute("WEIGHTS_1", np.zeros((4, 4), np.float32)),
            ),
            "JOINTS_1 must be unsigned whole numbers",
        ),
    ],
)
def test_skins_that_are_wrong_are_refused(change: Any, words: str, tmp_path: Path) -> None:
    model = bent()
    change(model)
    with pytest.raises(AssetError, match=words):
        opened(model, tmp_path)


@pytest.mark.parametrize("fifth", [0.0, 0.2])
def test_of_eight_joints_the_four_that_bend_most_are_kept(fifth: float, tmp_path: Path, caplog: Any) -> None:
    """The largest of both sets, in the order of their weights, which add up to 1 again."""
    model = bent()
    model.document["nodes"] += [{"name": f"Joint {number}"} for number in range(2, 8)]
    model.document["skins"][0] = {"joints": [2, 3, *range(4, 10)]}
    model.document["nodes"][0]["children"] += list(range(4, 10))
    model.attribute("JOINTS_0", np.array(((0, 1, 2, 3),) * 4, np.uint8))
    model.attribute("WEIGHTS_0", np.array(((0.1, 0.3, fifth, 0.0),) * 4, np.float32))
    model.attribute("JOINTS_1", np.array(((4, 5, 6, 7),) * 4, np.uint8))
    model.attribute("WEIGHTS_1", np.array(((0.4, 0.0, 0.2, 0.05 * (fifth > 0)),) * 4, np.float32))
    records, assets = opened(model, tmp_path)
    (mesh,) = [record.components["MeshRenderer"]["mesh"] for record in records if "MeshRenderer" in record.components]
    made = decode_mesh(assets.get(mesh))
    kept = {4: 0.4, 1: 0.3, 6: 0.2, 0: 0.1} if not fifth else {4: 0.4, 1: 0.3, 2: 0.2, 6: 0.2}
    np.testing.assert_array_equal(made.joints[0], list(kept))
    np.testing.assert_allclose(made.weights[0], np.array(list(kept.values())) / sum(kept.values()), atol=1e-6)
    assert ("more than four joints" in caplog.text) == bool(fifth)


def test_bytes_that_are_no_skin_are_refused(tmp_path: Path) -> None:
    records, assets = opened(bent(), tmp_path)
    (reference,) = [record.components["Skin"]["skin"] for record in records if "Skin" in record.components]
    data = assets.get(reference)
    skin = decode_skin(data)
    assert encode_skin(skin) == data
    for wrong, words in (
        (data[:6], "too few"),
        (b"ELYM" + data[4:], "starts with"),
        (data[:-4], "its 2 joints make"),
        (data[:-4] + b"\0\0\xc0\x7f", "not finite"),
        (data.replace(b"joints", b"joinst"), "header is wrong"),
    ):
        with pytest.raises(AssetError, match=words):
            decode_skin(wrong)


def test_instances_of_a_model_in_a_scene_have_joints_of_their_own(tmp_path: Path) -> None:
    opened(bent(), tmp_path)
    nodes = [EntityNode(name=name, prefab="model.gltf") for name in ("One", "Other")]
    assets = AssetStore()
    records = expand(SceneDocument(entities=nodes), directory=tmp_path, assets=assets)
    roots = [row for row, record in enumerate(records) if record.name in ("One", "Other")]
    assert [record.references["Skin.root"] for record in records if "Skin" in record.components] == roots
    document = collapse(records, name="", settings=SceneSettings(), directory=tmp_path, assets=assets)
    assert [(node.name, node.components, node.overrides) for node in document.entities] == [
        ("One", {}, {}),
        ("Other", {}, {}),
    ]


def morphed(weights: Any = None) -> Model:
    model = quad()
    offsets = np.array(((0, 0, 1), (0, 0, 2), (0, 0, 3), (0, 0, 4)), np.float32)
    model.primitive["targets"] = [
        {"POSITION": model.accessor(offsets)},
        {"NORMAL": model.accessor(offsets), "POSITION": model.accessor(-offsets)},
    ]
    model.document["meshes"][0]["weights"] = [0.25, 1.0]
    if weights is not None:
        model.document["nodes"][0]["weights"] = weights
    return model


def test_morph_targets_come_with_the_mesh_and_weights_with_the_node(tmp_path: Path) -> None:
    for weights, expected in ((None, "0.25 1"), ([0.0, 0.5], "0 0.5"), ([0.0, 0.0], None)):
        records, assets = opened(morphed(weights), tmp_path)
        assert records[1].components["Morph"].get("weights") == expected
    mesh = decode_mesh(assets.get(records[1].components["MeshRenderer"]["mesh"]))
    assert mesh.target_count == 2
    np.testing.assert_array_equal(mesh.target_positions[:, :, 2], [(1, 2, 3, 4), (-1, -2, -3, -4)])
    np.testing.assert_array_equal(mesh.target_normals[:, :, 2], [(0, 0, 0, 0), (1, 2, 3, 4)])
    data = assets.get(records[1].components["MeshRenderer"]["mesh"])
    assert encode_mesh(mesh) == data
    with pytest.raises(AssetError, match="where its header says"):
        decode_mesh(data.replace(b'"target_count":2', b'"target_count":3'))


def test_targets_of_a_mesh_without_normals_turn_its_faces(tmp_path: Path) -> None:
    model = morphed()
    del model.primitive["attributes"]["NORMAL"]
    model.primitive["targets"] = [
        {"POSITION": model.accessor(np.array(((0, 0, 0), (0, 0, 1), (0, 0, 1), (0, 0, 0)), np.float32))}
    ]
    records, assets = opened(model, tmp_path)
    mesh = decode_mesh(assets.get(records[1].components["MeshRenderer"]["mesh"]))
    tilted = mesh.normals + mesh.target_normals[0]
    np.testing.assert_allclose(tilted, [(-np.sqrt(0.5), 0.0, np.sqrt(0.5))] * 6, atol=1e-6)  # x rises to z 1 over 1


def test_targets_of_another_size_are_refused(tmp_path: Path) -> None:
    model = morphed()
    model.primitive["targets"][1]["NORMAL"] = model.accessor(np.zeros((3, 3), np.float32))
    with pytest.raises(AssetError, match=r"targets\[1\].NORMAL must be 4 vectors"):
        opened(model, tmp_path)


def test_weights_are_animated_for_whoever_draws_the_mesh(tmp_path: Path) -> None:
    model = morphed()
    keys = np.array((0.0, 0.0, 1.0, 0.0, 1.0, 1.0), np.float32)
    model.document["animations"] = [
        {
            "samplers": [{"input": model.accessor(TIMES), "output": model.accessor(keys)}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
        }
    ]
    opened(model, tmp_path)
    assets = AssetStore()
    scene = open_scene(str(tmp_path / "model.gltf"), assets)
    simulation = Simulation.load(scene, assets)
    for _ in range(15):  # 0.25 s, half of the way to the second key
        simulation.step()
    animated = simulation.animated()
    assert animated.weight.tolist() == [0.5, 0.0]
    assert animated.weight_target.tolist() == [0, 1]
    assert len(set(animated.weight_entity.tolist())) == 1
    assert not len(animated.local_entity)
    model.document["animations"][0]["samplers"][0]["output"] = model.accessor(keys[:5].copy())
    with pytest.raises(AssetError, match="must hold numbers for each of 3 keys"):
        opened(model, tmp_path)
