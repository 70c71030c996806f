"""What players can do in the scene of a session, as whoever sits at a window finds it out."""

from __future__ import annotations

from typing import cast

from elys.bus import topics
from elys.bus.messages.scene import SnapshotRequest
from elys.bus.mirror import SceneMirror
from elys.bus.session import Session
from elys.common.components import InputMap
from elys.common.ids import MAX_ENTITIES


def input_map_of(mirror: SceneMirror) -> InputMap:
    """The InputMap that counts, see docs/playing.md: the first that is switched on; the usual one where a scene has none."""
    declaring = [
        found.id
        for found in mirror.entities.values()
        if "InputMap" in found.components and mirror.world_enabled(found.id)
    ]
    if not declaring:
        return InputMap()
    first = min(declaring, key=lambda entity: entity & MAX_ENTITIES)
    return cast(InputMap, mirror.entities[first].components["InputMap"])


async def asked_input_map(session: Session) -> InputMap:
    """Likewise for who follows no scene: asks for it once. BusError where nobody answers."""
    mirror = SceneMirror()
    mirror.apply_snapshot(await session.request(topics.SNAPSHOT, SnapshotRequest(), timeout=5.0))
    return input_map_of(mirror)
