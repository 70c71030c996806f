"""Joints that come from a scene's file, against closed forms."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipk

from elys.common.assets import AssetStore
from elys.common.scene import open_scene
from elys.sim_node.physics import PhysicsSettings
from elys.sim_node.simulation import Simulation

G = 9.81
THIN = 0.1


def opened(tmp_path: Path, *entities: dict[str, Any]) -> Simulation:
    path = tmp_path / "test.scene.json"
    path.write_text(json.dumps({"elys_scene": 1, "entities": list(entities)}))
    return Simulation.load(open_scene(path, assets := AssetStore()), assets)


@pytest.mark.parametrize(("amplitude", "error"), [(0.1, 1e-4), (1.0, 1e-4), (2.0, 3e-4)])
def test_a_pendulum_has_the_period_of_the_elliptic_integral(tmp_path, amplitude, error):
    """A rod of 1 m and 1 kg, hinged at its end to a post; T = 4 K(sin(a / 2)) / w, w^2 = m g l / I about the hinge."""
    angle = amplitude - math.pi / 2  # of the rod, above the horizontal
    turn = [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
    place = [3.0 + 0.5 * math.cos(angle), 2.0 + 0.5 * math.sin(angle), 1.0]
    rod = {
        "Transform": {"position": place, "rotation": turn, "scale": [1.0, THIN, THIN]},
        "RigidBody": {},
        "Collider": {},
        "Joint": {"kind": "hinge", "other": "House/Post", "anchor": [-0.5, 0.0, 0.0], "axis": [0.0, 0.0, 1.0]},
    }
    post = {"name": "Post", "components": {"Transform": {"position": [0.0, 2.0, 1.0]}, "Collider": {}}}
    house = {"name": "House", "components": {"Transform": {"position": [3.0, 0.0, 0.0]}}, "children": [post]}
    simulation = opened(tmp_path, {"name": "Rod", "components": rod}, house)
    rate = math.sqrt(G * 0.5 / ((1.0 + THIN**2) / 12.0 + 0.25))
    expected = 4.0 / rate * ellipk(math.sin(amplitude / 2) ** 2)
    crossings, before = [], amplitude
    for tick in range(600):
        simulation.step()
        x, y, _ = simulation.moving_bodies().position[0] - (3.0, 2.0, 1.0)
        now = math.atan2(x, -y)
        if before < 0.0 <= now and now - before < 1.0:
            crossings.append((tick + 1 - now / (now - before)) / 60.0)
        before = now
    assert len(crossings) >= 3
    assert np.diff(crossings).mean() == pytest.approx(expected, rel=error)
    assert simulation.take_events() == []


def test_a_chain_hangs_as_its_loads_say(tmp_path):
    """Links from post to post, laid out on an arc, come to rest where their loads are in balance."""
    count, span = 24, 4.0
    radius = 2.6  # of the arc it is laid out in: somewhat longer than the span
    opening = 2.0 * math.asin(0.5 * span / radius)
    length = 2.0 * radius * math.sin(0.5 * opening / count)
    entities = []
    for side in (-1, 1):
        at = {"position": [side * (0.5 * span + 0.25), 3.0, 0.0], "scale": [0.5, 0.5, 0.5]}
        entities.append({"name": f"Post {side}", "components": {"Transform": at, "Collider": {"mask": 0}}})
    for k in range(count):
        angle = (k + 0.5) / count * opening - 0.5 * opening
        out = radius * math.cos(0.5 * opening / count)
        middle = [out * math.sin(angle), 3.0 + radius * math.cos(0.5 * opening) - out * math.cos(angle), 0.0]
        link = {
            "Transform": {"position": middle, "rotation": [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]},
            "RigidBody": {"linear_damping": 1.0, "angular_damping": 1.0},
            "Collider": {"size": [length, 0.02, 0.02], "mask": 0},
            "Joint": {
                "kind": "ball",
                "other": f"Link {k - 1}" if k else "Post -1",
                "anchor": [-0.5 * length, 0.0, 0.0],
            },
        }
        entities.append({"name": f"Link {k}", "components": link})
    last = {"kind": "ball", "other": "Post 1", "anchor": [0.5 * length, 0.0, 0.0]}
    entities[-1]["children"] = [{"name": "End", "components": {"Joint": last}}]
    simulation = opened(tmp_path, *entities)
    simulation.physics.settings = PhysicsSettings(sleeping=False)  # what sways by a millimetre would be put to sleep
    for _ in range(900):
        simulation.step()
    where = simulation.moving_bodies().position
    # Each link carries the mean of the loads at its ends: the tangents of their angles rise by the same step, which is found by
    # bisection so that the chain reaches from post to post.
    lower, upper = 0.0, 10.0
    for _ in range(80):
        step = 0.5 * (lower + upper)
        angles = np.arctan(step * (np.arange(count) - 0.5 * (count - 1)))
        lower, upper = (step, upper) if length * np.cos(angles).sum() > span else (lower, step)
    links = length * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    expected = np.cumsum(links, axis=0) - 0.5 * links + (-0.5 * span, 3.0)
    assert np.abs(where[:, :2] - expected).max() < 1e-4
    assert where[:, 1].min() < 3.0 - 0.5
