"""Which manifolds are solved side by side: a greedy colouring of the contacts of each group of islands.

Two manifolds of one colour share no body that can move, so the order within a colour does not matter: eight of them make a
batch, and threads may share a colour out. The colours depend on the order of the pairs and on nothing else.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.simd import LANES
from elys.sim_node.physics.kernels.tables import DYNAMIC, POINTS

COLOURS = 63  # what no colour is left for is solved one manifold at a time, as colour number 63
OVERFLOW = 63
KEYS = (OVERFLOW + 1) * POINTS  # a colour's manifolds, those with most points first

_ONE = np.uint64(1)
_NONE = np.uint64(0)


@inner
def free_colour(mask, base):
    """The first colour from `base` on that is not in the mask."""
    colour = base
    while colour < COLOURS and (mask >> np.uint64(colour)) & _ONE != _NONE:
        colour += 1
    return colour


@inner
def choose_colours(bodies, colliders, pairs, touching, touching_count, manifolds, group_of, masks, keys, colour_counts):
    """Writes the key of each touching pair: its group, colour and how many points it lacks.

    Contacts with what cannot move come last, in colours of their own: they have the last word on what stands on the ground.
    """
    for i in range(masks.shape[0]):
        masks[i] = _NONE
    colour_counts[:] = 0
    for fixed in range(2):
        for t in range(touching_count):
            pair = pairs[touching[t]]
            a = colliders[pair.a].body
            b = colliders[pair.b].body
            moves_a = bodies[a].motion == DYNAMIC
            moves_b = bodies[b].motion == DYNAMIC
            if (moves_a and moves_b) == (fixed == 1):
                continue
            group = group_of[a] if moves_a else group_of[b]
            mask = (masks[a] if moves_a else _NONE) | (masks[b] if moves_b else _NONE)
            colour = free_colour(mask, colour_counts[2 * group] if fixed == 1 else 0)
            if colour < COLOURS:
                bit = _ONE << np.uint64(colour)
                if moves_a:
                    masks[a] |= bit
                if moves_b:
                    masks[b] |= bit
                # Counted beside each other: the colours among what moves, and all.
                if fixed == 0:
                    colour_counts[2 * group] = max(colour_counts[2 * group], colour + 1)
            keys[t] = (group * (OVERFLOW + 1) + colour) * POINTS + POINTS - manifolds[touching[t]].point_count


@inner
def sort_by_key(keys, count, starts, order):
    """A counting sort that keeps the order of equals; starts[k] is where key k begins afterwards."""
    starts[:] = 0
    for t in range(count):
        starts[keys[t] + 1] += 1
    for k in range(starts.shape[0] - 1):
        starts[k + 1] += starts[k]
    for t in range(count):
        order[starts[keys[t]]] = t
        starts[keys[t]] += 1
    for k in range(starts.shape[0] - 1, 0, -1):
        starts[k] = starts[k - 1]
    starts[0] = 0


@inner
def count_batches(starts, group_count):
    """How many batches the sorted keys make: each colour's last one may have empty lanes."""
    batches = 0
    for colour in range(group_count * (OVERFLOW + 1)):
        count = starts[(colour + 1) * POINTS] - starts[colour * POINTS]
        batches += count if colour % (OVERFLOW + 1) == OVERFLOW else (count + LANES - 1) // LANES
    return batches


@inner
def fill_lane(lane, nobody, a, b, slot, body_a, body_b, slots):
    """Who is in a lane; what cannot move is `nobody`, whose row never changes."""
    body_a[lane] = a if a >= 0 else nobody
    body_b[lane] = b if b >= 0 else nobody
    slots[lane] = slot


@kernel
def colour_contacts(
    bodies,
    colliders,
    pairs,
    touching,
    touching_count,
    manifolds,
    group_of,
    masks,
    keys,
    order,
    starts,
    colour_counts,
    groups,
    spans,
    body_a,
    body_b,
    slots,
    counts,
):
    """Deals the touching pairs out into batches, and the batches into spans of one colour; returns how many batches.

    When there is no room for so many nothing is dealt out: the caller makes room and calls again.

    Parameters: group_of (N,) int32 are the bodies' groups; masks (N,) uint64, keys and order (T,) int32, starts and
    colour_counts int32 are room; body_a, body_b and slots (8 B,) int32 and counts (B,) are the batches' bodies, manifolds and
    points. Slot 0 is nobody's manifold.
    """
    choose_colours(bodies, colliders, pairs, touching, touching_count, manifolds, group_of, masks, keys, colour_counts)
    sort_by_key(keys, touching_count, starts, order)
    needed = count_batches(starts, groups.shape[0])
    if needed > counts.shape[0]:
        return needed
    nobody = bodies.shape[0]
    batch = 0
    span = 0
    for g in range(groups.shape[0]):
        groups[g].first_span = span
        for colour in range(OVERFLOW + 1):
            key = (g * (OVERFLOW + 1) + colour) * POINTS
            place = starts[key]
            end = starts[key + POINTS]
            if place == end:
                continue
            spans[span].first = batch
            spans[span].is_serial = 1 if colour == OVERFLOW else 0
            together = LANES if colour < COLOURS else 1
            while place < end:
                counts[batch] = 0
                for k in range(LANES):
                    lane = batch * LANES + k
                    if k >= together or place >= end:
                        fill_lane(lane, nobody, -1, -1, 0, body_a, body_b, slots)
                        continue
                    slot = touching[order[place]]
                    pair = pairs[slot]
                    a = colliders[pair.a].body
                    b = colliders[pair.b].body
                    a = a if bodies[a].held != 0 else -1
                    b = b if bodies[b].held != 0 else -1
                    fill_lane(lane, nobody, a, b, slot, body_a, body_b, slots)
                    counts[batch] = max(counts[batch], manifolds[slot].point_count)
                    place += 1
                batch += 1
            spans[span].last = batch
            span += 1
        groups[g].last_span = span
    return batch
