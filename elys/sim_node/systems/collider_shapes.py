"""Colliders as physics takes them: lengths stretched by the scene's scale, hulls and meshes of what the entity draws, ground
after files of heights."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.heights import decode_heights
from elys.common.assets.mesh import Mesh, decode_mesh
from elys.common.assets.primitives import is_primitive, primitive
from elys.common.assets.store import AssetStore
from elys.common.components import Collider, MeshRenderer
from elys.common.errors import AssetError, PhysicsError
from elys.common.ids import Entity
from elys.sim_node.ecs.entities import Entities
from elys.sim_node.ecs.world import World
from elys.sim_node.physics import DYNAMIC, HEIGHT_FIELD, HULL, MESH, PLANE, STATIC, PhysicsWorld

Values = NDArray[Any]

THINNEST: Final = 1e-4  # [m] a collider scaled to nothing keeps the least size that a Collider may have


def stretched_lengths(world: World, entities: Entities, scale: Values) -> dict[str, Values]:
    """Sizes [N, 3], radii [N] and half lengths [N] of colliders [m], stretched by scales [N, 3].

    What is round stays so: a sphere takes the largest stretch, capsules and cylinders the larger one across their axis.
    """
    table = world.table(Collider)
    rows = table.rows(entities)
    stretch = np.abs(scale.astype(np.float64))
    is_long = np.isin(table.column("shape")[rows], (2, 3))
    across = np.where(is_long, np.maximum(stretch[:, 0], stretch[:, 2]), stretch.max(axis=1))
    return {
        "size": np.maximum(table.column("size")[rows] * stretch, THINNEST),
        "radius": np.maximum(table.column("radius")[rows] * across, THINNEST),
        "half_length": np.maximum(table.column("half_length")[rows] * stretch[:, 1], THINNEST),
    }


def collider_columns(world: World, entities: Entities) -> dict[str, Values]:
    """What is taken from Colliders as it stands."""
    table = world.table(Collider)
    rows = table.rows(entities)
    same = ("shape", "friction", "restitution", "rolling_friction", "spin_friction", "density")
    columns = {name: table.column(name)[rows] for name in same}
    for name in ("layer", "mask"):
        columns[name] = table.column(name)[rows].astype(np.int32).view(np.uint32)
    columns["trigger"] = table.column("is_trigger")[rows]
    return columns


def geometries(
    world: World,
    physics: PhysicsWorld,
    assets: AssetStore,
    entities: Entities,
    motion: Values,
    scale: Values,
    leave_out: Callable[[Entities, str], None],
) -> tuple[Values, NDArray[np.bool_]]:
    """Geometry handles [N] of colliders on bodies with `motion` [N], and which of them physics can work with.

    The others are told to `leave_out` with the reason.
    """
    table = world.table(Collider)
    shapes = table.column("shape")[table.rows(entities)]
    handles = np.full(len(entities), -1)
    usable = np.ones(len(entities), bool)
    for place in np.flatnonzero(shapes >= HULL):
        entity = Entity(int(entities[place]))
        shape = int(shapes[place])
        try:
            _refuse_motion(shape, int(motion[place]))
            if shape == HEIGHT_FIELD:
                handles[place] = _ground(physics, assets, world.get(entity, Collider), scale[place])
            elif shape != PLANE:
                handles[place] = _geometry(physics, shape, _drawn_mesh(world, assets, entity), scale[place])
        except (AssetError, PhysicsError) as error:
            usable[place] = False
            leave_out(entities[place : place + 1], f"collides with nothing: {error}")
    return handles, usable


def _refuse_motion(shape: int, motion: int) -> None:
    if shape == MESH and motion != STATIC:
        raise PhysicsError("a mesh cannot move; make its RigidBody static, or its shape a hull")
    if shape == HEIGHT_FIELD and motion != STATIC:
        raise PhysicsError("a height field cannot move; make its RigidBody static")
    if shape == PLANE and motion == DYNAMIC:
        raise PhysicsError("a plane cannot fall; make its RigidBody static or kinematic")


def _drawn_mesh(world: World, assets: AssetStore, entity: Entity) -> Mesh:
    if not world.has(entity, MeshRenderer):
        raise AssetError("its shape is that of its mesh, and it has none; give it a MeshRenderer")
    name = world.get(entity, MeshRenderer).mesh
    return primitive(name) if is_primitive(name) else decode_mesh(assets.get(name))


def _ground(physics: PhysicsWorld, assets: AssetStore, collider: Collider, scale: Values) -> int:
    if not collider.heights:
        raise AssetError("its shape is that of its heights, and it has none; name a grayscale PNG or a .npy file")
    heights = decode_heights(assets.get(collider.heights)).T  # physics has x first
    size = np.asarray(collider.size) * scale
    # Mirrored ground rises where the picture's other side does.
    heights = heights[:: -1 if scale[0] < 0.0 else 1, :: -1 if scale[2] < 0.0 else 1]
    return physics.add_height_field(heights * size[1], np.maximum(np.abs(size[[0, 2]]), THINNEST))


def _geometry(physics: PhysicsWorld, shape: int, mesh: Mesh, scale: Values) -> int:
    if not mesh.is_surface:
        raise AssetError(
            f"its shape is that of its mesh, which consists of {mesh.topology}; choose a mesh of triangles"
        )
    points = mesh.positions.astype(np.float64) * scale
    if shape == HULL:
        return physics.add_hull(points)
    triangles = mesh.indices.reshape(-1, 3).astype(np.int64)
    if np.prod(np.sign(scale)) < 0.0:
        triangles = triangles[:, ::-1]  # mirrored: what was inside out is right again
    return physics.add_mesh(points, triangles)
