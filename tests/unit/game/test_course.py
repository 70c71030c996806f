"""Roads: where they lead, against plain geometry; and their meshes, which are closed and look outwards."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from elys.common.assets.store import AssetStore
from elys.game.driver import GAP
from elys.samples.game.course import STEP, SUNK, Course
from elys.samples.game.kit import BALL_DIAMETER, FALL
from elys.samples.game.levels import LEVELS


def test_straights_turns_and_gaps_lead_where_they_should():
    course = Course(width=4.0, height=2.0)
    course.straight(10.0, climb=1.5)
    assert course.here.position == pytest.approx([0.0, 3.5, -10.0])
    course.turn(90.0, radius=8.0, bank=10.0)  # to the left: from -z to -x
    assert course.here.position == pytest.approx([-8.0, 3.5, -18.0], abs=0.01)
    assert course.here.forward == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)
    assert course.here.up == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    course.gap(3.0, drop=0.5).turn(-180.0, radius=5.0)
    assert course.here.position == pytest.approx([-11.0, 3.0, -28.0], abs=0.02)
    assert [len(stretch.places) > 1 for stretch in course.stretches] == [True, True]


def test_a_ramp_is_steepest_at_its_end_and_a_bend_leans_inwards():
    course = Course()
    slope = course.ramp(8.0, climb=2.0).stretches[0].places[-1].forward
    assert slope[1] / -slope[2] == pytest.approx(2.0 * 2.0 / 8.0)
    bend = Course().turn(-90.0, radius=20.0, bank=15.0).stations
    middle = bend[len(bend) // 2]
    assert math.degrees(math.acos(middle.up[1])) == pytest.approx(15.0, abs=0.1)
    assert middle.up @ middle.right == pytest.approx(0.0, abs=1e-12)
    assert middle.right[1] < 0.0  # to the right it goes down


@pytest.mark.parametrize("curb", [0.0, 0.4])
def test_a_mesh_is_closed_and_looks_outwards(curb):
    course = Course(width=5.0, curb=curb).straight(6.0).turn(70.0, radius=9.0, bank=14.0).ramp(5.0, climb=1.0)
    mesh, origin = course.stretches[0].mesh()
    corners = mesh.positions[mesh.indices].reshape(-1, 3, 3)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ni,ni->n", faces, mesh.normals[mesh.indices[::3]]) > 0.0).all()
    _, welded = np.unique(mesh.positions.round(5), axis=0, return_inverse=True)
    triangles = welded.reshape(-1)[mesh.indices].reshape(-1, 3)
    sides = Counter((int(t[k]), int(t[(k + 1) % 3])) for t in triangles for k in range(3))
    assert all(sides[end, begin] == count for (begin, end), count in sides.items())
    # By the divergence theorem: what it encloses is its outline's area times its length, nearly (bends and banks cancel).
    volume = np.einsum("ni,ni->n", corners[:, 0], faces).sum() / 6.0
    area = 5.0 * 0.5 + (2.0 * 0.35 * (0.5 + curb) if curb else 0.0)
    length = np.linalg.norm(np.diff([place.position for place in course.stations], axis=0), axis=1).sum()
    assert volume == pytest.approx(area * length, rel=0.01)
    assert origin == pytest.approx(course.stations[0].position)


def test_where_a_road_becomes_wider_no_edge_stands_in_the_way_of_a_ball():
    """The next mesh begins below the one before: a fast ball would jump off an edge at the same height."""
    course = Course(width=5.0, curb=0.0)
    course.straight(20.0).widen(7.0).straight(10.0)
    seam = course.stretches[0].places[-1].position
    first, second = course.stretches
    assert second.places[0].position[1] == pytest.approx(first.places[-1].position[1] - SUNK)
    assert second.places[0].position[2] > seam[2] + 1.0  # it begins before the seam, below
    rising = np.diff([place.position[1] for place in second.places if place.position[2] > seam[2] - 1e-9])
    assert (rising > 0.0).all() and rising[-1] < 0.01  # and is level with it there
    assert len(course.stations) == 1 + 40 + 1 + 20  # the line goes on as the road is driven


def test_a_gate_stands_beside_the_road_as_wide_as_it_is_there():
    course = Course(width=5.0).straight(4.0).gate().widen(7.0).straight(4.0).gate()
    narrow, wide = course.gates
    assert (narrow.width, wide.width) == pytest.approx((5.7, 7.7))
    assert narrow.place.position == pytest.approx([0.0, 0.0, -4.0])
    assert wide.place.position == pytest.approx([0.0, 0.0, -8.0])


@pytest.mark.parametrize("name", LEVELS)
def test_a_ball_that_falls_is_back_before_it_meets_the_ground(name):
    layout = LEVELS[name].lay_out(AssetStore(), LEVELS[name].medals, 1)
    (plain,) = (node for top in layout.document.entities for node in (top, *top.children) if node.name == "Plain")
    ground = plain.components["Transform"]["position"][1] + 0.5
    lowest = min(place.position[1] for place in layout.line)
    assert lowest - FALL - BALL_DIAMETER / 2.0 >= ground


@pytest.mark.parametrize("name", LEVELS)
def test_who_begins_again_at_a_gate_has_room_for_a_run_before_the_next_gap(name):
    """From rest on level ground a ball has 7 m/s after 4 m, and flies 8 m when it jumps then."""
    layout = LEVELS[name].lay_out(AssetStore(), LEVELS[name].medals, 1)
    line = np.array([place.position for place in layout.line])
    edges = np.flatnonzero(np.linalg.norm(np.diff(line, axis=0), axis=1) > GAP)
    gates = [node for node in layout.document.entities if node.name.startswith("Gate ")]
    assert len(gates) == 5 and len(edges)
    for gate in gates:
        at = int(np.argmin(np.linalg.norm(line - gate.components["Transform"]["position"], axis=1)))
        ahead = edges[edges >= at]
        assert not len(ahead) or (ahead[0] - at) * STEP >= 4.0, gate.name


def test_a_plank_comes_out_of_the_road_and_goes_back_into_it():
    course = Course(width=6.0)
    start = course.straight(10.0).here
    end = course.gap(20.0).here
    course.straight(10.0)
    course.plank(start.at(right=2.0, forward=-4.0), end.at(right=2.0, forward=4.0), width=1.0)
    (board,) = course.planks
    heights = [place.position[1] for place in board]
    assert heights[0] == pytest.approx(-SUNK) and heights[-1] == pytest.approx(-SUNK)
    over = [h for place, h in zip(board, heights, strict=True) if -30.0 <= place.position[2] <= -10.0]
    assert min(over) > 0.0  # higher than the edges of the road
    line = course.way_over(0, leaves=20 - 8, joins=21 + 8)
    steps = np.linalg.norm(np.diff([place.position for place in line], axis=0), axis=1)
    assert steps.max() < 1.0  # without a leap to the side
