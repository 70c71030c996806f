"""A glTF 2.0 model as entities: nodes become entities, meshes and images become assets.

    file -> Document (gltf_schema) -> arrays (gltf_accessors) -> meshes (gltf_meshes) ┐
                                   -> materials (gltf_materials) ─────────────────────┴> records (gltf_nodes)
                                                              records -> skins (gltf_skins), clips (gltf_animations)

docs/gltf.md says what is read, how it maps to components, and what is left out with a warning.
"""

from __future__ import annotations

import logging
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import msgspec

from elys.common.assets.gltf_accessors import Buffers, pick, read_uri, uri_path
from elys.common.assets.gltf_animations import import_animations
from elys.common.assets.gltf_meshes import read_primitive
from elys.common.assets.gltf_nodes import ModelImport, import_nodes
from elys.common.assets.gltf_schema import Document, Image, parse_gltf
from elys.common.assets.gltf_skins import import_skins
from elys.common.assets.images import image_format, placeholder_image, read_asset_file
from elys.common.assets.mesh import encode_mesh
from elys.common.assets.store import AssetStore
from elys.common.errors import AssetError
from elys.common.scene_document import EntityRecord

logger = logging.getLogger(__name__)

MODEL_SUFFIXES: Final = (".gltf", ".glb")
_UNDERSTOOD_EXTENSIONS: Final = frozenset(
    {
        "KHR_lights_punctual",
        "KHR_mesh_quantization",
        "KHR_materials_emissive_strength",
        "KHR_materials_unlit",
        "KHR_materials_ior",
        "KHR_materials_specular",
        "KHR_materials_clearcoat",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_variants",  # the default one is what a model looks like without the extension
        "KHR_texture_transform",
        "EXT_texture_webp",
        "EXT_mesh_gpu_instancing",
        "KHR_node_visibility",
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "KHR_meshopt_compression",
    }
)
# Their data is read without them, at worst a model looks plainer.
_HARMLESS_EXTENSIONS: Final = _UNDERSTOOD_EXTENSIONS | {
    "KHR_materials_sheen",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_iridescence",
    "KHR_materials_anisotropy",
    "KHR_materials_dispersion",
    "KHR_animation_pointer",
    "KHR_xmp_json_ld",
}
_REMEDIES: Final = {"KHR_texture_basisu": "export its textures as PNG, JPEG or WebP"}
MAX_MESH_BYTES: Final = 1 << 31  # of all meshes of a model: accessors are named again and again by a few bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedModel:
    """What came out of a model: records with one root (first), and references by place: mesh and primitive, image or skin
    index.

    `clips` refers to all clips together, empty if there are none.
    """

    records: list[EntityRecord]
    meshes: dict[tuple[int, int], str]
    images: dict[int, str]
    clips: str = ""
    skins: dict[int, str] = field(default_factory=dict)


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
        job = ModelImport(document=document, buffers=buffers, path=path, assets=assets)
        # Reading waits for the disk and hashing lets other threads run: meshes are made meanwhile.
        with ThreadPoolExecutor(1, thread_name_prefix="elys-images") as pool:
            images = pool.submit(_import_images, job)
            _import_meshes(job)
            images.result()
        import_nodes(job)
        skins = import_skins(job)
        clips = import_animations(job)
    except AssetError as error:
        raise AssetError(f"{path}: {error}") from error
    except (OverflowError, MemoryError) as error:
        raise AssetError(f"{path}: the model asks for impossible amounts of data") from error
    return ImportedModel(records=job.records, meshes=job.meshes, images=job.images, clips=clips, skins=skins)


def _check_extensions(document: Document, path: Path) -> None:
    for name in document.extensions_required:
        if name not in _HARMLESS_EXTENSIONS:
            remedy = _REMEDIES.get(name, "export it without this extension")
            raise AssetError(f"the model requires the extension {name[:60]}, which ELYS does not read; {remedy}")
    left_out = [name for name in document.extensions_used if name not in _UNDERSTOOD_EXTENSIONS]
    if left_out:
        logger.warning("%s uses %s, which is left out", path.name, ", ".join(left_out))


def _import_images(job: ModelImport) -> None:
    """Puts the images that textures name into the store; one that cannot be had is told of, and seen as a checker."""
    used = {_image_of(job.document, index) for index in range(len(job.document.textures))}
    first_of: dict[int, int] = {}  # by buffer view: many images may name one
    for index, image in enumerate(job.document.images):
        if index not in used:
            continue
        first = index
        if image.uri is None and image.buffer_view is not None:
            first = first_of.setdefault(image.buffer_view, index)
        job.images[index] = _import_image(job, index) if first == index else job.images[first]


def _import_image(job: ModelImport, index: int) -> str:
    try:
        data, source = _read_image(job, job.document.images[index], index)
    except AssetError as error:
        logger.error("%s: %s; a checker takes its place", job.path, error)
        return job.assets.put(placeholder_image(), kind="image")
    return job.assets.put(data, kind="image", source=source)


def _read_image(job: ModelImport, image: Image, index: int) -> tuple[bytes, str]:
    """The bytes of an image, and where they came from."""
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
    return data, source


def _image_of(document: Document, texture_index: int) -> int | None:
    texture = document.textures[texture_index]
    source = texture.source
    if source is None and texture.extensions.webp is not None:
        source = texture.extensions.webp.source
    if source is not None:
        pick(document.images, source, f"textures[{texture_index}]", "image")
    elif texture.extensions.basisu is not None:
        raise AssetError(f"textures[{texture_index}] is KTX2 alone; {_REMEDIES['KHR_texture_basisu']}")
    return source


def _import_meshes(job: ModelImport) -> None:
    known: dict[bytes, str] = {}
    size = 0
    for mesh_index, mesh in enumerate(job.document.meshes):
        for index, primitive in enumerate(mesh.primitives):
            place = f"meshes[{mesh_index}].primitives[{index}]"
            if primitive.material is not None:
                pick(job.document.materials, primitive.material, place, "material")
            key = msgspec.json.encode(msgspec.structs.replace(primitive, material=None), order="sorted")
            if key in known:
                job.meshes[mesh_index, index] = known[key]
                continue
            data = encode_mesh(read_primitive(job.buffers, primitive, place))
            size += len(data)
            if size > MAX_MESH_BYTES:
                raise AssetError(f"{place}: the model's meshes have more than {MAX_MESH_BYTES >> 30} GiB")
            source = f"{job.path}#{mesh_index}/{index}"
            known[key] = job.meshes[mesh_index, index] = job.assets.put(data, kind="mesh", source=source)
