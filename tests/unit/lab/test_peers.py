"""A scene told to other engines: the same bodies, or a sentence why not."""

from __future__ import annotations

import numpy as np
import pytest

from elys.common.assets.store import AssetStore
from elys.common.scene import open_scene, write_scene
from elys.common.scene_document import EntityNode, SceneDocument
from elys.lab.motion import Job, Motion, run_job
from elys.lab.peers.columns import columns_of
from elys.lab.peers.engine import CannotError
from elys.lab.peers.running import PACKAGES, PeerJob, run_peer
from elys.sim_node.simulation import Simulation

BODY = {"Transform": {}, "RigidBody": {}, "Collider": {}}


@pytest.fixture
def opened(tmp_path):
    def open_(*entities: EntityNode):
        write_scene(SceneDocument(name="Told", entities=list(entities)), tmp_path / "told.scene.json")
        return open_scene(tmp_path / "told.scene.json", AssetStore())

    return open_


def three(opened):
    """A ground, and three shapes that turn and fly, one of them stretched by its parent."""
    spinning = {"linear_velocity": [1.0, 2.0, 0.0], "angular_velocity": [0.5, 1.0, -2.0], "mass": 3.0}
    shapes = [
        {"shape": "box", "size": [0.4, 0.6, 1.0]},
        {"shape": "sphere", "radius": 0.3},
        {"shape": "capsule", "radius": 0.2, "half_length": 0.4},
    ]
    movers = [
        EntityNode(
            name=f"Mover {n}",
            components={"Transform": {"position": [3.0 * n, 5.0, 0.0]}, "RigidBody": spinning, "Collider": shape},
        )
        for n, shape in enumerate(shapes)
    ]
    group = EntityNode(name="Group", components={"Transform": {"scale": [2.0, 2.0, 2.0]}}, children=movers[:1])
    ground = EntityNode(name="Ground", components={"Collider": {"size": [50.0, 1.0, 50.0]}})
    return opened(ground, group, *movers[1:])


def test_columns_are_what_the_scene_says(opened):
    scene = columns_of(Simulation.load(three(opened), AssetStore()))
    bodies = scene.bodies
    assert sorted(bodies.motion.tolist()) == [0, 0, 0, 2]
    box = int(np.flatnonzero((bodies.motion == 0) & (bodies.shape == 0))[0])
    assert bodies.size[box] == pytest.approx([0.8, 1.2, 2.0])
    assert bodies.position[box] == pytest.approx([0.0, 10.0, 0.0])
    capsule = int(np.flatnonzero(bodies.shape == 2)[0])
    assert (bodies.radius[capsule], bodies.half_length[capsule]) == pytest.approx((0.2, 0.4))
    assert bodies.mass[bodies.motion == 0] == pytest.approx(3.0)


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"Collider": {"shape": "cylinder"}}, "is a cylinder"),
        ({"Collider": {"offset": [0.0, 1.0, 0.0]}}, "stands off"),
        ({"Collider": {"is_trigger": True}}, "trigger"),
        ({"RigidBody": {"gravity_scale": 0.5}}, "gravity of its own"),
        ({"RigidBody": {"motion": "kinematic"}}, "kinematic"),
        ({"RigidBody": {"lock_turn_x": True}}, "locked"),
        ({"Joint": {"kind": "ball"}}, "joints"),
    ],
)
def test_what_has_no_equal_is_told(opened, changes, said):
    scene = opened(EntityNode(name="Thing", components={**BODY, **changes}))
    with pytest.raises(CannotError, match=said):
        columns_of(Simulation.load(scene, AssetStore()))


def test_a_shape_on_a_child_is_told(opened):
    child = EntityNode(name="Shape", components={"Transform": {}, "Collider": {}})
    scene = opened(EntityNode(name="Thing", components={"Transform": {}, "RigidBody": {}}, children=[child]))
    with pytest.raises(CannotError, match="Thing has its shape on a child"):
        columns_of(Simulation.load(scene, AssetStore()))


@pytest.mark.parametrize("peer", sorted(PACKAGES))
def test_a_peer_begins_with_the_energy_and_momentum_of_elys(opened, peer):
    """The bodies' inertia is ELYS's own there and a closed form here; one falls as the other for the first moments."""
    pytest.importorskip(PACKAGES[peer], reason="the peers are an extra")
    scene = three(opened)
    if peer == "mujoco":  # which is measured without capsules
        kept = [record for record in scene.records if record.components.get("Collider", {}).get("shape") != "capsule"]
        scene = type(scene)(name=scene.name, path=scene.path, settings=scene.settings, records=kept)
    own = run_job(Job(scene, AssetStore(), 0.2, 60, is_timed=False))
    found = run_peer(PeerJob(peer, scene, AssetStore(), 0.2, 60))
    assert isinstance(found, Motion)
    assert found.names == own.names
    assert found.kinetic[0] == pytest.approx(own.kinetic[0], rel=1e-6)
    assert found.potential[0] == pytest.approx(own.potential[0], rel=1e-9)
    assert found.momentum[0] == pytest.approx(own.momentum[0], abs=1e-5)
    # First-order integrators are off by half a step of gravity's way.
    assert np.abs(found.position - own.position).max() < 0.5 * 9.81 * 0.2 / 60.0 * 1.1 + 1e-4
    assert found.cost > 0.0
