"""What can be drawn of a scene, sorted into batches: all of it that does not change with time."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Material
from elys.render_node.batch_terms import Terms
from elys.render_node.deformation import Deformation, bent_rows, morphed_rows
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.look import Look, look_of
from elys.render_node.scene_tables import Rows, SceneTables

PLAIN: Final = Material()
# What is drawn where a mesh cannot be had.
MISSING: Final = Material(base_color=(0.0, 0.0, 0.0), emissive=(0.8, 0.0, 0.6))


class Batch(NamedTuple):
    """Instances that are drawn together."""

    mesh: str
    look: Look
    first: int  # instance
    instance_count: int
    terms: Terms = ()  # what of their numbers has to be compiled in

    @property
    def is_blended(self) -> bool:
        """Whether what is behind shows through."""
        return self.look.alpha_mode == "blend"


class Instances:
    """The M visible things of a scene in the order of their batches, opaque ones first.

    Attributes:
        batches: runs of the instances. batch_of: [M]. rows: [M] of the tables. stand_rows: [M] rows of where they stand: for who
            is bent that of the skin's root.
        entity: [M] u32. casts: [M] throws shadows. surface: [M, 3, 4] f32, the numbers of the materials as `instance.glsl` has
            them.
        first_blended: the first see-through one, M where there is none.
    """

    def __init__(self, tables: SceneTables, assets: DrawableAssets) -> None:
        mirrored = is_mirrored(tables)
        bent, morphed = bent_rows(tables, assets), morphed_rows(tables, assets)
        grouped: dict[tuple[str, Look], list[tuple[int, Material]]] = {}
        for row, renderer in tables.meshes.items():
            if not (renderer.visible and tables.enabled[row]):
                continue
            mesh, material = renderer.mesh, tables.materials.get(row, PLAIN)
            if mesh in assets.failed:
                mesh, material = "box", MISSING
            look = look_of(material, bool(bent[row].is_mirrored if row in bent else mirrored[row]), renderer.tangents)
            if row in bent or row in morphed:
                look = look._replace(is_skinned=row in bent, is_morphed=row in morphed)
            grouped.setdefault((mesh, look), []).append((row, material))
        batches: list[Batch] = []
        members: list[tuple[int, Material]] = []
        for mesh, look in sorted(grouped, key=lambda key: key[1].alpha_mode == "blend"):
            batches.append(Batch(mesh, look, len(members), len(grouped[mesh, look])))
            members += grouped[mesh, look]
        rows = [row for row, _ in members]
        self.batches = tuple(batches)
        self.rows: Rows = np.array(rows, np.intp)
        self.deformation = Deformation(tables, rows, bent, morphed, assets)
        self.stand_rows: Rows = np.array([bent[row].root if row in bent else row for row in rows], np.intp)
        self.entity = tables.entity[self.rows]
        self.batch_of: Rows = np.repeat(np.arange(len(batches)), [batch.instance_count for batch in batches])
        self.surface = _surfaces([material for _, material in members])
        self.casts = np.array([tables.meshes[row].cast_shadows for row in rows], np.bool_)
        self.first_blended = next((batch.first for batch in batches if batch.is_blended), len(rows))


def is_mirrored(tables: SceneTables) -> NDArray[np.bool_]:
    """Which entities' transforms turn things inside out."""
    return np.asarray(np.linalg.det(tables.world_from_local[:, :, :3]) < 0)


def _surfaces(materials: list[Material]) -> NDArray[np.float32]:
    """The numbers (M, 3, 4) of one material an instance; the same material is looked at once."""
    rows = {material: row for row, material in enumerate(dict.fromkeys(materials))}
    table = np.array([_surface(material) for material in rows], np.float32).reshape(-1, 3, 4)
    return table[np.array([rows[material] for material in materials], np.intp)]


def _surface(material: Material) -> tuple[tuple[float, ...], ...]:
    opacity = 1.0 if material.alpha_mode == "opaque" else material.opacity
    return (
        (*material.base_color, opacity),
        (*material.emissive, material.alpha_cutoff),
        (material.metallic, material.roughness, 0.0, 0.0),
    )
