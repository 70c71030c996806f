"""Pairs against brute force, while boxes of very different sizes move, come and go."""

from __future__ import annotations

import numpy as np

from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.kernels.tables import BODY, COLLIDER, DYNAMIC, STATIC

NONE = np.zeros(0, np.int64)


def make_tables(rng, count):
    bodies = np.zeros(count, BODY)
    bodies["motion"] = np.where(rng.random(count) < 0.3, STATIC, DYNAMIC)
    colliders = np.zeros(count, COLLIDER)
    colliders["body"] = np.arange(count)
    colliders["moved"] = 1
    size = 10.0 ** rng.uniform(-1, 1, (count, 3))
    lower = rng.uniform(-10, 10, (count, 3))
    colliders["fat_box"] = np.concatenate([lower, lower + size], axis=1)
    return bodies, colliders


def brute_force(bodies, colliders):
    low, high = colliders["fat_box"][:, :3], colliders["fat_box"][:, 3:]
    overlap = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(2)
    dynamic = bodies["motion"] == DYNAMIC
    a, b = np.nonzero(np.triu(overlap & (dynamic[:, None] | dynamic[None]), 1))
    return list(zip(a.tolist(), b.tolist(), strict=True))


def found(store):
    return list(zip(store.live_pairs["a"].tolist(), store.live_pairs["b"].tolist(), strict=True))


def test_pairs_equal_brute_force_and_are_sorted_while_boxes_move():
    rng = np.random.default_rng(0)
    bodies, colliders = make_tables(rng, 300)
    store = ContactStore()
    store.set_collider_count(len(colliders))
    store.update_pairs(bodies, colliders, NONE, len(colliders))
    assert found(store) == brute_force(bodies, colliders)
    for moved_share in (0.02, 0.3, 1.0, 0.1, 0.0):
        moved = rng.random(300) < moved_share
        step = rng.normal(0, 2, (300, 3)) * moved[:, None]
        colliders["fat_box"] += np.concatenate([step, step], axis=1)
        colliders["moved"] = moved
        store.update_pairs(bodies, colliders, NONE, int(moved.sum()))
        assert found(store) == brute_force(bodies, colliders)
        slots = store.live_pairs["slot"]
        assert len(np.unique(slots)) == len(slots) and (slots >= 0).all()


def test_a_pair_keeps_its_manifold_while_others_come_and_go():
    rng = np.random.default_rng(1)
    bodies, colliders = make_tables(rng, 100)
    store = ContactStore()
    store.set_collider_count(100)
    store.update_pairs(bodies, colliders, NONE, 100)
    store.manifolds["twist_impulse"][store.live_pairs["slot"]] = np.arange(store.pair_count) + 1.0
    named = dict(zip(found(store), np.arange(store.pair_count) + 1.0, strict=True))
    moved = np.arange(100) % 10 == 0
    step = rng.normal(0, 3, (100, 3)) * moved[:, None]
    colliders["fat_box"] += np.concatenate([step, step], axis=1)
    colliders["moved"] = moved
    store.update_pairs(bodies, colliders, NONE, 10)
    for pair, slot in zip(found(store), store.live_pairs["slot"], strict=True):
        assert store.manifolds["twist_impulse"][slot] == named.get(pair, 0.0)


def test_colliders_of_one_body_do_not_pair():
    rng = np.random.default_rng(2)
    bodies, colliders = make_tables(rng, 50)
    bodies["motion"] = DYNAMIC
    colliders["body"] = np.arange(50) // 2
    store = ContactStore()
    store.set_collider_count(50)
    store.update_pairs(bodies, colliders, NONE, 50)
    expected = [(a, b) for a, b in brute_force(bodies, colliders) if a // 2 != b // 2]
    assert found(store) == expected


def test_removed_colliders_end_their_pairs_and_the_others_follow():
    rng = np.random.default_rng(3)
    bodies, colliders = make_tables(rng, 80)
    store = ContactStore()
    store.set_collider_count(80)
    store.update_pairs(bodies, colliders, NONE, 80)
    keep = rng.random(80) < 0.7
    store.follow_colliders(np.where(keep, np.cumsum(keep) - 1, -1))
    assert found(store) == brute_force(bodies[keep], colliders[keep])
