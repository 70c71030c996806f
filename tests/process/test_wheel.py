"""A wheel with compiled kernels, installed elsewhere and read-only: it steps at once, and compiles nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

from elys.common.errors import ElysError
from elys.sim_node import cpu_level

pytestmark = [pytest.mark.process, pytest.mark.timeout(1800)]

ROOT = Path(__file__).parents[2]

# One step in the wheel's own words; then every other kernel; then what numba counted.
FIRST_STEP = """
import json, sys
from numba.core import event
recorder = event.RecordingListener()
event.register("numba:compile", recorder)
from elys import PhysicsWorld
from elys.sim_node.kernel_cache import kernel_cache_report, kernels_are_warm, warm_kernels
from elys.sim_node.kernel_list import all_kernels
is_warm = kernels_are_warm()
world = PhysicsWorld()
world.add_bodies([1, 2], motion=[2, 0], position=[[0, -0.5, 0], [0, 0.4, 0]])
world.add_colliders([1, 2], size=[[9, 1, 9], [1, 1, 1]])
world.step(1 / 60)
warm_kernels(every=True)
kernels = all_kernels()
print(json.dumps({
    "package": sys.modules["elys"].__file__,
    "is_warm": is_warm,
    "hits": {k.name: sum(k.function.stats.cache_hits.values()) for k in kernels},
    "misses": {k.name: sum(k.function.stats.cache_misses.values()) for k in kernels},
    "signatures": {k.name: sum(len(o.signatures) for o in kernels if o.function is k.function) for k in kernels},
    "compiled": [str(e.data["dispatcher"]) for _, e in recorder.buffer],
    "missing": kernel_cache_report().missing,
    "hash": world.state_hash(),
}))
"""


def build_wheel(folder: Path, **variables: str) -> Path:
    """The wheel that hatchling makes of this checkout."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), **variables}
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    built = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def compiled_wheel(tmp_path_factory) -> Path:
    """A wheel with kernels for all levels. What the user's cache holds already is taken from there."""
    return build_wheel(tmp_path_factory.mktemp("wheel"), HATCH_BUILD_HOOK_ENABLE_CUSTOM="true")


@pytest.fixture(scope="module")
def installed(compiled_wheel, tmp_path_factory) -> Path:
    """The Python of a new environment into which the wheel was installed, and nothing can be written any more."""
    folder = tmp_path_factory.mktemp("elsewhere")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    python = folder / "bin" / "python"
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(folder), "platbase": str(folder)}))
    # The dependencies are those of this environment; path files in a folder that a path file names are not read.
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    install = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        "--no-deps",
        "--no-index",
        "--quiet",
        compiled_wheel,
    ]
    subprocess.run([*install, "--disable-pip-version-check"], check=True)
    for path in folder.rglob("*"):
        if not path.is_symlink():
            path.chmod(path.stat().st_mode & 0o555)
    return python


def contents(folder: Path) -> set[tuple[str, int]]:
    return {(str(path), path.stat().st_mtime_ns) for path in folder.rglob("*") if path.exists()}


@pytest.mark.parametrize("level", cpu_level.SHIPPED_LEVELS)
def test_an_installed_wheel_steps_without_compiling(installed, tmp_path, level, monkeypatch):
    monkeypatch.setenv(cpu_level.LEVEL_VARIABLE, level)
    try:
        cpu_level.cpu_level.__wrapped__()
    except ElysError as error:
        pytest.skip(str(error))
    before = contents(installed.parents[1])
    environment = {"PATH": os.environ["PATH"], "HOME": str(tmp_path), cpu_level.LEVEL_VARIABLE: level}
    run = subprocess.run(
        [installed, "-c", FIRST_STEP], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    seen = json.loads(run.stdout)
    assert Path(seen["package"]).is_relative_to(installed.parents[1])
    assert seen["is_warm"] and not seen["missing"]
    assert seen["hits"] == seen["signatures"]
    assert not any(seen["misses"].values()) and not seen["compiled"]
    # Root may write where nobody may, so what counts is that nothing was written.
    assert contents(installed.parents[1]) == before
    assert not list(tmp_path.rglob("*.nb?"))


def test_the_wheel_names_its_platform_and_its_numba(compiled_wheel):
    from importlib.metadata import version

    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert f"-{python}-{python}-" in compiled_wheel.name and not compiled_wheel.stem.endswith("any")
    with zipfile.ZipFile(compiled_wheel) as archive:
        metadata = archive.read(next(name for name in archive.namelist() if name.endswith("/METADATA"))).decode()
    assert f"Requires-Dist: numba=={version('numba')}\n" in metadata


def test_a_pure_wheel_stays_possible(tmp_path):
    wheel = build_wheel(tmp_path)
    assert wheel.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        assert not [name for name in archive.namelist() if name.startswith("elys/_kernels/")]
