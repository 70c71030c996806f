"""Who uses which asset, where a drop lands, and what a scene names that its host has not: logic alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.bus.messages.scene import ComponentSet, SceneDelta
from elys.bus.messages.views import ViewCamera
from elys.common.assets.store import AssetStore
from elys.common.scene import EntityRecord
from elys.editor_node.asset_placing import ground_point, placed_records
from elys.editor_node.asset_uses import UseIndex, all_uses
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
        uses = all_uses(stage.model.scene.mirror)
        assert [(use.entity, use.field, use.options) for use in uses[IMAGE]] == [
            (wall, "base_color_texture", ""),
            (wall, "normal_texture", "?uv=1"),
        ]
        assert [(use.entity, use.options) for use in uses[OTHER]] == [(floor, "?scale=4,4")]
        assert [use.entity for use in uses["/project/wall.glb"]] == [wall]

    on_stage(scenario, records())


def test_a_glance_costs_little_of_the_time_and_ends_up_right(on_stage):
    now = [100.0]

    def clock() -> float:
        now[0] += 1.0  # each look at the clock: looking through the scene takes a second
        return now[0]

    async def scenario(stage):
        mirror, floor = stage.model.scene.mirror, stage.named("Floor")
        index = UseIndex(mirror, clock=clock)
        assert len(index.glance([OTHER])) == 1
        values = {"base_color_texture": IMAGE}
        change = ComponentSet(entity=floor, component="Material", values=values)
        mirror.apply_delta(SceneDelta(epoch=mirror.epoch, sequence=mirror.sequence + 1, tick=0, changes=(change,)))
        assert len(index.glance([OTHER])) == 1  # of before
        assert OTHER not in index.uses  # who edits looks again
        now[0] += 60.0
        assert index.glance([OTHER]) == []
        assert len(index.glance([IMAGE, IMAGE])) == 3

    on_stage(scenario, records())


def test_other_content_takes_the_place_of_old_in_one_edit(on_stage):
    async def scenario(stage):
        new = "blake2b:" + "3" * 32
        await stage.model.edit.replace_assets("Reload brick.png", {IMAGE: new, OTHER: OTHER})
        await stage.settle()
        material = stage.host.mirror.entities[stage.named("Wall")].components["Material"]
        assert (material.base_color_texture, material.normal_texture) == (new, f"{new}?uv=1")
        assert len(stage.host.mirror.entities[stage.named("Floor")].components["Material"].base_color_texture) > 32
        assert stage.model.edit.replace_assets("Reload brick.png", {IMAGE: new}) is None  # nobody uses it any more

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
