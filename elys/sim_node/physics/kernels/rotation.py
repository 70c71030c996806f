"""Quaternions (x y z w) and turning bodies, in scalars. Nothing here calls the C library: sin and cos differ between
machines, products and sums do not."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner


@inner
def cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inner
def multiplied(ax, ay, az, aw, bx, by, bz, bw):
    """The quaternion a b: first b's turn, then a's."""
    return (
        aw * bx + bw * ax + ay * bz - az * by,
        aw * by + bw * ay + az * bx - ax * bz,
        aw * bz + bw * az + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@inner
def normalized(x, y, z, w):
    scale = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    return x * scale, y * scale, z * scale, w * scale


@inner
def rotated(x, y, z, w, px, py, pz):
    """The vector p, turned by a unit quaternion."""
    tx, ty, tz = cross(x, y, z, px, py, pz)
    tx += tx
    ty += ty
    tz += tz
    ux, uy, uz = cross(x, y, z, tx, ty, tz)
    return px + w * tx + ux, py + w * ty + uy, pz + w * tz + uz


# Dividing takes five times as long as multiplying, and no compiler may exchange them.
_6TH, _12TH, _20TH, _30TH, _42ND, _56TH = 1.0 / 6.0, 1.0 / 12.0, 1.0 / 20.0, 1.0 / 30.0, 1.0 / 42.0, 1.0 / 56.0
_72ND, _90TH, _110TH = 1.0 / 72.0, 1.0 / 90.0, 1.0 / 110.0


@inner
def turn_by(vx, vy, vz):
    """The quaternion of a rotation vector.

    The series is taken at an eighth of the half angle, where seven terms are exact to the last bit for all turns below
    one revolution, and squared three times.
    """
    ax = vx * 0.0625
    ay = vy * 0.0625
    az = vz * 0.0625
    t = ax * ax + ay * ay + az * az
    s = 1.0 - t * _6TH * (1.0 - t * _20TH * (1.0 - t * _42ND * (1.0 - t * _72ND * (1.0 - t * _110TH))))
    w = 1.0 - t * 0.5 * (1.0 - t * _12TH * (1.0 - t * _30TH * (1.0 - t * _56TH * (1.0 - t * _90TH))))
    for _ in range(3):
        s, w = 2.0 * s * w, w * w - s * s * t
    return ax * s, ay * s, az * s, w


@inner
def spin_rates(x, y, z, a, b, c):
    """Euler's equations of a free body: the change of the angular velocity in its principal axes."""
    return a * y * z, b * z * x, c * x * y


@inner
def spun(x, y, z, w, ox, oy, oz, ix, iy, iz, h):
    """A free body after the time h: its quaternion and its world angular velocity.

    Parameters: unit quaternion, world angular velocity [rad/s], inverse principal inertia, time [s]. A body whose three
    moments are equal turns about a fixed axis, exactly.
    """
    if ix == iy and iy == iz:
        dx, dy, dz, dw = turn_by(ox * h, oy * h, oz * h)
        x, y, z, w = multiplied(dx, dy, dz, dw, x, y, z, w)
        x, y, z, w = normalized(x, y, z, w)
        return x, y, z, w, ox, oy, oz
    return spun_by_euler(x, y, z, w, ox, oy, oz, ix, iy, iz, h)


@inner
def spun_by_euler(x, y, z, w, ox, oy, oz, ix, iy, iz, h):
    """`spun` by Euler's equations, whatever the moments.

    Runge-Kutta of fourth order on quaternion and angular velocity in principal axes, in parts small enough that energy and
    angular momentum keep eight digits over minutes.
    """
    jx = 1.0 / ix
    jy = 1.0 / iy
    jz = 1.0 / iz
    a = (jy - jz) * ix
    b = (jz - jx) * iy
    c = (jx - jy) * iz
    px, py, pz = rotated(-x, -y, -z, w, ox, oy, oz)
    angle = math.sqrt(ox * ox + oy * oy + oz * oz) * h
    parts = min(int(angle * 16.0) + 1, 64)
    step = h / parts
    half = 0.5 * step
    sixth = step / 6.0
    for _ in range(parts):
        k1x, k1y, k1z = spin_rates(px, py, pz, a, b, c)
        q1x, q1y, q1z, q1w = multiplied(x, y, z, w, 0.5 * px, 0.5 * py, 0.5 * pz, 0.0)
        tx = px + half * k1x
        ty = py + half * k1y
        tz = pz + half * k1z
        k2x, k2y, k2z = spin_rates(tx, ty, tz, a, b, c)
        q2x, q2y, q2z, q2w = multiplied(
            x + half * q1x, y + half * q1y, z + half * q1z, w + half * q1w, 0.5 * tx, 0.5 * ty, 0.5 * tz, 0.0
        )
        tx = px + half * k2x
        ty = py + half * k2y
        tz = pz + half * k2z
        k3x, k3y, k3z = spin_rates(tx, ty, tz, a, b, c)
        q3x, q3y, q3z, q3w = multiplied(
            x + half * q2x, y + half * q2y, z + half * q2z, w + half * q2w, 0.5 * tx, 0.5 * ty, 0.5 * tz, 0.0
        )
        tx = px + step * k3x
        ty = py + step * k3y
        tz = pz + step * k3z
        k4x, k4y, k4z = spin_rates(tx, ty, tz, a, b, c)
        q4x, q4y, q4z, q4w = multiplied(
            x + step * q3x, y + step * q3y, z + step * q3z, w + step * q3w, 0.5 * tx, 0.5 * ty, 0.5 * tz, 0.0
        )
        px += sixth * (k1x + 2.0 * (k2x + k3x) + k4x)
        py += sixth * (k1y + 2.0 * (k2y + k3y) + k4y)
        pz += sixth * (k1z + 2.0 * (k2z + k3z) + k4z)
        x, y, z, w = normalized(
            x + sixth * (q1x + 2.0 * (q2x + q3x) + q4x),
            y + sixth * (q1y + 2.0 * (q2y + q3y) + q4y),
            z + sixth * (q1z + 2.0 * (q2z + q3z) + q4z),
            w + sixth * (q1w + 2.0 * (q2w + q3w) + q4w),
        )
    ox, oy, oz = rotated(x, y, z, w, px, py, pz)
    return x, y, z, w, ox, oy, oz
