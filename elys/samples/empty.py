"""The least that can be looked at: a ground, a sun and a camera."""

from __future__ import annotations

from elys.common.scene import SceneDocument
from elys.samples.entities import camera, obstacle, sun


def empty() -> SceneDocument:
    """A ground to build on."""
    ground = obstacle("Ground", size=(20.0, 1.0, 20.0), position=(0.0, -0.5, 0.0))
    return SceneDocument(name="Empty", entities=[sun(), camera((4.0, 3.0, 6.0), (0.0, 0.5, 0.0)), ground])
