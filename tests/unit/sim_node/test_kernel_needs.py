"""What kernels a scene needs, told before anything is compiled, against what its steps then call."""

from __future__ import annotations

import pytest

from elys.common.assets.store import AssetStore
from elys.common.scene import open_scene, write_scene
from elys.common.scene_document import EntityNode, SceneDocument
from elys.samples.hard_cases import HARD_CASES
from elys.samples.registry import SAMPLES, write_sample
from elys.sim_node.kernel_list import all_kernels, first_kernels
from elys.sim_node.kernel_needs import needed_kernels
from elys.sim_node.physics import events as event_stage
from elys.sim_node.physics import stepping
from elys.sim_node.simulation import Simulation

LATER = [kernel.name for kernel in all_kernels() if kernel not in first_kernels()]


@pytest.fixture
def opened(tmp_path):
    """Opens a scene of entities given by their components."""

    def open_(*entities: dict):
        nodes = [EntityNode(name=f"Entity{k}", components=components) for k, components in enumerate(entities)]
        write_scene(SceneDocument(entities=nodes), tmp_path / "needs.scene.json")
        return open_scene(tmp_path / "needs.scene.json", AssetStore())

    return open_


BALL = {"RigidBody": {}, "Collider": {"shape": "sphere"}}


def test_boxes_and_balls_need_nothing_more(opened):
    assert needed_kernels(opened({"Collider": {}}, BALL)) == ()


@pytest.mark.parametrize(
    "components, kernel",
    [
        ({"RigidBody": {}, "Collider": {"shape": "capsule"}}, "update_manifolds"),
        ({"Collider": {"shape": "plane"}}, "update_manifolds"),
        ({"Collider": {"is_trigger": True}}, "track_triggers"),
        ({**BALL, "Joint": {"kind": "ball"}}, "solve_jointed_contacts"),
        ({"RigidBody": {"linear_velocity": [200.0, 0.0, 0.0]}, "Collider": {}}, "stop_at_impacts"),
        ({"RigidBody": {}, "Collider": {"shape": "sphere", "radius": 0.02}}, "stop_at_impacts"),
        ({**BALL, "Transform": {"scale": [0.04, 0.04, 0.04]}}, "stop_at_impacts"),
    ],
)
def test_what_stands_in_the_scene_is_needed(opened, components, kernel):
    assert f"physics.{kernel}" in needed_kernels(opened({"Collider": {}}, components))


def test_threads_need_a_solver_that_shares(opened):
    assert needed_kernels(opened(BALL), threads=2) == ("physics.solve_shared_contacts",)


@pytest.mark.parametrize("name", sorted([*SAMPLES, *HARD_CASES]))
def test_a_sample_calls_no_other_kernel_at_first(name, tmp_path, monkeypatch):
    called: set[str] = set()
    for module in (stepping, event_stage):
        for function in {name.partition(".")[2] for name in LATER} & set(vars(module)):
            _listen(monkeypatch, module, function, called)
    if name in HARD_CASES:
        write_scene(HARD_CASES[name].quick.build(0), tmp_path / f"{name}.scene.json")
    else:
        write_sample(name, tmp_path / f"{name}.scene.json")
    scene, assets = open_scene(tmp_path / f"{name}.scene.json", AssetStore()), AssetStore()
    simulation = Simulation.load(scene, assets)
    for _ in range(50):  # later what tumbles may be faster by chance than could be told beforehand
        simulation.step()
    assert called <= set(needed_kernels(scene))


def _listen(monkeypatch, module, function: str, called: set[str]) -> None:
    kernel = getattr(module, function)

    def heard(*arguments):
        called.add(f"physics.{function}")
        return kernel(*arguments)

    monkeypatch.setattr(module, function, heard)
