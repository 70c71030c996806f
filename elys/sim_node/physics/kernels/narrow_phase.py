"""Where colliders touch: one function for each pair of shapes, chosen here."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.box_box import box_box
from elys.sim_node.physics.kernels.capsule import capsule_capsule, sphere_capsule
from elys.sim_node.physics.kernels.convex import convex_convex, plane_convex, triangle_convex
from elys.sim_node.physics.kernels.manifold import follow_motion, forget_contact, write_manifold
from elys.sim_node.physics.kernels.midphase import has_parts
from elys.sim_node.physics.kernels.sphere import box_sphere, sphere_sphere
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, MESH, PLANE, SPHERE


@inner
def pair_margin(first, second, a, b, constants):
    """Gap up to which the colliders a and b of two bodies may touch within this step.

    What approaches fast is looked for from farther away, so that it is stopped at the surface and not inside; but never
    from farther than the smaller shape is large: that would make it hit things that it passes by. Second comes whether one
    may even be through the other by then.
    """
    squared = 0.0
    for k in range(3):
        relative = second.velocity[k] - first.velocity[k]
        squared += relative * relative
    way = constants.time * math.sqrt(squared) + a.turning + b.turning
    return constants.margin + min(way, a.reach, b.reach), way > thinness(a) + thinness(b)


@inner
def thinness(collider):
    """How far something may move past the surface of a collider before its middle lies behind it [m]."""
    if collider.kind >= MESH:
        return 0.0
    half = collider.half_extents
    return min(half[0], half[1], half[2])


@inner
def boxes_apart(a, b, margin):
    """Whether the smallest boxes of two colliders are farther apart than the margin: most pairs are, and need no more."""
    for k in range(3):
        if a[k] - margin > b[3 + k] or b[k] - margin > a[3 + k]:
            return True
    return False


@inner
def move_points(found, count, origin, flipped):
    """Brings points that are relative to an origin into world space, and turns the normal round where asked."""
    point = found.point
    for k in range(count):
        point[3 * k] += origin[0]
        point[3 * k + 1] += origin[1]
        point[3 * k + 2] += origin[2]
    if flipped:
        turn_normal(found)
    return count


@inner
def turn_normal(found):
    normal = found.normal
    normal[0], normal[1], normal[2] = -normal[0], -normal[1], -normal[2]


@inner
def collide(colliders, a, b, part, margin, found, geometry):
    """Contact points of colliders a and b no farther apart than the margin; returns how many.

    `found` gets the normal from a to b and up to four points, in the middle between the surfaces, with their separations
    and features. `part` is the triangle where one of the two is a mesh or a height field.
    """
    first = colliders[a]
    second = colliders[b]
    if first.kind == BOX and second.kind == BOX:
        return box_box(colliders, a, b, margin, found)
    # By kind, so that half the pairs need no function.
    flipped = first.kind > second.kind
    if flipped:
        first = colliders[b]
        second = colliders[a]
    kind = second.kind
    if kind == SPHERE:
        count = (
            box_sphere(first, second, margin, found)
            if first.kind == BOX
            else sphere_sphere(first, second, margin, found)
        )
    elif kind == CAPSULE and first.kind == SPHERE:
        count = sphere_capsule(first, second, margin, found)
    elif kind == CAPSULE and first.kind == CAPSULE:
        count = capsule_capsule(first, second, margin, found)
    elif kind == PLANE:
        count = plane_convex(second, first, margin, found, geometry)
        return move_points(found, count, first.center, not flipped)
    elif has_parts(second):
        count = triangle_convex(second, part, first, margin, found, geometry)
        return move_points(found, count, first.center, not flipped)
    else:
        count = convex_convex(first, second, margin, found, geometry)
        return move_points(found, count, first.center, flipped)
    if flipped:
        turn_normal(found)
    return count


@inner
def rolls(collider):
    """Whether the point of contact wanders over the surface as the collider turns, so that a manifold must not be kept."""
    return collider.kind == SPHERE or collider.kind == CAPSULE or collider.kind == CYLINDER


@kernel
def update_manifolds(
    bodies, colliders, pairs, pair_count, manifolds, all_found, geometry, all_constants, touching, fast
):
    """Brings the manifold of every pair up to date; returns how many have contact, their pairs listed in `touching`.

    Second comes whether any manifold has got or lost points, third how many pairs are so fast that they may miss each other
    within the step: those are listed in `fast`.
    """
    constants = all_constants[0]
    found = all_found[0]
    touching_count = 0
    is_changed = False
    fast_count = 0
    for p in range(pair_count):
        pair = pairs[p]
        a = colliders[pair.a]
        b = colliders[pair.b]
        first = bodies[a.body]
        second = bodies[b.body]
        manifold = manifolds[pair.slot]
        margin, is_fast = pair_margin(first, second, a, b, constants)
        if is_fast:
            fast[fast_count] = p
            fast_count += 1
        before = manifold.point_count
        if boxes_apart(a.box, b.box, margin):
            if before > 0:
                is_changed = True
                forget_contact(manifold)
            manifold.margin = -1.0
            continue
        if rolls(a) or rolls(b) or not follow_motion(first, second, manifold, margin, constants):
            count = collide(colliders, pair.a, pair.b, pair.part, margin, found, geometry)
            write_manifold(first, second, a, b, manifold, found, count, margin, constants)
            is_changed = is_changed or count != before
        if manifold.point_count > 0:
            touching[touching_count] = p
            touching_count += 1
    return touching_count, is_changed, fast_count
