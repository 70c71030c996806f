"""The level that kernels are compiled for, by what a processor has and what the user wishes."""

from __future__ import annotations

import platform

import llvmlite.binding as llvm
import pytest

from elys.common.errors import ElysError
from elys.sim_node.cpu_level import LEVEL_VARIABLE, cpu_level

NEHALEM = {"cx16", "sahf", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3"}
SANDY_BRIDGE = NEHALEM | {"avx", "xsave"}
HASWELL = SANDY_BRIDGE | {"avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"}
CORE_2 = {"cx16", "sahf", "sse3", "ssse3"}


@pytest.fixture
def level_of(monkeypatch):
    def level(features: set[str], wish: str = "", machine: str = "x86_64") -> str:
        monkeypatch.setattr(
            llvm, "get_host_cpu_features", lambda: dict.fromkeys(HASWELL, False) | dict.fromkeys(features, True)
        )
        monkeypatch.setattr(platform, "machine", lambda: machine)
        monkeypatch.setenv(LEVEL_VARIABLE, wish)
        return cpu_level.__wrapped__()

    return level


def test_the_highest_level_that_a_processor_has_whole(level_of):
    assert level_of(HASWELL) == "x86-64-v3"
    assert level_of(HASWELL | {"avx512f"}) == "x86-64-v3"
    assert level_of(SANDY_BRIDGE) == level_of(NEHALEM) == "x86-64-v2"
    assert level_of(CORE_2) == "x86-64"


def test_another_architecture_has_one_level(level_of):
    assert level_of(set(), machine="aarch64") == "generic"


def test_the_users_wish_counts_if_the_processor_can_fulfil_it(level_of):
    assert level_of(HASWELL, "v2") == "x86-64-v2"
    assert level_of(HASWELL, "native") == llvm.get_host_cpu_name()
    with pytest.raises(ElysError, match="has no x86-64-v3"):
        level_of(NEHALEM, "v3")
    with pytest.raises(ElysError, match="'v5', which is no level"):
        level_of(HASWELL, "v5")
    with pytest.raises(ElysError, match="has no x86-64-v2"):
        level_of(set(), "v2", machine="aarch64")
