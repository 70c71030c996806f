"""Kernels have a target of their own, and the processes that compile them share the work."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import types
from pathlib import Path

import pytest

from elys.sim_node import kernel_workers
from elys.sim_node.kernel_list import Kernel, compiling_cost
from elys.sim_node.kernel_workers import KernelShares

ROOT = Path(__file__).parents[3]

# A user's own function, compiled before ELYS is imported and another one afterwards.
BESIDE_OTHERS = """
import numpy as np
from numba import njit
@njit
def before(x):
    return x + 1
before(1)
from elys import PhysicsWorld
from elys.sim_node.cpu_level import cpu_level
world = PhysicsWorld()
world.add_bodies([1])
world.step(0.01)
@njit
def after(x):
    return before(x) + np.zeros(3).sum()
assert after(1) == 2.0
from elys.sim_node.physics.kernels.integrator import finish_step
targets = [next(iter(f.overloads.values())).codegen.magic_tuple() for f in (before, after, finish_step)]
print(targets[0] == targets[1], targets[2][1] == cpu_level(), *targets[2][1:])
"""


def test_other_users_of_numba_keep_their_own_target():
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse3"}
    run = subprocess.run(
        [sys.executable, "-c", BESIDE_OTHERS], env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    own_is_kept, is_level, name, *features = run.stdout.split()
    assert (own_is_kept, is_level) == ("True", "True")
    assert name != "x86-64" and features != ["+sse3"]


def kernel_of_cost(name: str, length: int) -> Kernel:
    """A kernel whose Python code is so many statements long."""
    namespace: dict[str, types.FunctionType] = {}
    exec("def function(x):\n" + "    x += 1\n" * length, namespace)
    return Kernel(name, namespace["function"], ((),))


def test_shares_are_equal_by_cost_and_begin_with_what_is_quick():
    kernels = [kernel_of_cost(f"k{length}", length) for length in (100, 10, 50, 20, 40, 60)]
    shares = KernelShares(kernels, 2)
    first, second = shares.drawn_by(0), shares.drawn_by(1)
    assert [next(first).name for _ in range(2)] == ["k40", "k100"]
    assert [next(second).name for _ in range(4)] == ["k10", "k20", "k50", "k60"]
    assert next(first, None) is None and next(second, None) is None


def test_who_has_finished_takes_from_the_others():
    kernels = [kernel_of_cost(f"k{length}", length) for length in (100, 90, 10, 20)]
    shares = KernelShares(kernels, 2)
    assert sorted(kernel.name for kernel in shares.drawn_by(1)) == ["k10", "k100", "k20", "k90"]
    assert next(shares.drawn_by(0), None) is None


ECHO = "import sys\nfor line in sys.stdin: print(line, end='', flush=True)"
DIES_AT_THE_SECOND = "import sys; print(sys.stdin.readline(), end='', flush=True); sys.stdin.readline(); sys.exit(1)"
DIES_AT_ONCE = "raise SystemExit(1)"


@pytest.mark.parametrize("program", [ECHO, DIES_AT_THE_SECOND, DIES_AT_ONCE])
def test_every_kernel_is_ready_once_whatever_becomes_of_the_workers(program, monkeypatch):
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", program]
    monkeypatch.setattr(
        kernel_workers,
        "_started_worker",
        lambda: subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, bufsize=1),
    )
    compiled, heard = [], []
    monkeypatch.setattr(kernel_workers, "make_callable", lambda kernel: compiled.append(kernel.name))
    kernels = [kernel_of_cost(f"k{length}", length) for length in range(1, 40)]
    kernel_workers.compile_in_processes(kernels, heard.append, processes=3)
    names = sorted(kernel.name for kernel in kernels)
    assert sorted(heard) == names
    assert set(compiled) == set(names)


def test_an_interrupted_compilation_ends_the_workers(monkeypatch):
    command = [sys.executable, "-c", "import time; time.sleep(100)"]
    started = []

    def started_worker() -> subprocess.Popen[str]:
        started.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        return started[-1]

    monkeypatch.setattr(kernel_workers, "_started_worker", started_worker)
    interrupt = threading.Timer(0.3, os.kill, [os.getpid(), signal.SIGINT])
    interrupt.start()
    with pytest.raises(KeyboardInterrupt):
        kernel_workers.compile_in_processes([kernel_of_cost("k7", 7), kernel_of_cost("k8", 8)], print, processes=2)
    assert [worker.returncode for worker in started] == [-signal.SIGKILL, -signal.SIGKILL]


def test_the_cost_counts_what_a_kernel_calls_once():
    def called(x):
        return x * x + x

    called.py_func = called  # as a compiled function has it

    def caller(x):
        return called(x) + called(x + 1)

    alone = Kernel("called", called, ((),))
    together = Kernel("caller", caller, ((),))
    twice = Kernel("caller", caller, ((), ()))
    own = len(caller.__code__.co_code)
    assert compiling_cost(together) == own + compiling_cost(alone)
    assert compiling_cost(twice) == 2 * compiling_cost(together)
