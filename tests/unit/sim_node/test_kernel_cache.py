"""The folder of compiled kernels: named by the sources, filled once, reported."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from elys.common.errors import ElysError
from elys.sim_node import kernel_cache, kernel_directory, kernel_list

ROOT = Path(__file__).parents[3]

COMPILE_ONE = """
from elys.sim_node.physics.kernels import KERNELS
name, kernel, signatures = next(entry for entry in KERNELS if entry[0] == "physics.form_groups")
for signature in signatures:
    kernel.compile(signature)
print(sum(kernel.stats.cache_hits.values()), sum(kernel.stats.cache_misses.values()))
"""


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv(kernel_directory.CACHE_VARIABLE, str(tmp_path / "kernels"))
    kernel_directory.cache_root.cache_clear()
    yield tmp_path / "kernels"
    kernel_directory.cache_root.cache_clear()


def run(program: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    finished = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout.strip()


def test_the_second_process_finds_what_the_first_has_compiled(own_cache):
    assert run(COMPILE_ONE) == "0 1"
    assert run(COMPILE_ONE) == "1 0"
    report = kernel_cache.kernel_cache_report()
    assert report.path == own_cache
    assert "physics.form_groups" not in report.missing
    assert "physics.solve_contacts" in report.missing
    assert report.present == 1 and report.total == len(report.missing) + 1
    assert report.size > 1000


def test_what_a_scene_needs_is_compiled_ahead_and_only_that(own_cache, monkeypatch):
    kernels = {kernel.name: kernel for kernel in kernel_list.all_kernels()}
    first, wanted, other = (
        kernels[f"physics.{name}"] for name in ("wake_marked", "describe_contacts", "finish_joints")
    )
    monkeypatch.setattr(kernel_cache, "first_kernels", lambda: (first,))
    monkeypatch.setattr(kernel_cache, "all_kernels", lambda: (first, wanted, other))
    heard: list[tuple[str, int, int]] = []

    def warm(*needs: str) -> list[tuple[str, int, int]]:
        heard.clear()
        kernel_cache.warm_kernels(lambda *told: heard.append(told), needs=needs, processes=1)
        return heard

    assert not kernel_cache.kernels_are_warm()
    assert warm() == [(first.name, 1, 1)]
    assert kernel_cache.kernels_are_warm() and not kernel_cache.kernels_are_warm([wanted.name])
    assert warm(wanted.name) == [(wanted.name, 1, 1)]
    assert kernel_cache.kernels_are_warm([wanted.name])
    assert not kernel_cache.kernels_are_warm([wanted.name, other.name])
    assert warm(wanted.name) == []


def test_asking_whether_kernels_are_warm_imports_no_compiler(own_cache):
    program = (
        "import sys; from elys.sim_node.kernel_cache import kernels_are_warm; "
        "print(kernels_are_warm(), 'numba' in sys.modules, 'numpy' in sys.modules)"
    )
    assert run(program) == "False False False"


def test_the_folder_depends_on_every_kernel_source(tmp_path, monkeypatch):
    node = tmp_path / "sim_node"
    (node / "physics" / "kernels").mkdir(parents=True)
    (node / "scene").mkdir()
    sources = [node / "compilation.py", node / "physics" / "kernels" / "solver.py", node / "scene" / "kernels.py"]
    for source in sources:
        source.write_text("first")
    monkeypatch.setattr(kernel_directory, "_NODE", node)
    kernel_directory.kernel_packages.cache_clear()
    try:
        assert kernel_directory.kernel_packages() == ("physics", "scene")

        def hashes():
            kernel_directory.source_hash.cache_clear()
            return [kernel_directory.source_hash(package) for package in ("physics", "scene")]

        first = hashes()
        sources[1].write_text("second")
        second = hashes()
        assert second[0] != first[0] and second[1] == first[1]
        sources[0].write_text("second")
        third = hashes()
        assert third[0] != second[0] and third[1] != second[1]
        (node / "physics" / "world.py").write_text("no kernel")
        assert hashes() == third
    finally:
        kernel_directory.kernel_packages.cache_clear()
        kernel_directory.source_hash.cache_clear()


def test_every_kernel_is_listed_once_with_a_signature():
    kernels = kernel_list.all_kernels()
    names = [kernel.name for kernel in kernels]
    assert len(set(names)) == len(names)
    assert all(kernel.signatures for kernel in kernels)
    assert {name.partition(".")[0] for name in names} == set(kernel_directory.kernel_packages())


def test_a_cache_that_cannot_be_written_is_named(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv(kernel_directory.CACHE_VARIABLE, str(blocked / "kernels"))
    kernel_directory.cache_root.cache_clear()
    try:
        with pytest.raises(ElysError, match="ELYS_KERNEL_CACHE"):
            kernel_cache.warm_kernels()
    finally:
        kernel_directory.cache_root.cache_clear()
