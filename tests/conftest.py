"""What all tests share: options, and where the real models are."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples on every run and machine: a red test must be red again when it is looked at. `make soak` tries others.
settings.register_profile("tests", derandomize=True)
settings.register_profile("soak", derandomize=False, max_examples=500)
settings.load_profile("tests")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--soak", action="store_true", help="run the long campaigns whole (make soak)")
    parser.addoption("--draw-golden", action="store_true", help="draw the golden pictures anew (make golden)")


@pytest.fixture(scope="session")
def shared_assets() -> Path:
    """The folder of real glTF models, which is no part of the project: ELYS_REAL_MODELS, or beside its checkout."""
    folder = Path(os.environ.get("ELYS_REAL_MODELS") or Path(__file__).parents[2] / "shared" / "assets")
    if not folder.is_dir():
        pytest.skip(f"there is no folder of real models at {folder} (ELYS_REAL_MODELS)")
    return folder


@pytest.fixture
def soak(request: pytest.FixtureRequest) -> bool:
    """Whether long campaigns run whole."""
    return bool(request.config.getoption("--soak"))


def pytest_configure(config: pytest.Config) -> None:
    if "ELYS_CONFIG_DIR" not in os.environ:  # neither keys nor settings of whoever runs the tests are used or made
        os.environ["ELYS_CONFIG_DIR"] = tempfile.mkdtemp(prefix="elys-tests-")
        config.add_cleanup(lambda folder=os.environ["ELYS_CONFIG_DIR"]: shutil.rmtree(folder, ignore_errors=True))
    if config.getoption("--soak"):
        settings.load_profile("soak")
