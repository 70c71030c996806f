"""A glTF 2.0 model as entities: nodes become entities, meshes and images become assets.

    file -> Document (gltf_schema) -> arrays (gltf_accessors) -> meshes (gltf_meshes) -> records (here)

Left out with a warning, because a component for it is missing: skins, animations, morph targets, sampler modes, texture
transforms, and material extensions but for the emissive strength.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from elys.common.assets.gltf_accessors import Buffers, pick, read_uri, uri_path
from elys.common.assets.gltf_materials import material_values
from elys.common.assets.gltf_meshes import read_primitive
from elys.common.assets.gltf_schema import Camera, Document, Light, Node, Orthographic, parse_gltf
from elys.common.assets.images import image_format, read_asset_file
from elys.common.assets.mesh import encode_mesh
from elys.common.assets.store import AssetStore
from elys.common.components import component_from, values_of
from elys.common.errors import AssetError, ComponentError
from elys.common.math.matrix import compose_affine, decompose_affine
from elys.common.scene_document import ComponentValues, EntityRecord

logger = logging.getLogger(__name__)

MODEL_SUFFIXES: Final = (".gltf", ".glb")
# Their data is read without them, at worst a model looks plainer.
_HARMLESS_EXTENSIONS: Final = frozenset(
    {
        "KHR_lights_punctual",
        "KHR_mesh_quantization",
        "KHR_materials_emissive_strength",
        "KHR_texture_transform",
        "EXT_texture_webp",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_unlit",
        "KHR_materials_ior",
        "KHR_materials_specular",
        "KHR_materials_clearcoat",
        "KHR_materials_sheen",
        "KHR_materials_transmission",
        "KHR_materials_volume",
        "KHR_materials_iridescence",
        "KHR_materials_anisotropy",
        "KHR_materials_dispersion",
        "KHR_materials_variants",
        "KHR_node_visibility",
        "KHR_xmp_json_ld",
    }
)
_UNDERSTOOD_EXTENSIONS: Final = frozenset(
    {"KHR_lights_punctual", "KHR_mesh_quantization", "KHR_materials_emissive_strength", "EXT_texture_webp"}
    | {"KHR_materials_pbrSpecularGlossiness"}
)
_REMEDIES: Final = {
    "KHR_draco_mesh_compression": "export it without Draco compression",
    "EXT_meshopt_compression": "export it without meshopt compression",
    "KHR_meshopt_compression": "export it without meshopt compression",
    "KHR_texture_basisu": "export its textures as PNG or JPEG",
}
_DEFAULT_FAR: Final = 1000.0  # [m] of a camera that sees to infinity


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedModel:
    """What came out of a model: records with one root (first), and references by place: mesh and primitive, image index."""

    records: list[EntityRecord]
    meshes: dict[tuple[int, int], str]
    images: dict[int, str]


@dataclass(slots=True, kw_only=True)
class _Import:
    """What the steps of one import share."""

    document: Document
    buffers: Buffers
    path: Path
    assets: AssetStore
    meshes: dict[tuple[int, int], str] = field(default_factory=dict)
    images: dict[int, str] = field(default_factory=dict)
    materials: dict[int | None, dict[str, Any]] = field(default_factory=dict)
    records: list[EntityRecord] = field(default_factory=list)


def import_gltf(path: str | Path, assets: AssetStore) -> list[EntityRecord]:
    """The entities of a .gltf or .glb file, under one root named after it; its meshes and images are put into `assets`.

    Raises:
        AssetError: the file or one it names is missing, cut off or wrong, or needs an extension that ELYS has not.
    """
    return import_model(path, assets).records


def import_model(path: str | Path, assets: AssetStore) -> ImportedModel:
    """As `import_gltf`, with the references of all meshes and images by their place in the file."""
    path = Path(path).absolute()
    data = read_asset_file(path, what="model")
    try:
        document, binary = parse_gltf(data)
        _check_extensions(document, path)
        buffers = Buffers(document, directory=path.parent, binary=binary)
        job = _Import(document=document, buffers=buffers, path=path, assets=assets)
        _import_images(job)
        _import_meshes(job)
        _import_nodes(job)
    except AssetError as error:
        raise AssetError(f"{path}: {error}") from error
    except (OverflowError, MemoryError) as error:
        raise AssetError(f"{path}: the model asks for impossible amounts of data") from error
    return ImportedModel(records=job.records, meshes=job.meshes, images=job.images)


def _check_extensions(document: Document, path: Path) -> None:
    for name in document.extensions_required:
        if name not in _HARMLESS_EXTENSIONS:
            remedy = _REMEDIES.get(name, "export it without this extension")
            raise AssetError(f"the model requires the extension {name[:60]}, which ELYS does not read; {remedy}")
    left_out = [name for name in document.extensions_used if name not in _UNDERSTOOD_EXTENSIONS]
    if left_out:
        logger.warning("%s uses %s, which is left out", path.name, ", ".join(left_out))
    if document.animations:
        logger.warning("%s has animations, which are left out", path.name)


def _import_images(job: _Import) -> None:
    used = {_image_of(job.document, index) for index in range(len(job.document.textures))} - {None}
    for index, image in enumerate(job.document.images):
        if index not in used:
            continue
        place = f"images[{index}]"
        source = f"{job.path}#image/{index}"
        if image.uri is not None:
            data = read_uri(image.uri, directory=job.path.parent, where=place, what="image")
            if not image.uri.startswith("data:"):
                source = str(uri_path(image.uri, directory=job.path.parent, where=place))
        elif image.buffer_view is not None:
            data = bytes(job.buffers.view(image.buffer_view, place))
        else:
            raise AssetError(f"{place} has no data: neither a uri nor a buffer view")
        if not image_format(data):
            raise AssetError(f"{place} is not an image that ELYS knows (PNG, JPEG, WebP)")
        job.images[index] = job.assets.put(data, kind="image", source=source)


def _image_of(document: Document, texture_index: int) -> int | None:
    texture = document.textures[texture_index]
    source = texture.source
    if source is None and texture.extensions.webp is not None:
        source = texture.extensions.webp.source
    if source is not None:
        pick(document.images, source, f"textures[{texture_index}]", "image")
    return source


def _import_meshes(job: _Import) -> None:
    for mesh_index, mesh in enumerate(job.document.meshes):
        for index, primitive in enumerate(mesh.primitives):
            place = f"meshes[{mesh_index}].primitives[{index}]"
            if primitive.material is not None:
                pick(job.document.materials, primitive.material, place, "material")
            read = read_primitive(job.buffers, primitive, place)
            if read is not None:
                source = f"{job.path}#{mesh_index}/{index}"
                job.meshes[mesh_index, index] = job.assets.put(encode_mesh(read), kind="mesh", source=source)


def _import_nodes(job: _Import) -> None:
    """Appends the records of all nodes of the file's scene, parents first."""
    document = job.document
    job.records.append(EntityRecord(name=job.path.stem, components={"Transform": {}}))
    # Backwards, because the last on the stack is the first to become an entity.
    waiting = [(index, 0) for index in reversed(_root_nodes(document))]
    reached: set[int] = set()
    names: dict[int, set[str]] = {}
    while waiting:
        index, parent = waiting.pop()
        node = pick(document.nodes, index, "a parent or the scene", "node")
        if index in reached:
            raise AssetError(f"nodes[{index}] has two parents or is its own ancestor")
        reached.add(index)
        name = _unique(node.name or f"Node {index}", names.setdefault(parent, set()))
        row = len(job.records)
        _append_node(job, node, name, parent, f"nodes[{index}]", names.setdefault(row, set()))
        waiting.extend((child, row) for child in reversed(node.children))


def _root_nodes(document: Document) -> list[int]:
    if document.scenes:
        scene = pick(document.scenes, document.scene or 0, "scene", "scene")
        return list(scene.nodes)
    children = {child for node in document.nodes for child in node.children}
    roots = [index for index in range(len(document.nodes)) if index not in children]
    if document.nodes and not roots:
        raise AssetError("every node is its own ancestor")
    return roots


def _unique(name: str, taken: set[str]) -> str:
    """The name, numbered where a sibling has it: overrides name entities by path."""
    name = name.encode(errors="replace").decode()
    unique, number = name, 2
    while unique in taken:
        unique, number = f"{name} {number}", number + 1
    taken.add(unique)
    return unique


def _append_node(job: _Import, node: Node, name: str, parent: int, place: str, child_names: set[str]) -> None:
    document = job.document
    components: dict[str, dict[str, Any]] = {"Transform": _transform(node, place)}
    if node.camera is not None:
        components["Camera"] = _camera(pick(document.cameras, node.camera, place, "camera"), place)
    if node.extensions.lights_punctual is not None:
        lights = document.extensions.lights_punctual
        light = pick(lights.lights if lights else [], node.extensions.lights_punctual.light, place, "light")
        components["Light"] = _light(light)
    if node.skin is not None:
        logger.warning("%s of %s has a skin, which stays in its rest pose", place, job.path.name)
    primitives: list[int] = []
    if node.mesh is not None:
        pick(document.meshes, node.mesh, place, "mesh")
        count = len(document.meshes[node.mesh].primitives)
        primitives = [index for index in range(count) if (node.mesh, index) in job.meshes]
    if len(primitives) == 1:
        assert node.mesh is not None
        components |= _drawing(job, node.mesh, primitives[0])
    row = len(job.records)
    job.records.append(EntityRecord(name=name, parent=parent, components=_checked(components, place)))
    if len(primitives) > 1:
        assert node.mesh is not None
        for index in primitives:
            child_name = _unique(f"{name}.{index}", child_names)
            drawing = _checked(_drawing(job, node.mesh, index), place)
            job.records.append(EntityRecord(name=child_name, parent=row, components={"Transform": {}, **drawing}))


def _drawing(job: _Import, mesh_index: int, primitive_index: int) -> dict[str, dict[str, Any]]:
    material = job.document.meshes[mesh_index].primitives[primitive_index].material

    def image_of_texture(texture: int) -> str | None:
        image = _image_of(job.document, texture)
        return None if image is None else job.images[image]

    if material not in job.materials:
        job.materials[material] = material_values(job.document, material, image_of_texture)
    return {"MeshRenderer": {"mesh": job.meshes[mesh_index, primitive_index]}, "Material": job.materials[material]}


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
        return _approximated(camera.orthographic, place)
    raise AssetError(f"{place}: a camera of type {camera.type[:20]!r} without its values")


def _approximated(view: Orthographic, place: str) -> dict[str, Any]:
    """A perspective view as high, in the middle of its depth, as the orthographic one."""
    logger.warning("%s has an orthographic camera; a perspective one takes its place", place)
    middle = max((view.znear + view.zfar) / 2.0, 1e-3)
    return {
        "field_of_view": float(np.clip(2.0 * np.arctan2(abs(view.ymag), middle), 0.02, 3.0)),
        "near": max(view.znear, 1e-3 * view.zfar, 1e-4),
        "far": max(view.zfar, 1e-3),
    }
