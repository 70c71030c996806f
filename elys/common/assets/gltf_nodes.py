"""The nodes of a glTF model as records: an entity a node, and one more for each primitive or instance where there are several."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from elys.common.assets.gltf_accessors import Buffers, pick
from elys.common.assets.gltf_materials import material_values
from elys.common.assets.gltf_schema import Camera, Document, Instancing, Light, Node
from elys.common.assets.morph_weights import MAX_TARGETS, format_weights
from elys.common.assets.store import AssetStore
from elys.common.components import component_from, values_of
from elys.common.errors import AssetError, ComponentError
from elys.common.math.matrix import compose_affine, decompose_affine
from elys.common.scene_document import ComponentValues, EntityRecord

logger = logging.getLogger(__name__)

MAX_ENTITIES: Final = 1 << 18  # of a model: nodes times primitives times instances grow faster than a file
_DEFAULT_FAR: Final = 1000.0  # [m] of a camera that sees to infinity
# Attributes of EXT_mesh_gpu_instancing: field of Transform, width.
_INSTANCE_FIELDS: Final = {"TRANSLATION": ("position", 3), "ROTATION": ("rotation", 4), "SCALE": ("scale", 3)}


@dataclass(slots=True, kw_only=True)
class ModelImport:
    """What the steps of one import share. References stand by mesh and primitive, by image, materials by index."""

    document: Document
    buffers: Buffers
    path: Path
    assets: AssetStore
    meshes: dict[tuple[int, int], str] = field(default_factory=dict)
    images: dict[int, str] = field(default_factory=dict)
    materials: dict[int | None, dict[str, Any]] = field(default_factory=dict)
    drawings: dict[tuple[int, int], ComponentValues] = field(default_factory=dict)
    records: list[EntityRecord] = field(default_factory=list)
    rows: dict[int, int] = field(default_factory=dict)  # of the records, by node
    nodes: dict[int, int] = field(default_factory=dict)  # the other way round
    drawn: dict[int, list[int]] = field(default_factory=dict)  # the records that draw the mesh of each node


def import_nodes(job: ModelImport) -> None:
    """Appends the records of all nodes of the file's scene, parents first."""
    document = job.document
    job.records.append(EntityRecord(name=job.path.stem, components={"Transform": {}}))
    # Backwards, because the last on the stack is the first to become an entity.
    waiting = [(index, 0) for index in reversed(_root_nodes(document))]
    reached: set[int] = set()
    names: dict[int, dict[str, int]] = {}
    while waiting:
        index, parent = waiting.pop()
        node = pick(document.nodes, index, "a parent or the scene", "node")
        if index in reached:
            raise AssetError(f"nodes[{index}] has two parents or is its own ancestor")
        reached.add(index)
        name = _unique(node.name or f"Node {index}", names.setdefault(parent, {}))
        row = job.rows[index] = len(job.records)
        job.nodes[row] = index
        _append_node(job, node, name, parent, f"nodes[{index}]", names.setdefault(row, {}))
        waiting.extend((child, row) for child in reversed(node.children))


def path_below_root(job: ModelImport, row: int) -> tuple[str, ...]:
    """Names from below the model's root down to a record."""
    names: list[str] = []
    while row > 0:
        names.append(job.records[row].name)
        row = job.records[row].parent
    return tuple(reversed(names))


def _root_nodes(document: Document) -> list[int]:
    if document.scenes:
        scene = pick(document.scenes, document.scene or 0, "scene", "scene")
        return list(scene.nodes)
    children = {child for node in document.nodes for child in node.children}
    roots = [index for index in range(len(document.nodes)) if index not in children]
    if document.nodes and not roots:
        raise AssetError("every node is its own ancestor")
    return roots


def _unique(name: str, taken: dict[str, int]) -> str:
    """The name, numbered where a sibling has it: overrides name entities by path. `taken` holds the last number of each."""
    name = name.encode(errors="replace").decode()
    unique, number = name, taken.get(name, 1)
    while unique in taken:
        number += 1
        unique = f"{name} {number}"
    taken[name] = number
    taken.setdefault(unique, 1)
    return unique


def _append_node(job: ModelImport, node: Node, name: str, parent: int, place: str, child_names: dict[str, int]) -> None:
    document, more = job.document, node.extensions
    components: dict[str, dict[str, Any]] = {"Transform": _transform(node, place)}
    if node.camera is not None:
        components["Camera"] = _camera(pick(document.cameras, node.camera, place, "camera"), place)
    if more.lights_punctual is not None:
        lights = document.extensions.lights_punctual
        components["Light"] = _light(pick(lights.lights if lights else [], more.lights_punctual.light, place, "light"))
    row = len(job.records)
    drawings = _drawings(job, node, place)
    values = _checked(components, place)
    if len(drawings) == 1 and more.instancing is None:
        values |= drawings[0]
    enabled = more.visibility is None or more.visibility.visible
    _append(job, EntityRecord(name=name, parent=parent, enabled=enabled, components=values))
    if more.instancing is not None and drawings:
        for transform in _instances(job, more.instancing, f"{place}.extensions.EXT_mesh_gpu_instancing"):
            parts = _checked({"Transform": transform}, place) | (drawings[0] if len(drawings) == 1 else {})
            record = EntityRecord(name=_unique(f"{name} instance", child_names), parent=row, components=parts)
            _append(job, record)
            _append_drawings(job, drawings, name, len(job.records) - 1, {})
    else:
        _append_drawings(job, drawings, name, row, child_names)
    if drawings:
        first = row if len(drawings) == 1 else row + 1
        job.drawn[job.nodes[row]] = [
            r for r in range(first, len(job.records)) if "MeshRenderer" in job.records[r].components
        ]


def _append(job: ModelImport, record: EntityRecord) -> None:
    if len(job.records) >= MAX_ENTITIES:
        raise AssetError(f"the model has more than {MAX_ENTITIES} entities: nodes, their primitives and instances")
    job.records.append(record)


def _append_drawings(
    job: ModelImport,
    drawings: list[ComponentValues],
    name: str,
    parent: int,
    taken: dict[str, int],
) -> None:
    """A child for each of several primitives: an entity draws one mesh."""
    if len(drawings) < 2:
        return
    for index, drawing in enumerate(drawings):
        components = {"Transform": {}, **drawing}
        _append(job, EntityRecord(name=_unique(f"{name}.{index}", taken), parent=parent, components=components))


def _drawings(job: ModelImport, node: Node, place: str) -> list[ComponentValues]:
    """What draws each primitive of a node's mesh."""
    if node.mesh is None:
        return []
    pick(job.document.meshes, node.mesh, place, "mesh")
    mesh = job.document.meshes[node.mesh]
    weights = format_weights((node.weights or mesh.weights)[:MAX_TARGETS])
    morph: ComponentValues = {"Morph": {"weights": weights} if weights else {}}
    drawings = [_drawing(job, node.mesh, number, place) for number in range(len(mesh.primitives))]
    return [
        {**drawing, **morph} if primitive.targets else drawing
        for primitive, drawing in zip(mesh.primitives, drawings, strict=True)
    ]


def _instances(job: ModelImport, instancing: Instancing, place: str) -> list[dict[str, Any]]:
    """The Transform of each instance."""
    columns: dict[str, list[Any]] = {}
    for name, (column, width) in _INSTANCE_FIELDS.items():
        index = instancing.attributes.get(name)
        if index is None:
            continue
        values = job.buffers.floats(index, f"{place}.{name}")
        if values.ndim != 2 or values.shape[1] != width:
            raise AssetError(f"{place}.{name} must be vectors of {width} numbers")
        if len(values) > MAX_ENTITIES:
            raise AssetError(f"{place}.{name} has {len(values)} instances; there may be {MAX_ENTITIES}")
        columns[column] = values.tolist()
    if len({len(values) for values in columns.values()}) > 1:
        raise AssetError(f"{place} has attributes of different counts")
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _drawing(job: ModelImport, mesh_index: int, primitive_index: int, place: str) -> ComponentValues:
    key = (mesh_index, primitive_index)
    if key in job.drawings:
        return job.drawings[key]
    material = job.document.meshes[mesh_index].primitives[primitive_index].material

    def image_of_texture(texture: int) -> str | None:
        found = job.document.textures[texture]
        webp = found.extensions.webp
        image = webp.source if found.source is None and webp is not None else found.source
        return None if image is None else job.images[image]

    if material not in job.materials:
        job.materials[material] = material_values(job.document, material, image_of_texture)
    parts = {"MeshRenderer": {"mesh": job.meshes[key]}, "Material": job.materials[material]}
    job.drawings[key] = _checked(parts, place)
    return job.drawings[key]


def _checked(components: dict[str, dict[str, Any]], place: str) -> ComponentValues:
    """Only what differs from the defaults, and nothing that a component would refuse."""
    try:
        return {name: values_of(component_from(name, values), only_changed=True) for name, values in components.items()}
    except ComponentError as error:
        raise AssetError(f"{place}: {error}") from error


def _transform(node: Node, place: str) -> dict[str, Any]:
    if node.matrix is None:
        return {"position": node.translation, "rotation": node.rotation, "scale": node.scale}
    affine = np.array(node.matrix).reshape(4, 4).T[:3]
    position, rotation, scale = decompose_affine(affine)
    if not np.allclose(compose_affine(position, rotation, scale), affine, rtol=1e-4, atol=1e-4 * np.abs(affine).max()):
        logger.warning("%s.matrix is sheared; the shear is left out", place)
    return {"position": position.tolist(), "rotation": rotation.tolist(), "scale": scale.tolist()}


def _light(light: Light) -> dict[str, Any]:
    values: dict[str, Any] = {"kind": light.type, "color": light.color, "intensity": light.intensity}
    values["range"] = light.range or 0.0
    if light.type == "spot":
        values |= {"inner_cone_angle": light.spot.inner_cone_angle, "outer_cone_angle": light.spot.outer_cone_angle}
    return values


def _camera(camera: Camera, place: str) -> dict[str, Any]:
    if camera.perspective is not None:
        view = camera.perspective
        return {
            "field_of_view": float(np.clip(view.yfov, 0.02, 3.0)),
            "near": max(view.znear, 1e-4),
            "far": view.zfar or max(_DEFAULT_FAR, 10.0 * view.znear),
        }
    if camera.orthographic is not None:
        flat = camera.orthographic
        return {
            "projection": "orthographic",
            "ortho_height": max(2.0 * abs(flat.ymag), 1e-3),
            "near": max(flat.znear, 1e-4),
            "far": max(flat.zfar, 1e-3),
        }
    raise AssetError(f"{place}: a camera of type {camera.type[:20]!r} without its values")
