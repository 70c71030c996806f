"""Components as they are now: of a body that moves, where the newest state frame says and not where it was put."""

from __future__ import annotations

import msgspec

from elys.bus.mirror import SceneMirror
from elys.common.components import Component, RigidBody, Transform
from elys.common.math.poses import local_pose


def live_value(mirror: SceneMirror, entity: int, value: Component) -> Component:
    """A component of an entity, as the mirror has it, as it is now."""
    row = mirror.frame_row(entity) if isinstance(value, Transform | RigidBody) else -1
    frame = mirror.latest_frame
    if row < 0 or frame is None:
        return value
    if isinstance(value, RigidBody):
        return msgspec.structs.replace(
            value,
            linear_velocity=tuple(frame.linear_velocity[row].tolist()),
            angular_velocity=tuple(frame.angular_velocity[row].tolist()),
        )
    position, rotation = tuple(frame.position[row].tolist()), tuple(frame.rotation[row].tolist())
    parent = mirror.entities[entity].parent
    if parent:
        position, rotation = local_pose(*mirror.world_pose(parent), position, rotation)
    return msgspec.structs.replace(value, position=position, rotation=rotation)


def live_components(mirror: SceneMirror, entity: int) -> dict[str, Component]:
    """All components of an entity as they are now. KeyError where it does not live."""
    return {name: live_value(mirror, entity, value) for name, value in mirror.entities[entity].components.items()}
