"""Where colliders touch: one function for each pair of shapes, chosen here."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.box_box import box_box
from elys.sim_node.physics.kernels.manifold import follow_motion, forget_contact, write_manifold
from elys.sim_node.physics.kernels.sphere import box_sphere, sphere_sphere
from elys.sim_node.physics.kernels.tables import BOX


@inner
def pair_margin(first, second, a, b, constants):
    """Gap up to which the colliders a and b of two bodies may touch within this step.

    What approaches fast is looked for from farther away, so that it is stopped at the surface and not inside; but never
    from farther than the smaller shape is large: that would make it hit things that it passes by.
    """
    squared = 0.0
    for k in range(3):
        relative = second.velocity[k] - first.velocity[k]
        squared += relative * relative
    way = constants.time * math.sqrt(squared) + a.turning + b.turning
    return constants.margin + min(way, a.reach, b.reach)


@inner
def boxes_apart(a, b, margin):
    """Whether the smallest boxes of two colliders are farther apart than the margin: most pairs are, and need no more."""
    for k in range(3):
        if a[k] - margin > b[3 + k] or b[k] - margin > a[3 + k]:
            return True
    return False


@kernel
def update_manifolds(bodies, colliders, pairs, pair_count, manifolds, all_found, all_constants, touching):
    """Brings the manifold of every pair up to date; returns how many have contact, their pairs listed in `touching`.

    Second comes whether any manifold has got or lost points.
    """
    constants = all_constants[0]
    found = all_found[0]
    touching_count = 0
    is_changed = False
    for p in range(pair_count):
        pair = pairs[p]
        a = colliders[pair.a]
        b = colliders[pair.b]
        first = bodies[a.body]
        second = bodies[b.body]
        manifold = manifolds[pair.slot]
        margin = pair_margin(first, second, a, b, constants)
        boxes = a.kind == BOX and b.kind == BOX
        before = manifold.point_count
        if boxes_apart(a.box, b.box, margin):
            if before > 0:
                is_changed = True
                forget_contact(manifold)
            manifold.margin = -1.0
            continue
        if not (boxes and follow_motion(first, second, manifold, margin, constants)):
            flipped = False
            if boxes:
                count = box_box(colliders, pair.a, pair.b, margin, found)
            elif a.kind == BOX:
                count = box_sphere(a, b, margin, found)
            elif b.kind == BOX:
                count = box_sphere(b, a, margin, found)
                flipped = True
            else:
                count = sphere_sphere(a, b, margin, found)
            write_manifold(first, second, a, b, manifold, found, count, margin, flipped)
            is_changed = is_changed or count != before
        if manifold.point_count > 0:
            touching[touching_count] = p
            touching_count += 1
    return touching_count, is_changed
