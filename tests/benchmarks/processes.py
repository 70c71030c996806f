"""Real commands for benchmarks, in a runtime directory of their own."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
from collections.abc import Iterator, Sequence


@contextlib.contextmanager
def environment(**variables: str) -> Iterator[dict[str, str]]:
    """An environment in which no other session of this machine is found."""
    with tempfile.TemporaryDirectory() as runtime:
        # Python of who uses ELYS keeps what it has compiled.
        hidden = {"DISPLAY", "WAYLAND_DISPLAY", "PYTHONDONTWRITEBYTECODE"}
        kept = {name: value for name, value in os.environ.items() if name not in hidden}
        yield {**kept, "ELYS_RUNTIME_DIR": runtime, "PYTHONUNBUFFERED": "1", **variables}


@contextlib.contextmanager
def running(words: Sequence[str], *, env: dict[str, str], wait_for: str) -> Iterator[subprocess.Popen[str]]:
    """A command that has said `wait_for`; asked to end when the block is left."""
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=env)
    try:
        assert process.stdout is not None
        said = []
        for line in process.stdout:
            said.append(line)
            if wait_for in line:
                break
        else:
            raise RuntimeError(f"{' '.join(words)} ended: {''.join(said)}")
        yield process
    finally:
        process.terminate()
        process.wait(20)
