"""Real processes for tests: `elys` commands with a runtime directory of their own, ended for sure."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ELYS = (sys.executable, "-m", "elys")


class Command:
    """A running `elys` command; its lines (stdout and stderr together) are collected as they come.

    With a `prefix` it is another program (or this one within another); one that `hears` can be told lines.
    """

    def __init__(
        self,
        words: tuple[str, ...],
        environment: dict[str, str],
        directory: Path,
        *,
        prefix: tuple[str, ...] = ELYS,
        hears: bool = False,
    ) -> None:
        self.words = words
        self.lines: list[str] = []
        self._news = threading.Condition()
        self.process = subprocess.Popen(
            [*prefix, *words],
            stdin=subprocess.PIPE if hears else subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
            cwd=directory,
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def output(self) -> str:
        return "\n".join(self.lines)

    def wait_for(self, pattern: str, *, seconds: float = 60.0) -> re.Match[str]:
        """The first line that matches, now or later; fails with all that was said when it does not come."""
        deadline = time.monotonic() + seconds
        seen = 0
        with self._news:
            while True:
                for line in self.lines[seen:]:
                    if match := re.search(pattern, line):
                        return match
                seen = len(self.lines)
                left = deadline - time.monotonic()
                if left <= 0 or (not self._reader.is_alive() and seen == len(self.lines)):
                    pytest.fail(f"elys {' '.join(self.words)} never said {pattern!r}; it said:\n{self.output}")
                self._news.wait(min(left, 0.5))

    def tell(self, line: str) -> None:
        """A line for its input."""
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def wait(self, *, seconds: float = 60.0) -> int:
        """Its exit status, after its output was read to the end."""
        status = self.process.wait(seconds)
        self._reader.join(seconds)
        return status

    def kill(self) -> None:
        """kill -9, and nothing else."""
        self.process.kill()
        self.process.wait()

    def end(self) -> None:
        """Asks it to end, and ends its whole group if it does not."""
        if self.process.poll() is None:
            self.process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(10)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._news:
                self.lines.append(line.rstrip("\n"))
                self._news.notify_all()
        with self._news:
            self._news.notify_all()


Elys = Callable[..., Command]


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """An environment in which no other session of this machine is found and no window server is used."""
    runtime = tmp_path / "runtime"
    runtime.mkdir()
    hidden = {"DISPLAY", "WAYLAND_DISPLAY"}
    kept = {name: value for name, value in os.environ.items() if name not in hidden}
    return {**kept, "ELYS_RUNTIME_DIR": str(runtime), "PYTHONUNBUFFERED": "1", "COLUMNS": "200"}


@pytest.fixture
def elys(environment: dict[str, str], tmp_path: Path) -> Iterator[Elys]:
    """Starts `elys WORDS...` in a directory of the test's own, with words `before` it where it is to run within another."""
    started: list[Command] = []

    def start(*words: str | Path, before: tuple[str, ...] = (), **variables: str) -> Command:
        prefix = (*before, *ELYS)
        command = Command(tuple(map(str, words)), {**environment, **variables}, tmp_path, prefix=prefix)
        started.append(command)
        return command

    yield start
    for command in reversed(started):
        command.end()


@pytest.fixture
def free_port() -> int:
    """A port of loopback that nobody uses now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_until(condition: Callable[[], bool], *, seconds: float = 20.0) -> None:
    """Waits for a condition; fails when it does not come true."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            pytest.fail(f"it did not come true within {seconds:g} s")
        time.sleep(0.01)  # other processes tell us nothing: there is nothing to wait on but the clock
