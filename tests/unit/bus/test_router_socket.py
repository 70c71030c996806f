"""The directory in which a router's two ends meet goes with its router, or with the next one."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from elys.bus.transports.router_socket import RouterSocket, remove_abandoned

HOLDER = """
import sys
from elys.bus.transports.router_socket import RouterSocket
held = RouterSocket()
print(held.endpoint_path, flush=True)
sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    yield tmp_path


def holder() -> tuple[subprocess.Popen[str], Path]:
    process = subprocess.Popen([sys.executable, "-c", HOLDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_what_a_killed_router_left_is_removed_when_the_next_one_starts_and_nothing_else(folder: Path) -> None:
    killed, left = holder()
    living, kept = holder()
    left.write_text("a socket")
    foreign = folder / "elys-router-of-no-router"
    foreign.mkdir()
    (folder / "elys-router-link").symlink_to(kept.parent)
    try:
        killed.kill()
        killed.wait()
        assert left.parent.is_dir()
        own = RouterSocket()
        assert not left.parent.exists()
        assert kept.parent.is_dir() and foreign.is_dir()
        assert stat.S_IMODE(own.endpoint_path.parent.stat().st_mode) == 0o700
        remove_abandoned()
        assert own.endpoint_path.parent.is_dir()
        own.remove()
        assert not own.endpoint_path.parent.exists()
    finally:
        for process in (killed, living):
            process.kill()
            process.communicate()


def test_another_users_directories_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    process, left = holder()
    process.kill()
    process.communicate()
    with monkeypatch.context() as other:
        other.setattr(os, "getuid", lambda: left.parent.stat().st_uid + 1)
        remove_abandoned()
    assert left.parent.is_dir()
    remove_abandoned()
    assert not left.parent.exists()
