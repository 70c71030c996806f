"""The JSON Schema says of scene files what reading them says."""

from __future__ import annotations

from typing import Annotated

import pytest

from elys.common.components import Component, Vec3, about, component, declarations, forget
from elys.common.components.schema import component_schema, scene_schema
from elys.common.errors import ComponentError
from elys.common.scene import SceneSettings


def test_every_component_and_field_is_in_the_schema() -> None:
    definitions = scene_schema()["$defs"]
    for name, declaration in declarations().items():
        assert list(definitions[name]["properties"]) == [field.name for field in declaration.fields]
        assert definitions[name]["additionalProperties"] is False
        assert definitions["components"]["properties"][name] == {"$ref": f"#/$defs/{name}"}
    assert list(definitions["settings"]["properties"]) == list(SceneSettings.__struct_fields__)


def test_a_field_tells_range_unit_choices_default_and_what_it_is() -> None:
    mass = component_schema("RigidBody")["properties"]["mass"]
    assert mass["type"] == "number"
    assert (mass["minimum"], mass["maximum"], mass["default"], mass["unit"]) == (1e-6, 1e9, 1.0, "kg")
    assert mass["description"] == "Mass of the whole body. [kg]"
    collider = component_schema("Collider")["properties"]
    assert collider["shape"]["enum"][:2] == ["box", "sphere"]
    assert collider["size"]["items"] == {"type": "number", "minimum": 1e-4}
    assert (collider["size"]["minItems"], collider["size"]["maxItems"]) == (3, 3)
    assert component_schema("Transform")["properties"]["rotation"]["default"] == [0.0, 0.0, 0.0, 1.0]
    assert component_schema("Camera")["properties"]["priority"]["type"] == "integer"
    assert component_schema("Light")["properties"]["cast_shadows"]["type"] == "boolean"
    assert component_schema("MeshRenderer")["properties"]["mesh"]["type"] == "string"


def test_all_references_lead_somewhere() -> None:
    schema = scene_schema()
    waiting, found = [schema], 0
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            if "$ref" in part:
                found += 1
                assert part["$ref"].removeprefix("#/$defs/") in schema["$defs"]
            waiting.extend(part.values())
        elif isinstance(part, list):
            waiting.extend(part)
    assert found > 10


def test_a_component_declared_in_one_place_appears() -> None:
    @component
    class Spring(Component):
        """Pulls its entity towards an anchor."""

        stiffness: Annotated[float, about("How hard it pulls.", unit="N/m", minimum=0.0)] = 100.0
        anchor: Annotated[Vec3, about("Where to.", unit="m")] = (0.0, 0.0, 0.0)

    try:
        assert scene_schema()["$defs"]["Spring"]["properties"]["stiffness"]["minimum"] == 0.0
        assert component_schema("Spring")["description"] == "Pulls its entity towards an anchor."
    finally:
        forget(Spring)
    assert "Spring" not in scene_schema()["$defs"]


def test_an_unknown_component_is_named() -> None:
    with pytest.raises(ComponentError, match="no component 'Zebra'"):
        component_schema("Zebra")
