"""What lies near a collider that is not bounded by a box of its own size: triangles of meshes and height fields, half-spaces."""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.tables import HEIGHT_FIELD, MESH


@inner
def has_parts(collider):
    return collider.kind == MESH or collider.kind == HEIGHT_FIELD


@inner
def box_over_plane(plane, box):
    """How far a box in world axes stays above a half-space; negative when it reaches into it [m]."""
    n = plane.axes
    height = 0.0
    for k in range(3):
        height += n[3 + k] * (0.5 * (box[k] + box[3 + k]) - plane.center[k])
        height -= abs(n[3 + k]) * 0.5 * (box[3 + k] - box[k])
    return height


@inner
def local_interval(mesh, box, k):
    """The extent of a box in world axes along axis k of a mesh, from the mesh's centre."""
    u = mesh.axes
    middle = reach = 0.0
    for d in range(3):
        along = u[3 * k + d]
        middle += along * (0.5 * (box[d] + box[3 + d]) - mesh.center[d])
        reach += abs(along) * 0.5 * (box[3 + d] - box[d])
    return middle - reach, middle + reach


@inner
def meets_part(mesh, part, box, geometry):
    """Whether a box in world axes overlaps the box of one triangle in the mesh's axes."""
    first = geometry.faces[geometry.headers[mesh.geometry].first_face + part].first_corner
    points = geometry.points
    meets = True
    for k in range(3):
        low, high = local_interval(mesh, box, k)
        p, q, r = points[first, k], points[first + 1, k], points[first + 2, k]
        meets = meets and low <= max(p, q, r) and high >= min(p, q, r)
    return meets


@inner
def next_part(mesh, low_x, high_x, low_y, high_y, low_z, high_z, geometry, stack, bottom, top):
    """Walks the tree over a mesh's triangles down to the next leaf that meets a box in the mesh's axes.

    The walk is in stack[bottom:top]. Returns the leaf's first triangle and the new top; -1 at the end.
    """
    header = geometry.headers[mesh.geometry]
    nodes = geometry.nodes
    while top > bottom:
        top -= 1
        node = stack[top]
        box = nodes[header.first_node + node]
        apart = (box[0] > high_x) | (box[3] < low_x) | (box[1] > high_y) | (box[4] < low_y)
        if apart | (box[2] > high_z) | (box[5] < low_z):
            continue
        if node >= header.leaf_count:
            return 2 * (node - header.leaf_count), top
        stack[top] = 2 * node + 1
        stack[top + 1] = 2 * node  # on top: parts come in ascending order
        top += 2
    return -1, top
