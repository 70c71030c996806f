"""Components: declared once, known everywhere."""

# Components are listed in the order in which they are declared: those of every scene come first.
# isort: off
from elys.common.components.builtin import (
    Camera,
    Collider,
    Environment,
    Joint,
    Light,
    Material,
    MeshRenderer,
    Morph,
    RigidBody,
    Script,
    Skin,
    Transform,
)

# isort: on
from elys.common.components.animation import (
    Animation,
    AnimationBlend,
    AnimationLayer,
    AnimationMarkers,
    RootMotion,
)
from elys.common.components.character import CameraRig, Character
from elys.common.components.curve import Curve
from elys.common.components.declaration import (
    Component,
    ComponentDeclaration,
    FieldDeclaration,
    Kind,
    Naming,
    Quat,
    Vec3,
    about,
    component,
    declaration_of,
    declarations,
    forget,
)
from elys.common.components.input_map import InputMap
from elys.common.components.overlay import Overlay, OverlayBar, OverlayImage, OverlayPanel, OverlayText
from elys.common.components.sound import SoundSource
from elys.common.components.values import check_value, component_from, laid_over, values_of

__all__ = [
    "Animation",
    "AnimationBlend",
    "AnimationLayer",
    "AnimationMarkers",
    "Camera",
    "CameraRig",
    "Character",
    "Collider",
    "Component",
    "ComponentDeclaration",
    "Curve",
    "Environment",
    "FieldDeclaration",
    "InputMap",
    "Joint",
    "Kind",
    "Light",
    "Material",
    "MeshRenderer",
    "Morph",
    "Naming",
    "Overlay",
    "OverlayBar",
    "OverlayImage",
    "OverlayPanel",
    "OverlayText",
    "Quat",
    "RigidBody",
    "RootMotion",
    "Script",
    "Skin",
    "SoundSource",
    "Transform",
    "Vec3",
    "about",
    "check_value",
    "component",
    "component_from",
    "declaration_of",
    "declarations",
    "forget",
    "laid_over",
    "values_of",
]
