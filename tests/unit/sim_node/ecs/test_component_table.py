from __future__ import annotations

import numpy as np
import pytest

from elys.common.components import RigidBody, declaration_of
from elys.common.errors import ComponentError
from elys.sim_node.ecs.columns import ComponentTable

DEFAULTS = {field.name: 0 for field in declaration_of(RigidBody).fields}


def filled(count: int) -> ComponentTable:
    """A table in which entity n has mass n."""
    table = ComponentTable(declaration_of(RigidBody), count + 1)
    entities = np.arange(1, count + 1, dtype=np.uint32)
    table.insert(entities, {**DEFAULTS, "mass": entities})
    return table


def assert_consistent(table: ComponentTable, entities: set[int]) -> None:
    assert set(table.entities.tolist()) == entities and table.count == len(entities)
    np.testing.assert_array_equal(table.rows(table.entities), np.arange(table.count))
    assert np.count_nonzero(table.row_of >= 0) == table.count
    np.testing.assert_array_equal(table.column("mass"), table.entities.astype(np.float32))


@pytest.mark.parametrize(
    "removed", [[1], [5], [2, 5], [5, 4, 3], [1, 2, 3, 4, 5], list(range(1, 41, 2)), list(range(1, 51))]
)
def test_rows_stay_packed_whatever_is_removed(removed):
    table = filled(50)
    table.remove(np.array(removed))
    assert_consistent(table, set(range(1, 51)) - set(removed))


def test_removing_what_has_no_row_changes_nothing():
    table = filled(3)
    version = table.structure_version
    table.remove(np.array([0, 2]))
    assert_consistent(table, {1, 3})
    table.remove(np.array([2]))
    assert table.structure_version == version + 1


def test_columns_are_views_to_write_into():
    table = filled(3)
    table.column("linear_velocity")[1] = (1, 2, 3)
    assert table.read(1)["linear_velocity"].tolist() == [1, 2, 3]
    table.write(0, {"mass": 9.0})
    assert table.columns()["mass"].tolist() == [9, 2, 3]
    with pytest.raises(ComponentError, match="RigidBody has no field 'weight'; it has motion, mass"):
        table.column("weight")


def test_tables_grow_with_the_world():
    table = filled(2)
    table.reserve_entities(100)
    table.insert(np.array([99], np.uint32), {**DEFAULTS, "mass": 99.0})
    assert_consistent(table, {1, 2, 99})
