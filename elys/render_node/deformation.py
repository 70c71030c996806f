"""What bends meshes and morphs them: the joints of skins and the weights of morph targets, as shaders read them.

    texels    three of each joint: the rows of its transform, from the mesh to the instance's space
              then of each morphed instance its weights, four a texel

An instance that is bent stands where the root of its skin does, unturned: its joints tell all the rest, and small numbers of 32
bits are enough for them.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.morph_weights import parse_weights
from elys.common.assets.skin import NamesBelow
from elys.common.errors import AssetError
from elys.common.math.matrix import multiply_affine
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.scene_tables import Rows, SceneTables
from elys.render_node.timeline import Timeline

_log = logging.getLogger(__name__)


class Bent(NamedTuple):
    """How one mesh is bent by J joints."""

    root: int  # row of the tables
    joints: Rows  # (J,) likewise
    joint_from_mesh: NDArray[np.float32]  # (J, 3, 4)
    is_mirrored: bool = False  # by the first joint

    def turns_over(self, tables: SceneTables) -> bool:
        """Whether the first joint turns the mesh inside out."""
        linear = tables.world_from_local[self.joints[0], :, :3] @ self.joint_from_mesh[0, :, :3]
        return bool(np.linalg.det(linear) < 0.0)


def bent_rows(tables: SceneTables, assets: DrawableAssets) -> dict[int, Bent]:
    """By row, whoever is drawn bent; who lacks a joint, or something that is on its way, is drawn at rest."""
    if not tables.skins:
        return {}
    below = NamesBelow(tables.names, tables.parent.tolist())
    found: dict[int, Bent] = {}
    for row, component in tables.skins.items():
        renderer, root = tables.meshes.get(row), tables.row_of.get(component.root)
        if renderer is None or root is None or not component.skin:
            continue
        skin, mesh = assets.skin(component.skin), assets.mesh(renderer.mesh)
        if skin is None or mesh is None or mesh.joints is None:
            continue
        joints = np.array([below.find(root, path) for path in skin.joints], np.intp)
        if (joints < 0).any() or int(mesh.joints.max(initial=0)) >= len(joints):
            lost = [path for path, joint in zip(skin.joints, joints, strict=True) if joint < 0]
            why = f"nobody is at '{'/'.join(lost[0])}' below its root" if lost else "it has too few for the mesh"
            _log.warning("a skin of %d joints bends nothing: %s", len(joints), why)
            continue
        bent = Bent(root, joints, skin.joint_from_mesh)
        found[row] = bent._replace(is_mirrored=bent.turns_over(tables))
    return found


def morphed_rows(tables: SceneTables, assets: DrawableAssets) -> dict[int, NDArray[np.float32]]:
    """By row, the weights at rest of whoever is drawn morphed, one for each target."""
    found: dict[int, NDArray[np.float32]] = {}
    for row, component in tables.morphs.items():
        renderer = tables.meshes.get(row)
        mesh = assets.mesh(renderer.mesh) if renderer is not None else None
        if mesh is None or not mesh.target_count:
            continue
        weights = np.zeros(mesh.target_count, np.float32)
        try:
            given = parse_weights(component.weights)[: mesh.target_count]
            weights[: len(given)] = given
        except AssetError as error:
            _log.warning("a mesh rests: %s", error)
        found[row] = weights
    return found


class Deformation:
    """Of M instances, those that are bent or morphed.

    Attributes:
        bent, morphed: which instances. joint_rows: [J] rows of all their joints, to be placed.
        pose: [M, 2] i4, where an instance's joints and weights begin among the texels. texels: [K, 4] f32.
    """

    def __init__(
        self,
        tables: SceneTables,
        rows: Sequence[int],
        bent: dict[int, Bent],
        morphed: dict[int, NDArray[np.float32]],
        assets: DrawableAssets,
    ) -> None:
        """`rows` (M,) of the tables are the instances'."""
        self.bent: Rows = np.array([item for item, row in enumerate(rows) if row in bent], np.intp)
        self.morphed: Rows = np.array([item for item, row in enumerate(rows) if row in morphed], np.intp)
        self.pose = np.zeros((len(rows), 2), np.int32)
        skins = [bent[rows[item]] for item in self.bent.tolist()]
        counts = [len(skin.joints) for skin in skins]
        first = np.cumsum([0, *counts])
        self.joint_rows: Rows = np.concatenate([np.zeros(0, np.intp), *(skin.joints for skin in skins)])
        self._owner = np.repeat(self.bent, counts)
        self._joint_from_mesh = np.concatenate(
            [np.zeros((0, 3, 4), np.float32), *(skin.joint_from_mesh for skin in skins)]
        )
        self.pose[self.bent, 0] = 3 * first[:-1]
        meshes = {item: tables.meshes[rows[item]].mesh for item in (*self.bent.tolist(), *self.morphed.tolist())}
        bounds = [assets.joint_bounds(meshes[item], count) for item, count in zip(self.bent, counts, strict=True)]
        lower, upper = (
            np.concatenate([np.zeros((0, 3), np.float32), *(pair[side] for pair in bounds)]) for side in (0, 1)
        )
        self._used = np.flatnonzero(lower[:, 0] <= upper[:, 0])  # joints that bend anything at all
        self._used_owner = self._owner[self._used]
        self._middle = (lower[self._used] + upper[self._used]) / 2
        self._half = (upper[self._used] - lower[self._used]) / 2
        self._first_used = np.searchsorted(self._used, first[:-1])
        self._weights = [morphed[rows[item]] for item in self.morphed.tolist()]
        self._reaches = [assets.morph_reach(meshes[item]) for item in self.morphed.tolist()]
        texel = 3 * len(self.joint_rows)
        for item, weights in zip(self.morphed.tolist(), self._weights, strict=True):
            self.pose[item, 1] = texel
            texel += -(-len(weights) // 4)
        self.texels = np.zeros((texel, 4), np.float32)
        self._slots_of: tuple[NDArray[np.uint32], NDArray[np.uint32]] | None = None
        self._item_of = {int(tables.entity[rows[item]]): item for item in self.morphed.tolist()}
        self.reach = np.zeros((len(rows), 3), np.float32)  # [M, 3] m, how far morph targets may draw vertices

    @property
    def is_none(self) -> bool:
        """Whether nobody is bent or morphed."""
        return not (len(self.bent) or len(self.morphed))

    def morph(self, timeline: Timeline, fraction: float) -> None:
        """Takes the weights `fraction` of the way to the newest frame; where it tells of none, those at rest."""
        flat = self.texels.reshape(-1)
        for item, weights in zip(self.morphed.tolist(), self._weights, strict=True):
            begin = 4 * int(self.pose[item, 1])
            flat[begin : begin + len(weights)] = weights
        if timeline.newest is not None and len(timeline.newest.weight):
            slots = self._slots(timeline.newest.weight_entity, timeline.newest.weight_target)
            flat[slots[slots >= 0]] = timeline.weights(fraction)[slots >= 0]
        for item, reach in zip(self.morphed.tolist(), self._reaches, strict=True):
            begin = 4 * int(self.pose[item, 1])
            self.reach[item] = np.abs(flat[begin : begin + len(reach)]) @ reach

    def bend(
        self, linear: NDArray[np.float32], position: NDArray[np.float64], origin: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Takes where the joints are (J, 3, 3) and (J, 3), and where all instances stand (M, 3).

        Returns corners (B, 3) of boxes around the bent instances, along the world's axes and relative to where they stand.
        """
        origin_from_joint = np.empty((len(self.joint_rows), 3, 4), np.float32)
        origin_from_joint[:, :, :3] = linear
        origin_from_joint[:, :, 3] = position - origin[self._owner]  # in 64 bits
        matrices = multiply_affine(origin_from_joint, self._joint_from_mesh)
        self.texels[: 3 * len(matrices)] = matrices.reshape(-1, 4)
        used = matrices[self._used]
        half = self._half + self.reach[self._used_owner] if len(self.morphed) else self._half
        # A box taken along is enclosed by one around its middle, as wide as the sum of what its edges have along each axis.
        middle = np.einsum("nij,nj->ni", used[:, :, :3], self._middle) + used[:, :, 3]
        wide = np.einsum("nij,nj->ni", np.abs(used[:, :, :3]), half)
        return (
            np.minimum.reduceat(middle - wide, self._first_used),
            np.maximum.reduceat(middle + wide, self._first_used),
        )

    def _slots(self, entities: NDArray[np.uint32], targets: NDArray[np.uint32]) -> NDArray[np.intp]:
        """(W,) where among the numbers of the texels each weight of a frame goes, -1 for nowhere."""
        known = self._slots_of
        if known is None or not (np.array_equal(known[0], entities) and np.array_equal(known[1], targets)):
            counts = {item: len(weights) for item, weights in zip(self.morphed.tolist(), self._weights, strict=True)}
            slots = []
            for entity, target in zip(entities.tolist(), targets.tolist(), strict=True):
                item = self._item_of.get(entity)
                is_there = item is not None and target < counts[item]
                slots.append(4 * int(self.pose[item, 1]) + target if is_there else -1)
            self._slots_of, self._slot_rows = (entities, targets), np.array(slots, np.intp)
        return self._slot_rows
