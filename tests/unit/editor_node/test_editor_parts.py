"""Camera, selection, fields, rows of the tree and console: the parts without a window."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from elys.common.scene import EntityRecord
from elys.editor_node.camera import OrbitCamera, project
from elys.editor_node.colors import linear_from_srgb, srgb_from_linear
from elys.editor_node.console_log import ConsoleLog
from elys.editor_node.rotations import degrees_from, rotation_from
from elys.editor_node.selection import Selection

ANGLES = st.floats(-180.0, 180.0)


@given(notches=st.floats(-5.0, 5.0), x=st.floats(-0.9, 0.9), y=st.floats(-0.9, 0.9))
def test_what_is_under_the_pointer_stays_there_while_zooming(notches, x, y):
    camera, aspect = OrbitCamera(), 1.6
    reach = np.tan(camera.field_of_view / 2.0) * camera.distance
    rotation = Rotation.from_quat(camera.rotation)
    point = camera.target + rotation.apply((x * aspect * reach, y * reach, 0.0))
    camera.zoom(notches, (x, y), aspect)
    assert project(camera.view, aspect, point) == pytest.approx((x, y), abs=1e-6)


def test_a_drag_pans_the_target_with_the_pointer():
    camera, height = OrbitCamera(), 600
    target = camera.target.copy()
    camera.pan(90.0, -45.0, height)
    # 300 pixels are half the picture's height: 1 in y.
    assert project(camera.view, 1.5, target) == pytest.approx((90.0 / 300.0 / 1.5, 45.0 / 300.0), abs=1e-9)


def test_looking_about_keeps_the_place_and_orbiting_the_target():
    camera = OrbitCamera()
    position = camera.position
    camera.look(30.0, -12.0)
    assert camera.position == pytest.approx(position)
    target = camera.target.copy()
    camera.orbit(50.0, 500.0)
    assert camera.target == pytest.approx(target)
    assert np.linalg.norm(camera.position - target) == pytest.approx(camera.distance)


def test_a_framed_ball_fits():
    camera = OrbitCamera()
    camera.frame(np.array((3.0, -2.0, 8.0)), 2.5)
    right = Rotation.from_quat(camera.rotation).apply((0.0, 2.5, 0.0))
    _, top = project(camera.view, 1.0, np.array((3.0, -2.0, 8.0)) + right)
    assert 0.4 < top < 1.0


@given(st.tuples(ANGLES, st.floats(-89.0, 89.0), ANGLES))
def test_euler_degrees_are_a_rotation_and_back(degrees):
    rotation = rotation_from(degrees)
    assert Rotation.from_quat(rotation).as_matrix() == pytest.approx(
        Rotation.from_euler("xyz", degrees, degrees=True).as_matrix(), abs=1e-9
    )
    again = rotation_from(degrees_from(rotation))
    assert abs(np.dot(rotation, again)) == pytest.approx(1.0, abs=1e-9)


@given(st.floats(0.0, 1.0))
def test_colours_survive_the_picker(value):
    assert linear_from_srgb(srgb_from_linear(value)) == pytest.approx(value, abs=1e-9)


def test_selection_keeps_order_and_primary():
    selection = Selection()
    selection.replace([1, 2, 3])
    assert (selection.entities, selection.primary) == ((1, 2, 3), 3)
    selection.toggle(2)
    selection.toggle(9)
    assert (selection.entities, selection.primary) == ((1, 3, 9), 9)
    selection.add([1])
    assert selection.primary == 1
    selection.extend([7, 8, 9, 10, 11], 11)
    assert selection.entities == (9, 10, 11)
    selection.extend([7, 8, 9, 10, 11], 7)
    assert selection.entities == (9, 8, 7)
    selection.remap({8: 80})
    assert selection.entities == (9, 80, 7)
    selection.keep_only({7}.__contains__)
    assert selection.entities == (7,)


def test_rows_open_close_and_find(on_stage):
    async def scenario(stage):
        scene = stage.model.scene

        def names(search: str = "") -> list[tuple[str, int]]:
            return [(scene.name_of(row.entity), row.depth) for row in scene.rows(search)]

        assert names()[:4] == [("Ground", 0), ("Crate", 0), ("Lid", 1), ("Sun", 0)]
        scene.set_open(stage.named("Lid"), True)
        assert names()[:4] == [("Ground", 0), ("Crate", 0), ("Lid", 1), ("Handle", 2)]
        scene.set_open(stage.named("Crate"), False)
        assert names()[:3] == [("Ground", 0), ("Crate", 0), ("Sun", 0)]
        scene.reveal(stage.named("Handle"))
        assert ("Handle", 2) in names()
        assert names("HAND") == [("Crate", 0), ("Lid", 1), ("Handle", 2)]
        assert names("has:light") == [("Sun", 0)]
        assert names("nothing of the kind") == []
        await stage.model.edit.rename(stage.named("Handle"), "Knob")
        assert names("knob")[-1] == ("Knob", 2)

    on_stage(scenario)


def test_deep_trees_are_no_deep_recursion(on_stage):
    async def scenario(stage):
        scene = stage.model.scene
        bottom = stage.named("Node 2999")
        scene.reveal(bottom)
        assert scene.rows()[-1].depth == 2999
        stage.model.selection.replace([stage.named("Node 0")])
        await stage.model.edit.delete()
        assert not scene.rows()
        await stage.model.history.undo()
        assert len(scene.mirror.entities) == 3000

    on_stage(scenario, [EntityRecord(name=f"Node {n}", parent=n - 1) for n in range(3000)])


def test_the_console_counts_and_filters():
    console = ConsoleLog()
    for _ in range(3):
        console.add("simulation", "warning", "late")
    console.add("render", "info", "drawing")
    assert [(line.text, line.count) for line in console] == [("late", 3), ("drawing", 1)]
    assert [line.text for line in console.matching(frozenset({"warning"}), "")] == ["late"]
    assert [line.text for line in console.matching(frozenset({"info", "warning"}), "RENDER")] == ["drawing"]
    console.clear()
    assert len(console) == 0


def test_without_a_display_there_is_one_sentence_with_a_remedy():
    program = (
        "from elys.editor_node.window import Window\n"
        "from elys.common.errors import DisplayError\n"
        "try:\n    Window('x', (64, 64))\nexcept DisplayError as error:\n    print(error)\n"
    )
    hidden = {"ELYS_NULL_PLATFORM": "0", "PATH": "/usr/bin", "LC_ALL": "C.UTF-8"}
    done = subprocess.run([sys.executable, "-c", program], env=hidden, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("no display to open the editor's window on")
    assert "elys render" in done.stdout
    assert done.stdout.count("\n") == 1


def test_model_and_camera_need_no_window():
    program = (
        "import sys, elys.editor_node.model, elys.editor_node.camera\n"
        "assert not {'moderngl', 'glfw', 'imgui_bundle'} & set(sys.modules), 'the model needs no window'\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)  # fails where the assertion does


def test_the_camera_looks_from_where_it_is_put():
    camera = OrbitCamera()
    camera.look_from((1.0, 2.0, 3.0), (0.6, -0.5, -0.4), 7.0)
    assert camera.position == pytest.approx((1.0, 2.0, 3.0))
    assert -camera.backward == pytest.approx(np.array((0.6, -0.5, -0.4)) / np.linalg.norm((0.6, -0.5, -0.4)))
