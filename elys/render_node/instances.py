"""What can be drawn of a scene, sorted into batches: all of it that does not change with time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Material
from elys.render_node.batch_terms import Terms, terms_of_batches
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
        entity: [M] u32. casts: [M] throws shadows, as lines and points never do. surface: [M, 3, 4] f32, the numbers of the
            materials as `instance.glsl` has them.
        first_blended: the first see-through one, M where there is none.
    """

    def __init__(self, tables: SceneTables, assets: DrawableAssets) -> None:
        mirrored = turns_over(tables.world_from_local[:, :, :3])
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
        self._item_of = np.full(len(tables.entity), -1)
        self._item_of[self.rows] = np.arange(len(rows))
        self._bent = bent
        self._is_mirrored = np.array([batch.look.is_mirrored for batch in batches], np.bool_)
        self.deformation = Deformation(tables, rows, bent, morphed, assets)
        self.stand_rows: Rows = np.array([bent[row].root if row in bent else row for row in rows], np.intp)
        self.entity = tables.entity[self.rows]
        self.batch_of: Rows = np.repeat(np.arange(len(batches)), [batch.instance_count for batch in batches])
        self.surface = _surfaces([material for _, material in members])
        self.casts = np.array([tables.meshes[row].cast_shadows for row in rows], np.bool_)
        self.casts &= np.array([assets.is_surface(batch.mesh) for batch in batches], np.bool_)[self.batch_of]
        self.first_blended = next((batch.first for batch in batches if batch.is_blended), len(rows))

    def of_rows(self, rows: Rows) -> Rows:
        """The instances of some rows of the tables, as far as they are any, in their order."""
        items = self._item_of[rows]
        return items[items >= 0]

    def keeps_batches(self, tables: SceneTables, moved: Rows) -> bool:
        """Whether nobody of these rows, which have moved, is turned inside out now who was not, or the other way round."""
        if not len(moved):
            return True
        items = self.of_rows(moved)
        items = items[~np.isin(items, self.deformation.bent)]
        is_over = turns_over(tables.world_from_local[self.rows[items], :, :3])
        if (is_over != self._is_mirrored[self.batch_of[items]]).any():
            return False
        led = (skin for skin in self._bent.values() if skin.joints[0] in moved)
        return all(skin.turns_over(tables) == skin.is_mirrored for skin in led)

    def paint(self, tables: SceneTables, rows: Sequence[int]) -> Rows | None:
        """Takes the materials of some rows; returns their instances, or None where one belongs into another batch now."""
        painted = []
        for row in rows:
            item, material = int(self._item_of[row]), tables.materials[row]
            if item < 0:
                continue
            batch, renderer = self.batches[self.batch_of[item]], tables.meshes[row]
            if renderer.mesh != batch.mesh:
                continue  # it cannot be had
            look = look_of(material, batch.look.is_mirrored, renderer.tangents)
            if look._replace(is_skinned=batch.look.is_skinned, is_morphed=batch.look.is_morphed) != batch.look:
                return None
            self.surface[item] = _surface(material)
            painted.append(item)
        return np.array(painted, np.intp)

    def with_terms(self, is_even: NDArray[np.bool_]) -> tuple[Batch, ...]:
        """The batches with what their instances, of whom (M,) are scaled evenly, need of shaders."""
        first = np.array([batch.first for batch in self.batches], np.intp)
        terms = terms_of_batches(first, self.surface, is_even)
        return tuple(batch._replace(terms=found) for batch, found in zip(self.batches, terms, strict=True))

    def with_terms_of(self, items: Rows, batches: tuple[Batch, ...], is_even: NDArray[np.bool_]) -> tuple[Batch, ...]:
        """The same where some instances differ from when these batches were found."""
        found = list(batches)
        for place in np.unique(self.batch_of[items]).tolist():
            batch = found[place]
            run = slice(batch.first, batch.first + batch.instance_count)
            (terms,) = terms_of_batches(np.zeros(1, np.intp), self.surface[run], is_even[run])
            found[place] = batch._replace(terms=terms)
        return tuple(found)


def turns_over(linear: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which transforms (N, 3, 3) turn things inside out."""
    return np.asarray(np.linalg.det(linear) < 0)


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
