"""Who uses which asset, where a drop lands, and what a scene names that its host has not: logic alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.bus.messages.views import ViewCamera
from elys.common.assets.store import AssetStore
from elys.common.scene import EntityRecord
from elys.editor_node.asset_placing import ground_point, placed_records
from elys.editor_node.asset_uses import UseIndex
from elys.editor_node.camera import OrbitCamera, project

IMAGE = "blake2b:" + "1" * 32
OTHER = "blake2b:" + "2" * 32


def records() -> list[EntityRecord]:
    return [
        EntityRecord(
            name="Wall",
            prefab="/project/wall.glb",
            components={
                "MeshRenderer": {},
                "Material": {"base_color_texture": IMAGE, "normal_texture": f"{IMAGE}?uv=1"},
            },
        ),
        EntityRecord(
            name="Floor", components={"MeshRenderer": {}, "Material": {"base_color_texture": f"{OTHER}?scale=4,4"}}
        ),
    ]


def test_uses_are_found_whatever_a_texture_is_laid_like(on_stage):
    async def scenario(stage):
        wall, floor = stage.named("Wall"), stage.named("Floor")
        index = UseIndex(stage.model.scene.mirror)
        assert index.known([IMAGE]) == []
        uses = await index.fresh()
        assert [(use.entity, use.field, use.options) for use in uses[IMAGE]] == [
            (wall, "base_color_texture", ""),
            (wall, "normal_texture", "?uv=1"),
        ]
        assert [(use.entity, use.options) for use in uses[OTHER]] == [(floor, "?scale=4,4")]
        assert [use.entity for use in uses["/project/wall.glb"]] == [wall]
        assert index.known([IMAGE, IMAGE, OTHER]) == uses[IMAGE] + uses[OTHER]

    on_stage(scenario, records())


def test_a_scene_that_changed_is_looked_through_again(on_stage):
    async def scenario(stage):
        index = UseIndex(stage.model.scene.mirror)
        await index.fresh()
        assert index.is_fresh
        await stage.model.edit.set_fields((stage.named("Floor"),), "Material", {"base_color_texture": IMAGE})
        assert not index.is_fresh
        assert len(index.known([OTHER])) == 1  # of before
        assert OTHER not in await index.fresh()
        assert len(index.known([IMAGE])) == 3

    on_stage(scenario, records())


def test_other_content_takes_the_place_of_old_in_one_edit(on_stage):
    async def scenario(stage):
        new = "blake2b:" + "3" * 32
        index = UseIndex(stage.model.scene.mirror)
        uses = await index.fresh()
        await stage.model.edit.replace_assets("Reload brick.png", {IMAGE: new, OTHER: OTHER}, uses)
        await stage.settle()
        material = stage.host.mirror.entities[stage.named("Wall")].components["Material"]
        assert (material.base_color_texture, material.normal_texture) == (new, f"{new}?uv=1")
        floor = stage.host.mirror.entities[stage.named("Floor")].components["Material"]
        assert floor.base_color_texture == f"{OTHER}?scale=4,4"
        # What was looked up before somebody else changed it changes nothing.
        assert stage.model.edit.replace_assets("Reload brick.png", {IMAGE: new}, uses) is None

    on_stage(scenario, records())


@pytest.mark.parametrize("ortho", [0.0, 6.0])
def test_the_ground_is_hit_where_it_is_seen(ortho):
    camera = OrbitCamera()
    camera.target = np.array((3.0, 0.0, -2.0))
    view = camera.view
    if ortho:
        view = ViewCamera(position=view.position, rotation=view.rotation, ortho_height=ortho)
    for x, y in ((0.0, 0.0), (0.4, -0.3), (-0.7, 0.1)):
        point = ground_point(view, 1.6, x, y, camera.target)
        assert point[1] == pytest.approx(0.0, abs=1e-9)
        assert project(view, 1.6, point) == pytest.approx((x, y), abs=1e-6)


def test_where_no_ground_is_seen_it_is_as_far_as_the_focus():
    up = Rotation.from_euler("x", 40.0, degrees=True).as_quat()
    view = ViewCamera(position=(0.0, 2.0, 0.0), rotation=tuple(up.tolist()))
    point = ground_point(view, 1.0, 0.0, 0.0, (0.0, 2.0, -7.0))
    assert np.linalg.norm(point - (0.0, 2.0, 0.0)) == pytest.approx(7.0)
    assert point[1] > 2.0


def test_what_is_dropped_lies_on_the_point():
    parts = [
        EntityRecord(name="Root", components={"Transform": {"position": [9.0, 1.0, 9.0]}}),
        EntityRecord(
            name="Low", parent=0, components={"Transform": {"position": [0, -2, 0]}, "MeshRenderer": {"mesh": "box"}}
        ),
    ]
    root, low = placed_records(parts, AssetStore(), np.array((1.0, 5.0, 2.0)))
    # The box of 1 m reaches 2.5 m below the root.
    assert root.components["Transform"]["position"] == [1.0, 7.5, 2.0]
    assert low == parts[1]
    (light,) = placed_records([EntityRecord(name="Lamp")], AssetStore(), np.array((1.0, 5.0, 2.0)))
    assert light.components["Transform"]["position"] == [1.0, 5.0, 2.0]
