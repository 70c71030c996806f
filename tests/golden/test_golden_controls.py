"""The card of controls over a picture, which must stay as it is; `pytest tests/golden --draw-golden` draws it anew."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from elys.bus.messages.views import ViewCamera
from elys.common.components import InputMap
from elys.common.components.input_map import ACTIONS
from elys.render_node.camera import View
from elys.render_node.controls_card import ControlsCard
from elys.render_node.gpu import Context, Framebuffer
from elys.render_node.offline import load_picture, save_picture
from elys.render_node.overlays import Overlays
from elys.render_node.passes.overlay import OverlayPass
from elys.render_node.resources import Resources

pytestmark = pytest.mark.gl

MEAN_TOLERANCE = 1.0  # of 255, as in test_golden_pictures
FAR_OFF = 16
FAR_OFF_SHARE = 0.005
CAMERA = ViewCamera(position=(0, 0, 0), rotation=(0, 0, 0, 1))


def test_the_card_stays_as_it_is(context: Context, request: pytest.FixtureRequest) -> None:
    actions = {**ACTIONS, "boost": "+pad_right_trigger, mouse_left", "zoom_in": "+wheel_y, pad_y"}
    axes = {"steer": "a/d, pad_left_x curve=0.5", "throttle": "-pad_left_trigger, pad_right_trigger, w"}
    card = ControlsCard(InputMap(actions=actions, axes=axes), {"jump": "k, pad_a", "run": ""}, lambda bound: None)
    for name in ("down", "down", "enter", "e"):  # the jump's key becomes that of "use"
        card.press(name)
    target = Framebuffer(context, 640, 360, colors=("rgba8",))
    target.use()
    target.clear((0.2, 0.3, 0.35, 1.0))
    OverlayPass(Resources(context)).draw_over(Overlays(card.nodes()), View.of(CAMERA, 640, 360), None, target)
    picture = np.ascontiguousarray(target.read()[::-1, :, :3])
    path = Path(__file__).parent / "controls.png"
    if request.config.getoption("--draw-golden"):
        save_picture(path, picture)
    difference = np.abs(picture.astype(int) - load_picture(path).astype(int))
    assert difference.mean() <= MEAN_TOLERANCE
    assert (difference.max(axis=-1) > FAR_OFF).mean() <= FAR_OFF_SHARE
