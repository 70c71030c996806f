"""Threads that work on one step together: how work is shared out, and how they wait for each other.

They meet between the colours of contacts hundreds of times in a step, so nobody sleeps meanwhile: who comes first spins. A
team is a table of one row, on a line of the cache for each number, so that who waits does not slow down who counts.
"""

from __future__ import annotations

import platform
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from elys.sim_node.compilation import inner

PLACES = 16  # of a team: int64 numbers, on two lines of the cache
_ARRIVED, _ROUND, _GIVEN_UP = 0, 8, 9
_HAS_PAUSE = platform.machine().lower() in ("x86_64", "amd64")


def new_team() -> np.ndarray[Any, Any]:
    """A team of which nobody waits."""
    return np.zeros(PLACES, np.int64)


def give_up(team: np.ndarray[Any, Any]) -> None:
    """Lets nobody wait any more: one of the team will not come. What they work on is lost, and so is the team."""
    team[_GIVEN_UP] = 1


@inner
def share(first, last, thread, threads):
    """The part of [first, last) that is for one of several threads."""
    count = last - first
    return first + count * thread // threads, first + count * (thread + 1) // threads


def _place(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    return builder.gep(context.make_array(array_type)(context, builder, array).data, [index])


@intrinsic
def _add_one(typingctx: Any, array: Any, index: Any) -> Any:
    """Adds one to a number that several threads add to; returns what it was."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = context.cast(builder, args[1], sig.args[1], types.intp)
        place = _place(context, builder, sig.args[0], args[0], at)
        return builder.atomic_rmw("add", place, ir.Constant(ir.IntType(64), 1), "acq_rel")

    return types.int64(array, index), emit


@intrinsic
def _read(typingctx: Any, array: Any, index: Any) -> Any:
    """A number that another thread writes, with all that it wrote before."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = context.cast(builder, args[1], sig.args[1], types.intp)
        return builder.load_atomic(_place(context, builder, sig.args[0], args[0], at), "acquire", 8)

    return types.int64(array, index), emit


@intrinsic
def _write(typingctx: Any, array: Any, index: Any, value: Any) -> Any:
    """Writes a number that other threads read, after all that was written before."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = context.cast(builder, args[1], sig.args[1], types.intp)
        place = _place(context, builder, sig.args[0], args[0], at)
        number = context.cast(builder, args[2], sig.args[2], types.int64)
        builder.store_atomic(number, place, "release", 8)
        return context.get_dummy_value()

    return types.none(array, index, value), emit


@intrinsic
def _pause(typingctx: Any) -> Any:
    """Tells the processor that a thread waits for another: it then leaves more to the other of its two."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if _HAS_PAUSE:
            function = builder.module.globals.get("llvm.x86.sse2.pause") or ir.Function(
                builder.module, ir.FunctionType(ir.VoidType(), []), "llvm.x86.sse2.pause"
            )
            builder.call(function, [])
        return context.get_dummy_value()

    return types.none(), emit


@inner
def meet(team, threads):
    """Waits until all threads of a team have come here; what each did before is then seen by all."""
    if team is not None:
        number = _read(team, _ROUND)
        if _add_one(team, _ARRIVED) == threads - 1:
            _write(team, _ARRIVED, 0)
            _write(team, _ROUND, number + 1)
        else:
            while _read(team, _ROUND) == number and _read(team, _GIVEN_UP) == 0:
                _pause()
