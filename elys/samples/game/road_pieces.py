"""Pieces of road and a gate as prefabs, for levels that are put together in the editor: `elys:game/road_straight.prefab.json`.

    python -m elys.samples.game.road_pieces        writes them into elys/pieces/game, after something here was changed

Each piece begins at its origin and leads along -z; where it ends is a round number of metres on, so that one fits to the next.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from elys.common.assets.gltf_writing import GltfModel
from elys.common.assets.mesh import Mesh
from elys.common.scene import EntityNode, SceneDocument, write_scene
from elys.common.scene_files import PIECES_FOLDER, PREFAB_SUFFIX
from elys.samples.game import kit
from elys.samples.game.course import WAYSIDE, Course

WIDTH: Final = 6.0  # [m]
MESHES: Final = "roads.glb"
ROADS: Final[dict[str, Callable[[Course], Course]]] = {
    "road_straight": lambda course: course.straight(10.0),
    "road_bend_left": lambda course: course.turn(90.0, radius=12.0),
    "road_bend_right": lambda course: course.turn(-90.0, radius=12.0),
    "road_slope": lambda course: course.straight(12.0, climb=2.0),
    "road_jump": lambda course: course.ramp(10.0, climb=2.0),
}


def road_mesh(name: str) -> Mesh:
    """One piece, which begins below the one before it, as a stretch does that another goes on from."""
    course = Course(width=WIDTH)
    course.straight(4.0).widen(WIDTH)
    begin = course.here.position
    ROADS[name](course)
    mesh, origin = course.stretches[1].mesh()
    return replace(mesh, positions=(mesh.positions + (origin - begin)).astype(np.float32))


def road_prefab(name: str, number: int) -> EntityNode:
    """A piece of road whose mesh is the file's of this number."""
    return EntityNode(
        name=name.replace("_", " ").capitalize(),
        components={
            "Transform": {},
            "Collider": {"shape": "mesh", "friction": 1.2},
            "MeshRenderer": {"mesh": f"{MESHES}#{number}/0"},
            "Material": {"base_color": [1.0, 1.0, 1.0], "roughness": 0.75},
        },
    )


def gate_prefab() -> EntityNode:
    """A gate over such a road: the first, until its number is changed."""
    gate = kit.gate(Course(width=WIDTH).here, 1, width=WIDTH + 2.0 * WAYSIDE)
    script = {**(gate.components["Script"] or {}), "source": "race.py#Gate"}
    return EntityNode(name="Gate", components={**gate.components, "Script": script}, children=gate.children)


def write(folder: Path) -> None:
    """All of them."""
    model = GltfModel("elys")
    for name in ROADS:
        made = model.add("meshes", {"name": name, "primitives": [model.primitive(road_mesh(name), has_uvs=False)]})
        model.add("nodes", {"name": name, "mesh": made})
    model.add("scenes", {"nodes": list(range(len(ROADS)))})
    file = io.BytesIO()
    model.write(file)
    (folder / MESHES).write_bytes(file.getvalue())
    nodes = {name: road_prefab(name, number) for number, name in enumerate(ROADS)} | {"gate": gate_prefab()}
    for name, node in nodes.items():
        write_scene(SceneDocument(name=node.name, entities=[node]), folder / f"{name}{PREFAB_SUFFIX}")


if __name__ == "__main__":
    write(PIECES_FOLDER / "game")
