"""The parts of glTF 2.0 that ELYS reads, as Structs, and the two containers they come in: .gltf and .glb.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

from __future__ import annotations

import struct
from typing import Annotated, Final, Literal

import msgspec
from msgspec import Meta

from elys.common.errors import AssetError

Index = Annotated[int, Meta(ge=0, le=2**31)]
Size = Annotated[int, Meta(ge=0, le=2**40)]
Unit = Annotated[float, Meta(ge=0.0, le=1.0)]
Float = Annotated[float, Meta(ge=-1e30, le=1e30)]
Coordinate = Annotated[float, Meta(ge=-1e6, le=1e6)]
Positive = Annotated[float, Meta(ge=0.0, le=1e30)]
Vec3 = tuple[Float, Float, Float]
Vec4 = tuple[Float, Float, Float, Float]


class _Part(msgspec.Struct, rename="camel", frozen=True, kw_only=True):
    """glTF writes camelCase and lets anybody add fields."""


class Asset(_Part, frozen=True):
    version: str
    min_version: str = ""


class Buffer(_Part, frozen=True):
    byte_length: Size
    uri: str | None = None


class PackedView(_Part, frozen=True):
    """EXT_meshopt_compression: where the packed bytes are, and as what."""

    buffer: Index
    byte_length: Size
    byte_stride: Annotated[int, Meta(ge=1, le=256)]
    count: Annotated[int, Meta(ge=0, le=2**31)]
    mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
    byte_offset: Size = 0
    filter: Literal["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"] = "NONE"


class ViewExtensions(msgspec.Struct, frozen=True, kw_only=True):
    meshopt: PackedView | None = msgspec.field(name="EXT_meshopt_compression", default=None)
    ratified_meshopt: PackedView | None = msgspec.field(name="KHR_meshopt_compression", default=None)

    @property
    def packed(self) -> PackedView | None:
        """The one that is there."""
        return self.meshopt or self.ratified_meshopt


class BufferView(_Part, frozen=True):
    buffer: Index
    byte_length: Size
    byte_offset: Size = 0
    byte_stride: Annotated[int, Meta(ge=4, le=252)] | None = None
    extensions: ViewExtensions = ViewExtensions()


class SparseIndices(_Part, frozen=True):
    buffer_view: Index
    component_type: int
    byte_offset: Size = 0


class SparseValues(_Part, frozen=True):
    buffer_view: Index
    byte_offset: Size = 0


class Sparse(_Part, frozen=True):
    count: Annotated[int, Meta(ge=1, le=2**31)]
    indices: SparseIndices
    values: SparseValues


class Accessor(_Part, frozen=True):
    component_type: int
    count: Annotated[int, Meta(ge=1, le=2**31)]
    type: str
    buffer_view: Index | None = None
    byte_offset: Size = 0
    normalized: bool = False
    sparse: Sparse | None = None


class DracoMesh(_Part, frozen=True):
    buffer_view: Index
    attributes: dict[str, Index]


class PrimitiveExtensions(msgspec.Struct, frozen=True, kw_only=True):
    draco: DracoMesh | None = msgspec.field(name="KHR_draco_mesh_compression", default=None)


class Primitive(_Part, frozen=True):
    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Meta(ge=0, le=6)] = 4
    targets: list[dict[str, Index]] = []
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class Mesh(_Part, frozen=True):
    primitives: list[Primitive]
    weights: list[Coordinate] = []
    name: str = ""


class TextureTransform(_Part, frozen=True):
    offset: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    rotation: Coordinate = 0.0
    scale: tuple[Coordinate, Coordinate] = (1.0, 1.0)
    tex_coord: Index | None = None


class TextureInfoExtensions(msgspec.Struct, frozen=True, kw_only=True):
    transform: TextureTransform | None = msgspec.field(name="KHR_texture_transform", default=None)


class TextureInfo(_Part, frozen=True):
    index: Index
    tex_coord: Index = 0
    scale: Coordinate = 1.0  # of a normal map
    strength: Unit = 1.0  # of occlusion
    extensions: TextureInfoExtensions = TextureInfoExtensions()


class MetallicRoughness(_Part, frozen=True):
    base_color_factor: tuple[Unit, Unit, Unit, Unit] = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureInfo | None = None
    metallic_factor: Unit = 1.0
    roughness_factor: Unit = 1.0
    metallic_roughness_texture: TextureInfo | None = None


class EmissiveStrength(_Part, frozen=True):
    emissive_strength: Positive = 1.0


class SpecularGlossiness(_Part, frozen=True):
    diffuse_factor: tuple[Unit, Unit, Unit, Unit] = (1.0, 1.0, 1.0, 1.0)
    diffuse_texture: TextureInfo | None = None
    specular_factor: tuple[Unit, Unit, Unit] = (1.0, 1.0, 1.0)
    glossiness_factor: Unit = 1.0
    specular_glossiness_texture: TextureInfo | None = None


class Unlit(_Part, frozen=True):
    pass


class Refraction(_Part, frozen=True):
    ior: Annotated[float, Meta(ge=0.0, le=1e6)] = 1.5


class Specular(_Part, frozen=True):
    specular_factor: Unit = 1.0
    specular_texture: TextureInfo | None = None
    specular_color_factor: tuple[Positive, Positive, Positive] = (1.0, 1.0, 1.0)
    specular_color_texture: TextureInfo | None = None


class Clearcoat(_Part, frozen=True):
    clearcoat_factor: Unit = 0.0
    clearcoat_texture: TextureInfo | None = None
    clearcoat_roughness_factor: Unit = 0.0
    clearcoat_roughness_texture: TextureInfo | None = None
    clearcoat_normal_texture: TextureInfo | None = None


class MaterialExtensions(msgspec.Struct, frozen=True, kw_only=True):
    specular_glossiness: SpecularGlossiness | None = msgspec.field(
        name="KHR_materials_pbrSpecularGlossiness", default=None
    )
    emissive_strength: EmissiveStrength | None = msgspec.field(name="KHR_materials_emissive_strength", default=None)
    unlit: Unlit | None = msgspec.field(name="KHR_materials_unlit", default=None)
    refraction: Refraction | None = msgspec.field(name="KHR_materials_ior", default=None)
    specular: Specular | None = msgspec.field(name="KHR_materials_specular", default=None)
    clearcoat: Clearcoat | None = msgspec.field(name="KHR_materials_clearcoat", default=None)


class Material(_Part, frozen=True):
    name: str = ""
    pbr_metallic_roughness: MetallicRoughness = MetallicRoughness()
    normal_texture: TextureInfo | None = None
    occlusion_texture: TextureInfo | None = None
    emissive_texture: TextureInfo | None = None
    emissive_factor: tuple[Unit, Unit, Unit] = (0.0, 0.0, 0.0)
    alpha_mode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alpha_cutoff: Positive = 0.5
    double_sided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()


class TextureSource(_Part, frozen=True):
    source: Index


class TextureExtensions(msgspec.Struct, frozen=True, kw_only=True):
    webp: TextureSource | None = msgspec.field(name="EXT_texture_webp", default=None)
    basisu: TextureSource | None = msgspec.field(name="KHR_texture_basisu", default=None)


class Sampler(_Part, frozen=True):
    mag_filter: Literal[9728, 9729] | None = None
    min_filter: Literal[9728, 9729, 9984, 9985, 9986, 9987] | None = None
    wrap_s: Literal[10497, 33071, 33648] = 10497
    wrap_t: Literal[10497, 33071, 33648] = 10497


class Texture(_Part, frozen=True):
    sampler: Index | None = None
    source: Index | None = None
    extensions: TextureExtensions = TextureExtensions()


class Image(_Part, frozen=True):
    uri: str | None = None
    buffer_view: Index | None = None
    name: str = ""


class Perspective(_Part, frozen=True):
    yfov: Annotated[float, Meta(gt=0.0, lt=3.2)]
    znear: Annotated[float, Meta(gt=0.0, le=1e30)]
    zfar: Annotated[float, Meta(gt=0.0, le=1e30)] | None = None


class Orthographic(_Part, frozen=True):
    xmag: Float
    ymag: Float
    znear: Positive
    zfar: Annotated[float, Meta(gt=0.0, le=1e30)]


class Camera(_Part, frozen=True):
    type: str
    perspective: Perspective | None = None
    orthographic: Orthographic | None = None


class Spot(_Part, frozen=True):
    inner_cone_angle: Annotated[float, Meta(ge=0.0, le=1.5708)] = 0.0
    outer_cone_angle: Annotated[float, Meta(ge=0.0, le=1.5708)] = 0.7853982


class Light(_Part, frozen=True):
    type: Literal["directional", "point", "spot"]
    color: tuple[Unit, Unit, Unit] = (1.0, 1.0, 1.0)
    intensity: Positive = 1.0
    range: Annotated[float, Meta(gt=0.0, le=1e30)] | None = None
    spot: Spot = Spot()


class Lights(_Part, frozen=True):
    lights: list[Light]


class RootExtensions(msgspec.Struct, frozen=True, kw_only=True):
    lights_punctual: Lights | None = msgspec.field(name="KHR_lights_punctual", default=None)


class NodeLight(_Part, frozen=True):
    light: Index


class Instancing(_Part, frozen=True):
    attributes: dict[str, Index] = {}


class Visibility(_Part, frozen=True):
    visible: bool = True


class NodeExtensions(msgspec.Struct, frozen=True, kw_only=True):
    lights_punctual: NodeLight | None = msgspec.field(name="KHR_lights_punctual", default=None)
    instancing: Instancing | None = msgspec.field(name="EXT_mesh_gpu_instancing", default=None)
    visibility: Visibility | None = msgspec.field(name="KHR_node_visibility", default=None)


class Node(_Part, frozen=True):
    name: str = ""
    children: list[Index] = []
    mesh: Index | None = None
    camera: Index | None = None
    skin: Index | None = None
    weights: list[Coordinate] = []
    matrix: Annotated[list[Float], Meta(min_length=16, max_length=16)] | None = None
    translation: Vec3 = (0.0, 0.0, 0.0)
    rotation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    scale: Vec3 = (1.0, 1.0, 1.0)
    extensions: NodeExtensions = NodeExtensions()


class Skin(_Part, frozen=True):
    joints: Annotated[list[Index], Meta(min_length=1, max_length=1 << 16)]
    inverse_bind_matrices: Index | None = None


class ChannelTarget(_Part, frozen=True):
    path: str
    node: Index | None = None


class AnimationChannel(_Part, frozen=True):
    sampler: Index
    target: ChannelTarget


class AnimationSampler(_Part, frozen=True):
    input: Index
    output: Index
    interpolation: Literal["STEP", "LINEAR", "CUBICSPLINE"] = "LINEAR"


class Animation(_Part, frozen=True):
    channels: list[AnimationChannel]
    samplers: list[AnimationSampler]
    name: str = ""


class Scene(_Part, frozen=True):
    nodes: list[Index] = []
    name: str = ""


class Document(_Part, frozen=True):
    """A glTF file's JSON."""

    asset: Asset
    extensions_used: list[str] = []
    extensions_required: list[str] = []
    scene: Index | None = None
    scenes: list[Scene] = []
    nodes: list[Node] = []
    meshes: list[Mesh] = []
    accessors: list[Accessor] = []
    buffer_views: list[BufferView] = []
    buffers: list[Buffer] = []
    materials: list[Material] = []
    textures: list[Texture] = []
    samplers: list[Sampler] = []
    images: list[Image] = []
    cameras: list[Camera] = []
    animations: list[Animation] = []
    skins: list[Skin] = []
    extensions: RootExtensions = RootExtensions()


_GLB_HEADER: Final = struct.Struct("<4sII")
_CHUNK_HEADER: Final = struct.Struct("<I4s")


def parse_gltf(data: bytes) -> tuple[Document, bytes | None]:
    """The document in a .gltf's or .glb's bytes and, of a .glb, its binary chunk; raises AssetError without naming the file."""
    binary: bytes | None = None
    text = data
    if data[:4] == b"glTF":
        text, binary = _split_glb(data)
    elif data[:3] == b"\xef\xbb\xbf":
        text = data[3:]
    try:
        document = msgspec.json.decode(text, type=Document)
    except msgspec.ValidationError as error:
        reason, _, where = str(error).partition(" - at `$")
        place = where.rstrip("`").lstrip(".")
        raise AssetError(f"{place}: {reason[:1].lower()}{reason[1:]}" if place else reason) from None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise AssetError(f"not a glTF model: {error}") from None
    except RecursionError:
        raise AssetError("not a glTF model: brackets are nested too deeply") from None
    if document.asset.version.split(".")[0] != "2":
        raise AssetError(f"asset.version is {document.asset.version[:20]!r}; ELYS reads glTF 2.0, so export it as that")
    return document, binary


def _split_glb(data: bytes) -> tuple[bytes, bytes | None]:
    if len(data) < _GLB_HEADER.size:
        raise AssetError(f"a .glb of {len(data)} bytes was cut off in its header")
    _, version, length = _GLB_HEADER.unpack_from(data)
    if version != 2:
        raise AssetError(f"a .glb of version {version}; ELYS reads version 2")
    if length > len(data):
        raise AssetError(f"a .glb that was cut off: it says it has {length} bytes, there are {len(data)}")
    chunks: list[tuple[bytes, bytes]] = []
    offset = _GLB_HEADER.size
    while offset + _CHUNK_HEADER.size <= length:
        size, kind = _CHUNK_HEADER.unpack_from(data, offset)
        offset += _CHUNK_HEADER.size
        if offset + size > length:
            raise AssetError(f"a .glb whose chunk {kind!r} of {size} bytes reaches past its end")
        chunks.append((kind, data[offset : offset + size]))
        offset += size
    if not chunks or chunks[0][0] != b"JSON":
        raise AssetError("a .glb whose first chunk is not JSON")
    binary = chunks[1][1] if len(chunks) > 1 and chunks[1][0] == b"BIN\0" else None
    return chunks[0][1], binary
