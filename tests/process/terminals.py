"""A pseudo terminal for tests: what a program draws there, and keys pressed on it."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
from fcntl import ioctl
from pathlib import Path
from typing import Any, Final

CTRL_C: Final = b"\x03"
SHOW_CURSOR: Final = "\x1b[?25h"
HIDE_CURSOR: Final = "\x1b[?25l"
_COLOURS: Final = re.compile(r"\x1b\[[0-9;]*m")


class Terminal:
    """An `elys` command in a terminal of 50 rows of 160 characters."""

    def __init__(self, words: tuple[str, ...], environment: dict[str, str], directory: Path) -> None:
        self._master, slave = pty.openpty()
        ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 50, 160, 0, 0))
        self._raw = b""
        self.before = termios.tcgetattr(slave)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "elys", *words],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env={**environment, "TERM": "xterm-256color", "COLUMNS": "160", "LINES": "50"},
            cwd=directory,
            preexec_fn=lambda: _own_terminal(slave),  # noqa: PLW1509  two system calls and nothing that threads share
        )
        self._slave = slave

    @property
    def raw(self) -> str:
        """All that was written, with its control sequences."""
        return self._raw.decode(errors="replace")

    @property
    def text(self) -> str:
        """The same without colours."""
        return _COLOURS.sub("", self.raw)

    @property
    def attributes(self) -> list[Any]:
        """How the terminal takes keys now."""
        return termios.tcgetattr(self._slave)

    def press(self, key: bytes) -> None:
        os.write(self._master, key)

    def wait_for(self, pattern: str, *, seconds: float = 60.0, start: int = 0) -> re.Match[str]:
        """The first match in what was written from character `start` on, now or later."""
        deadline = time.monotonic() + seconds
        while not (match := re.compile(pattern).search(self.text, start)):
            left = deadline - time.monotonic()
            ended = self.process.poll() is not None
            if left <= 0 or (not self._read(min(left, 0.5)) and ended):
                raise AssertionError(f"the terminal never showed {pattern!r}; it shows:\n{self.text[-4000:]}")
        return match

    def wait(self, *, seconds: float = 60.0) -> int:
        """Its exit status, after all that it wrote was read."""
        deadline = time.monotonic() + seconds
        while self.process.poll() is None and time.monotonic() < deadline:
            self._read(0.2)
        status = self.process.wait(max(deadline - time.monotonic(), 0.1))
        while self._read(0.0):
            pass
        return status

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        for descriptor in (self._master, self._slave):
            with contextlib.suppress(OSError):
                os.close(descriptor)

    def _read(self, seconds: float) -> bool:
        if not select.select([self._master], [], [], seconds)[0]:
            return False
        self._raw += os.read(self._master, 1 << 16)
        return True


def _own_terminal(slave: int) -> None:
    """Makes it the terminal that Ctrl-C of its keys interrupts."""
    os.setsid()
    ioctl(slave, termios.TIOCSCTTY, 0)
