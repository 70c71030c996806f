"""What `import elys` offers, and what it does not cost."""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import elys

HEAVY = ("numpy", "numba", "msgspec", "zenoh", "moderngl", "glfw", "imgui_bundle", "mcap")


def test_the_example_in_the_docstring_runs():
    example, _ = elys.__doc__.split("    AssetStore ")  # the table of names follows
    code = "\n".join(line for line in example.splitlines() if not line or line.startswith("    "))
    names: dict[str, object] = {}
    exec(textwrap.dedent(code), names)
    assert names["height"] == pytest.approx(0.5 + 0.5, abs=2e-3)


@pytest.mark.parametrize("name", elys.__all__)
def test_every_name_is_there_and_known_to_type_checkers(name):
    assert name in dir(elys) and getattr(elys, name) is not None
    assert f" as {name}\n" in Path(elys.__file__).with_suffix(".pyi").read_text()
    assert re.search(rf"\b{name}\b", elys.__doc__ or "")


def test_another_name_is_refused_with_those_there_are():
    with pytest.raises(AttributeError, match="'Simulatoin'; it offers Aabb, AssetStore"):
        elys.Simulatoin  # noqa: B018


def test_importing_elys_imports_nothing_else():
    code = f"import sys, elys; print([name for name in {HEAVY!r} if name in sys.modules], len(elys.__version__))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said == f"[] {len(elys.__version__)}\n"
