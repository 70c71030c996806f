"""Four float64 numbers in one register, for sums over three axes: the fourth is along for the ride, and never read.

As in `simd`, nothing is contracted or reordered, and with the compiler switched off (NUMBA_DISABLE_JIT) the same names work on
numpy arrays of four numbers.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core.datamodel.models import PrimitiveModel
from numba.extending import intrinsic, register_model

from elys.sim_node.physics.kernels.simd import _allow, _place

_DOUBLES = ir.VectorType(ir.DoubleType(), 4)
_INT32 = ir.IntType(32)


class F64x4Type(types.Type):
    """<4 x double>."""

    def __init__(self) -> None:
        super().__init__(name="F64x4")


f64x4 = F64x4Type()


@register_model(F64x4Type)
class _F64x4Model(PrimitiveModel):
    def __init__(self, manager: Any, front_end_type: Any) -> None:
        super().__init__(manager, front_end_type, _DOUBLES)


for _operation, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _allow(_operation, (f64x4, f64x4), f64x4, lambda builder, a, b, name=_name: getattr(builder, name)(a, b))


@intrinsic
def quad(typingctx: Any, x: Any, y: Any, z: Any) -> Any:
    """Three numbers, and the last once more."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        vector = ir.Constant(_DOUBLES, ir.Undefined)
        for lane, number in enumerate((*args, args[2])):
            vector = builder.insert_element(vector, number, ir.Constant(_INT32, lane))
        return vector

    return f64x4(types.float64, types.float64, types.float64), emit


@intrinsic
def quad_at(typingctx: Any, array: Any, index: Any) -> Any:
    """array[index : index + 4] of float64; the last may be what lies behind the array in its row."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = context.cast(builder, args[1], sig.args[1], types.intp)
        place = _place(context, builder, sig.args[0], args[0], at)
        vector = builder.load(builder.bitcast(place, _DOUBLES.as_pointer()))
        vector.align = 8
        return vector

    return f64x4(array, index), emit


@intrinsic
def next_axes(typingctx: Any, a: Any) -> Any:
    """(y, z, x) of (x, y, z)."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        lanes = ir.Constant(ir.VectorType(_INT32, 4), [1, 2, 0, 3])
        return builder.shuffle_vector(args[0], args[0], lanes)

    return f64x4(a), emit


@intrinsic
def axes_of(typingctx: Any, a: Any) -> Any:
    """The three numbers (x, y, z)."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        numbers = [builder.extract_element(args[0], ir.Constant(_INT32, lane)) for lane in range(3)]
        return context.make_tuple(builder, sig.return_type, numbers)

    return types.UniTuple(types.float64, 3)(a), emit


if config.DISABLE_JIT:

    def quad(x, y, z):
        return np.array([x, y, z, z], np.float64)

    def quad_at(array, index):
        return np.resize(array[index : index + 4], 4)

    def next_axes(a):
        return a[[1, 2, 0, 3]]

    def axes_of(a):
        return float(a[0]), float(a[1]), float(a[2])
