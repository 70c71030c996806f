"""Pairs against brute force, while boxes of very different sizes move, come and go."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.geometry import GeometryStore
from elys.sim_node.physics.kernels.tables import BODY, COLLIDER, DYNAMIC, HEIGHT_FIELD, PROXY, STATIC

NO_GEOMETRY = GeometryStore().arrays


def make_tables(rng, count):
    """As many bodies as colliders, and the colliders with their proxies: a table of each."""
    bodies = np.zeros(count, BODY)
    bodies["motion"] = np.where(rng.random(count) < 0.3, STATIC, DYNAMIC)
    colliders, proxies = np.zeros(count, COLLIDER), np.zeros(count, PROXY)
    colliders["body"] = proxies["body"] = np.arange(count)
    proxies["motion"] = bodies["motion"]
    proxies["layer"] = proxies["mask"] = 1
    size = 10.0 ** rng.uniform(-1, 1, (count, 3))
    lower = rng.uniform(-10, 10, (count, 3))
    proxies["fat_box"] = np.concatenate([lower, lower + size], axis=1)
    return bodies, colliders, proxies


def brute_force(proxies):
    low, high = proxies["fat_box"][:, :3], proxies["fat_box"][:, 3:]
    overlap = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(2)
    dynamic = proxies["motion"] == DYNAMIC
    a, b = np.nonzero(np.triu(overlap & (dynamic[:, None] | dynamic[None]), 1))
    return list(zip(a.tolist(), b.tolist(), strict=True))


def found(store):
    return list(zip(store.live_pairs["a"].tolist(), store.live_pairs["b"].tolist(), strict=True))


def update(store, tables, moved=None, geometry=NO_GEOMETRY):
    """Lets the store follow boxes of which those where `moved` (C,) is set, else all, are new."""
    bodies, colliders, proxies = tables
    if store.is_outdated:
        store.list_active(bodies, colliders)
    rows = np.arange(len(proxies)) if moved is None else np.flatnonzero(moved)
    movers = (rows.astype(np.int32), len(rows))
    store.update_pairs(colliders, proxies, geometry, np.zeros(0, np.int64), *movers)


@pytest.mark.parametrize("count", [1, 7, 300, 2500])
def test_pairs_equal_brute_force_and_are_sorted_while_boxes_move(count):
    rng = np.random.default_rng(0)
    tables = make_tables(rng, count)
    proxies = tables[2]
    store = ContactStore()
    store.set_collider_count(count)
    update(store, tables)
    assert found(store) == brute_force(proxies)
    for moved_share in (0.02, 0.3, 1.0, 0.1, 0.0):
        moved = rng.random(count) < moved_share
        step = rng.normal(0, 2, (count, 3)) * moved[:, None]
        proxies["fat_box"] += np.concatenate([step, step], axis=1)
        update(store, tables, moved)
        assert found(store) == brute_force(proxies)
        slots = store.live_pairs["slot"]
        assert len(np.unique(slots)) == len(slots) and (slots >= 0).all()


def test_a_sleeping_pair_that_is_found_again_is_no_new_one():
    """A static body alone gets a new box, as when a joint lets go of it: its pairs with what sleeps are not active."""
    rng = np.random.default_rng(6)
    tables = make_tables(rng, 100)
    bodies, colliders, proxies = tables
    store = ContactStore()
    store.set_collider_count(100)
    update(store, tables)
    bodies["asleep"] = (bodies["motion"] == DYNAMIC) & (rng.random(100) < 0.5)
    store.list_active(bodies, colliders)
    assert store.active_count < store.pair_count
    store.list_sleeping(bodies, colliders, wanted=True)
    update(store, tables, bodies["motion"] == STATIC)
    assert found(store) == brute_force(proxies)


def test_a_pair_keeps_its_manifold_while_others_come_and_go():
    rng = np.random.default_rng(1)
    tables = make_tables(rng, 100)
    proxies = tables[2]
    store = ContactStore()
    store.set_collider_count(100)
    update(store, tables)
    store.manifolds["twist_impulse"][store.live_pairs["slot"]] = np.arange(store.pair_count) + 1.0
    named = dict(zip(found(store), np.arange(store.pair_count) + 1.0, strict=True))
    moved = np.arange(100) % 10 == 0
    step = rng.normal(0, 3, (100, 3)) * moved[:, None]
    proxies["fat_box"] += np.concatenate([step, step], axis=1)
    update(store, tables, moved)
    for pair, slot in zip(found(store), store.live_pairs["slot"], strict=True):
        assert store.manifolds["twist_impulse"][slot] == named.get(pair, 0.0)


def test_colliders_of_one_body_do_not_pair():
    rng = np.random.default_rng(2)
    tables = make_tables(rng, 50)
    proxies = tables[2]
    proxies["motion"] = DYNAMIC
    proxies["body"] = np.arange(50) // 2
    store = ContactStore()
    store.set_collider_count(50)
    update(store, tables)
    expected = [(a, b) for a, b in brute_force(proxies) if a // 2 != b // 2]
    assert found(store) == expected


def test_removed_colliders_end_their_pairs_and_the_others_follow():
    rng = np.random.default_rng(3)
    tables = make_tables(rng, 80)
    proxies = tables[2]
    store = ContactStore()
    store.set_collider_count(80)
    update(store, tables)
    keep = rng.random(80) < 0.7
    store.follow_colliders(np.where(keep, np.cumsum(keep) - 1, -1))
    assert found(store) == brute_force(proxies[keep])


def test_a_collider_pairs_with_the_triangles_near_it_and_only_with_them():
    rng = np.random.default_rng(4)
    store = GeometryStore()
    handle = store.add_height_field(rng.uniform(-1, 1, (30, 40)), [30.0, 40.0])
    turn = Rotation.random(random_state=rng)
    bodies, colliders, proxies = tables = make_tables(rng, 60)
    bodies["motion"][0] = proxies["motion"][0] = STATIC
    proxies["kind"][0] = HEIGHT_FIELD
    mesh = colliders[0]
    mesh["kind"], mesh["geometry"] = HEIGHT_FIELD, handle
    mesh["axes"] = turn.as_matrix().T.ravel()
    mesh["center"] = [1.0, -2.0, 0.5]
    proxies["fat_box"][0] = [-100, -100, -100, 100, 100, 100]
    contacts = ContactStore()
    contacts.set_collider_count(60)
    triangles = store.arrays.points[store.arrays.faces["first_corner"][:, None] + np.arange(3)]
    low, high = triangles.min(1), triangles.max(1)
    for moved_share in (1.0, 0.3, 0.1):
        moved = rng.random(60) < moved_share
        moved[0] = moved_share == 1.0
        step = rng.normal(0, 2, (60, 3)) * moved[:, None]
        step[0] = 0.0
        proxies["fat_box"] += np.concatenate([step, step], axis=1)
        update(contacts, tables, moved, store.arrays)
        expected = []
        for b in np.flatnonzero(bodies["motion"] == DYNAMIC):
            box = proxies["fat_box"][b]
            middle = turn.apply(0.5 * (box[:3] + box[3:]) - mesh["center"], inverse=True)
            reach = abs(turn.as_matrix().T) @ (0.5 * (box[3:] - box[:3]))
            near = ((low <= middle + reach) & (high >= middle - reach)).all(1)
            expected += [(0, int(b), int(part)) for part in np.flatnonzero(near)]
        live = contacts.live_pairs
        with_mesh = live[live["a"] == 0]
        assert [(int(p["a"]), int(p["b"]), int(p["part"])) for p in with_mesh] == expected
        assert len(expected) > 50


def test_layers_that_do_not_meet_make_no_pairs():
    rng = np.random.default_rng(5)
    tables = make_tables(rng, 60)
    proxies = tables[2]
    proxies["layer"] = 1 << rng.integers(0, 3, 60)
    proxies["mask"] = rng.integers(0, 8, 60)
    store = ContactStore()
    store.set_collider_count(60)
    update(store, tables)
    layer, mask = proxies["layer"].astype(int), proxies["mask"].astype(int)
    expected = [(a, b) for a, b in brute_force(proxies) if layer[a] & mask[b] and layer[b] & mask[a]]
    assert found(store) == expected
