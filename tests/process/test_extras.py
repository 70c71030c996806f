"""The extras are honest: without the libraries of drawing all that draws nothing works, and what draws says what is missing."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = pytest.mark.process
DRAWING = ("moderngl", "glcontext", "glfw", "imgui_bundle", "PIL", "simplejpeg", "av", "OpenEXR")
# A module that is None in sys.modules cannot be imported: as if it had never been installed.
WITHOUT_DRAWING = f"""
import sys
sys.modules.update(dict.fromkeys({DRAWING!r}))
sys.argv[0] = "elys"
from elys.__main__ import main
main()
"""


def run(
    *words: str, environment: dict[str, str], cwd, program: str = WITHOUT_DRAWING
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program, *words],
        env=environment,
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_simulation_recording_and_export_need_nothing_that_draws(environment, tmp_path):
    for words in (
        ("samples", "stack"),
        ("run", "stack.scene.json", "--headless", "--steps", "20", "--record", "stack.mcap"),
        ("info", "stack.mcap"),
        ("export", "stack.mcap", "stack.npz"),
        ("export", "stack.mcap", "stack.csv"),
        ("export", "stack.mcap", "stack.glb"),
        ("cut", "stack.mcap", "--from", "0.1s", "-o", "part.mcap"),
        ("recover", "part.mcap"),
        ("schema", "Light"),
        ("topic", "list"),
        ("doctor",),
    ):
        done = run(*words, environment=environment, cwd=tmp_path)
        assert done.returncode == 0, (words, done.stderr)
        assert "Traceback" not in done.stderr
    assert (tmp_path / "stack.npz").stat().st_size > 1000


@pytest.mark.parametrize(
    "words", [("run", "stack"), ("view",), ("edit",), ("web",), ("render", "stack", "-o", "x.png")]
)
def test_what_draws_names_the_extra_that_is_missing(environment, tmp_path, words):
    done = run(*words, environment=environment, cwd=tmp_path)
    assert done.returncode == 1
    assert "pip install 'elys[" in done.stderr or "no session is running" in done.stderr, done.stderr
    assert "Traceback" not in done.stderr


def test_the_page_says_what_it_needs(environment, tmp_path):
    without = WITHOUT_DRAWING.replace("import sys\n", "import sys\nsys.modules['aiohttp'] = None\n", 1)
    done = run("web", environment=environment, cwd=tmp_path, program=without)
    assert done.returncode == 1
    assert done.stderr == "elys: showing a session in a browser needs aiohttp: pip install 'elys[web]'\n"
