"""A skin: which entities bend a mesh, as the bytes by which it is stored, hashed and sent.

The bytes are a `container` with the magic "ELYJ". Its header has the names of joints; joint_from_mesh of each follows, 3 x 4 by
rows, as float32.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.common.assets.container import Container
from elys.common.assets.mesh import Mesh
from elys.common.errors import AssetError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SkinBinding:
    """J joints.

    Attributes:
        joints: [J] names from below the skin's root down to each joint; empty for the root itself.
        joint_from_mesh: [J, 3, 4], where the mesh stood when it was bound.
    """

    joints: tuple[tuple[str, ...], ...]
    joint_from_mesh: NDArray[np.float32]


class _Header(msgspec.Struct, forbid_unknown_fields=True):
    joints: tuple[tuple[str, ...], ...]


_BYTES: Final = Container(magic=b"ELYJ", version=1, header=_Header, noun="a skin", largest_header=1 << 24)


def encode_skin(skin: SkinBinding) -> bytes:
    """The bytes of a skin."""
    return _BYTES.encode(_Header(skin.joints), [np.asarray(skin.joint_from_mesh, np.float32)])


def decode_skin(data: bytes) -> SkinBinding:
    """The skin in its bytes; raises AssetError for anything that is not a whole and sound one."""
    header, offset = _BYTES.decode(data)
    expected = offset + 48 * len(header.joints)
    if not header.joints or expected != len(data):
        raise AssetError(f"a skin has {len(data)} bytes where its {len(header.joints)} joints make {expected}")
    matrices = np.frombuffer(data, "<f4", offset=offset).reshape(-1, 3, 4)
    if not np.isfinite(matrices).all():
        raise AssetError("a skin has numbers that are not finite")
    return SkinBinding(joints=header.joints, joint_from_mesh=matrices)


class NamesBelow:
    """Who stands below whom in a tree of N rows, by the names that lead there; the first of equal ones."""

    def __init__(self, names: Sequence[str], parents: Sequence[int]) -> None:
        """`parents` (N,) are rows of the same tree, negative for none."""
        self._children: list[dict[str, int]] = [{} for _ in names]
        for row, (name, parent) in enumerate(zip(names, parents, strict=True)):
            if parent >= 0:
                self._children[parent].setdefault(name, row)

    def find(self, row: int, path: Sequence[str]) -> int:
        """The row to which names lead from below a row on, -1 if there is none."""
        for name in path:
            row = self._children[row].get(name, -1)
            if row < 0:
                return -1
        return row


def joint_bounds(mesh: Mesh, joint_count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Corners (J, 3) of boxes in the mesh' space around what each joint bends; (+inf, -inf) where it bends nothing.

    A bent vertex lies in the convex hull of where each of its joints alone would take it: the boxes, taken along by their joints,
    enclose the bent mesh.
    """
    lower = np.full((joint_count, 3), np.inf, np.float32)
    upper = np.full((joint_count, 3), -np.inf, np.float32)
    assert mesh.joints is not None
    assert mesh.weights is not None
    vertex, slot = np.nonzero(mesh.weights > 0.0)
    joint = mesh.joints[vertex, slot].astype(np.intp)
    np.minimum.at(lower, joint, mesh.positions[vertex])
    np.maximum.at(upper, joint, mesh.positions[vertex])
    return lower, upper


def bent_positions(mesh: Mesh, space_from_mesh: NDArray[np.floating]) -> NDArray[np.float64]:
    """Where the joints' transforms (J, 3, 4) take the vertices (V, 3) of a mesh; joints past J count as the last."""
    assert mesh.joints is not None
    assert mesh.weights is not None
    taken = np.zeros((mesh.vertex_count, 3))
    for slot in range(4):
        joint = np.minimum(mesh.joints[:, slot].astype(np.intp), len(space_from_mesh) - 1)
        moved = np.einsum("vij,vj->vi", space_from_mesh[joint, :, :3], mesh.positions) + space_from_mesh[joint, :, 3]
        taken += mesh.weights[:, slot, None] * moved
    return taken
