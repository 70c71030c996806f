"""The components of movement by clips; docs/animation.md says how they work together."""

from __future__ import annotations

from typing import Annotated, Literal

from elys.common.components.declaration import Component, Kind, Naming, about, component


@component
class Animation(Component, frozen=True):
    """Plays a clip on the entities below it: what the clip names moves as the clip says, at the time of the simulation."""

    clips: Annotated[str, about("The clips there are, as model.glb#clips.", kind=Kind.ASSET)] = ""
    clip: Annotated[str, about("Name of the clip that is played; empty for the first.", names=Naming.CLIP)] = ""
    playing: Annotated[bool, about("Whether time goes on.")] = True
    time: Annotated[float, about("Where it is in the clip.", unit="s", minimum=0.0, step=0.05, dtype="f8")] = 0.0
    speed: Annotated[float, about("How fast; below 0 backwards.", minimum=-1000.0, maximum=1000.0, step=0.05)] = 1.0
    loop: Annotated[
        Literal["repeat", "ping_pong", "once"], about("Starts again, goes to and fro, or stays at the end.")
    ] = "repeat"
    fade: Annotated[
        float,
        about(
            "How long another clip, or other weights, take to come in.", unit="s", minimum=0.0, maximum=60.0, step=0.05
        ),
    ] = 0.0
    passes: Annotated[int, about("How often it has come to an end since it began.", minimum=0)] = 0


@component
class AnimationBlend(Component, frozen=True):
    """Several clips at once, in step, instead of the one of the Animation beside it, while that names none."""

    mix: Annotated[str, about("Clips with numbers, as Idle 0, Walk 1.4, Run 4.", names=Naming.MIX)] = ""
    by: Annotated[
        Literal["weight", "value"],
        about("What the numbers are: how much of each clip there is, or at which value it is all there is."),
    ] = "weight"
    value: Annotated[float, about("Of a mix by value: where it is, between the numbers of its clips.", step=0.05)] = 0.0


@component
class AnimationLayer(Component, frozen=True):
    """Lays what the Animation beside it plays over what another entity plays."""

    on: Annotated[int, about("The entity with that Animation; none for the parent.", kind=Kind.ENTITY)] = 0
    order: Annotated[int, about("Of several layers the lower ones come first.")] = 0
    mode: Annotated[
        Literal["replace", "add"],
        about("Takes the place of what is below, or adds how the clip differs from its beginning."),
    ] = "replace"
    weight: Annotated[float, about("How much of it there is.", minimum=0.0, maximum=1.0, step=0.01)] = 1.0
    mask: Annotated[str, about("Names of those it moves, with all below them, as Spine, Head; empty for all.")] = ""


@component
class AnimationMarkers(Component, frozen=True):
    """Instants of clips that are told as events when the Animation beside it comes by."""

    markers: Annotated[
        str, about("By clip names with times in s, as Walk: step 0.1 0.6; Jump: land 0.8.", names=Naming.MARKERS)
    ] = ""


@component
class RootMotion(Component, frozen=True):
    """Lets the way that a clip moves one of its nodes move the entity that plays it instead."""

    node: Annotated[str, about("Which one, by names from below the entity, as Armature/Hips.")] = ""
    turn: Annotated[bool, about("Turns about the vertical as well.")] = False
    height: Annotated[bool, about("Goes up and down as well.")] = False
    mode: Annotated[
        Literal["move", "tell"], about("Moves the entity, or only tells scripts how far it would have gone.")
    ] = "move"
