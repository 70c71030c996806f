"""Components: declared once, known everywhere."""

from elys.common.components.builtin import (
    Camera,
    Collider,
    Joint,
    Light,
    Material,
    MeshRenderer,
    RigidBody,
    Script,
    Transform,
)
from elys.common.components.declaration import (
    Component,
    ComponentDeclaration,
    FieldDeclaration,
    Kind,
    Quat,
    Vec3,
    about,
    component,
    declaration_of,
    declarations,
    forget,
)
from elys.common.components.values import check_value, component_from, values_of

__all__ = [
    "Camera",
    "Collider",
    "Component",
    "ComponentDeclaration",
    "FieldDeclaration",
    "Joint",
    "Kind",
    "Light",
    "Material",
    "MeshRenderer",
    "Quat",
    "RigidBody",
    "Script",
    "Transform",
    "Vec3",
    "about",
    "check_value",
    "component",
    "component_from",
    "declaration_of",
    "declarations",
    "forget",
    "values_of",
]
