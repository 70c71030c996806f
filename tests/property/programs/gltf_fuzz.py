"""A child process that opens and draws mutated models within a limit of memory: python gltf_fuzz.py FIRST COUNT MEMORY FOLDER.

Prints a JSON list of what went wrong: seed and why. Everything a seed does follows from the seed alone.
"""

from __future__ import annotations

import base64
import copy
import io
import json
import math
import resource
import signal
import struct
import sys
import traceback
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from elys.common.assets import AssetStore
from elys.common.assets.clip import Clip, decode_clips
from elys.common.assets.clip_sampling import ClipSampler
from elys.common.components import Skin, component_from
from elys.common.errors import ElysError
from elys.common.scene import open_scene
from elys.render_node.camera import framing_camera
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import offscreen_context
from elys.render_node.quality import FAST
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import tables_of

LONGEST = 30  # [s] that one model may take before it counts as a hang
VALUES: tuple[Any, ...] = (
    0, 1, -1, 2, 3, 4, 255, 5121, 5123, 5126, 2**16, 2**31, 2**31 - 1, 2**40, 2**63, -(2**31), 10**400, 0.5, -0.0, 1e30, 1e308,
    math.nan, math.inf, "", "x", "MAT4", "VEC3", "../../etc/passwd", "data:,", "data:;base64,////", None, True, [], {}, [[]],
)  # fmt: skip


class Builder:
    """A document with a bit of everything, and its buffer."""

    def __init__(self) -> None:
        self.data = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, data: bytes, **more: Any) -> int:
        self.data += bytes(-len(self.data) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more})
        self.data += data
        return len(self.views) - 1

    def accessor(self, array: np.ndarray, **more: Any) -> int:
        types = {"f4": 5126, "u1": 5121, "i1": 5120, "u2": 5123, "i2": 5122, "u4": 5125}
        kind = "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"
        view = self.view(array.tobytes())
        entry = {"bufferView": view, "componentType": types[array.dtype.str[1:]], "count": len(array), "type": kind}
        self.accessors.append({**entry, **more})
        return len(self.accessors) - 1


def rich_document() -> tuple[dict[str, Any], bytes]:
    build = Builder()
    corners = np.float32(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)))
    attributes = {
        "POSITION": build.accessor(corners),
        "NORMAL": build.accessor(np.tile(np.int8((0, 0, 127, 0)), (4, 1))[:, :3].copy(), normalized=True),
        "TEXCOORD_0": build.accessor(corners[:, :2].copy()),
        "TEXCOORD_1": build.accessor((corners[:, :2] * 65535).astype(np.uint16), normalized=True),
        "COLOR_0": build.accessor(np.full((4, 4), 200, np.uint8), normalized=True),
    }
    indices = build.accessor(np.uint16((0, 1, 2, 0, 2, 3)))
    strip = build.accessor(np.uint8((0, 1, 3, 2)))
    build.accessors.append({"componentType": 5126, "count": 4, "type": "VEC3"})
    build.accessors[-1]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": build.view(np.uint16((1, 3)).tobytes()), "componentType": 5123},
        "values": {"bufferView": build.view(corners[:2].tobytes())},
    }
    sparse = len(build.accessors) - 1
    pictures = []
    for form in ("PNG", "JPEG"):
        file = io.BytesIO()
        Image.fromarray(np.arange(192, dtype=np.uint8).reshape(8, 8, 3)).save(file, format=form)
        pictures.append({"bufferView": build.view(file.getvalue()), "mimeType": f"image/{form.lower()}"})
    turns = build.accessor(np.float32(((0, 0, 0, 1), (0, 1, 0, 0), (1, 0, 0, 0))))
    moved = {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 0.5, "scale": [2, 2], "texCoord": 1}}
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_texture_transform", "KHR_lights_punctual", "EXT_mesh_gpu_instancing"],
        "scene": 0,
        "scenes": [{"nodes": [0, 4]}],
        "nodes": [
            {"name": "A", "children": [1, 2], "mesh": 0, "translation": [1, 2, 3]},
            {"name": "B", "children": [3], "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1], "camera": 0},
            {"mesh": 1, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"ROTATION": turns}}}},
            {
                "camera": 1,
                "extensions": {"KHR_lights_punctual": {"light": 0}, "KHR_node_visibility": {"visible": True}},
            },
            {"scale": [1, -1, 1], "mesh": 1, "rotation": [0, 0, 0, 1]},
        ],
        "cameras": [
            {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}},
            {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 2, "znear": 0.1, "zfar": 9}},
        ],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 5, "spot": {}}]}},
        "meshes": [
            {"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]},
            {
                "primitives": [
                    {"attributes": {"POSITION": sparse}, "indices": strip, "mode": 5, "material": 1},
                    {"attributes": {"POSITION": attributes["POSITION"]}, "mode": 6},
                ]
            },
        ],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": moved}, "metallicFactor": 0.5},
                "normalTexture": {"index": 1, "scale": 0.5},
                "alphaMode": "MASK",
                "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}, "KHR_materials_ior": {"ior": 1.3}},
            },
            {"emissiveTexture": {"index": 1, "texCoord": 1}, "alphaMode": "BLEND", "doubleSided": True},
        ],
        "samplers": [{"wrapS": 33648, "wrapT": 33071, "magFilter": 9728, "minFilter": 9986}],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1}],
        "images": pictures,
        "accessors": build.accessors,
        "bufferViews": build.views,
        "buffers": [{"byteLength": len(build.data)}],
    }
    return document, build.data


def moving_document() -> tuple[dict[str, Any], bytes]:
    """A model with a skin, morph targets and all kinds of channels."""
    build = Builder()
    corners = np.float32(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)))
    target = {"POSITION": build.accessor(corners), "NORMAL": build.accessor(-corners)}
    attributes = {
        "POSITION": build.accessor(corners),
        "NORMAL": build.accessor(np.tile(np.float32((0, 0, 1)), (4, 1))),
        "JOINTS_0": build.accessor(np.tile(np.uint8((0, 1, 0, 0)), (4, 1))),
        "WEIGHTS_0": build.accessor(np.tile(np.uint8((128, 127, 0, 0)), (4, 1)), normalized=True),
    }
    matrices = build.view(np.tile(np.eye(4, dtype=np.float32), (2, 1, 1)).tobytes())
    build.accessors.append({"bufferView": matrices, "componentType": 5126, "count": 2, "type": "MAT4"})
    skin = {"joints": [1, 2], "inverseBindMatrices": len(build.accessors) - 1}
    times = build.accessor(np.float32((0, 0.5, 2)))
    turns = np.float32(((0, 0, 0, 1), (0, 1, 0, 0), (1, 0, 0, 0)))
    channels = (
        ("translation", "STEP", 1, corners[:3]),
        ("rotation", "LINEAR", 2, (turns * 32767).astype(np.int16)),
        ("rotation", "CUBICSPLINE", 1, np.repeat(turns, 3, axis=0)),
        ("scale", "CUBICSPLINE", 1, np.ones((9, 3), np.float32)),
        ("weights", "LINEAR", 0, np.float32((0, 1, 0.5, 0.5, 1, 0))),
    )
    samplers = [
        {"input": times, "output": build.accessor(values, normalized=values.dtype == np.int16), "interpolation": kind}
        for _, kind, _, values in channels
    ]
    moved = [
        {"sampler": number, "target": {"node": node, "path": path}}
        for number, (path, _, node, _) in enumerate(channels)
    ]
    document = {
        "asset": {"version": "2.0"},
        "nodes": [
            {"name": "Body", "mesh": 0, "skin": 0, "weights": [0.5, 0]},
            {"name": "Hip", "children": [2]},
            {"translation": [0, 1, 0]},
        ],
        "meshes": [{"primitives": [{"attributes": attributes, "targets": [target, target]}], "weights": [0, 1]}],
        "skins": [skin],
        "animations": [{"name": "Walk", "samplers": samplers, "channels": moved}],
        "accessors": build.accessors,
        "bufferViews": build.views,
        "buffers": [{"byteLength": len(build.data)}],
    }
    return document, build.data


def packed_document(library: str) -> tuple[dict[str, Any], bytes] | None:
    """A model packed with one of the libraries, if it is there."""
    build = Builder()
    corners = np.float32(np.random.default_rng(0).normal(size=(64, 3)))
    faces = np.arange(63, dtype=np.uint32)
    primitive: dict[str, Any] = {"attributes": {"POSITION": 0}, "indices": 1}
    try:
        if library == "KHR_draco_mesh_compression":
            import DracoPy

            view = build.view(DracoPy.encode(corners, faces.reshape(-1, 3)))
            primitive["extensions"] = {library: {"bufferView": view, "attributes": {"POSITION": 0}}}
            build.accessors += [
                {"componentType": 5126, "count": 64, "type": "VEC3"},
                {"componentType": 5125, "count": 63, "type": "SCALAR"},
            ]
        else:
            import meshoptimizer

            parts = (
                (bytes(meshoptimizer.encode_vertex_buffer(corners, 64, 12)), 64, 12, "ATTRIBUTES", 5126, "VEC3"),
                (bytes(meshoptimizer.encode_index_buffer(faces, 63, 64)), 63, 4, "TRIANGLES", 5125, "SCALAR"),
            )
            for data, count, stride, mode, component, kind in parts:
                view = build.view(data)
                packed = {**build.views[view], "byteStride": stride, "count": count, "mode": mode}
                build.views[view]["extensions"] = {library: packed}
                build.accessors.append({"bufferView": view, "componentType": component, "count": count, "type": kind})
    except ImportError:
        return None
    document = {
        "asset": {"version": "2.0"},
        "extensionsRequired": [library],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": build.accessors,
        "bufferViews": build.views,
        "buffers": [{"byteLength": len(build.data)}],
    }
    return document, build.data


def containers(text: bytes, data: bytes, binary: bool) -> bytes:
    if not binary:
        uri = b'"uri": "data:;base64,' + base64.b64encode(data) + b'", "byteLength"'
        head, name, tail = text.rpartition(b'"byteLength"')
        return head + uri + tail if name else text
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def paths_of(part: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    pairs = part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
    return [path] * bool(path) + [found for key, value in pairs for found in paths_of(value, (*path, key))]


def mutated_document(document: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """One to three changes of structure: another value, a part that goes, comes twice or takes another's place."""
    document = copy.deepcopy(document)
    for _ in range(rng.integers(1, 4)):
        paths = paths_of(document)
        if not paths:
            break
        *keys, last = paths[rng.integers(len(paths))]
        owner: Any = document
        for key in keys:
            owner = owner[key]
        match rng.integers(5):
            case 0 | 1:
                owner[last] = VALUES[rng.integers(len(VALUES))]
            case 2:
                del owner[last]
            case 3 if isinstance(owner, list):
                owner += [copy.deepcopy(owner[last])] * int(rng.integers(1, 2000))
            case _:
                *from_keys, from_last = paths[rng.integers(len(paths))]
                other: Any = document
                try:
                    for key in from_keys:
                        other = other[key]
                    owner[last] = copy.deepcopy(other[from_last])
                except (KeyError, IndexError, TypeError):
                    continue
    return document


def mutated(seed: int, corpus: list[tuple[dict[str, Any], bytes]]) -> tuple[bytes, str]:
    """A file and its suffix."""
    rng = np.random.default_rng(seed)
    document, data = corpus[rng.integers(len(corpus))]
    binary = bool(rng.integers(2))
    kind = rng.integers(7)
    if kind in (0, 4):
        document = mutated_document(document, rng)
    elif kind in (5, 6):  # of what accessors and images hold
        content = bytearray(data)
        for _ in range(rng.integers(1, 9)):
            content[rng.integers(len(content))] = rng.integers(256)
        data = bytes(content)
    file = bytearray(containers(json.dumps(document).encode(), data, binary))
    if kind == 1:
        for _ in range(rng.integers(1, 9)):
            file[rng.integers(len(file))] = rng.integers(256)
    elif kind == 2:
        del file[rng.integers(len(file)) :]
    elif kind == 3:  # numbers in the text: lengths, offsets, indices
        digits = [place for place, byte in enumerate(file[:6000]) if 48 <= byte <= 57]
        for _ in range(rng.integers(1, 4)):
            file[digits[rng.integers(len(digits))]] = 48 + rng.integers(10)
    return bytes(file), ".glb" if binary else ".gltf"


def clips_of(assets: AssetStore, animation: Any) -> tuple[Clip, ...]:
    return decode_clips(assets.get(animation.clips))


def show(path: Path, renderer: Renderer) -> None:
    assets = AssetStore()
    records = open_scene(path, assets).records
    world = RenderWorld(DrawableAssets(assets.get))
    try:
        components = [{name: component_from(name, fields) for name, fields in r.components.items()} for r in records]
        for record, built in zip(records, components, strict=True):
            if "Skin.root" in record.references:
                built["Skin"] = Skin(skin=built["Skin"].skin, root=record.references["Skin.root"] + 1)
        parents, names = [r.parent + 1 for r in records], [r.name for r in records]
        world.set_scene(tables_of(range(1, len(records) + 1), parents, components, names=names))
        for clip in (
            clip for built in components if "Animation" in built for clip in clips_of(assets, built["Animation"])
        ):
            samples = ClipSampler(clip).sample(np.array((-1.0, 0.0, 0.7, 1e9)))
            assert all(np.isfinite(values).all() for values in samples)
        renderer.settle(world)
        world.place()
        light = renderer.draw(world, framing_camera(*world.bounds(), aspect=1.0), 32, 32)
        assert renderer.read_pixels(light).shape == (32, 32, 4)
    finally:
        world.assets.close()


def main(first: int, count: int, memory: int, folder: Path) -> None:
    renderer = Renderer(offscreen_context(), quality=FAST)
    packed = map(packed_document, ("KHR_draco_mesh_compression", "EXT_meshopt_compression"))
    corpus = [rich_document(), rich_document(), moving_document(), *(made for made in packed if made is not None)]
    for number, (document, data) in enumerate(corpus):
        whole = folder / f"whole{number}.glb"
        whole.write_bytes(containers(json.dumps(document).encode(), data, True))
        show(whole, renderer)
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    signal.signal(signal.SIGALRM, lambda *_: (_ for _ in ()).throw(TimeoutError("a hang")))
    wrong: list[tuple[int, str]] = []
    counts = {"drawn": 0, "refused": 0}
    for seed in range(first, first + count):
        data, suffix = mutated(seed, corpus)
        path = folder / f"mutated{suffix}"
        path.write_bytes(data)
        signal.alarm(LONGEST)
        try:
            show(path, renderer)
            counts["drawn"] += 1
        except ElysError as error:
            counts["refused"] += 1
            if str(path) not in str(error) or "\n" in str(error) or len(str(error)) > 600:
                wrong.append((seed, f"says {str(error)[:700]}"))
        except BaseException:
            wrong.append((seed, traceback.format_exc()[-1500:]))
        finally:
            signal.alarm(0)
    print(json.dumps({"wrong": wrong, **counts}))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
