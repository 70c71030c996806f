"""Between a Snapshot's packed columns and component values, whole columns at a time."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.scene import ComponentColumns, FieldColumn, Snapshot
from elys.common.components import Component, ComponentDeclaration, FieldDeclaration, declaration_of, declarations
from elys.common.components.columns import StringTable, columns_from, components_from, pack_array, pack_values
from elys.common.errors import ComponentError, MessageError

_log = logging.getLogger(__name__)
_reported: set[str] = set()


def entity_column(data: bytes, count: int, what: str) -> NDArray[np.uint32]:
    """`count` u32; MessageError if `data` holds another number."""
    if len(data) != 4 * count:
        raise MessageError(f"a snapshot of {count} entities has {4 * count} bytes of {what}, this one {len(data)}")
    return np.frombuffer(data, "<u4")


def check_tree(snapshot: Snapshot) -> tuple[list[int], list[int], list[bool]]:
    """Ids, parents and switches of a snapshot's entities.

    Raises:
        MessageError: lengths differ, an id is 0 or twice there, or a parent does not stand before its child.
    """
    count = len(snapshot.names)
    if len(snapshot.prefabs) != count or len(snapshot.enabled) != count:
        raise MessageError("a snapshot's names, prefabs and switches are not of one length")
    entities = entity_column(snapshot.entities, count, "ids").tolist()
    parents = entity_column(snapshot.parents, count, "parents").tolist()
    known = {0}
    for entity, parent in zip(entities, parents, strict=True):
        if entity in known:
            raise MessageError(f"entity {entity} is no new id in this snapshot")
        if parent not in known:
            raise MessageError(f"entity {entity} stands before its parent {parent} in this snapshot")
        known.add(entity)
    return entities, parents, [byte != 0 for byte in snapshot.enabled]


def decode_components(snapshot: Snapshot) -> list[tuple[str, list[int], list[Component]]]:
    """Per component its name, entities and values. Components that this side does not know are left out, said once.

    Raises:
        MessageError: a column is not what the component's declaration says.
    """
    try:
        strings = StringTable(snapshot.strings)
        known = [packed for packed in snapshot.components if is_known(packed.component)]
        return [_decode(packed, strings) for packed in known]
    except ComponentError as error:
        raise MessageError(f"this snapshot is wrong: {error}") from error


def encode_components(
    values: Mapping[str, tuple[Sequence[int], Sequence[Component]]], strings: StringTable
) -> tuple[ComponentColumns, ...]:
    """The inverse: columns of every component that anyone has, in the order of the declarations."""
    return tuple(
        pack_columns(declaration, *values[name], strings)
        for name, declaration in declarations().items()
        if values.get(name, ((), ()))[0]
    )


def pack_columns(
    declaration: ComponentDeclaration, entities: Sequence[int], components: Sequence[Component], strings: StringTable
) -> ComponentColumns:
    """One component's values as they travel."""
    return component_columns(declaration, np.asarray(entities, "<u4"), columns_from(declaration, components, strings))


def component_columns(
    declaration: ComponentDeclaration, entities: NDArray[Any], columns: Mapping[str, NDArray[Any]]
) -> ComponentColumns:
    """One component's columns as they travel: `entities` [N], a column [N] or [N, width] per field that is told."""
    return ComponentColumns(
        component=declaration.name,
        entities=np.ascontiguousarray(entities, "<u4").tobytes(),
        fields=tuple(_field_column(field, columns[field.name]) for field in declaration.told),
    )


def _field_column(field: FieldDeclaration, column: NDArray[Any]) -> FieldColumn:
    wire = np.ascontiguousarray(column, np.dtype(field.dtype).newbyteorder("<"))
    return FieldColumn(name=field.name, dtype=field.dtype, width=field.width, data=wire.tobytes())


def is_known(component: str) -> bool:
    """Whether this program declares the component; what it does not is left out of its mirrors, said once."""
    if component in declarations():
        return True
    if component not in _reported:
        _reported.add(component)
        _log.warning("the scene has a component '%s' that this program does not declare: it is left out", component)
    return False


def unpack_columns(
    packed: ComponentColumns, strings: StringTable
) -> tuple[NDArray[np.uint32], dict[str, NDArray[Any]]]:
    """The inverse of `component_columns`: entities [N] and a column [N] or [N, width] per field, texts as rows of `strings`.

    Raises:
        MessageError: a column is not what the component's declaration says.
        ComponentError: there is no such component, or it does not take a value.
    """
    declaration = declaration_of(packed.component)
    if len(packed.entities) % 4:
        raise MessageError(f"the ids of {packed.component} are {len(packed.entities)} bytes, not a multiple of 4")
    entities = np.frombuffer(packed.entities, "<u4")
    fields = {field.name: field for field in packed.fields}
    if len(fields) != len(packed.fields) or not fields.keys() <= {field.name for field in declaration.fields}:
        raise MessageError(f"{packed.component} has other fields here ({', '.join(fields)}) than where it came from")
    columns = {
        field.name: _column(declaration, field, fields[field.name], len(entities), strings)
        if field.name in fields
        # Memory, which does not travel, or a recording of before the component had this field: all have its default.
        else pack_values(declaration, field, [field.default] * len(entities), strings)
        for field in declaration.fields
    }
    return entities, columns


def _decode(packed: ComponentColumns, strings: StringTable) -> tuple[str, list[int], list[Component]]:
    entities, columns = unpack_columns(packed, strings)
    components = _shared_components(declaration_of(packed.component), columns, len(entities), strings)
    return packed.component, entities.tolist(), components


def _shared_components(
    declaration: ComponentDeclaration, columns: Mapping[str, NDArray[Any]], count: int, strings: StringTable
) -> list[Component]:
    """A component per row; equal rows share one value, which they may, as it never changes. Most of a scene is alike."""
    if not declaration.fields:
        return [declaration.struct()] * count
    widths = [(field.name, columns[field.name].dtype, (field.width,)) for field in declaration.fields]
    records = np.zeros(count, np.dtype(widths))
    for field in declaration.fields:
        records[field.name] = columns[field.name].reshape(count, field.width)
    rows: list[bytes] = records.view(f"V{records.dtype.itemsize}").tolist()
    first_of: dict[bytes, int] = {}
    for index, row in enumerate(rows):
        first_of.setdefault(row, index)
    firsts = np.fromiter(first_of.values(), np.intp, len(first_of))
    distinct = components_from(declaration, {name: column[firsts] for name, column in columns.items()}, strings)
    component_of = dict(zip(first_of, distinct, strict=True))
    return [component_of[row] for row in rows]


def _column(
    declaration: ComponentDeclaration, field: FieldDeclaration, packed: FieldColumn, count: int, strings: StringTable
) -> NDArray[Any]:
    wire = np.dtype(field.dtype).newbyteorder("<")
    expected = count * field.width * wire.itemsize
    if packed.dtype != field.dtype or packed.width != field.width or len(packed.data) != expected:
        raise MessageError(
            f"{declaration.name}.{field.name} should be {count} rows of {field.width} {field.dtype}, not "
            f"{len(packed.data)} bytes of {packed.width} {packed.dtype}"
        )
    array = np.frombuffer(packed.data, wire)
    shaped = array.reshape(count, field.width) if field.width > 1 else array
    return pack_array(declaration, field, shaped, count, strings)
