"""A laboratory for each test that asks for one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.network.laboratory import Laboratory, why_impossible


@pytest.fixture(scope="session")
def laboratory_here() -> None:
    """Skips where no laboratory can be."""
    if reason := why_impossible():
        pytest.skip(reason)


@pytest.fixture
def machine_to_itself(soak: bool) -> None:
    """Skips where other tests run beside: these judge by the clock."""
    if not soak:
        pytest.skip("judges by the clock: make soak")


@pytest.fixture
def lab(laboratory_here: None, tmp_path: Path) -> Iterator[Laboratory]:
    """A laboratory without machines yet; all in it ends with the test."""
    with Laboratory(tmp_path) as laboratory:
        yield laboratory
