"""ELYS's own target for numba: machine code for the level that `cpu_level` names, beside numba's target for the host.

Numba fixes its processor for the whole process when the first function of any library is compiled, from variables that everybody
shares. So kernels have a target of their own, below the CPU in numba's hierarchy: nobody else's functions change, and it does not
matter who used numba first. What is shared all the same: numba's reference counts are compiled by whichever target comes first, a
few atomic instructions that read the same on every level.
"""

from __future__ import annotations

import functools
from typing import Any, Final

from numba.core import cpu, externals, typing, utils
from numba.core.codegen import JITCPUCodegen, get_host_cpu_features
from numba.core.compiler_lock import global_compiler_lock
from numba.core.decorators import jit
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUTarget
from numba.core.target_extension import CPU, dispatcher_registry, jit_registry, target_override, target_registry

from elys.sim_node.cpu_level import cpu_level, is_native

TARGET: Final = "elys"

# A fused multiplication and addition rounds once where two instructions round twice: v3 would part from v2. Numba asks for none,
# and without the instructions nobody can.
_NO_FUSING: Final = "-fma"


class ElysCPU(CPU):
    """The target's place in numba's hierarchy: whatever numba implements for the CPU holds here too."""


class _FixedLevelCodegen(JITCPUCodegen):
    """Generates code for a level. The keys of the cache hold what these two answer."""

    def _get_host_cpu_name(self) -> str:
        return cpu_level()

    def _get_host_cpu_features(self) -> str:
        if is_native():
            return str(get_host_cpu_features())
        return _NO_FUSING if cpu_level() == "x86-64-v3" else ""


class _Context(cpu.CPUContext):
    @global_compiler_lock
    def init(self) -> None:
        # As the CPU's, but for the code generator.
        self.is32bit = utils.MACHINE_BITS == 32
        self._internal_codegen = _FixedLevelCodegen("elys.kernels")
        externals.c_math_functions.install(self)


class _Descriptor(CPUTarget):
    @functools.cached_property
    def _toplevel_target_context(self) -> Any:
        return _Context(self.typing_context, self._target_name)

    @functools.cached_property
    def _toplevel_typing_context(self) -> Any:
        return typing.Context()


class KernelDispatcher(Dispatcher):
    """What `@kernel` and `@inner` make of a function."""

    targetdescr = _Descriptor(TARGET)

    direct_signature: tuple[Any, ...] | None = None  # the one signature of all its calls, where there is just one
    _entry: Any = None

    def __call__(self, *arguments: Any) -> Any:
        """Calls the function; a direct one without the microsecond that numba takes to look at the types of its arguments."""
        if self._entry is not None:
            return self._entry(*arguments)
        result = super().__call__(*arguments)
        if self.direct_signature is not None and tuple(self.overloads) == (self.direct_signature,):
            self._entry = self.overloads[self.direct_signature].entry_point
        return result

    def compile(self, sig: Any) -> Any:
        """Compiles or loads the function for a signature, and everything it calls, for this target."""
        with target_override(TARGET):
            return super().compile(sig)


target_registry[TARGET] = ElysCPU
dispatcher_registry[ElysCPU] = KernelDispatcher
jit_registry[ElysCPU] = functools.partial(jit, _target=TARGET, nopython=True)
