"""What a bare model needs to be seen: the box around it, a sun, and a camera that frames it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.common.assets.mesh import Mesh, decode_mesh
from elys.common.assets.primitives import is_primitive, primitive
from elys.common.assets.skin import NamesBelow, SkinBinding, bent_positions, decode_skin
from elys.common.assets.store import AssetStore
from elys.common.components import Camera, Transform, component_from
from elys.common.math import quaternion
from elys.common.math.aabb import bounds_of_points, transform_bounds, union_bounds
from elys.common.math.matrix import compose_affine, look_rotation, multiply_affine, propagate_affine
from elys.common.scene_document import EntityRecord

_SUN_DIRECTION: Final = (-0.45, -0.8, -0.4)
_VIEW_DIRECTION: Final = (-0.5, -0.35, -0.8)
_MARGIN: Final = 1.15
# Rounded so that a file stays readable; a tenth of a millimetre or a hundredth of a degree is not seen.
_DECIMALS: Final = 4


def scene_bounds(
    records: Sequence[EntityRecord], assets: AssetStore
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (3,) of the box around everything that is drawn, in world space; of nothing (+inf, -inf).

    Raises AssetError if a mesh is not in `assets`.
    """
    world_from_local = _world_from_local(records)
    bounds: dict[str, tuple[NDArray[np.float32], NDArray[np.float32]]] = {}
    corners = []
    for row, record in enumerate(records):
        if "MeshRenderer" not in record.components:
            continue
        mesh = record.components["MeshRenderer"].get("mesh", "box")
        if mesh not in bounds:
            bounds[mesh] = (primitive(mesh) if is_primitive(mesh) else decode_mesh(assets.get(mesh))).bounds
        skin = record.components.get("Skin", {}).get("skin", "")
        if skin and "Skin.root" in record.references:
            skinned = decode_mesh(assets.get(mesh))
            corners += _bent_bounds(records, row, skinned, decode_skin(assets.get(skin)), world_from_local)
        elif np.isfinite(bounds[mesh][0]).all():
            corners.append(transform_bounds(world_from_local[row], *bounds[mesh]))
    lower, upper = union_bounds(*(np.array([c[side] for c in corners]).reshape(-1, 3) for side in (0, 1)))
    return lower.astype(np.float64), upper.astype(np.float64)


def _bent_bounds(
    records: Sequence[EntityRecord],
    row: int,
    mesh: Mesh,
    skin: SkinBinding,
    world_from_local: NDArray[np.floating[Any]],
) -> list[tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]]:
    """The box in world space around a record's mesh as its joints bend it; none where it has no vertices or lacks joints."""
    below = NamesBelow([record.name for record in records], [record.parent for record in records])
    found = np.array([below.find(records[row].references["Skin.root"], path) for path in skin.joints], np.intp)
    if mesh.joints is None or not mesh.vertex_count or (found < 0).any():
        return []
    return [bounds_of_points(bent_positions(mesh, multiply_affine(world_from_local[found], skin.joint_from_mesh)))]


def sun_components(direction: ArrayLike = _SUN_DIRECTION, *, intensity: float = 3.0) -> dict[str, dict[str, Any]]:
    """Components of a sun that shines along `direction` (3,)."""
    return {
        "Transform": {"rotation": _rounded_rotation(direction)},
        "Light": {"kind": "directional", "intensity": intensity},
    }


def camera_components(eye: ArrayLike, target: ArrayLike, **fields: Any) -> dict[str, dict[str, Any]]:
    """Components of a camera at `eye` (3,) that looks at `target` (3,); `fields` go to the Camera."""
    position = [round(float(x), _DECIMALS) for x in np.asarray(eye)]
    rotation = _rounded_rotation(np.subtract(target, position))
    return {"Transform": {"position": position, "rotation": rotation}, "Camera": dict(fields)}


def framing_camera(
    lower: ArrayLike, upper: ArrayLike, *, direction: ArrayLike = _VIEW_DIRECTION
) -> dict[str, dict[str, Any]]:
    """Components of a camera that looks along `direction` (3,) and has the box with corners (3,) in its view."""
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        low, high = np.full(3, -1.0), np.full(3, 1.0)
    centre, radius = (low + high) / 2.0, max(float(np.linalg.norm(high - low)) / 2.0, 1e-3)
    distance = _MARGIN * radius / math.sin(Camera().field_of_view / 2.0)
    forward = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    near, far = float(f"{distance / 100.0:.2g}"), float(f"{distance * 20.0 + radius:.2g}")
    return camera_components(centre - forward * distance, centre, near=max(near, 1e-4), far=max(far, 1e-2))


def _world_from_local(records: Sequence[EntityRecord]) -> NDArray[np.floating[Any]]:
    transforms = [component_from("Transform", record.components.get("Transform", {})) for record in records]
    poses = [pose for pose in transforms if isinstance(pose, Transform)]
    local = compose_affine(
        np.array([pose.position for pose in poses]).reshape(-1, 3),
        np.array([pose.rotation for pose in poses]).reshape(-1, 4),
        np.array([pose.scale for pose in poses]).reshape(-1, 3),
    )
    return propagate_affine(np.array([record.parent for record in records], dtype=np.int32), local)


def _rounded_rotation(direction: ArrayLike) -> list[float]:
    # Six digits: closer to length 1 than what component values are normalised for.
    return [round(float(x), 7) for x in quaternion.normalize(look_rotation(direction))]
