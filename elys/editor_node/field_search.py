"""Finding fields and components by what they are called and what they are: the words behind the inspector's two search boxes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

from elys.common.components import ComponentDeclaration, FieldDeclaration
from elys.editor_node.field_values import label_of
from elys.editor_node.language import tr

GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "Place": ("Transform",),
    "Physics": ("RigidBody", "Collider", "Joint"),
    "Picture": ("MeshRenderer", "Material", "Skin", "Morph"),
    "Light and view": ("Light", "Environment", "Camera"),
    "Behaviour": (
        "Animation",
        "AnimationBlend",
        "AnimationLayer",
        "AnimationMarkers",
        "RootMotion",
        "InputMap",
        "Script",
    ),
}
OTHERS: Final = "Others"  # the group of what a project declares itself


class Offer(NamedTuple):
    """A component that can be added, and the group it is listed in."""

    group: str
    declaration: ComponentDeclaration


def shows_field(query: str, declaration: ComponentDeclaration, field: FieldDeclaration) -> bool:
    """Whether each word of a query is part of the component's name, or of the field's name or unit; an empty one shows all."""
    label = label_of(field)
    text = f"{declaration.name} {field.name} {label} {tr(label)} {field.unit}".casefold()
    return all(word in text for word in query.casefold().split())


def offers(query: str, known: Mapping[str, ComponentDeclaration], owned: Collection[str] = ()) -> tuple[Offer, ...]:
    """The components that are not `owned` and have each word of the query in their name, group or description.

    Group by group; those whose name starts with the query come first, and need no group then.
    """
    words = query.casefold().split()
    found: list[Offer] = []
    for name, declaration in known.items():
        group = group_of(name)
        text = f"{name} {group} {tr(group)} {declaration.text} {tr(declaration.text)}".casefold()
        if name not in owned and all(word in text for word in words):
            found.append(Offer(group, declaration))
    order = [*GROUPS, OTHERS]
    start = query.casefold().strip()
    return tuple(
        sorted(
            found,
            key=lambda offer: (
                bool(start) and not offer.declaration.name.casefold().startswith(start),
                order.index(offer.group),
            ),
        )
    )


def group_of(component: str) -> str:
    """The group in which a component is listed; English."""
    return next((group for group, names in GROUPS.items() if component in names), OTHERS)
