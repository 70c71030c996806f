"""Boxes, turned or not, against linear programs that know no formula for boxes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import elys
from elys.common.math import Aabb, Obb, matrix
from tests.reference import naive_boxes

SEEDS = st.integers(0, 10_000)


def boxes(seed: int, *, spread: float = 3.0, turned: bool = True):
    """Two random boxes as (center, rotation, half)."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(2):
        rotation = Rotation.random(random_state=rng).as_quat() if turned else np.array([0.0, 0.0, 0.0, 1.0])
        made.append((rng.uniform(-spread, spread, 3), rotation, rng.uniform(0.1, 2.0, 3)))
    return *made, rng


def as_aabb(box) -> Aabb:
    return Aabb.from_center(box[0], box[2])


@given(SEEDS, st.booleans())
def test_boxes_overlap_where_a_point_lies_in_both(seed: int, turned: bool) -> None:
    first, second, _ = boxes(seed, turned=turned)
    depth = naive_boxes.depth_of_overlap(first, second)
    if abs(depth) > 1e-7:
        assert Obb(*first).overlaps(Obb(*second)) == (depth > 0)
        if not turned:
            assert as_aabb(first).overlaps(as_aabb(second)) == (depth > 0)
            assert Obb(*first).overlaps(as_aabb(second)) == (depth > 0)


@given(SEEDS, st.booleans())
def test_rays_enter_and_leave_where_the_box_begins_and_ends(seed: int, turned: bool) -> None:
    box, other, rng = boxes(seed, turned=turned)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    origin = other[0]
    expected = naive_boxes.ray_interval(origin, direction, box)
    for found in [Obb(*box).raycast(origin, 3.0 * direction)] + (
        [] if turned else [as_aabb(box).raycast(origin, direction)]
    ):
        assert found.hit == (expected is not None)
        if expected is None:
            assert found.entry == found.exit == np.inf
            assert (found.normal == 0).all()
            continue
        np.testing.assert_allclose((found.entry, found.exit), expected, atol=1e-7)
        if found.entry == 0:
            np.testing.assert_allclose(found.normal, -direction, atol=1e-12)
        else:
            # A step back along the ray leaves through the plane that the normal belongs to.
            matrix_of, bound = naive_boxes.halfspaces(*box)
            face = (matrix_of @ (origin + found.entry * direction) - bound).argmax()
            np.testing.assert_allclose(found.normal, matrix_of[face], atol=1e-9)


@given(SEEDS, st.booleans())
def test_a_moving_box_touches_at_the_first_time_there_is_a_common_point(seed: int, turned: bool) -> None:
    moving, still, rng = boxes(seed, spread=5.0, turned=turned)
    displacement = 1.5 * (still[0] - moving[0]) + rng.normal(size=3)
    expected = naive_boxes.time_of_impact(moving, displacement, still)
    answers = [Obb(*moving).sweep(displacement, Obb(*still))]
    if not turned:
        answers.append(as_aabb(moving).sweep(displacement, as_aabb(still)))
    for found in answers:
        assert found.hit == (expected is not None)
        if expected is None:
            assert found.fraction == np.inf
            continue
        assert found.fraction == pytest.approx(expected, abs=1e-7)
        # The plane of the first touch has the one box on either side.
        there = (moving[0] + found.fraction * displacement, *moving[1:])
        if found.fraction > 0:
            lowest = (Obb(*there).corners @ found.normal).min()
            highest = (Obb(*still).corners @ found.normal).max()
            assert lowest == pytest.approx(highest, abs=1e-9)
            assert displacement @ found.normal < 0


def test_overlapping_boxes_are_parted_the_shortest_way() -> None:
    found = Aabb((0, 0, 0), (2, 2, 2)).sweep((0, 0, 5), Aabb((1.5, -1, -1), (9, 9, 9)))
    assert found.hit
    assert found.fraction == 0
    assert found.normal.tolist() == [-1, 0, 0]


@given(SEEDS)
def test_the_nearest_point_is_inside_and_nothing_inside_is_nearer(seed: int) -> None:
    box, other, rng = boxes(seed)
    solid = Obb(*box)
    nearest = solid.closest_point(other[0])
    assert solid.expanded(1e-9).contains_point(nearest)
    samples = box[0] + Rotation.from_quat(box[1]).apply(rng.uniform(-1, 1, (200, 3)) * box[2])
    assert solid.contains_point(samples).all()
    distances = np.linalg.norm(samples - other[0], axis=1)
    assert solid.distance(other[0]) <= distances.min() + 1e-9
    assert np.linalg.norm(nearest - other[0]) == pytest.approx(solid.distance(other[0]), abs=1e-9)
    # Supporting plane: no corner lies beyond the nearest point as seen from outside.
    if solid.distance(other[0]) > 0:
        assert ((solid.corners - nearest) @ (other[0] - nearest)).max() < 1e-9


@given(SEEDS)
def test_boxes_hold_what_they_were_made_from(seed: int) -> None:
    first, second, rng = boxes(seed)
    a, b = Obb(*first), Obb(*second)
    both = a.merged(b)
    assert both.expanded(1e-9).contains(a)
    assert both.expanded(1e-9).contains(b)
    assert both.volume >= max(a.volume, b.volume) * (1 - 1e-9)
    assert a.contains(b) == a.contains_point(b.corners).all()
    assert a.bounds.expanded(1e-9).contains_point(a.corners).all()
    np.testing.assert_allclose(a.bounds.lower, a.corners.min(axis=0), atol=1e-12)
    points = rng.normal(size=(7, 3)) * (3, 1, 0.2)
    fitted = Obb.from_points(points)
    assert fitted.expanded(1e-9).contains_point(points).all()
    assert fitted.volume <= Aabb.from_points(points).volume * (1 + 1e-9)


@given(SEEDS)
def test_the_corners_of_a_turned_box_give_it_back(seed: int) -> None:
    box, *_ = boxes(seed)
    solid = Obb(*box)
    # Principal axes find the box again where its extents differ.
    if np.diff(np.sort(box[2])).min() > 1e-3:
        again = Obb.from_points(solid.corners)
        np.testing.assert_allclose(np.sort(again.half_extents), np.sort(box[2]), atol=1e-6)
        np.testing.assert_allclose(again.center, box[0], atol=1e-9)


@given(SEEDS)
def test_moving_the_world_changes_no_answer(seed: int) -> None:
    first, second, rng = boxes(seed)
    turn, shift = Rotation.random(random_state=rng), rng.normal(size=3)
    a, b = Obb(*first), Obb(*second)
    moved_a, moved_b = (box.transformed(shift, turn.as_quat()) for box in (a, b))
    np.testing.assert_allclose(moved_a.corners, turn.apply(a.corners) + shift, atol=1e-9)
    displacement = b.center - a.center
    before, after = a.sweep(displacement, b), moved_a.sweep(turn.apply(displacement), moved_b)
    assert after.fraction == pytest.approx(before.fraction, abs=1e-9)
    if before.fraction > 0:
        np.testing.assert_allclose(after.normal, turn.apply(before.normal), atol=1e-6)


def test_many_at_once_broadcast() -> None:
    rng = np.random.default_rng(3)
    lower = rng.uniform(-5, 5, (40, 3))
    crowd = Aabb(lower, lower + rng.uniform(0.1, 2, (40, 3)))
    one = Aabb((-1, -1, -1), (1, 1, 1))
    expected = [bool(Aabb(*pair).overlaps(one)) for pair in zip(crowd.lower, crowd.upper, strict=True)]
    assert crowd.overlaps(one).tolist() == expected
    table = Aabb(crowd.lower[:, None], crowd.upper[:, None]).overlaps(crowd)
    assert table.shape == (40, 40)
    assert (table == table.T).all()
    turned = Obb(crowd.center, (0, 0, 0, 1), crowd.half_extents)
    assert (turned.overlaps(one) == crowd.overlaps(one)).all()
    rays = one.raycast(rng.uniform(-5, 5, (9, 3)), (0.0, 0.0, 1.0))
    assert rays.hit.shape == (9,)
    assert crowd.union().contains(crowd).all()
    assert crowd.union().lower.tolist() == crowd.lower.min(axis=0).tolist()


def test_rays_along_edges_and_faces_touch() -> None:
    unit = Aabb((0, 0, 0), (1, 1, 1))
    found = unit.raycast([[-1, 0, 0], [-1, 1, 1], [-1, 0.5, 1], [-1, 0.5, 1.0000001], [2, 0, 0]], [1, 0, 0])
    assert found.hit.tolist() == [True, True, True, False, False]
    assert found.entry[:3].tolist() == [1, 1, 1]
    assert found.exit[:3].tolist() == [2, 2, 2]
    assert (found.normal[:3] == (-1, 0, 0)).all()
    assert unit.raycast((-1, 0.5, 0.5), (1, 0, 0), max_distance=0.9).hit.tolist() is False


def test_an_empty_box_meets_nothing() -> None:
    empty, unit = Aabb.from_points(np.zeros((0, 3))), Aabb((0, 0, 0), (1, 1, 1))
    assert empty.is_empty
    assert empty.volume == 0
    assert not empty.overlaps(unit)
    assert not empty.raycast((0, 0, 0), (1, 0, 0)).hit
    assert not unit.sweep((1, 0, 0), empty).hit
    assert unit.contains(empty)
    merged = unit.merged(empty)
    assert merged.lower.tolist() == [0, 0, 0]
    assert merged.upper.tolist() == [1, 1, 1]
    assert unit.intersection(Aabb((2, 0, 0), (3, 1, 1))).is_empty


def test_nearly_parallel_boxes_are_not_parted_by_rounding() -> None:
    for angle in (0.0, 1e-16, 1e-12, 1e-9, 1e-7, 1e-5):
        tilted = Obb((1.9, 0.3, 0.1), (0, 0, np.sin(angle / 2), np.cos(angle / 2)), (1, 1, 1))
        assert tilted.overlaps(Aabb((-1, -1, -1), (1, 1, 1)))


@pytest.mark.parametrize(
    ("ask", "sentence"),
    [
        (lambda: Aabb((0, 0), (1, 1)), "corners"),
        (lambda: Obb((0, 0, 0), (0, 0, 0, 1), (1, -1, 1)), "half extents"),
        (lambda: Obb.from_points(np.zeros((0, 3))), "at least one point"),
        (lambda: Obb.from_points([[np.nan, 0, 0]]), "points must be finite"),
        (lambda: Aabb((0, 0, 0), (1, 1, 1)).raycast((0, 0, 0), (0, 0, 0)), "length 0"),
        (lambda: Aabb((0, 0, 0), (1, 1, 1)).raycast((0, np.inf, 0), (0, 0, 1)), "origin must be finite"),
        (lambda: Aabb((0, 0, 0), (1, 1, 1)).raycast((0, 0, 0), (0, 0, 1), -1.0), "0 m or more"),
    ],
)
def test_what_is_no_box_or_ray_is_refused(ask, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        ask()


def test_the_library_offers_both() -> None:
    moved = elys.Aabb((0, 0, 0), (1, 1, 1)).transformed(matrix.compose_affine((5, 0, 0), (0, 0, 0, 1), (2, 2, 2)))
    assert moved.upper.tolist() == [7, 2, 2]
    assert elys.Obb is Obb
