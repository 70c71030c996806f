"""What stands over the picture: texts, panels, bars and images, laid out in the picture and not in the world.

An `Overlay` is a rectangle; what an entity has besides is drawn in it, from below to above: OverlayPanel, OverlayBar,
OverlayImage, then OverlayText. Without one, the rectangle is that of the default `Overlay`. Lengths are shares of the height of
the largest 16:9 picture that fits into the view: 1 from top to bottom, in every view of that shape or wider.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

from elys.common.components.declaration import Component, Kind, Vec3, about, component

# Of the components of this file by what they are drawn over: those that stand later are drawn over those before.
OVERLAY_COMPONENTS: Final = ("Overlay", "OverlayPanel", "OverlayBar", "OverlayImage", "OverlayText")

Anchor = Literal[
    "top_left",
    "top",
    "top_right",
    "left",
    "center",
    "right",
    "bottom_left",
    "bottom",
    "bottom_right",
]
ALIGNMENTS: Final = ("left", "center", "right")
WHITE: Final = (1.0, 1.0, 1.0)


@component
class Overlay(Component, frozen=True):
    """A rectangle in the picture: in that of the nearest Overlay above it, else in the whole picture."""

    anchor: Annotated[
        Anchor, about("The point of what it is in from which x and y go, and its own point that stands there.")
    ] = "top_left"
    x: Annotated[float, about("To the right, in heights of the picture.", minimum=-100.0, maximum=100.0, step=0.01)] = (
        0.0
    )
    y: Annotated[float, about("Down, in heights of the picture.", minimum=-100.0, maximum=100.0, step=0.01)] = 0.0
    width: Annotated[
        float, about("In heights of the picture; 0: as its text or image needs.", minimum=0.0, maximum=100.0, step=0.01)
    ] = 0.0
    height: Annotated[
        float, about("In heights of the picture; 0: as its text or image needs.", minimum=0.0, maximum=100.0, step=0.01)
    ] = 0.0
    order: Annotated[int, about("What has a higher one is drawn over what has a lower one.")] = 0
    opacity: Annotated[float, about("Of it and of all below it.", minimum=0.0, maximum=1.0, step=0.01)] = 1.0
    visible: Annotated[bool, about("Drawn at all, and all below it.")] = True
    player: Annotated[
        int, about("Only views of this player show it, and all below it; 0: all do.", minimum=0, maximum=64)
    ] = 0
    follow: Annotated[
        int, about("Entity over which it stands, wherever that is seen; none: the anchor says.", kind=Kind.ENTITY)
    ] = 0
    rise: Annotated[
        float, about("How far above that entity's origin the point is that it follows.", unit="m", step=0.1)
    ] = 0.0
    clamp: Annotated[bool, about("What it follows is shown at the picture's edge while it is not in view.")] = False


@component
class OverlayPanel(Component, frozen=True):
    """Fills the rectangle."""

    color: Annotated[Vec3, about("Colour, linear.", minimum=0.0, maximum=1.0, step=0.01, kind=Kind.COLOR)] = (
        0.01,
        0.012,
        0.016,
    )
    opacity: Annotated[float, about("Of the panel alone.", minimum=0.0, maximum=1.0, step=0.01)] = 0.7
    radius: Annotated[
        float, about("Of the corners, in heights of the picture.", minimum=0.0, maximum=10.0, step=0.005)
    ] = 0.015
    padding: Annotated[
        float,
        about("Kept free around text and image, in heights of the picture.", minimum=0.0, maximum=10.0, step=0.005),
    ] = 0.01
    border: Annotated[
        float, about("Width of its edge, in heights of the picture.", minimum=0.0, maximum=10.0, step=0.001)
    ] = 0.0
    border_color: Annotated[
        Vec3, about("Of the edge, linear.", minimum=0.0, maximum=1.0, step=0.01, kind=Kind.COLOR)
    ] = WHITE


@component
class OverlayBar(Component, frozen=True):
    """Shows a value as a share of the rectangle."""

    value: Annotated[float, about("From 0, nothing, to 1, all.", minimum=0.0, maximum=1.0, step=0.01)] = 1.0
    color: Annotated[Vec3, about("Of what is there, linear.", minimum=0.0, maximum=1.0, step=0.01, kind=Kind.COLOR)] = (
        0.2,
        0.7,
        0.25,
    )
    back_color: Annotated[Vec3, about("Of the rest, linear.", minimum=0.0, maximum=1.0, step=0.01, kind=Kind.COLOR)] = (
        0.02,
        0.02,
        0.025,
    )
    back_opacity: Annotated[float, about("Of the rest.", minimum=0.0, maximum=1.0, step=0.01)] = 0.6
    radius: Annotated[
        float, about("Of the corners, in heights of the picture.", minimum=0.0, maximum=10.0, step=0.005)
    ] = 0.01
    grows: Annotated[Literal["right", "left", "up", "down"], about("Where to, from 0 to 1.")] = "right"


@component
class OverlayImage(Component, frozen=True):
    """Shows an image in the rectangle."""

    image: Annotated[str, about("Image, sRGB; its alpha counts.", kind=Kind.ASSET)] = ""
    color: Annotated[Vec3, about("What it is multiplied with, linear.", minimum=0.0, maximum=1.0, kind=Kind.COLOR)] = (
        WHITE
    )
    opacity: Annotated[float, about("Of the image alone.", minimum=0.0, maximum=1.0, step=0.01)] = 1.0
    fit: Annotated[Literal["contain", "stretch"], about("Keeps its proportions within the rectangle, or fills it.")] = (
        "contain"
    )


@component
class OverlayText(Component, frozen=True):
    """Shows a text in the rectangle."""

    text: Annotated[
        str, about("May have several lines; {} and the like are replaced by the value, {:.2f} with two decimals.")
    ] = "Text"
    value: Annotated[float, about("The number that stands for {} in the text.", dtype="f8")] = 0.0
    size: Annotated[
        float, about("Of the letters, in heights of the picture.", minimum=0.001, maximum=2.0, step=0.005)
    ] = 0.04
    color: Annotated[Vec3, about("Colour, linear.", minimum=0.0, maximum=1.0, step=0.01, kind=Kind.COLOR)] = WHITE
    align: Annotated[Literal["left", "center", "right"], about("Where lines stand in the rectangle.")] = "left"
    outline: Annotated[
        float,
        about("Width of the edge around letters, as a share of their size.", minimum=0.0, maximum=0.25, step=0.01),
    ] = 0.06
    outline_color: Annotated[
        Vec3, about("Of the edge, linear.", minimum=0.0, maximum=1.0, step=0.01, kind=Kind.COLOR)
    ] = (0.0, 0.0, 0.0)
    shadow: Annotated[
        float, about("How far its shadow lies below, as a share of the size; 0 for none.", minimum=0.0, maximum=0.5)
    ] = 0.0
