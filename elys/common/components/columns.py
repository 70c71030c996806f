"""From a component's declaration to numpy columns, and values in and out of them: one row an entity, one column a field.

    kind               column                  reads back as
    FLOAT              f4 or f8  [N]           float: the shortest decimal of an f4, so that 0.1 is 0.1 again
    VEC3, QUAT, COLOR  f4 or f8  [N, 3 or 4]   tuple of such floats
    INT, BOOL, ENTITY  i4, ?, u4 [N]           int, bool, int
    CHOICE             u1        [N]           str: row of the declaration's choices
    TEXT, ASSET        i4        [N]           str: row of a StringTable
    CURVE              f4        [N, 64]       tuple of keys: all numbers of up to 16, those that are none begin at -1 s

What goes in is checked: a column never holds what its declaration forbids.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.components.curve import KEY_WIDTH, curve_of, stored_keys
from elys.common.components.decimals import FLOAT32_MAX, shortest_decimal, shortest_decimals
from elys.common.components.declaration import Component, ComponentDeclaration, FieldDeclaration, Kind
from elys.common.components.values import MOST_OF_A_CURVE, check_value, values_from, values_text
from elys.common.errors import ComponentError

Column = NDArray[Any]

_TEXTS: Final = (Kind.TEXT, Kind.ASSET)
_VECTORS: Final = (Kind.VEC3, Kind.QUAT, Kind.COLOR)
_FLOATS: Final = (Kind.FLOAT, *_VECTORS)
_NUMBER_TYPES: Final = frozenset({float, int})
_UNIT_TOLERANCE: Final = 1e-6  # as check_value's: what is of length 1 to rounding stays as it is
_STORED_UNIT_TOLERANCE: Final = 1e-3  # rotations that a simulation stored have drifted a little, and are not refused


class StringTable:
    """Every text that columns name, once, in the order of first use; row 0 is the empty text."""

    def __init__(self, texts: Iterable[str] = ("",)) -> None:
        """`texts` as `self.texts` gave them; ComponentError if they do not start with "" or repeat one."""
        self._texts = list(texts)
        self._rows = {text: row for row, text in enumerate(self._texts)}
        if self._texts[:1] != [""] or len(self._rows) != len(self._texts):
            raise ComponentError("a string table starts with the empty text and holds every text once")

    def __len__(self) -> int:
        return len(self._texts)

    @property
    def texts(self) -> tuple[str, ...]:
        """All texts by row."""
        return tuple(self._texts)

    def intern(self, text: str) -> int:
        """The row of `text`, a new one at its first use."""
        row = self._rows.setdefault(text, len(self._texts))
        if row == len(self._texts):
            self._texts.append(text)
        return row

    def lookup(self, row: int) -> str:
        """The text of a row; ComponentError if there is no such row."""
        if not 0 <= row < len(self._texts):
            raise ComponentError(f"the string table has {len(self._texts)} rows and so no row {row}")
        return self._texts[row]


def column_of(field: FieldDeclaration, capacity: int) -> Column:
    """An empty column: [capacity] or [capacity, width] zeros of the field's dtype."""
    return np.zeros((capacity, field.width) if field.width > 1 else capacity, np.dtype(field.dtype))


def pack_value(declaration: ComponentDeclaration, field: FieldDeclaration, value: Any, strings: StringTable) -> Any:
    """What to store in a row of the field's column for `value`; ComponentError if it is none the field takes."""
    checked = check_value(declaration, field, value)
    if field.kind is Kind.CHOICE:
        return field.choices.index(checked)
    if field.kind in _TEXTS:
        return strings.intern(checked)
    if field.kind is Kind.CURVE:
        return stored_keys(checked)
    if field.kind is Kind.VALUES:
        return strings.intern(values_text(checked))
    if field.dtype == "f4":
        for number in checked if field.width > 1 else (checked,):
            if abs(number) > FLOAT32_MAX:
                raise ComponentError(f"{declaration.name}.{field.name} must fit 32 bits (3.4e38), not {number:g}")
    return checked


def unpack_value(field: FieldDeclaration, stored: Any, strings: StringTable) -> Any:
    """The value that one row of the field's column, `stored = column[row]`, stands for."""
    plain = stored.tolist()
    if field.kind is Kind.CURVE:
        return curve_of(list(map(shortest_decimal, plain)))
    if field.kind in _FLOATS:
        if field.dtype != "f4":
            return tuple(plain) if field.width > 1 else plain
        return tuple(map(shortest_decimal, plain)) if field.width > 1 else shortest_decimal(plain)
    if field.kind is Kind.CHOICE:
        return field.choices[plain]
    if field.kind is Kind.VALUES:
        return values_from(strings.lookup(plain))
    return strings.lookup(plain) if field.kind in _TEXTS else plain


def pack_values(
    declaration: ComponentDeclaration, field: FieldDeclaration, values: Sequence[Any], strings: StringTable
) -> Column:
    """A full column from one value a row, checked all at once; ComponentError as `pack_value` raises it."""
    column = _packed_together(field, values, strings)
    if column is not None:
        return column
    # Something is unusual: the careful way either takes it or says what is wrong.
    column = column_of(field, len(values))
    for row, value in enumerate(values):
        column[row] = pack_value(declaration, field, value, strings)
    return column


def pack_array(
    declaration: ComponentDeclaration, field: FieldDeclaration, array: NDArray[Any], count: int, strings: StringTable
) -> Column:
    """A full column from an array of stored values (choices and texts as their rows), broadcast to `count` rows.

    Raises:
        ComponentError: the array has another shape, or holds what the field does not take.
    """
    where = f"{declaration.name}.{field.name}"
    shape = (count, field.width) if field.width > 1 else (count,)
    try:
        rows = np.broadcast_to(array, shape)
    except ValueError:
        raise ComponentError(f"{where} must be an array of shape {shape}, not {np.shape(array)}") from None
    limits = {Kind.CHOICE: len(field.choices), **dict.fromkeys((*_TEXTS, Kind.VALUES), len(strings))}
    if field.kind in limits:
        fits = np.issubdtype(array.dtype, np.integer) and bool(np.all((array >= 0) & (array < limits[field.kind])))
        expected = f"rows from 0 to {limits[field.kind] - 1}"
    elif field.kind is Kind.CURVE:
        fits, expected = _takes_curves(field, rows), "curves"
    else:
        fits = _takes(field, array, unit_tolerance=_STORED_UNIT_TOLERANCE)
        expected = "finite numbers in its range" + (" of length 1" if field.kind is Kind.QUAT else "")
    if not fits:
        raise ComponentError(f"{where} must be an array of {expected}")
    return np.ascontiguousarray(rows, np.dtype(field.dtype))


def unpack_values(field: FieldDeclaration, column: Column, strings: StringTable) -> list[Any]:
    """The values of all rows of a column."""
    if field.kind is Kind.CURVE:
        return list(map(curve_of, shortest_decimals(column).tolist()))
    if field.kind in _FLOATS and field.dtype == "f4":
        column = shortest_decimals(column)
    plain: list[Any] = column.tolist()
    if field.kind is Kind.CHOICE:
        return [field.choices[row] for row in plain]
    if field.kind in _TEXTS:
        return [strings.lookup(row) for row in plain]
    if field.kind is Kind.VALUES:
        return [values_from(strings.lookup(row)) for row in plain]
    return list(map(tuple, plain)) if field.width > 1 else plain


def columns_from(
    declaration: ComponentDeclaration, components: Sequence[Component], strings: StringTable
) -> dict[str, Column]:
    """A column per field, with a row per component."""
    return {
        field.name: pack_values(declaration, field, [getattr(value, field.name) for value in components], strings)
        for field in declaration.fields
    }


def components_from(
    declaration: ComponentDeclaration, columns: Mapping[str, Column], strings: StringTable
) -> list[Component]:
    """A component per row of columns as `columns_from` gives them."""
    names = [field.name for field in declaration.fields]
    values = [unpack_values(field, columns[field.name], strings) for field in declaration.fields]
    return [declaration.struct(**dict(zip(names, row, strict=True))) for row in zip(*values, strict=True)]


def _packed_together(field: FieldDeclaration, values: Sequence[Any], strings: StringTable) -> Column | None:
    """The column for values that are all of the plain, expected types; None if any is not."""
    types = set(map(type, values))
    match field.kind:
        case Kind.CHOICE if types <= {str}:
            rows = {choice: row for row, choice in enumerate(field.choices)}
            return np.array([rows[v] for v in values], field.dtype) if rows.keys() >= set(values) else None
        case Kind.TEXT | Kind.ASSET if types <= {str}:
            return np.array([strings.intern(value) for value in values], field.dtype)
        case Kind.BOOL if types <= {bool}:
            return np.array(values, field.dtype)
        case Kind.CURVE if all(value == () for value in values):
            return np.tile(np.array(stored_keys(()), field.dtype), (len(values), 1))
        case Kind.FLOAT if types <= _NUMBER_TYPES:
            return _packed_numbers(field, values)
        case Kind.VEC3 | Kind.QUAT | Kind.COLOR if types <= {tuple, list} and set(map(len, values)) <= {field.width}:
            elements = list(chain.from_iterable(values))
            return _packed_numbers(field, elements) if set(map(type, elements)) <= _NUMBER_TYPES else None
        case _:
            return None


def _packed_numbers(field: FieldDeclaration, numbers: Sequence[float]) -> Column | None:
    try:
        array = np.array(numbers, np.float64)
    except OverflowError:
        return None
    array = array.reshape(-1, field.width) if field.width > 1 else array
    return array.astype(field.dtype) if _takes(field, array, unit_tolerance=_UNIT_TOLERANCE) else None


def _takes(field: FieldDeclaration, array: NDArray[Any], *, unit_tolerance: float) -> bool:
    """Whether all numbers are finite, in the field's range and, in a rotation, of length 1."""
    if not array.size:
        return True
    lowest, highest = float(array.min()), float(array.max())
    if not (np.isfinite(lowest) and np.isfinite(highest)):
        return False
    if field.dtype == "f4" and max(-lowest, highest) > FLOAT32_MAX:
        return False
    # The bounds as the column holds them: 1e-4 in 32 bits is less than 1e-4.
    if field.minimum is not None and lowest < np.dtype(field.dtype).type(field.minimum):
        return False
    if field.maximum is not None and highest > np.dtype(field.dtype).type(field.maximum):
        return False
    if field.kind is not Kind.QUAT:
        return True
    lengths = np.sqrt(np.einsum("...i,...i->...", array, array))
    return bool(np.all(np.abs(lengths - 1.0) <= unit_tolerance))


def _takes_curves(field: FieldDeclaration, array: NDArray[Any]) -> bool:
    """Whether rows of stored keys (N, keys * 4) are curves: numbers, times that rise, and none behind one that is none."""
    keys = np.asarray(array, np.float32).reshape(len(array), field.width // KEY_WIDTH, KEY_WIDTH)
    time, value = keys[..., 0], keys[..., 1]
    is_key = time >= 0.0
    rises = ~is_key[:, 1:] | (is_key[:, :-1] & (time[:, 1:] > time[:, :-1]))
    fits = np.all(np.abs(keys) <= MOST_OF_A_CURVE) and rises.all()  # NaN is no number that is less
    if field.minimum is not None:
        fits &= np.all(value[is_key] >= np.float32(field.minimum))
    if field.maximum is not None:
        fits &= np.all(value[is_key] <= np.float32(field.maximum))
    return bool(fits)
