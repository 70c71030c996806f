"""A picture with all kinds of debug drawing, which must stay as it is; `pytest tests/golden --draw-golden` draws it anew."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from elys.bus.messages.physics import ContactBatch, DebugLines, Touches
from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.common.components import (
    Camera,
    Component,
    Joint,
    Light,
    Material,
    MeshRenderer,
    RigidBody,
    Transform,
    values_of,
)
from elys.common.errors import DisplayError
from elys.common.math.matrix import look_rotation
from elys.render_node.debug_drawing import DEBUG_KINDS, DebugDrawing
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.offline import OfflineRenderer, Overlay, load_picture, save_picture

pytestmark = pytest.mark.gl

SIZE = (480, 270)
MEAN_TOLERANCE = 1.0  # of 255, as in test_golden_pictures
FAR_OFF = 16
FAR_OFF_SHARE = 0.005
BALL, BLOCK, DOOR, POST = 3, 4, 5, 6


@pytest.fixture(scope="module")
def context() -> Iterator[Context]:
    """OpenGL; golden pictures are for software renderers."""
    try:
        made = offscreen_context()
    except DisplayError as error:
        pytest.skip(str(error))
    if not made.is_software:
        pytest.skip("golden pictures are compared on software OpenGL only")
    yield made
    made.release()


def scene() -> SceneMirror:
    """A white and a black half of a floor, a ball that flies, a block that lies, and a door on a post."""
    light, dark = Material(base_color=(0.9, 0.9, 0.9)), Material(base_color=(0.02, 0.02, 0.02))
    hinge = Joint(
        kind="hinge", other=POST, anchor=(-0.5, 0.0, 0.0), other_anchor=(0.0, 0.0, 0.0), axis=(0, 1, 0), fit=False
    )
    rotation = tuple(look_rotation((-0.08, -0.4, -1.0)).tolist())
    things: list[tuple[str, tuple[Component, ...]]] = [
        ("White", (Transform(position=(-4, -0.25, 0), scale=(8, 0.5, 12)), MeshRenderer(), light)),
        ("Black", (Transform(position=(4, -0.25, 0), scale=(8, 0.5, 12)), MeshRenderer(), dark)),
        ("Ball", (Transform(), MeshRenderer(mesh="sphere"), RigidBody(), Material(base_color=(0.8, 0.3, 0.2)))),
        ("Block", (Transform(), MeshRenderer(), RigidBody(), Material(base_color=(0.2, 0.4, 0.8)))),
        ("Door", (Transform(scale=(1.0, 1.6, 0.1)), MeshRenderer(), RigidBody(), hinge)),
        ("Post", (Transform(position=(1.4, 0.8, 1.0), scale=(0.2, 1.6, 0.2)), MeshRenderer())),
        ("Sun", (Transform(rotation=tuple(look_rotation((-0.5, -1.0, -0.4)).tolist())), Light(intensity=2.5))),
        ("Eye", (Transform(position=(0.6, 3.4, 7.5), rotation=rotation), Camera(field_of_view=0.75))),
    ]
    mirror = SceneMirror()
    mirror.epoch = 1
    changes = tuple(
        Spawned(
            entity=number, name=name, parent=0, enabled=True, components={type(c).__name__: values_of(c) for c in parts}
        )
        for number, (name, parts) in enumerate(things, 1)
    )
    mirror.apply_delta(SceneDelta(epoch=1, sequence=0, tick=0, changes=changes))
    return mirror


def frame(tick: int) -> StateFrame:
    """Where all is after so many ticks of a 60th of a second."""
    time = tick / 60
    turn = 0.6 * time
    door = np.array((0.0, np.sin(turn / 2), 0.0, np.cos(turn / 2)))
    place = (1.4 + 0.5 * np.cos(turn), 0.8, 1.0 - 0.5 * np.sin(turn))
    block = np.array((0.0, np.sin(0.2), 0.0, np.cos(0.2)))
    ball = (-3.0 + 2.6 * time, 0.5 + 4.0 * time - 2.5 * time * time, -1.0)
    velocity = np.array([(2.6, 4.0 - 5.0 * time, 0.0), (0, 0, 0), (0, 0, 0)])
    return StateFrame(
        epoch=1,
        tick=tick,
        simulation_time=time,
        published_at=tick,
        delta_sequence=0,
        state_hash=0,
        playing=True,
        position=np.array([ball, (-1.2, 0.5, 1.4), place], np.float64),
        rotation=np.array([(0, 0, 0, 1), block, door], np.float32),
        linear_velocity=velocity.astype(np.float32),
        angular_velocity=np.zeros((3, 3), np.float32),
        entity=np.array([BALL, BLOCK, DOOR], np.uint32),
    )


def fed(mirror: SceneMirror) -> DebugDrawing:
    """What has been heard until the last frame."""
    drawing = DebugDrawing(mirror)
    for tick in range(73):
        mirror.keep_frame(frame(tick))
        drawing.take_state(frame(tick))
    corners = [(-1.7, 0.0, 1.0), (-0.8, 0.0, 1.2)]
    pairs = {"entity_a": (1, 2), "entity_b": (BLOCK, DOOR), "body_a": (1, 2), "body_b": (BLOCK, DOOR)}
    touches = Touches(
        **pairs,
        point=tuple(corners),
        normal=((0, 1, 0),) * 2,
        depth=(0.0,) * 2,
        normal_impulse=(3.5, 1.5),
        speed=(0.0,) * 2,
    )
    drawing.take_contacts(ContactBatch(epoch=1, tick=72, begun=touches))
    asleep = np.array([[(-2.0, y, 2.1), (-0.4, y, 2.1)] for y in (0.05, 1.05)], "<f4")
    for key in ("islands", "sleeping"):
        drawing.take_lines(key, DebugLines(epoch=1, tick=72, positions=asleep.tobytes(), colors=b"\x01\x02"))
    return drawing


def test_debug_drawing_stays_as_it_is(context: Context, request: pytest.FixtureRequest) -> None:
    mirror = scene()
    overlay = Overlay(drawing=fed(mirror), kinds=DEBUG_KINDS, stamp=True)
    with OfflineRenderer(mirror, width=SIZE[0], height=SIZE[1], overlay=overlay, context=context) as renderer:
        picture = renderer.picture()[..., :3]
    path = Path(__file__).parent / "debug_drawing.png"
    if request.config.getoption("--draw-golden"):
        save_picture(path, picture)
    difference = np.abs(picture.astype(int) - load_picture(path).astype(int))
    assert difference.mean() <= MEAN_TOLERANCE
    assert (difference.max(axis=-1) > FAR_OFF).mean() <= FAR_OFF_SHARE
