"""A session that goes on for long: what is seen does not grow older, and nothing fills up.

A minute in the tests, an hour in `make soak`, or ELYS_SOAK_SECONDS.
"""

from __future__ import annotations

import os
import statistics
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.network.laboratory import PORT, Laboratory
from tests.network.test_far_away import WATCHER, simulating
from tests.network.test_survival import wait_for_states
from tests.network.truth import Account
from tests.process.conftest import Command

pytestmark = pytest.mark.process
SECONDS, SOAK_SECONDS = 45.0, 3600.0
WARM_UP = 10.0  # [s] in which what is kept of the past fills
AGE_ROOM = 0.02  # [s] by which the median age may differ between beginning and end
MEMORY_ROOM = 24 << 20  # [bytes] likewise: allocators take their time to come to rest


@dataclass(frozen=True, slots=True)
class Held:
    """What a process holds."""

    memory: int  # [bytes] resident
    files: int

    @classmethod
    def by(cls, command: Command) -> Held:
        process = Path(f"/proc/{command.process.pid}")
        pages = int((process / "statm").read_text().split()[1])
        return cls(pages * os.sysconf("SC_PAGE_SIZE"), len(list((process / "fd").iterdir())))


@pytest.mark.usefixtures("machine_to_itself")
@pytest.mark.timeout(3 * 3600)
def test_nothing_grows(lab: Laboratory, soak: bool) -> None:
    seconds = float(os.environ.get("ELYS_SOAK_SECONDS") or (SOAK_SECONDS if soak else SECONDS))
    server, laptop, archive = lab.machines("server", "laptop", "archive")
    links = [lab.link(server, machine, delay=0.01) for machine in (laptop, archive)]
    near, far = (f"tcp/{link.address_of(server)}:{PORT}" for link in links)
    simulation = simulating(server, "stack", "--keep", "2", "--no-guard")
    watcher = laptop.start_program(WATCHER, near)
    recorder = archive.start("record", "--connect", far, "-o", "long.mcap", "--compact")
    recorder.wait_for("recording")
    wait_for_states(watcher, 60)
    processes = {"simulation": simulation, "watcher": watcher, "recorder": recorder}
    time.sleep(WARM_UP)
    before, since = {name: Held.by(command) for name, command in processes.items()}, len(watcher.lines)
    shared_before = server.run(["ls", "/dev/shm"])
    time.sleep(seconds)  # the time that passes is what is tested
    after = {name: Held.by(command) for name, command in processes.items()}
    ages = [age for *_, age in Account.of(watcher, since=since).states]
    third = len(ages) // 3
    first, last = statistics.median(ages[:third]), statistics.median(ages[-third:])
    print(f"{len(ages)} states, age {first * 1e3:.1f} ms, then {last * 1e3:.1f} ms", end="; ")
    for name in processes:
        print(f"{name} {before[name].memory >> 20}, then {after[name].memory >> 20} MiB", end="; ")
    assert not any(not connected for _, connected in Account.of(watcher, since=since).links)
    assert last - first < AGE_ROOM
    for name in processes:
        assert after[name].files <= before[name].files, name
        assert after[name].memory - before[name].memory < MEMORY_ROOM, name
    assert server.run(["ls", "/dev/shm"]) == shared_before
