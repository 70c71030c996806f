"""What a scene is before it lives: the document as it stands in a file, and the flat records it is made of.

A SceneDocument nests (children stand inside their parents, prefabs are named), so that its file reads and diffs well. Expanded,
it is a list of EntityRecords, parents first, in which every reference is resolved: what the simulation loads and what a
Spawn command carries.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

import msgspec
from msgspec import Meta

from elys.common.scene_picture import PictureSettings

SCENE_VERSION: Final = 1

# Both bounds are given wherever one is needed: they are what refuses NaN on the bus.
Acceleration = Annotated[float, Meta(ge=-1e6, le=1e6)]
Radiance = Annotated[float, Meta(ge=0.0, le=1e6)]
Coordinate = Annotated[float, Meta(ge=-1e9, le=1e9)]

ComponentValues = dict[str, dict[str, Any]]  # component name -> field name -> plain JSON value
ComponentChanges = dict[str, dict[str, Any] | None]  # the same over a prefab's; null takes the component away


class AttractorSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A point that attracts all bodies, by their gravity_scale: a = strength r / (r^2 + softening^2)^(3/2)."""

    position: Annotated[
        tuple[Coordinate, Coordinate, Coordinate], Meta(description="Place in the world.", extra={"unit": "m"})
    ] = (0.0, 0.0, 0.0)
    strength: Annotated[
        float,
        Meta(
            ge=-1e30,
            le=1e30,
            description="Surface gravity times the squared radius of a planet; negative repels.",
            extra={"unit": "m3/s2"},
        ),
    ] = 0.0
    softening: Annotated[
        float,
        Meta(ge=0.0, le=1e9, description="Within about this distance the pull fades.", extra={"unit": "m"}),
    ] = 0.0


class Calibration(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Why a scene is simulated as its settings say: what `elys calibrate` measured when it wrote them."""

    budget: Annotated[float, Meta(gt=0.0, description="Error that was asked for, as a share of what is typical.")]
    error: Annotated[float, Meta(ge=0.0, description="Error that was measured.")]
    dominant: Annotated[str, Meta(description="The observable that makes it.")]
    observables: Annotated[tuple[str, ...], Meta(description="All that were judged.")]
    duration: Annotated[float, Meta(gt=0.0, description="Simulated time.", extra={"unit": "s"})]
    reference: Annotated[str, Meta(description="What it was compared with.")]
    cost: Annotated[float, Meta(ge=0.0, description="Processor time for a second.", extra={"unit": "ms"})]
    cost_before: Annotated[float, Meta(ge=0.0, description="The same of the settings before.", extra={"unit": "ms"})]
    error_before: Annotated[float, Meta(ge=0.0, description="The error of the settings before.")]
    date: Annotated[str, Meta(description="Of the measurement.")]
    version: Annotated[str, Meta(description="Of ELYS.")]
    processor: Annotated[str, Meta(description="That the times were measured on.")]


class SceneSettings(msgspec.Struct, frozen=True, kw_only=True):
    """What holds for the whole scene."""

    gravity: Annotated[
        tuple[Acceleration, Acceleration, Acceleration],
        Meta(description="Acceleration of everything that falls.", extra={"unit": "m/s2"}),
    ] = (0.0, -9.81, 0.0)
    attractors: Annotated[
        tuple[AttractorSettings, ...], Meta(max_length=16, description="Points that attract, beside gravity.")
    ] = ()
    tick_rate: Annotated[
        int, Meta(ge=1, le=10_000, description="Ticks in a second of simulation.", extra={"unit": "Hz"})
    ] = 60
    substeps: Annotated[int, Meta(ge=1, le=64, description="Steps of the contact solver in a tick.")] = 8
    strengths: Annotated[
        int,
        Meta(
            ge=1,
            le=8,
            description="How often substeps may be doubled for islands that are high or uneven in mass, that and one.",
        ),
    ] = 5
    calibration: Annotated[
        Calibration | None, Meta(description="Evidence for tick_rate, substeps and strengths, by `elys calibrate`.")
    ] = None
    on_problem: Annotated[
        Literal["continue", "pause"], Meta(description="Whether time stops when physics finds something to be wrong.")
    ] = "continue"
    background: Annotated[
        tuple[Radiance, Radiance, Radiance], Meta(description="Colour behind everything, linear.")
    ] = (0.3, 0.42, 0.6)
    ambient: Annotated[
        tuple[Radiance, Radiance, Radiance],
        Meta(description="Light that reaches every surface from everywhere, linear radiance."),
    ] = (0.25, 0.27, 0.3)
    picture: Annotated[PictureSettings, Meta(description="How light becomes a picture, and effects.")] = (
        PictureSettings()
    )


class EntityNode(msgspec.Struct, kw_only=True):
    """An entity in a scene file, with its children.

    With `prefab` (another scene file or a glTF model, relative to this file) the prefab's root takes this place: `components`
    are laid over the root's and `overrides` over those of its descendants, by path of names ("Arm/Hand").
    """

    name: str = ""
    enabled: bool = True
    prefab: str = ""
    components: ComponentChanges = {}
    overrides: dict[str, ComponentChanges] = {}
    children: list[EntityNode] = []


class SceneDocument(msgspec.Struct, kw_only=True):
    """A scene file's content. A prefab is a document with exactly one root entity."""

    name: str = ""
    settings: SceneSettings = SceneSettings()
    entities: list[EntityNode] = []


class EntityRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One entity of an expanded scene.

    `parent` is the index of the parent within the same list (-1: a root); parents stand before their children.
    `components` need to hold only what differs from the defaults. `prefab` is the file, by
    absolute path, of which an instance's root came. `references` says which ENTITY fields, as "Joint.other", name entities of
    the same list, by index: those have no ids yet. In `components` such a field may name one that lives, by its id.
    """

    name: str
    parent: int = -1
    enabled: bool = True
    components: ComponentValues = {}
    prefab: str = ""
    references: dict[str, int] = {}
