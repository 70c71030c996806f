"""Roads: where they lead, against plain geometry; and their meshes, which are closed and look outwards."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from elys.samples.game.course import Course


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
