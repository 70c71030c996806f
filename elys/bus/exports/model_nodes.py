"""A scene as the nodes of a glTF model: a node an entity, with its mesh, material, camera or lamp."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from elys.bus.exports.scene_meshes import SceneMeshes
from elys.bus.mirror import MirrorEntity, SceneMirror, WorldPose
from elys.common.assets.gltf_material_writing import MaterialWriting, has_images, has_normal_map
from elys.common.assets.gltf_writing import GltfModel
from elys.common.assets.mesh import Mesh
from elys.common.assets.morph_weights import parse_weights
from elys.common.assets.primitives import is_primitive
from elys.common.assets.skin import NamesBelow, SkinBinding, decode_skin
from elys.common.components import Camera, Light, Material, MeshRenderer, Morph, Skin, Transform
from elys.common.errors import AssetError, ElysError
from elys.common.math import poses

_ASPECT = 16.0 / 9.0  # of cameras: an entity's camera has the shape of the window it is seen in
_PLAIN = Transform()
_log = logging.getLogger(__name__)


class ModelNodes:
    """Makes nodes of entities as they first appear, each once; later edits of what they look like are not followed.

    Attributes:
        node_of: entity -> number of its node. parent_of: entity -> the entity whose node is above its own, 0 for none.
    """

    def __init__(self, model: GltfModel, fetch: Callable[[str], bytes]) -> None:
        self.node_of: dict[int, int] = {}
        self.parent_of: dict[int, int] = {}
        self.target_counts: dict[int, int] = {}  # of who is drawn with morph targets
        self._model = model
        self._fetch = fetch
        self._materials = MaterialWriting(model, fetch)
        self._meshes = SceneMeshes(fetch)
        self._primitives: dict[tuple[str, bool, bool], dict[str, Any]] = {}
        self._drawn: dict[tuple[str, Material, str], int] = {}
        self._roots: list[int] = []
        model.document["scene"] = model.add("scenes", {"nodes": self._roots})

    def follow(self, mirror: SceneMirror, chosen: set[int] | None) -> list[int]:
        """Adds who is not a node yet, of all or of those chosen; returns them."""
        added = [
            entity
            for entity in mirror.in_order()
            if entity.id not in self.node_of and (chosen is None or entity.id in chosen)
        ]
        for entity in added:
            self._add(entity)
        for entity in added:
            self._bend(mirror, entity)
        return [entity.id for entity in added]

    def node(self, entity: int) -> dict[str, Any]:
        """An entity's node."""
        found: dict[str, Any] = self._model.document["nodes"][self.node_of[entity]]
        return found

    def local_pose(self, mirror: SceneMirror, entity: int) -> WorldPose:
        """Where an entity is, relative to the node above its own, with its scale."""
        parent, here = self.parent_of[entity], mirror.entities[entity]
        if here.parent == parent and mirror.frame_row(entity) < 0:
            local = mirror.local_pose(entity)
            return WorldPose(local.position, local.rotation, local.scale)
        world = mirror.world_pose(entity)
        if parent not in mirror.entities:  # none, or gone while this one was put elsewhere
            return world
        return WorldPose(*poses.local_pose(*mirror.world_pose(parent), world.position, world.rotation), _scale_of(here))

    # --- making a node ---------------------------------------------------------------------------------------------

    def _add(self, entity: MirrorEntity) -> None:
        node: dict[str, Any] = {"name": entity.name}
        self._draw(node, entity)
        camera, light = entity.components.get("Camera"), entity.components.get("Light")
        if isinstance(camera, Camera):
            node["camera"] = self._model.add("cameras", _camera(camera) | {"name": entity.name})
        if isinstance(light, Light):
            node["extensions"] = {"KHR_lights_punctual": {"light": self._light(light, entity.name)}}
        number = self.node_of[entity.id] = self._model.add("nodes", node)
        self.parent_of[entity.id] = entity.parent if entity.parent in self.node_of else 0
        if entity.parent in self.node_of:
            self.node(entity.parent).setdefault("children", []).append(number)
        else:
            self._roots.append(number)

    def _draw(self, node: dict[str, Any], entity: MirrorEntity) -> None:
        drawing = entity.components.get("MeshRenderer")
        if not isinstance(drawing, MeshRenderer) or (mesh := self._meshes.get(drawing.mesh)) is None:
            return
        material = entity.components.get("Material", Material())
        assert isinstance(material, Material)
        morph = entity.components.get("Morph")
        weights = self._weights(morph, mesh) if mesh.target_count else []
        key = (drawing.mesh, material, str(weights))
        if key not in self._drawn:
            surface = self._surface(drawing.mesh, mesh, material)
            described: dict[str, Any] = {"primitives": [surface | {"material": self._materials.material(material)}]}
            if weights:
                described["weights"] = weights
            if is_primitive(drawing.mesh):
                described["name"] = drawing.mesh
            self._drawn[key] = self._model.add("meshes", described)
        node["mesh"] = self._drawn[key]
        if weights:
            self.target_counts[entity.id] = mesh.target_count

    def _surface(self, name: str, mesh: Mesh, material: Material) -> dict[str, Any]:
        """The arrays of a mesh, with what its material's images need."""
        key = (name, has_images(material), has_normal_map(material))
        if key not in self._primitives:
            self._primitives[key] = self._model.primitive(mesh, has_uvs=key[1], has_tangents=key[2])
        return self._primitives[key]

    def _weights(self, morph: object, mesh: Mesh) -> list[float]:
        try:
            given = parse_weights(morph.weights) if isinstance(morph, Morph) else ()
        except AssetError as error:
            _log.warning("left out of the model: %s", error)
            given = ()
        return [*given, *[0.0] * mesh.target_count][: mesh.target_count]

    def _bend(self, mirror: SceneMirror, entity: MirrorEntity) -> None:
        """Gives a bent mesh its skin; what lacks a joint is drawn as it is."""
        skin, node = entity.components.get("Skin"), self.node(entity.id)
        if not isinstance(skin, Skin) or "mesh" not in node or skin.root not in mirror.entities:
            return
        try:
            binding = decode_skin(self._fetch(skin.skin))
        except ElysError as error:
            _log.warning("left out of the model: %s", error)
            return
        joints = _joints(mirror, skin.root, binding)
        if all(joint in self.node_of for joint in joints):
            node["skin"] = self._model.add("skins", self._skin(binding, [self.node_of[joint] for joint in joints]))

    def _skin(self, binding: SkinBinding, joints: list[int]) -> dict[str, Any]:
        matrices = np.tile(np.eye(4, dtype=np.float32), (len(joints), 1, 1))
        matrices[:, :3] = binding.joint_from_mesh
        return {"joints": joints, "inverseBindMatrices": self._model.accessor(matrices.transpose(0, 2, 1))}

    def _light(self, light: Light, name: str) -> int:
        self._model.use("KHR_lights_punctual")
        described: dict[str, Any] = {
            "type": light.kind,
            "color": list(light.color),
            "intensity": light.intensity,
            "name": name,
        }
        if light.range > 0.0 and light.kind != "directional":
            described["range"] = light.range
        if light.kind == "spot":
            outer = min(max(light.outer_cone_angle, 1e-3), np.pi / 2)
            inner = min(light.inner_cone_angle, outer - 1e-4)
            described["spot"] = {"innerConeAngle": inner, "outerConeAngle": outer}
        extensions: dict[str, Any] = self._model.document.setdefault("extensions", {})
        lights: list[Any] = extensions.setdefault("KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(described)
        return len(lights) - 1


def is_seen(mirror: SceneMirror, entity: int) -> bool:
    """Whether an entity is there and drawn, if it has a mesh."""
    if entity not in mirror.entities or not mirror.world_enabled(entity):
        return False
    drawing = mirror.entities[entity].components.get("MeshRenderer")
    return not isinstance(drawing, MeshRenderer) or drawing.visible


def _scale_of(entity: MirrorEntity) -> tuple[float, float, float]:
    local = entity.components.get("Transform", _PLAIN)
    assert isinstance(local, Transform)
    return local.scale


def _joints(mirror: SceneMirror, root: int, binding: SkinBinding) -> list[int]:
    """The entities that bend, 0 for one that is not there."""
    order = mirror.descendants(root)
    row_of = {entity: row for row, entity in enumerate(order)}
    below = NamesBelow(
        [mirror.entities[entity].name for entity in order],
        [row_of.get(mirror.entities[entity].parent, -1) for entity in order],
    )
    rows = [below.find(0, path) for path in binding.joints]
    return [order[row] if row >= 0 else 0 for row in rows]


def _camera(camera: Camera) -> dict[str, Any]:
    near, far = camera.near, max(camera.far, camera.near * 1.001)
    if camera.projection == "orthographic":
        half = camera.ortho_height / 2
        flat = {"xmag": half * _ASPECT, "ymag": half, "znear": near, "zfar": far}
        return {"type": "orthographic", "orthographic": flat}
    return {"type": "perspective", "perspective": {"yfov": camera.field_of_view, "znear": near, "zfar": far}}


def extras_of(mirror: SceneMirror) -> dict[str, Any]:
    """What the model says of where it came from."""
    return {"scene": mirror.scene, "settings": msgspec.to_builtins(mirror.settings)}
