"""Rows of tables that are soon needed are brought into the cache ahead of their turn; nothing but the time depends on it."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

LINE = 64  # bytes of a cache line


@intrinsic
def prefetch(typingctx: Any, table: Any, row: Any) -> Any:
    """Asks for all of table[row], a row of a structured array."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        byte, word, number = ir.IntType(8), ir.IntType(64), ir.IntType(32)
        size = sig.args[0].dtype.size
        data = builder.bitcast(context.make_array(sig.args[0])(context, builder, args[0]).data, byte.as_pointer())
        at = builder.mul(context.cast(builder, args[1], sig.args[1], types.intp), ir.Constant(word, size))
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(ir.VoidType(), [byte.as_pointer(), number, number, number]),
            "llvm.prefetch.p0i8",
        )
        for offset in (*range(0, size, LINE), size - 1):
            place = builder.gep(data, [builder.add(at, ir.Constant(word, offset))])
            builder.call(function, [place, *(ir.Constant(number, k) for k in (0, 3, 1))])  # to read, to stay, data
        return context.get_dummy_value()

    return types.none(table, row), emit


if config.DISABLE_JIT:

    def _nothing(table: Any, row: Any) -> None:
        pass

    prefetch = _nothing
