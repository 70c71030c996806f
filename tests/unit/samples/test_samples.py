"""The sample scenes: sound files, the same every time, nothing overlapping, seen by their cameras."""

from __future__ import annotations

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from elys.common.assets import AssetStore
from elys.common.components import component_from
from elys.common.errors import AssetError, SceneError
from elys.common.math.matrix import compose_affine, look_at, perspective, propagate_affine
from elys.common.math.quaternion import rotate, to_matrix
from elys.common.scene import (
    EntityRecord,
    SceneDocument,
    expand,
    format_scene,
    open_scene,
    parse_scene,
    scene_bounds,
    write_scene,
)
from elys.samples import SAMPLES, sample, write_sample
from elys.samples.pile import pile
from elys.samples.stack import check_stack, stack
from elys.samples.yard import BODY_COUNT, check_yard, yard, yard_with_model


def records_of(document: SceneDocument) -> list[EntityRecord]:
    return expand(document, directory=Path.cwd(), assets=AssetStore())


def world_from_local(records: list[EntityRecord]) -> np.ndarray:
    poses = [component_from("Transform", record.components.get("Transform", {})) for record in records]
    local = compose_affine([p.position for p in poses], [p.rotation for p in poses], [p.scale for p in poses])
    return propagate_affine(np.array([record.parent for record in records]), local)


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_is_a_canonical_file_that_opens(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.scene.json"
    write_sample(name, path)
    text = path.read_text()
    assert format_scene(parse_scene(text)) == text
    assert max(map(len, text.splitlines())) <= 120
    scene = open_scene(path, AssetStore())
    present = {component for record in scene.records for component in record.components}
    assert {"Camera", "Light", "Collider"} <= present
    assert len({(record.parent, record.name) for record in scene.records}) == len(scene.records)


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_is_the_same_every_time(name: str) -> None:
    code = (
        "from elys.samples import sample; from elys.common.scene import format_scene; "
        f"print(format_scene(sample({name!r}).build()))"
    )
    outputs = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, check=True, env={"PYTHONHASHSEED": seed}, cwd=Path.cwd()
        ).stdout
        for seed in ("1", "2")
    }
    assert len(outputs) == 1


def test_an_unknown_sample_is_named() -> None:
    with pytest.raises(SceneError, match="no sample scene 'yrad'; did you mean 'yard'"):
        sample("yrad")
    with pytest.raises(SceneError, match="there are yard, stack"):
        sample("x")


def colliders(records: list[EntityRecord]) -> list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Name, shape, centre (3,), axes (3, 3) and half edges (3,) of every collider."""
    found = []
    for record, affine in zip(records, world_from_local(records), strict=True):
        if "Collider" in record.components:
            collider = component_from("Collider", record.components["Collider"])
            edges = np.linalg.norm(affine[:, :3], axis=0)
            size = np.full(3, 2 * collider.radius) if collider.shape == "sphere" else np.array(collider.size)
            found.append((record.name, collider.shape, affine[:, 3], affine[:, :3] / edges, edges * size / 2))
    return found


def separated(a: tuple, b: tuple) -> bool:
    """Whether two boxes or spheres have a gap between them, by separating axes (spheres as their boxes, or as distance)."""
    (_, shape_a, centre_a, axes_a, half_a), (_, shape_b, centre_b, axes_b, half_b) = a, b
    between = centre_b - centre_a
    if shape_a == shape_b == "sphere":
        return np.linalg.norm(between) > half_a[0] + half_b[0]
    axes = [*axes_a.T, *axes_b.T, *(np.cross(x, y) for x in axes_a.T for y in axes_b.T), between]
    for axis in axes:
        length = np.linalg.norm(axis)
        if length < 1e-9:
            continue
        axis = axis / length
        reach_a = half_a[0] if shape_a == "sphere" else np.abs(axes_a.T @ axis) @ half_a
        reach_b = half_b[0] if shape_b == "sphere" else np.abs(axes_b.T @ axis) @ half_b
        if abs(between @ axis) > reach_a + reach_b:
            return True
    return False


def test_nothing_in_the_yard_overlaps_before_it_falls() -> None:
    all_colliders = colliders(records_of(yard()))
    falling = [c for c in all_colliders if c[0].startswith(("Box ", "Sphere "))]
    standing = [c for c in all_colliders if c not in falling]
    assert len(falling) == BODY_COUNT == 200
    for a, b in itertools.combinations(falling, 2):
        if np.linalg.norm(a[2] - b[2]) < 2.0:
            assert separated(a, b), (a[0], b[0])
    for a, b in itertools.product(falling, standing):
        assert separated(a, b), (a[0], b[0])


def test_the_yard_rains_boxes_and_spheres_of_many_sizes_and_colours() -> None:
    records = [r for r in records_of(yard()) if "RigidBody" in r.components]
    spheres = [r for r in records if r.components["Collider"].get("shape") == "sphere"]
    assert len(spheres) == 100
    assert len({tuple(r.components["Transform"]["scale"]) for r in records}) > 100
    assert len({tuple(r.components["Material"]["base_color"]) for r in records}) == 8
    for record in records:
        volume = np.prod(record.components["Transform"]["scale"]) * (np.pi / 6 if record in spheres else 1)
        assert record.components["RigidBody"]["mass"] == pytest.approx(500 * volume, rel=1e-3)


@pytest.mark.parametrize("document", [yard(), pile(200), stack()], ids=["yard", "pile", "stack"])
def test_the_camera_sees_where_things_come_to_rest(document: SceneDocument) -> None:
    records = records_of(document)
    world = world_from_local(records)
    row = next(i for i, r in enumerate(records) if "Camera" in r.components)
    camera = component_from("Camera", records[row].components["Camera"])
    rotation = records[row].components["Transform"]["rotation"]
    assert np.allclose(world[row, :, :3], to_matrix(rotation), atol=1e-6)
    forward = rotate(rotation, (0.0, 0.0, -1.0))
    view_from_world = look_at(world[row, :, 3], world[row, :, 3] + forward)
    clip_from_view = perspective(camera.field_of_view, 16 / 9, camera.near, camera.far)
    bodies = [i for i, r in enumerate(records) if "RigidBody" in r.components]
    resting = world[bodies, :, 3] * ((1, 1, 1) if "Stack" in document.name else (1, 0.1, 1))
    for place in resting:
        clip = clip_from_view @ np.append(view_from_world[:, :3] @ place + view_from_world[:, 3], 1.0)
        assert (np.abs(clip[:2]) < clip[3] * 0.99).all(), place


def test_a_pile_has_as_many_bodies_as_asked_for_and_none_overlap() -> None:
    for count in (1, 7, 300):
        cubes = [c for c in colliders(records_of(pile(count))) if c[0].startswith("Cube ")]
        assert len(cubes) == count
    near = [(a, b) for a, b in itertools.combinations(cubes, 2) if np.linalg.norm(a[2] - b[2]) < 1.0]
    assert all(separated(a, b) for a, b in near)
    walls = [c for c in colliders(records_of(pile(300))) if not c[0].startswith("Cube ")]
    assert all(separated(a, b) for a, b in itertools.product(cubes, walls))
    with pytest.raises(ValueError, match="at least one"):
        pile(0)


def test_a_stack_stands_exactly() -> None:
    records = records_of(stack(4))
    world = world_from_local(records)
    positions = {r.name: w[:, 3].tolist() for r, w in zip(records, world, strict=True)}
    assert [positions[f"Cube {n}"][1] for n in range(1, 5)] == [0.5, 1.5, 2.5, 3.5]
    assert check_stack(positions) == ""
    positions["Cube 4"][0] += 0.2
    assert check_stack(positions) == "Cube 4 is 0.200 m off its place"
    assert "off its place" in check_stack({"Cube 1": (float("nan"), 0.5, 0.0)})
    with pytest.raises(ValueError, match="at least one"):
        stack(0)


def test_the_yards_check_finds_what_left_sank_or_hangs() -> None:
    assert check_yard({"Box 1": (0, 0.3, 0), "Ground": (0, -0.5, 0), "Sphere 2": (5, 0.2, -5)}) == ""
    assert "left the yard" in check_yard({"Box 1": (9, 0.3, 0)})
    assert "in the ground or still in the air" in check_yard({"Sphere 1": (0, -2, 0)})
    assert "left the yard" in check_yard({"Box 1": (float("nan"), 0.3, 0)})


def test_a_real_model_falls_into_the_yard_as_one_body(shared_assets: Path, tmp_path: Path) -> None:
    model = shared_assets / "FlightHelmet" / "FlightHelmet.gltf"
    path = tmp_path / "helmet.scene.json"
    write_scene(yard_with_model(str(model)), path)
    records = open_scene(path, AssetStore()).records
    row = next(i for i, r in enumerate(records) if r.name == "Model")
    size = np.array(records[row].components["Collider"]["size"])
    assert size.max() == pytest.approx(2.0)
    assert len([r for r in records if "RigidBody" in r.components]) == BODY_COUNT + 1
    instance = next(r for r in records if r.parent == row)
    assert (instance.name, Path(instance.prefab).name) == ("FlightHelmet", "FlightHelmet.gltf")
    # In the body's own space the model fills its collider.
    alone = [EntityRecord(name="Model", components={"Transform": {}}), *below(records, row)]
    assets = AssetStore()
    open_scene(path, assets)
    lower, upper = scene_bounds(alone, assets)
    assert np.allclose(upper, size / 2, atol=1e-3)
    assert np.allclose(lower, -size / 2, atol=1e-3)
    falling = [c for c in colliders(records) if c[0].startswith(("Box ", "Sphere "))]
    (body,) = [c for c in colliders(records) if c[0] == "Model"]
    assert all(separated(body, other) for other in falling)


def below(records: list[EntityRecord], root: int) -> list[EntityRecord]:
    rows = {root: 0}
    kept = []
    for row, record in enumerate(records):
        if record.parent in rows:
            rows[row] = len(kept) + 1
            kept.append(EntityRecord(name=record.name, parent=rows[record.parent], components=record.components))
    return kept


def test_a_model_that_is_missing_is_an_asset_error(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="does not exist"):
        yard_with_model(tmp_path / "gone.gltf")


def test_scenes_are_read_without_compiling_anything() -> None:
    code = (
        "import sys, elys.samples, elys.common.scene; "
        "print([m for m in ('numba', 'scipy', 'moderngl', 'PIL') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True, cwd=Path.cwd())
    assert result.stdout.strip() == "[]"
