"""Eight float32 numbers in one register: the value type that the contact solver calculates with.

Numba's own loops are not turned into vectors reliably, so the vectors are explicit: `F32x8` is LLVM's <8 x float>, `Mask8` its
<8 x i1>, both as numba value types. A table is read and written through its flat float32 view: `gather_rows` takes eight
floats out of each of eight rows and hands them over as eight vectors, one for each of the eight floats.

No operation may be contracted or reordered: the same bits must come out on every processor, whatever its registers are wide.
With the compiler switched off (NUMBA_DISABLE_JIT) the same names work on numpy arrays of eight numbers.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model

LANES = 8

_FLOATS = ir.VectorType(ir.FloatType(), LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)
_INT32 = ir.IntType(32)
_INT64 = ir.IntType(64)


class F32x8Type(types.Type):
    """<8 x float>."""

    def __init__(self) -> None:
        super().__init__(name="F32x8")


class Mask8Type(types.Type):
    """<8 x i1>."""

    def __init__(self) -> None:
        super().__init__(name="Mask8")


f32x8 = F32x8Type()
mask8 = Mask8Type()
_eight = types.UniTuple(f32x8, LANES)


@register_model(F32x8Type)
class _F32x8Model(PrimitiveModel):
    def __init__(self, manager: Any, front_end_type: Any) -> None:
        super().__init__(manager, front_end_type, _FLOATS)


@register_model(Mask8Type)
class _Mask8Model(PrimitiveModel):
    def __init__(self, manager: Any, front_end_type: Any) -> None:
        super().__init__(manager, front_end_type, _BITS)


def _allow(operation: Any, operands: tuple[types.Type, ...], result: types.Type, emit: Callable[..., Any]) -> None:
    """Teaches the compiler one operator on vectors; `emit` (builder, *values) writes its instruction."""

    @infer_global(operation)
    class _Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            return signature(result, *operands) if args == operands else None

    @lower_builtin(operation, *operands)
    def _lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit(builder, *args)


for _operations, _name in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
    ((operator.truediv, operator.itruediv), "fdiv"),
):
    for _operation in _operations:
        _allow(_operation, (f32x8, f32x8), f32x8, lambda builder, a, b, name=_name: getattr(builder, name)(a, b))
for _operation, _name in ((operator.lt, "<"), (operator.gt, ">"), (operator.le, "<="), (operator.ge, ">=")):
    _allow(_operation, (f32x8, f32x8), mask8, lambda builder, a, b, name=_name: builder.fcmp_ordered(name, a, b))
_allow(operator.neg, (f32x8,), f32x8, lambda builder, a: builder.fneg(a))
_allow(operator.and_, (mask8, mask8), mask8, lambda builder, a, b: builder.and_(a, b))
_allow(operator.or_, (mask8, mask8), mask8, lambda builder, a, b: builder.or_(a, b))


def _place(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    return builder.gep(context.make_array(array_type)(context, builder, array).data, [index])


def _load(builder: Any, place: Any) -> Any:
    vector = builder.load(builder.bitcast(place, _FLOATS.as_pointer()))
    vector.align = 4
    return vector


def _store(builder: Any, vector: Any, place: Any) -> None:
    builder.store(vector, builder.bitcast(place, _FLOATS.as_pointer())).align = 4


def _shuffled(builder: Any, a: Any, b: Any, lanes: list[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_INT32, LANES), lanes))


_FOURS = ([0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15])


def _transposed(builder: Any, rows: list[Any]) -> list[Any]:
    """An 8 x 8 transpose in three rounds of shuffles: pairs, fours, halves."""
    pairs = []
    for k in range(0, LANES, 2):
        pairs.append(_shuffled(builder, rows[k], rows[k + 1], [0, 8, 1, 9, 4, 12, 5, 13]))
        pairs.append(_shuffled(builder, rows[k], rows[k + 1], [2, 10, 3, 11, 6, 14, 7, 15]))
    fours = []
    for k in (0, 4):
        for low in (0, 1):
            first, second = pairs[k + low], pairs[k + low + 2]
            fours += [_shuffled(builder, first, second, lanes) for lanes in _FOURS]
    low_half, high_half = [0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 12, 13, 14, 15]
    return [_shuffled(builder, fours[k], fours[k + 4], half) for half in (low_half, high_half) for k in range(4)]


def _row_places(context: Any, builder: Any, sig: Any, args: Any) -> list[Any]:
    """Pointers to float `offset` of rows indices[first : first + 8] of a flat table."""
    table, indices, first, stride, offset = args[:5]
    as_word = [
        context.cast(builder, value, kind, types.intp) for value, kind in zip(args[2:5], sig.args[2:5], strict=True)
    ]
    first, stride, offset = as_word
    index_place = _place(context, builder, sig.args[1], indices, first)
    data = context.make_array(sig.args[0])(context, builder, table).data
    places = []
    for lane in range(LANES):
        row = builder.sext(builder.load(builder.gep(index_place, [ir.Constant(_INT32, lane)])), _INT64)
        places.append(builder.gep(data, [builder.add(builder.mul(row, stride), offset)]))
    return places


@intrinsic
def splat(typingctx: Any, x: Any) -> Any:
    """Eight times the same number, rounded to float32."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        number = context.cast(builder, args[0], sig.args[0], types.float32)
        undefined = ir.Constant(_FLOATS, ir.Undefined)
        return _shuffled(
            builder, builder.insert_element(undefined, number, ir.Constant(_INT32, 0)), undefined, [0] * LANES
        )

    return f32x8(x), emit


@intrinsic
def load(typingctx: Any, array: Any, index: Any) -> Any:
    """array[index : index + 8] of a flat float32 array."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = context.cast(builder, args[1], sig.args[1], types.intp)
        return _load(builder, _place(context, builder, sig.args[0], args[0], at))

    return f32x8(array, index), emit


@intrinsic
def store(typingctx: Any, array: Any, index: Any, vector: Any) -> Any:
    """array[index : index + 8] = vector."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = context.cast(builder, args[1], sig.args[1], types.intp)
        _store(builder, args[2], _place(context, builder, sig.args[0], args[0], at))
        return context.get_dummy_value()

    return types.none(array, index, vector), emit


@intrinsic
def square_root(typingctx: Any, a: Any) -> Any:
    """The correctly rounded square root of each lane."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_FLOATS, [_FLOATS]), f"llvm.sqrt.v{LANES}f32"
        )
        return builder.call(function, args)

    return f32x8(a), emit


@intrinsic
def where(typingctx: Any, mask: Any, a: Any, b: Any) -> Any:
    """Lanes of a where the mask is set, of b elsewhere."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(*args)

    return f32x8(mask, a, b), emit


def _chosen(comparison: str) -> Any:
    def typed(typingctx: Any, a: Any, b: Any) -> Any:
        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.select(builder.fcmp_ordered(comparison, args[0], args[1]), args[0], args[1])

        return f32x8(a, b), emit

    return typed


larger = intrinsic(_chosen(">"))  # of each two lanes; the second where one is not a number
smaller = intrinsic(_chosen("<"))


@intrinsic
def bits_of(typingctx: Any, mask: Any) -> Any:
    """The lanes of a mask as bits of a number, lane 0 the lowest."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), _INT64)

    return types.int64(mask), emit


@intrinsic
def lowest_bit(typingctx: Any, bits: Any) -> Any:
    """The place of the lowest bit that is set in a number above 0."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(bits), emit


@intrinsic
def gather_rows(typingctx: Any, table: Any, indices: Any, first: Any, stride: Any, offset: Any) -> Any:
    """Floats offset..offset + 8 of eight rows of a flat table, as eight vectors: one for each float, a lane for each row.

    The rows are indices[first : first + 8] (int32), each `stride` floats long.
    """

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        rows = [_load(builder, place) for place in _row_places(context, builder, sig, args)]
        return context.make_tuple(builder, _eight, _transposed(builder, rows))

    return _eight(table, indices, first, stride, offset), emit


@intrinsic
def scatter_rows(typingctx: Any, table: Any, indices: Any, first: Any, stride: Any, offset: Any, vectors: Any) -> Any:
    """Writes what `gather_rows` reads; of rows that are named twice the last lane stays."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        rows = _transposed(builder, [builder.extract_value(args[5], lane) for lane in range(LANES)])
        for row, place in zip(rows, _row_places(context, builder, sig, args), strict=True):
            _store(builder, row, place)
        return context.get_dummy_value()

    return types.none(table, indices, first, stride, offset, vectors), emit


if config.DISABLE_JIT:

    def splat(x):
        return np.full(LANES, x, np.float32)

    def load(array, index):
        return array[index : index + LANES].copy()

    def store(array, index, vector):
        array[index : index + LANES] = vector

    def square_root(a):
        return np.sqrt(a)

    def where(mask, a, b):
        return np.where(mask, a, b)

    def larger(a, b):
        return np.where(a > b, a, b)

    def smaller(a, b):
        return np.where(a < b, a, b)

    def bits_of(mask):
        return int(sum(1 << lane for lane in range(LANES) if mask[lane]))

    def lowest_bit(bits):
        return int(bits & -bits).bit_length() - 1

    def gather_rows(table, indices, first, stride, offset):
        rows = [table[i * stride + offset : i * stride + offset + LANES] for i in indices[first : first + LANES]]
        return tuple(np.array(rows).T.copy())

    def scatter_rows(table, indices, first, stride, offset, vectors):
        for lane, i in enumerate(indices[first : first + LANES]):
            table[i * stride + offset : i * stride + offset + LANES] = [vector[lane] for vector in vectors]
