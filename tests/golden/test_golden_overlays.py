"""A picture with overlays of every kind, which must stay as it is; `pytest tests/golden --draw-golden` draws it anew."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.mirror import SceneMirror
from elys.common.assets import AssetStore
from elys.common.components import (
    Camera,
    Component,
    Light,
    Material,
    MeshRenderer,
    Overlay,
    OverlayBar,
    OverlayImage,
    OverlayPanel,
    OverlayText,
    Transform,
    values_of,
)
from elys.common.math.matrix import look_rotation
from elys.render_node.gpu import Context
from elys.render_node.offline import OfflineRenderer, load_picture, save_picture

pytestmark = pytest.mark.gl

MEAN_TOLERANCE = 1.0  # of 255, as in test_golden_pictures
FAR_OFF = 16
FAR_OFF_SHARE = 0.005
BALL, MENU = 3, 6
Parts = tuple[Component, ...]


def medal() -> bytes:
    """A disc of gold, smooth at its edge."""
    y, x = np.mgrid[0:64, 0:64]
    pixels = np.empty((64, 64, 4), np.uint8)
    pixels[..., :3] = (255, 200, 40)
    pixels[..., 3] = np.clip((30.5 - np.hypot(x - 31.5, y - 31.5)) * 255, 0, 255)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    return file.getvalue()


def scene(image: str) -> SceneMirror:
    """A ball on a floor, and what a game says over it: a clock, a menu, a count, a medal, a table and a name."""
    rotation = tuple(look_rotation((-0.08, -0.4, -1.0)).tolist())
    row = {"anchor": "top", "width": 0.5, "height": 0.07}
    things: list[tuple[int, Parts]] = [
        (0, (Transform(rotation=tuple(look_rotation((-0.5, -1.0, -0.4)).tolist())), Light())),
        (0, (Transform(position=(0, -0.25, 0), scale=(12, 0.5, 12)), MeshRenderer(), Material())),
        (0, (Transform(position=(1, 0.5, 0)), MeshRenderer(mesh="sphere"), Material(base_color=(0.8, 0.3, 0.2)))),
        (0, (Transform(position=(0.6, 3.4, 7.5), rotation=rotation), Camera(field_of_view=0.75))),
        (0, (Overlay(anchor="top", y=0.03), OverlayText(text="{:time}", value=83.456, size=0.1, align="center"))),
        (0, (Overlay(anchor="left", x=0.05, width=0.55, height=0.5), OverlayPanel(border=0.004, radius=0.03))),
        (MENU, (Overlay(anchor="top", y=0.03), OverlayText(text="Pausé — Größe", size=0.06, shadow=0.06))),
        (
            MENU,
            (
                Overlay(y=0.14, **row),
                OverlayPanel(color=(0.05, 0.2, 0.6), opacity=0.9),
                OverlayText(text="Continuer", size=0.05, align="center"),
            ),
        ),
        (MENU, (Overlay(y=0.23, **row), OverlayText(text="Réglages →", size=0.05, align="center"))),
        (MENU, (Overlay(anchor="bottom", y=-0.06, width=0.45, height=0.04), OverlayBar(value=0.62))),
        (0, (Overlay(anchor="top_right", x=-0.03, y=0.03, height=0.15), OverlayImage(image=image))),
        (
            0,
            (
                Overlay(anchor="bottom_right", x=-0.03, y=-0.03),
                OverlayText(text="1  Ana 1:02.11\n2  Zoë 1:05.02", size=0.05, align="right"),
            ),
        ),
        (
            0,
            (Overlay(follow=BALL, rise=0.7, anchor="bottom"), OverlayPanel(), OverlayText(text="Ball", size=0.04)),
        ),
        (0, (Overlay(follow=99, anchor="center"), OverlayText(text="nobody"))),
        (
            0,
            (
                Overlay(anchor="center", y=0.25, opacity=0.8),
                OverlayText(text="3", size=0.35, color=(1.0, 0.6, 0.05), outline=0.04),
            ),
        ),
    ]
    mirror = SceneMirror()
    mirror.epoch = 1
    changes = tuple(
        Spawned(
            entity=number,
            name="",
            parent=parent,
            enabled=True,
            components={type(c).__name__: values_of(c) for c in parts},
        )
        for number, (parent, parts) in enumerate(things, 1)
    )
    mirror.apply_delta(SceneDelta(epoch=1, sequence=0, tick=0, changes=changes))
    return mirror


def test_overlays_stay_as_they_are(context: Context, request: pytest.FixtureRequest) -> None:
    store = AssetStore()
    mirror = scene(store.put(medal(), kind="image"))
    with OfflineRenderer(mirror, store.get, width=480, height=270, context=context) as renderer:
        picture = renderer.picture()[..., :3]
    path = Path(__file__).parent / "overlays.png"
    if request.config.getoption("--draw-golden"):
        save_picture(path, picture)
    difference = np.abs(picture.astype(int) - load_picture(path).astype(int))
    assert difference.mean() <= MEAN_TOLERANCE
    assert (difference.max(axis=-1) > FAR_OFF).mean() <= FAR_OFF_SHARE
