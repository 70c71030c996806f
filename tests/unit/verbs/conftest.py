"""The command line in this process: what it says, and with which status it ends."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from elys.__main__ import main


class Outcome(NamedTuple):
    """How a command ended."""

    status: int
    out: str
    err: str

    @property
    def sentence(self) -> str:
        """The one line on stderr that a mistake ends with, after the bar of kernels where they had to be compiled first."""
        assert self.status in (1, 2), (self.status, self.out, self.err)
        lines = [line for line in self.err.splitlines() if not line.startswith("Compiling kernels")]
        assert len(lines) == 1, self.err
        assert lines[0].startswith("elys: ")
        return lines[0]


Elys = Callable[..., Outcome]


@pytest.fixture
def elys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Elys]:
    """Runs `elys WORDS...` in a directory of the test's own, with no window server and no other session in sight."""
    (tmp_path / "runtime").mkdir()
    monkeypatch.setenv("ELYS_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("COLUMNS", "200")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    root, own = logging.getLogger(), logging.getLogger("elys")
    handlers, level = root.handlers[:], own.level

    def run(*words: str | Path) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["elys", *map(str, words)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        return Outcome(ended.value.code if isinstance(ended.value.code, int) else 0, said.out, said.err)

    yield run
    root.handlers[:] = handlers  # a command logs to a stderr that ends with the test
    own.setLevel(level)
