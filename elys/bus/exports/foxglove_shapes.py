"""What is drawn of an entity as Foxglove's primitives, in the entity's own frame. Needs foxglove-sdk."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from foxglove import messages as fox

from elys.bus.exports.scene_meshes import SceneMeshes
from elys.common.assets.gltf_material_writing import MaterialWriting, has_images, has_normal_map
from elys.common.assets.gltf_writing import GltfModel
from elys.common.assets.mesh import Mesh
from elys.common.components import Material, Vec3

Paint = tuple[float, float, float, float]  # linear, with opacity

_HALF_TURN: Final = math.sqrt(0.5)
# Foxglove's cylinders stand along z, ours along y; and it turns models from y up to z up, which our scene is not.
_ALONG_Y: Final = fox.Quaternion(x=-_HALF_TURN, y=0.0, z=0.0, w=_HALF_TURN)


class Shapes:
    """Primitives by mesh, material and scale; meshes and images come from `fetch`."""

    def __init__(self, fetch: Callable[[str], bytes]) -> None:
        self._fetch = fetch
        self._meshes = SceneMeshes(fetch)
        self._models: dict[tuple[str, Material], bytes] = {}

    def primitives(self, mesh: str, material: Material, scale: Vec3) -> dict[str, Any]:
        """The fields of a SceneEntity that hold what is drawn: none if the mesh cannot be had."""
        opacity = 1.0 if material.alpha_mode == "opaque" else material.opacity
        paint = (*material.base_color, opacity)
        color = _color(paint)
        x, y, z = (abs(axis) for axis in scale)
        if not has_images(material):
            match mesh:
                case "box":
                    return {"cubes": [fox.CubePrimitive(pose=_pose(), size=fox.Vector3(x=x, y=y, z=z), color=color)]}
                case "sphere":
                    return {
                        "spheres": [fox.SpherePrimitive(pose=_pose(), size=fox.Vector3(x=x, y=y, z=z), color=color)]
                    }
                case "cylinder" | "cone":
                    return {"cylinders": [_cylinder(x, y, z, color, top=0.0 if mesh == "cone" else 1.0)]}
        found = self._meshes.get(mesh)
        if found is None:
            return {}
        if has_images(material) or found.topology == "points":  # of which Foxglove knows no primitive
            return {"models": [self._model(mesh, found, material, scale)]}
        if found.topology == "lines":
            return {"lines": [_lines(found, scale, paint)]}
        return {"triangles": [_triangles(found, scale, paint)]}

    def bounds(self, mesh: str) -> tuple[Vec3, Vec3]:
        """Lower and upper corner of a mesh in its own space; a cube of 1 m if it cannot be had."""
        found = self._meshes.get(mesh)
        if found is None:
            return (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)
        lower, upper = found.bounds
        return tuple(lower.tolist()), tuple(upper.tolist())

    def _model(self, name: str, mesh: Mesh, material: Material, scale: Vec3) -> Any:
        """The mesh with its images, as a .glb."""
        key = (name, material)
        if key not in self._models:
            model = GltfModel("elys")
            surface = model.primitive(mesh, has_tangents=has_normal_map(material))
            surface["material"] = MaterialWriting(model, self._fetch).material(material)
            model.add("nodes", {"mesh": model.add("meshes", {"primitives": [surface]})})
            model.document["scene"] = model.add("scenes", {"nodes": [0]})
            file = io.BytesIO()
            model.write(file)
            self._models[key] = file.getvalue()
        pose = fox.Pose(position=fox.Vector3(x=0.0, y=0.0, z=0.0), orientation=_ALONG_Y)
        x, y, z = scale
        size = fox.Vector3(x=x, y=z, z=y)  # along its axes after it was turned
        return fox.ModelPrimitive(pose=pose, scale=size, media_type="model/gltf-binary", data=self._models[key])


def _cylinder(x: float, y: float, z: float, color: Any, *, top: float) -> Any:
    pose = fox.Pose(position=fox.Vector3(x=0.0, y=0.0, z=0.0), orientation=_ALONG_Y)
    size = fox.Vector3(x=x, y=z, z=y)
    return fox.CylinderPrimitive(pose=pose, size=size, bottom_scale=1.0, top_scale=top, color=color)


def _triangles(mesh: Mesh, scale: Vec3, paint: Paint) -> Any:
    indices = mesh.indices if np.prod(scale) >= 0.0 else mesh.indices.reshape(-1, 3)[:, ::-1].reshape(-1)
    return fox.TriangleListPrimitive(
        pose=_pose(),
        points=_points(mesh, scale),
        color=_color(paint),
        colors=_colors(mesh, paint),
        indices=indices.tolist(),
    )


def _lines(mesh: Mesh, scale: Vec3, paint: Paint) -> Any:
    return fox.LinePrimitive(
        type=fox.LinePrimitiveLineType.LineList,
        pose=_pose(),
        thickness=1.0,
        scale_invariant=True,  # in pixels
        points=_points(mesh, scale),
        color=_color(paint),
        colors=_colors(mesh, paint),
        indices=mesh.indices.tolist(),
    )


def _points(mesh: Mesh, scale: Vec3) -> list[Any]:
    return [fox.Point3(x=x, y=y, z=z) for x, y, z in (mesh.positions.astype(np.float64) * scale).tolist()]


def _colors(mesh: Mesh, paint: Paint) -> list[Any]:
    if mesh.colors is None:
        return []
    return [_color(mixed) for mixed in (np.clip(mesh.colors.astype(np.float64), 0.0, 1.0) * paint).tolist()]


def _color(paint: Sequence[float]) -> Any:
    red, green, blue = (srgb(channel) for channel in paint[:3])
    return fox.Color(r=red, g=green, b=blue, a=paint[3])


def _pose() -> Any:
    return fox.Pose(position=fox.Vector3(x=0.0, y=0.0, z=0.0), orientation=fox.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))


def srgb(linear: float) -> float:
    """A linear channel as screens take it. IEC 61966-2-1."""
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055
