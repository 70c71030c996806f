"""Two machines on a network of their own, as namespaces of the kernel: needs to be root, and `ip` of iproute2."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator

import pytest


@contextlib.contextmanager
def two_machines() -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
    """What to put before a command to run it on the one or on the other; 10.77.0.1 and 10.77.0.2. Skips where it cannot be."""
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("network namespaces take root and iproute2")
    names = [f"elys-{os.getpid()}-{place}" for place in "ab"]
    made: list[str] = []
    try:
        for name in names:
            if subprocess.run(("ip", "netns", "add", name), capture_output=True, check=False).returncode:
                pytest.skip("this kernel gives no network namespaces")
            made.append(name)
        _ip("link", "add", "cable", "netns", names[0], "type", "veth", "peer", "name", "cable", "netns", names[1])
        for number, name in enumerate(names, 1):
            for words in (
                ("addr", "add", f"10.77.0.{number}/24", "dev", "cable"),
                ("link", "set", "cable", "up"),
                ("link", "set", "lo", "up"),
            ):
                _ip("-n", name, *words)
        first, second = (("ip", "netns", "exec", name) for name in names)
        yield first, second
    finally:
        for name in made:
            subprocess.run(("ip", "netns", "delete", name), capture_output=True, check=False)


def _ip(*words: str) -> None:
    subprocess.run(("ip", *words), check=True, capture_output=True)
