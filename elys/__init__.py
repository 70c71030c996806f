"""ELYS: a game engine of processes on a message bus.

What a script or a notebook needs is here; each name is imported when it is first used, so `import elys` costs nothing.

    import elys
    from elys import components as c

    simulation = elys.Simulation()
    world = simulation.world
    world.spawn([c.Transform(), c.Collider(size=(20.0, 1.0, 20.0))], name="Ground")
    ball = world.spawn([c.Transform(position=(0.0, 3.0, 0.0)), c.RigidBody(), c.Collider(shape="sphere")], name="Ball")
    for _ in range(120):
        simulation.step()
    height = world.transforms.world_pose(ball)[0][1]  # [m] it lies on the ground: 0.5 m and its radius

    AssetStore       meshes and images by content             World            entities, components, queries
    open_scene       a scene file or a model, ready to load   PhysicsWorld     rigid bodies alone, as arrays
    samples          scenes that ELYS makes by itself         Recording        a recorded session, frame by frame
    components       Transform, RigidBody, Light, ...         SceneMirror      a scene as a session or a recording tells it
    Simulation       a scene that runs, tick by tick          join_session     attach to a running session (asyncio)
    OfflineRenderer  pictures and films without a window      ElysError        the root of all that goes wrong on purpose
    Aabb             boxes along the axes, as arrays          Obb              turned boxes: overlap, rays, sweeps
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

# By name where each is defined. No import statements: every package below reads `elys.__version__`, and would draw all others in.
_HOMES = {
    "Aabb": "elys.common.math.aabb",
    "AssetStore": "elys.common.assets.store",
    "ElysError": "elys.common.errors",
    "Obb": "elys.common.math.obb",
    "OfflineRenderer": "elys.render_node.offline",
    "PhysicsWorld": "elys.sim_node.physics.world",
    "Recording": "elys.bus.recording",
    "SceneMirror": "elys.bus.mirror",
    "Simulation": "elys.sim_node.simulation",
    "World": "elys.sim_node.ecs.world",
    "join_session": "elys.bus.discovery",
    "open_scene": "elys.common.scene",
}
_MODULES = {"components": "elys.common.components", "samples": "elys.samples"}

__all__ = [*_HOMES, *_MODULES]  # noqa: PLE0604  all of them are texts


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        found = importlib.import_module(_MODULES[name])
    elif name in _HOMES:
        found = getattr(importlib.import_module(_HOMES[name]), name)
    else:
        raise AttributeError(f"module 'elys' has no attribute '{name}'; it offers {', '.join(sorted(__all__))}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
