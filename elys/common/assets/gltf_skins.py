"""The skins of a glTF model: which entities bend a mesh, as assets, and the component of those that are bent."""

from __future__ import annotations

import logging

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.common.assets.gltf_accessors import pick
from elys.common.assets.gltf_nodes import ModelImport, path_below_root
from elys.common.assets.gltf_schema import Skin
from elys.common.assets.mesh import decode_mesh
from elys.common.assets.skin import SkinBinding, encode_skin
from elys.common.errors import AssetError

logger = logging.getLogger(__name__)


def import_skins(job: ModelImport) -> dict[int, str]:
    """Puts the skins that nodes name into the store, and a Skin on whoever draws those nodes' meshes; references by index."""
    skins: dict[int, str] = {}
    for index, rows in job.drawn.items():
        skin, place = job.document.nodes[index].skin, f"nodes[{index}].skin"
        if skin is None:
            continue
        found = pick(job.document.skins, skin, place, "skin")
        if skin not in skins:
            binding = _binding(job, found, f"skins[{skin}]")
            if binding is None:
                continue
            skins[skin] = job.assets.put(encode_skin(binding), kind="skin", source=f"{job.path}#skin/{skin}")
        for row in rows:
            _bend(job, row, skins[skin], len(found.joints), place)
    return skins


def _binding(job: ModelImport, skin: Skin, place: str) -> SkinBinding | None:
    for joint in skin.joints:
        pick(job.document.nodes, joint, f"{place}.joints", "node")
        if joint not in job.rows:
            logger.warning("%s of %s has joints that are in no scene; it bends nothing", place, job.path.name)
            return None
    return SkinBinding(
        joints=tuple(path_below_root(job, job.rows[joint]) for joint in skin.joints),
        joint_from_mesh=_inverse_bind_matrices(job, skin, place),
    )


def _inverse_bind_matrices(job: ModelImport, skin: Skin, place: str) -> NDArray[np.float32]:
    count = len(skin.joints)
    if skin.inverse_bind_matrices is None:
        return np.tile(np.eye(3, 4, dtype=np.float32), (count, 1, 1))
    values = job.buffers.floats(skin.inverse_bind_matrices, f"{place}.inverseBindMatrices")
    if values.ndim != 2 or values.shape[1] != 16 or len(values) < count:
        raise AssetError(f"{place}.inverseBindMatrices must hold a 4x4 matrix for each of {count} joints")
    return np.ascontiguousarray(values[:count].reshape(-1, 4, 4).transpose(0, 2, 1)[:, :3])


def _bend(job: ModelImport, row: int, reference: str, joint_count: int, place: str) -> None:
    record = job.records[row]
    mesh = decode_mesh(job.assets.get(record.components["MeshRenderer"]["mesh"]))
    if mesh.joints is None:
        logger.warning("%s of %s is on a mesh without joints and weights; it bends nothing", place, job.path.name)
        return
    named = int(mesh.joints.max(initial=0))
    if named >= joint_count:
        raise AssetError(f"{place}: its mesh names joint {named}, the skin has {joint_count}")
    components = {**record.components, "Skin": {"skin": reference}}
    references = {**record.references, "Skin.root": 0}
    job.records[row] = msgspec.structs.replace(record, components=components, references=references)
