"""What the compiler made of the kernels: nothing that another processor would calculate otherwise."""

from __future__ import annotations

import re

import llvmlite.binding as llvm
import pytest

from elys.sim_node.cpu_level import is_native
from elys.sim_node.kernel_list import all_kernels, make_callable

# What a kernel may call: Python and numba's runtime, which calculate nothing, and single instructions that IEEE 754 rounds for
# all alike. `sqrt` is libm's word for negative numbers, NaN everywhere; sin, exp, pow and the like differ between machines.
ALLOWED_CALLS = re.compile(
    r"Py\w+|NRT_\w+|numba_\w+|mem(cpy|set|move)|sqrtf?"
    r"|llvm\.(memset|memcpy|memmove|prefetch|experimental\.noalias|lifetime|assume|expect|x86\.(atomic|sse2\.pause)|vector|[su]?(add|sub|mul)\.with|[su](min|max)|abs|ct|bswap)[.\w]*"
    r"|llvm\.(fabs|sqrt|floor|ceil|trunc|rint|copysign|minnum|maxnum)\.\w+"
)
RELAXED = re.compile(r"= (?:tail )?(?:f\w+|call|select|phi) (?:fast|contract|reassoc|arcp|afn|nnan|ninf|nsz)\b")

KERNELS = {kernel.name: kernel for kernel in all_kernels()}


@pytest.fixture(params=KERNELS)
def modules(request):
    """The LLVM modules of one kernel, one for each signature."""
    kernel = KERNELS[request.param]
    if not hasattr(kernel.function, "overloads"):
        pytest.skip("the compiler is switched off")
    make_callable(kernel)
    return [compiled.library._get_module_for_linking() for compiled in kernel.function.overloads.values()]


def test_a_kernel_calls_no_mathematics_of_the_system(modules):
    for module in modules:
        called = {function.name for function in module.functions if function.is_declaration}
        assert not {name for name in called if not ALLOWED_CALLS.fullmatch(name)}


def test_a_kernel_may_not_be_reordered_or_contracted(modules):
    for module in modules:
        assert not RELAXED.findall(str(module))


@pytest.mark.skipif(is_native(), reason="ELYS_CPU_LEVEL=native promises nothing about bits")
def test_a_kernel_has_no_fused_instruction(modules):
    kernel = next(iter(KERNELS.values()))
    make_callable(kernel)
    target_machine = next(iter(kernel.function.overloads.values())).codegen._tm
    for module in modules:
        assembly = target_machine.emit_assembly(llvm.parse_bitcode(module.as_bitcode()))
        assert "mul" in assembly or "ret" in assembly
        assert not re.findall(r"\bvf(?:n?m(?:add|sub)|maddsub)\w*|\bfmadd\w*", assembly)
