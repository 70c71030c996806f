"""Contacts with many triangles at once, joined where they lie in one plane.

A box on a ground of small triangles touches dozens. Each alone would give up to four points, most of them on seams that
nobody sees: more work, a stiffer contact than on one plane, and friction that is lost whenever a seam is crossed. So the
pairs of a collider with the parts of a mesh, which stand together in the order of pairs, are brought up to date together:
points with one normal become one manifold of at most four. Any pair of the run may keep it; it stays where it is, so that
impulses are inherited, as long as that pair lives.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.tables import MOST_CLUSTERS, POINTS

SAME_NORMAL = 1e-5  # 1 - cosine
SAME_CONTACT = 0.1  # 1 - cosine up to which a manifold of before is the same contact
SAME_POINT = 1e-6  # squared distance, as a share of the squared margin, below which two points are one
DEEPER = 0.02  # how much deeper a point must be to be kept for its depth alone, as a share of the margin


@inner
def run_end(pairs, active, begin, active_count):
    """Where the pairs of the same two colliders end."""
    pair = pairs[active[begin]]
    end = begin + 1
    while end < active_count and pairs[active[end]].a == pair.a and pairs[active[end]].b == pair.b:
        end += 1
    return end


@inner
def cosine_between(p, q):
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


@inner
def copy_point(cluster, source, target):
    for k in range(3):
        cluster.point[3 * target + k] = cluster.point[3 * source + k]
    cluster.separation[target] = cluster.separation[source]
    cluster.feature[target] = cluster.feature[source]


@inner
def squared_between(cluster, i, j):
    p = cluster.point
    x, y, z = p[3 * i] - p[3 * j], p[3 * i + 1] - p[3 * j + 1], p[3 * i + 2] - p[3 * j + 2]
    return x * x + y * y + z * z


@inner
def side_of(cluster, i, j, k):
    """Twice the area of the triangle of three points, with the sign of its turn about the normal."""
    p = cluster.point
    n = cluster.normal
    ux, uy, uz = p[3 * j] - p[3 * i], p[3 * j + 1] - p[3 * i + 1], p[3 * j + 2] - p[3 * i + 2]
    vx, vy, vz = p[3 * k] - p[3 * i], p[3 * k + 1] - p[3 * i + 1], p[3 * k + 2] - p[3 * i + 2]
    return n[0] * (uy * vz - uz * vy) + n[1] * (uz * vx - ux * vz) + n[2] * (ux * vy - uy * vx)


@inner
def keep_four(cluster, margin):
    """Leaves at most four points: the two farthest apart, the extremes on either side, and one much deeper than those."""
    count = cluster.count
    c0 = c1 = c2 = c3 = 0
    widest = -1.0
    for i in range(count):
        for j in range(i + 1, count):
            squared = squared_between(cluster, i, j)
            if squared > widest:
                widest, c0, c1 = squared, i, j
    c2 = c3 = c0
    most = least = 0.0
    deepest = 0
    for k in range(count):
        area = side_of(cluster, c0, c1, k)
        if area > most:
            most, c2 = area, k
        if area < least:
            least, c3 = area, k
        if cluster.separation[k] < cluster.separation[deepest]:
            deepest = k
    kept = min(cluster.separation[c0], cluster.separation[c1], cluster.separation[c2], cluster.separation[c3])
    if cluster.separation[deepest] < kept - DEEPER * margin:
        if squared_between(cluster, deepest, c0) < squared_between(cluster, deepest, c1):
            c0 = deepest
        else:
            c1 = deepest
    written = 0
    for k in range(count):
        if k in (c0, c1, c2, c3):
            copy_point(cluster, k, written)
            written += 1
    cluster.count = written


@inner
def join_points(cluster, found, count, margin):
    """Adds the points found to a cluster; what is in the same place is one point."""
    for k in range(count):
        at = cluster.count
        for d in range(3):
            cluster.point[3 * at + d] = found.point[3 * k + d]
        cluster.separation[at] = found.separation[k]
        cluster.feature[at] = found.feature[k]
        is_new = True
        for j in range(at):
            is_new = is_new and squared_between(cluster, j, at) > SAME_POINT * margin * margin
        if is_new:
            cluster.count = at + 1
    if cluster.count > POINTS:
        keep_four(cluster, margin)


@inner
def gather(clusters, cluster_count, found, count, pair, margin):
    """Puts what was found with one part to the cluster of its normal; returns how many clusters there are now."""
    best = -2.0
    at = 0
    for c in range(cluster_count):
        cosine = cosine_between(clusters[c].normal, found.normal)
        if cosine > best:
            best, at = cosine, c
    if 1.0 - best > SAME_NORMAL and cluster_count < MOST_CLUSTERS:
        at = cluster_count
        cluster_count += 1
        clusters[at].count = 0
        clusters[at].origin = pair
        clusters[at].host = -1
        for d in range(3):
            clusters[at].normal[d] = found.normal[d]
    join_points(clusters[at], found, count, margin)
    return cluster_count


@inner
def hosted_by(clusters, cluster_count, pair):
    at = -1
    for c in range(cluster_count):
        if clusters[c].host == pair:
            at = c
    return at


@inner
def choose_hosts(clusters, cluster_count, active, begin, end, manifolds):
    """Gives every cluster a pair of its own: the one that kept this contact before, if there is one."""
    for q in range(begin, end):
        manifold = manifolds[active[q]]
        if manifold.point_count == 0:
            continue
        best = 1.0 - SAME_CONTACT
        at = -1
        for c in range(cluster_count):
            cosine = cosine_between(clusters[c].normal, manifold.normal)
            if clusters[c].host < 0 and cosine > best:
                best, at = cosine, c
        if at >= 0:
            clusters[at].host = q
    for c in range(cluster_count):
        if clusters[c].host < 0 and hosted_by(clusters, cluster_count, clusters[c].origin) < 0:
            clusters[c].host = clusters[c].origin
        q = begin
        while clusters[c].host < 0:
            if hosted_by(clusters, cluster_count, q) < 0:
                clusters[c].host = q
            q += 1


@inner
def take_cluster(cluster, found):
    """Writes a cluster as what was found; returns how many points."""
    for d in range(3):
        found.normal[d] = cluster.normal[d]
    for k in range(cluster.count):
        for d in range(3):
            found.point[3 * k + d] = cluster.point[3 * k + d]
        found.separation[k] = cluster.separation[k]
        found.feature[k] = cluster.feature[k]
    return cluster.count
