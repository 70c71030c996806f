"""Where cameras look: yaw and pitch as quaternions, without the C library's sine."""

from __future__ import annotations

from elys.sim_node.compilation import kernel
from elys.sim_node.physics.kernels.rotation import multiplied, normalized, rotated, turn_by


@kernel
def turn_views(yaw, pitch, rotation, axes):
    """Quaternions (N, 4) that turn by yaw about y and then pitch about their own x.

    `axes` (N, 2, 3) get where they look, and what is to their right.
    """
    for i in range(yaw.shape[0]):
        ax, ay, az, aw = turn_by(0.0, yaw[i], 0.0)
        bx, by, bz, bw = turn_by(pitch[i], 0.0, 0.0)
        x, y, z, w = multiplied(ax, ay, az, aw, bx, by, bz, bw)
        x, y, z, w = normalized(x, y, z, w)
        rotation[i, 0], rotation[i, 1], rotation[i, 2], rotation[i, 3] = x, y, z, w
        axes[i, 0, 0], axes[i, 0, 1], axes[i, 0, 2] = rotated(x, y, z, w, 0.0, 0.0, -1.0)
        axes[i, 1, 0], axes[i, 1, 1], axes[i, 1, 2] = rotated(x, y, z, w, 1.0, 0.0, 0.0)
