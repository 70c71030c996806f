"""Bodies that were put deep into others: looked for once, in the first step after they came."""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, FRESH, HULL, SPHERE

DEEP = 0.2  # share of the thinner shape's thickness


@inner
def thickness(collider):
    """How thick a shape is where it is thinnest [m]; infinite for what has no inside."""
    half = collider.half_extents
    if collider.kind == SPHERE or collider.kind == CAPSULE:
        return 2.0 * half[0]
    if collider.kind == CYLINDER:
        return 2.0 * min(half[0], half[1])
    if collider.kind == BOX or collider.kind == HULL:
        return 2.0 * min(half[0], half[1], half[2])
    return 1e300


@kernel
def find_deep_overlaps(bodies, colliders, pairs, touching, touching_count, manifolds, listed, depths):
    """Lists the slots of pairs in which a fresh body overlaps another deeply, with depths; no body is fresh afterwards.

    `listed` (T,) int32 and `depths` (T,) have room for all touching pairs. Returns how many were found.
    """
    found = 0
    for t in range(touching_count):
        pair = pairs[touching[t]]
        a = colliders[pair.a]
        b = colliders[pair.b]
        if not (bodies[a.body].told | bodies[b.body].told) & FRESH:
            continue
        depth = 0.0
        manifold = manifolds[touching[t]]
        for k in range(manifold.point_count):
            depth = max(depth, -manifold.made_separation[k])
        if depth > DEEP * min(thickness(a), thickness(b)):
            listed[found] = touching[t]
            depths[found] = depth
            found += 1
    for i in range(bodies.shape[0]):
        bodies[i].told = bodies[i].told & (255 - FRESH)
    return found
