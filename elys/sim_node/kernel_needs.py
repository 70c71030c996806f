"""Which of the kernels that only some worlds need a scene will call, told from its components before anything is compiled.

What is missed here is compiled when it is first called: a step stands still for it, once on a machine. So this follows what the
scene says and does not guess what its scripts or its users will add.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Final

from elys.common.scene import OpenedScene
from elys.common.scene_document import ComponentValues

_SIMPLE_SHAPES: Final = ("box", "sphere")  # they have a smaller kernel of their own
_FALL: Final = 1.0  # [s] of free fall: what is through itself in a tick by then will want its impacts found


def needed_kernels(scene: OpenedScene, *, threads: int = 1) -> tuple[str, ...]:
    """Names of the kernels that the scene's steps need beside those of every world, in a fixed order."""
    entities = [record.components for record in scene.records]
    needs: list[str] = []
    if any(_shape(collider) not in _SIMPLE_SHAPES for collider in _all_of(entities, "Collider")):
        needs.append("physics.update_manifolds")
    if any(collider.get("is_trigger") for collider in _all_of(entities, "Collider")):
        needs.append("physics.track_triggers")
    if any(_may_be_fast(_body_of(scene, place), entity, scene) for place, entity in enumerate(entities)):
        needs.append("physics.stop_at_impacts")
    if any(True for _ in _all_of(entities, "Script")):
        needs.append("physics.describe_contacts")  # they hear what touches whom
    is_jointed = any(True for _ in _all_of(entities, "Joint"))
    if is_jointed:
        needs += ["physics.prepare_joints", "physics.finish_joints", "physics.measure_joints"]
        needs.append("physics.solve_jointed_contacts")
    characters, rigs = (any(True for _ in _all_of(entities, name)) for name in ("Character", "CameraRig"))
    if characters and "physics.update_manifolds" not in needs:
        needs.append("physics.update_manifolds")  # they are capsules
    if characters:
        needs += ["character.foresee_bodies", "character.move_characters"]
    if characters or rigs:
        needs += ["character.turn_views", "physics.build_query_tree", "physics.refit_query_tree"]
    if rigs:
        needs.append("physics.cast_shapes")
    if threads > 1:
        needs.append("physics.solve_shared_jointed_contacts" if is_jointed else "physics.solve_shared_contacts")
    return tuple(needs)


def _all_of(entities: Iterable[ComponentValues], name: str) -> Iterable[dict[str, Any]]:
    return (entity[name] for entity in entities if name in entity)


def _shape(collider: dict[str, Any]) -> str:
    return str(collider.get("shape", "box"))


def _body_of(scene: OpenedScene, place: int) -> dict[str, Any] | None:
    """The RigidBody that a record's collider is part of: its own, or the nearest above it."""
    while place >= 0:
        record = scene.records[place]
        if "RigidBody" in record.components:
            return record.components["RigidBody"]
        place = record.parent
    return None


def _may_be_fast(body: dict[str, Any] | None, entity: ComponentValues, scene: OpenedScene) -> bool:
    """Whether a body with such a collider soon moves by more than its thickness in a tick, as bullets and pebbles do."""
    if body is None or "Collider" not in entity:
        return False
    collider = entity["Collider"]
    if body.get("motion", "dynamic") == "static":
        return False
    speed = math.hypot(*body.get("linear_velocity", (0.0, 0.0, 0.0)))
    if body.get("motion", "dynamic") == "dynamic":
        speed += _FALL * math.hypot(*scene.settings.gravity)
    thickness = (
        min(collider.get("size", (1.0, 1.0, 1.0))) if _shape(collider) == "box" else 2.0 * collider.get("radius", 0.5)
    )
    scale = entity.get("Transform", {}).get("scale", (1.0, 1.0, 1.0))
    return speed / scene.settings.tick_rate > thickness * min(abs(factor) for factor in scale)
