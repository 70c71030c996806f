from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.components import (
    Component,
    Kind,
    Material,
    Quat,
    RigidBody,
    Transform,
    Vec3,
    about,
    component,
    declaration_of,
    forget,
)
from elys.common.components.columns import (
    StringTable,
    column_of,
    columns_from,
    components_from,
    pack_array,
    pack_value,
    pack_values,
    unpack_value,
)
from elys.common.errors import ComponentError

single = st.floats(width=32, allow_nan=False, allow_infinity=False).map(lambda value: float(str(np.float32(value))))
units = st.sampled_from([(0.0, 0.0, 0.0, 1.0), (0.6, 0.0, 0.8, 0.0), (0.5, -0.5, 0.5, -0.5)])


@pytest.fixture(scope="module")
def sample() -> type[Component]:
    @component
    class Sample(Component):
        """One field of every kind."""

        number: Annotated[float, about("")] = 0.5
        fine: Annotated[float, about("", dtype="f8")] = 0.1
        count: Annotated[int, about("")] = 3
        flag: Annotated[bool, about("")] = True
        place: Annotated[Vec3, about("", dtype="f8")] = (0.0, 0.0, 0.0)
        turn: Annotated[Quat, about("")] = (0.0, 0.0, 0.0, 1.0)
        tint: Annotated[Vec3, about("", kind=Kind.COLOR)] = (0.1, 0.2, 0.3)
        choice: Annotated[Literal["a", "b", "c"], about("")] = "b"
        text: Annotated[str, about("")] = "hello"
        asset: Annotated[str, about("", kind=Kind.ASSET)] = ""
        other: Annotated[int, about("", kind=Kind.ENTITY)] = 0

    yield Sample
    forget(Sample)


def values() -> st.SearchStrategy[dict]:
    doubles = st.floats(allow_nan=False, allow_infinity=False)
    return st.fixed_dictionaries(
        {
            "number": single,
            "fine": doubles,
            "count": st.integers(-(2**31), 2**31 - 1),
            "flag": st.booleans(),
            "place": st.tuples(doubles, doubles, doubles),
            "turn": units,
            "tint": st.tuples(single, single, single),
            "choice": st.sampled_from("abc"),
            "text": st.text(max_size=3),
            "asset": st.sampled_from(["", "box", "blake2b:00"]),
            "other": st.integers(0, 2**32 - 1),
        }
    )


@given(st.lists(values(), max_size=6))
def test_components_survive_columns_together_and_one_by_one(sample, many):
    declaration = declaration_of(sample)
    components = [sample(**given) for given in many]
    strings = StringTable()
    columns = columns_from(declaration, components, strings)
    assert components_from(declaration, columns, strings) == components
    for field in declaration.fields:
        column = column_of(field, len(components))
        assert columns[field.name].dtype == column.dtype and columns[field.name].shape == column.shape
        for row, value in enumerate(components):
            column[row] = pack_value(declaration, field, getattr(value, field.name), strings)
            assert unpack_value(field, column[row], strings) == getattr(value, field.name)
        assert column.tobytes() == columns[field.name].tobytes()


def test_bulk_packing_forgives_what_single_packing_forgives():
    declaration, strings = declaration_of(Transform), StringTable()
    position = pack_values(declaration, declaration.field("position"), [[1, 2, 3], (4.0, 5, 6)], strings)
    np.testing.assert_array_equal(position, [[1, 2, 3], [4, 5, 6]])
    rotation = pack_values(declaration, declaration.field("rotation"), [[0, 0, 0, 2], [0, 0, 0, 1]], strings)
    np.testing.assert_array_equal(rotation, [[0, 0, 0, 1], [0, 0, 0, 1]])


@pytest.mark.parametrize(
    ("struct", "field", "wrong", "sentence"),
    [
        (RigidBody, "mass", -1.0, "RigidBody.mass must be at least 1e-06 kg, not -1"),
        (RigidBody, "mass", float("nan"), "RigidBody.mass must be a finite number"),
        (RigidBody, "mass", "heavy", "RigidBody.mass must be a number, not 'heavy'"),
        (RigidBody, "mass", True, "RigidBody.mass must be a number"),
        (RigidBody, "linear_velocity", (0.0, 1e39, 0.0), r"RigidBody.linear_velocity must fit 32 bits .*1e\+39"),
        (RigidBody, "linear_velocity", (1.0, 2.0), "RigidBody.linear_velocity must be 3 numbers"),
        (RigidBody, "linear_velocity", (1.0, 2.0, None), "RigidBody.linear_velocity must be a number"),
        (RigidBody, "linear_velocity", (10**400, 0, 0), "RigidBody.linear_velocity must be a finite number"),
        (RigidBody, "motion", "flying", "RigidBody.motion must be one of dynamic, kinematic, static"),
        (RigidBody, "motion", ["static"], "RigidBody.motion must be one of"),
        (Transform, "rotation", (0.0, 0.0, 0.0, 0.0), "Transform.rotation must be a rotation"),
        (Material, "normal_texture", 7, "Material.normal_texture must be a text, not 7"),
        (Material, "double_sided", 1, "Material.double_sided must be true or false"),
    ],
)
def test_wrong_values_are_refused_alike_alone_and_among_others(struct, field, wrong, sentence):
    declaration = declaration_of(struct)
    about_field = declaration.field(field)
    with pytest.raises(ComponentError, match=sentence):
        pack_value(declaration, about_field, wrong, StringTable())
    with pytest.raises(ComponentError, match=sentence):
        pack_values(declaration, about_field, [about_field.default, wrong], StringTable())


@pytest.mark.parametrize(
    ("struct", "field", "array"),
    [
        (RigidBody, "mass", np.array([1.0, np.nan])),
        (RigidBody, "mass", np.array([1.0, 0.0])),
        (RigidBody, "mass", np.array([1.0, 1.0, 1.0])),
        (RigidBody, "motion", np.array([0, 3])),
        (RigidBody, "motion", np.array([-1, 0])),
        (RigidBody, "motion", np.array([0.0, 1.0])),
        (RigidBody, "linear_velocity", np.array([[0.0, 1e39, 0.0]])),
        (Transform, "rotation", np.zeros((2, 4))),
        (Material, "normal_texture", np.array([0, 1])),
    ],
)
def test_wrong_arrays_are_refused(struct, field, array):
    declaration = declaration_of(struct)
    with pytest.raises(ComponentError, match=f"{struct.__name__}.{field} must be an array of"):
        pack_array(declaration, declaration.field(field), array, 2, StringTable())


def test_arrays_are_broadcast_and_cast():
    declaration = declaration_of(RigidBody)
    column = pack_array(declaration, declaration.field("linear_velocity"), np.array([1, 2, 3]), 2, StringTable())
    assert column.dtype == np.float32
    np.testing.assert_array_equal(column, [[1, 2, 3], [1, 2, 3]])


def test_string_tables_give_rows_in_order_of_first_use():
    strings = StringTable()
    assert [strings.intern(text) for text in ("b", "a", "", "b")] == [1, 2, 0, 1]
    assert strings.texts == ("", "b", "a") and len(strings) == 3
    assert StringTable(strings.texts).intern("c") == 3
    assert strings.lookup(2) == "a"
    with pytest.raises(ComponentError, match="3 rows and so no row 3"):
        strings.lookup(3)
    for wrong in ([], ["a"], ["", "a", "a"]):
        with pytest.raises(ComponentError, match="starts with the empty text"):
            StringTable(wrong)
