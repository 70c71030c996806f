"""Tangents of vertices against those of pixels: `python -m tests.tangent_space [MODELS]` measures docs/tangent-space.md anew.

MODELS is a folder with the Khronos sample models NormalTangentTest and FlightHelmet; without it only shapes are measured, and
the page stays as it is.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from PIL import Image

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore, Mesh, decode_mesh, encode_mesh, is_primitive, primitive
from elys.common.assets.tangents import with_tangents
from elys.common.math import quaternion
from elys.common.math.matrix import look_rotation
from elys.common.scene import OpenedScene, open_scene, write_scene
from elys.common.scene_document import EntityNode, SceneDocument
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.offline import OfflineRenderer
from elys.verbs.footage import simulated

Array = np.ndarray[Any, Any]

PAGE: Final = Path(__file__).parents[1] / "docs" / "tangent-space.md"
PICTURES: Final = PAGE.parent / "pictures" / "tangent-space"
SIZE: Final = 512
LEAN: Final = (200, 90, 225)  # a normal map of one colour: what it means can be said in closed form
REDDEST: Final = 3.0  # [degrees] of error that the pictures show as full red
FRAMES: Final = 12


class Row(NamedTuple):
    """What one choice for one thing came to; errors are angles [degrees]."""

    thing: str
    choice: str
    mean: float
    p95: float
    vertices: int
    kilobytes: float
    compute: float  # [ms]
    frame: float  # [ms]


def main(words: list[str]) -> None:
    """Measures, prints, and writes the page where the models are there."""
    context = offscreen_context()
    rows: list[Row] = []
    for shape in ("box", "sphere"):
        rows += measure_shape(shape, context)
    models = (
        [next(Path(words[0]).glob(f"{name}/**/*.gl*")) for name in ("NormalTangentTest", "FlightHelmet")]
        if words
        else []
    )
    for path in models:
        rows += measure_model(path, context)
    table = "\n".join(
        [
            "| thing | tangents | error, mean / p95 | vertices | of them | to compute | a frame |",
            "| --- | --- | --- | --- | --- | --- | --- |",
        ]
        + [
            f"| {r.thing} | {r.choice} | {r.mean:.2f} / {r.p95:.2f} deg | {r.vertices} | {r.kilobytes:.0f} kB "
            f"| {r.compute:.1f} ms | {r.frame:.1f} ms |"
            for r in rows
        ]
    )
    print(table)
    if models:
        before, rest = PAGE.read_text(encoding="utf-8").split("<!-- figures -->\n")
        after = rest.split("<!-- /figures -->")[1]
        PAGE.write_text(f"{before}<!-- figures -->\n{table}\n<!-- /figures -->{after}", encoding="utf-8")
        print(PAGE)
    context.release()


def measure_shape(shape: str, context: Context) -> list[Row]:
    """A primitive under a normal map of one colour, against the closed form."""
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "lean.png"
        Image.new("RGB", (4, 4), LEAN).save(image)
        components = {"Transform": {}, "MeshRenderer": {"mesh": shape}, "Material": {"normal_texture": str(image)}}
        write_scene(
            SceneDocument(name=shape, entities=[EntityNode(name="Thing", components=components)]),
            Path(folder) / "a.scene.json",
        )
        assets = AssetStore()
        scene = open_scene(Path(folder) / "a.scene.json", assets)
        eye = np.array((1.1, 0.9, 1.3))
        camera = looking(eye, 0.9)
        places = seen_places(scene, assets, camera, context)
        truth = closed_form(shape, places)
        return compare(shape, scene, assets, camera, context, truth, ("vertices", "pixels"))


def measure_model(path: Path, context: Context) -> list[Row]:
    """A model against its own tangents, or else against those computed for its vertices."""
    assets = AssetStore()
    scene = open_scene(path, assets)
    meshes = model_meshes(scene, assets)
    brings = any(mesh.tangents is not None for mesh in meshes)
    truth, _ = normals(scene, assets, None, "auto" if brings else "vertices", context)
    choices = ("auto", "vertices", "pixels") if brings else ("vertices", "pixels")
    return compare(path.stem, scene, assets, None, context, truth, choices)


def compare(
    thing: str,
    scene: OpenedScene,
    assets: AssetStore,
    camera: ViewCamera | None,
    context: Context,
    truth: Array,
    choices: tuple[str, ...],
) -> list[Row]:
    rows = []
    for choice in choices:
        stripped = without_tangents(scene, assets) if choice == "vertices" else scene
        found, frame = normals(stripped, assets, camera, choice, context)
        both = (np.linalg.norm(found, axis=2) > 0.5) & (np.linalg.norm(truth, axis=2) > 0.5)
        cosine = np.clip(np.einsum("ijk,ijk->ij", found, truth), -1.0, 1.0)
        angle = np.degrees(np.arccos(cosine))
        meshes = model_meshes(stripped, assets)
        began = time.perf_counter()
        made = [with_tangents(mesh) for mesh in meshes] if choice == "vertices" else meshes
        compute = 1e3 * (time.perf_counter() - began) if choice == "vertices" else 0.0
        count = sum(mesh.vertex_count for mesh in made)
        size = 0.0 if choice == "pixels" else 16e-3 * count
        label = {"auto": "its own", "vertices": "computed", "pixels": "of pixels"}[choice]
        rows.append(
            Row(thing, label, angle[both].mean(), float(np.percentile(angle[both], 95)), count, size, compute, frame)
        )
        draw(PICTURES / f"{thing.lower()}-{choice}.png", found, np.where(both, angle, 0.0))
    return rows


def draw(path: Path, found: Array, angle: Array) -> None:
    """Normals on the left, their error in red on the right."""
    path.parent.mkdir(parents=True, exist_ok=True)
    shown = np.where(np.linalg.norm(found, axis=2, keepdims=True) > 0.5, 0.5 + 0.5 * found, 0.1)
    red = np.full_like(shown, 0.1)
    red[..., 0] = np.clip(0.1 + 0.9 * angle / REDDEST, 0.0, 1.0)
    pixels = np.concatenate([shown, red], axis=1)
    Image.fromarray((255 * pixels).astype(np.uint8)).resize((SIZE, SIZE // 2)).save(path, optimize=True)


def normals(
    scene: OpenedScene, assets: AssetStore, camera: ViewCamera | None, choice: str, context: Context
) -> tuple[Array, float]:
    """Shaded normals (H, W, 3), and the least time of a frame [ms]."""
    with renderer(chosen(scene, choice), assets, context, "normals") as drawing:
        found = drawing.values(camera=camera)
    best = math.inf
    with renderer(chosen(scene, choice), assets, context, "shaded") as drawing:
        for _ in range(FRAMES):
            began = time.process_time()
            drawing.picture(camera=camera)
            best = min(best, 1e3 * (time.process_time() - began))
    return found, best


def renderer(scene: OpenedScene, assets: AssetStore, context: Context, shows: Any) -> OfflineRenderer:
    footage = simulated(scene, assets, 0.0)
    footage.mirror.keep_frame(next(iter(footage.frames)))
    return OfflineRenderer(footage.mirror, footage.fetch, width=SIZE, height=SIZE, shows=shows, context=context)


def chosen(scene: OpenedScene, choice: str) -> OpenedScene:
    """The scene with that choice for every mesh."""
    return changed(scene, lambda values: {**values, "tangents": choice})


def without_tangents(scene: OpenedScene, assets: AssetStore) -> OpenedScene:
    """The scene with meshes whose own tangents are taken away, so that some are computed."""

    def strip(values: dict[str, Any]) -> dict[str, Any]:
        mesh = replace(mesh_of(values, assets), tangents=None)
        return {**values, "mesh": assets.put(encode_mesh(mesh), kind="mesh")}

    return changed(scene, strip)


def changed(scene: OpenedScene, change: Callable[[dict[str, Any]], dict[str, Any]]) -> OpenedScene:
    """The scene with other values in every MeshRenderer."""
    records = [
        msgspec.structs.replace(
            record,
            components={**record.components, "MeshRenderer": change(dict(record.components["MeshRenderer"]))},
        )
        if "MeshRenderer" in record.components
        else record
        for record in scene.records
    ]
    return msgspec.structs.replace(scene, records=records)


def mesh_of(values: dict[str, Any], assets: AssetStore) -> Mesh:
    """The mesh that a MeshRenderer names."""
    name = str(values.get("mesh", "box"))
    return primitive(name) if is_primitive(name) else decode_mesh(assets.get(name))


def model_meshes(scene: OpenedScene, assets: AssetStore) -> list[Mesh]:
    """All meshes of a scene, each once."""
    values = [
        dict(record.components["MeshRenderer"]) for record in scene.records if "MeshRenderer" in record.components
    ]
    return [mesh_of(one, assets) for one in {str(one.get("mesh")): one for one in values}.values()]


def closed_form(shape: str, places: Array) -> Array:
    """Normals (H, W, 3) of a primitive under the map of one colour, for places on its surface; 0 where there are none."""
    lean = np.array(LEAN) / 255 * 2 - 1
    there = np.isfinite(places).all(axis=2)
    out = np.zeros_like(places)
    at = places[there]
    if shape == "sphere":
        normal = at / np.linalg.norm(at, axis=1, keepdims=True)
        tangent = np.cross((0.0, 1.0, 0.0), normal)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    else:  # which face a place is on, and along what the box says that its image lies there
        mesh = primitive(shape)
        assert mesh.tangents is not None
        face = (at @ mesh.normals.T.astype(np.float64)).argmax(axis=1)
        normal, tangent = mesh.normals[face], mesh.tangents[face, :3]
    out[there] = lean[0] * tangent + lean[1] * np.cross(normal, tangent) + lean[2] * normal
    return out / np.maximum(np.linalg.norm(out, axis=2, keepdims=True), 1e-9)


def seen_places(scene: OpenedScene, assets: AssetStore, camera: ViewCamera, context: Context) -> Array:
    """Where in the world (H, W, 3) what is seen lies; infinite where nothing is."""
    with renderer(scene, assets, context, "depth") as drawing:
        depth = drawing.values(camera=camera)[..., 0].astype(np.float64)
    across = (np.arange(SIZE) + 0.5) / SIZE * 2.0 - 1.0
    reach = math.tan(camera.field_of_view / 2)
    rays = np.stack([*np.meshgrid(across * reach, -across * reach), -np.ones((SIZE, SIZE))], axis=2)
    world_from_view = np.asarray(quaternion.to_matrix(np.array(camera.rotation)))
    with np.errstate(invalid="ignore"):
        return np.array(camera.position) + depth[..., None] * (rays @ world_from_view.T)


def looking(eye: Array, field_of_view: float) -> ViewCamera:
    """Towards the middle of the world."""
    rotation = tuple(look_rotation(-eye).tolist())
    return ViewCamera(position=tuple(eye.tolist()), rotation=rotation, field_of_view=field_of_view)


if __name__ == "__main__":
    main(sys.argv[1:])
