"""Putting assets into the running scene: where they are let go, and anew when their files change. Each is one edit."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus.asset_service import AssetOffer
from elys.common.assets.store import AssetStore, references_in
from elys.common.errors import AssetError, BusError
from elys.common.math import quaternion
from elys.common.scene import EntityRecord, scene_bounds
from elys.editor_node.asset_folder import AssetFile
from elys.editor_node.asset_reading import AssetContent, read_asset
from elys.editor_node.asset_uses import UseIndex
from elys.editor_node.language import tr
from elys.editor_node.sentences import sentence

if TYPE_CHECKING:
    from elys.bus.messages.views import ViewCamera
    from elys.editor_node.history import Outcome
    from elys.editor_node.model import EditorModel

_GROUND_REACH = 500.0  # [m] beyond which the ground is as good as the horizon

Point = NDArray[np.float64]


class AssetPlacing:
    """Gives the host what it lacks of an asset, then edits the scene. What goes wrong is said in the console."""

    def __init__(self, model: EditorModel) -> None:
        self._model = model
        self.uses = UseIndex(model.scene.mirror)
        self.offer = AssetOffer(model.session)

    async def place(self, file: AssetFile, point: Point, *, onto: int = 0) -> Outcome | None:
        """Puts what a file holds into the scene: what has a shape at a point [m], an image on the entity there (`onto`), light
        all around. None where that cannot be.
        """
        store = AssetStore()
        content, records = await asyncio.to_thread(read_asset, file, store)
        if content.error:
            self._model.say("error", content.error)
            return None
        if not await self.bring(content.references, store, file.name):
            return None
        label = sentence("Add {what}", what=file.name)
        match file.type:
            case "image" | "heights":
                return await self._lay(file, content, onto)
            case "light":
                return await self._light(file, content, records)
            case _:
                try:
                    placed = await asyncio.to_thread(placed_records, records, store, point)
                except AssetError as error:
                    self._model.say("error", str(error))
                    return None
                done = self._model.edit.spawn_records(label, placed)
                return await done if done is not None else None

    async def reload(self, before: AssetContent, file: AssetFile) -> tuple[AssetContent, Outcome | None]:
        """Has the scene show what a file holds now where it showed `before`; part by part, entities stay as they are.

        A file that cannot be read, half written say, changes nothing: the content tells why.
        """
        store = AssetStore()
        content, _ = await asyncio.to_thread(read_asset, file, store)
        if content.error or content.key == before.key:
            return content, None
        new_of = {old: content.parts[place] for place, old in before.parts.items() if place in content.parts}
        uses = await self.uses.fresh()
        used = [old for old, new in new_of.items() if old != new and old in uses]
        if not used or not await self.bring((new_of[old] for old in used), store, file.name):
            return content, None
        uses = await self.uses.fresh()
        label = sentence("Reload {what}", what=file.name)
        done = self._model.edit.replace_assets(label, {old: new_of[old] for old in used}, uses)
        return content, await done if done is not None else None

    async def bring(self, references: Iterable[str], store: AssetStore, name: str) -> bool:
        """Whether the host has all of the content now; if not, why is said."""
        try:
            for reference in references:
                if not await self.offer.bring(reference, store):
                    self._model.say("error", tr("The simulation did not take what {name} holds", name=name))
                    return False
        except (BusError, AssetError) as error:
            self._model.say("error", tr("{name} cannot be given to the simulation: {error}", name=name, error=error))
            return False
        return True

    async def _lay(self, file: AssetFile, content: AssetContent, onto: int) -> Outcome | None:
        scene = self._model.scene
        fields = {"image": ("Material", "base_color_texture"), "heights": ("Collider", "heights")}
        component, field = fields[file.type]
        if not scene.exists(onto) or scene.component_of(onto, component) is None:
            text = tr("Drop {name} on an entity that has a {component}", name=file.name, component=component)
            self._model.say("error", text)
            return None
        done = self._model.edit.set_fields((onto,), component, {field: content.parts[""]})
        return await done if done is not None else None

    async def _light(self, file: AssetFile, content: AssetContent, records: Sequence[EntityRecord]) -> Outcome | None:
        edit, scene = self._model.edit, self._model.scene
        around = [entity for entity in scene.mirror.entities if scene.component_of(entity, "Environment") is not None]
        if around:
            done = edit.set_fields(around[:1], "Environment", {"kind": "image", "image": content.parts[""]})
        else:
            done = edit.spawn_records(sentence("Add {what}", what=file.name), records)
        return await done if done is not None else None


def placed_records(records: Sequence[EntityRecord], store: AssetStore, point: Point) -> list[EntityRecord]:
    """The entities with their root where its lowest point lies on `point` [m]; AssetError for a broken mesh."""
    (root, *others) = records
    components: dict[str, dict[str, Any]] = {**root.components}
    transform = dict(components.get("Transform", {}))
    origin = np.array(transform.get("position", (0.0, 0.0, 0.0)), dtype=np.float64)
    known = [record for record in records if all(map(store.has, references_in(msgspec.json.encode(record))))]
    lowest = float(scene_bounds(records, store)[0][1]) if len(known) == len(records) else float("inf")
    rise = origin[1] - lowest if np.isfinite(lowest) else 0.0
    transform["position"] = [round(float(value), 4) for value in (point[0], point[1] + rise, point[2])]
    components["Transform"] = transform
    return [msgspec.structs.replace(root, components=components), *others]


def ground_point(camera: ViewCamera, aspect: float, x: float, y: float, focus: Sequence[float]) -> Point:
    """Where a line of sight meets the ground (height 0), x and y from -1 to 1 with y up; where it does not, or only far away,
    the point of it as far away as `focus` [m].
    """
    half = np.tan(camera.field_of_view / 2.0) if camera.ortho_height <= 0.0 else camera.ortho_height / 2.0
    rotation, eye = np.array(camera.rotation), np.array(camera.position, dtype=np.float64)
    across = np.array((x * aspect * half, y * half, 0.0))
    if camera.ortho_height > 0.0:
        eye = eye + np.asarray(quaternion.rotate(rotation, across), dtype=np.float64)
        across = np.zeros(3)
    ray = np.asarray(quaternion.rotate(rotation, (*across[:2], -1.0)), dtype=np.float64)
    ray /= np.linalg.norm(ray)
    distance = -eye[1] / ray[1] if abs(ray[1]) > 1e-6 else np.inf
    if not 0.0 < distance < _GROUND_REACH:
        distance = float(np.linalg.norm(np.asarray(focus, dtype=np.float64) - eye))
    return np.asarray(eye + ray * distance, dtype=np.float64)
