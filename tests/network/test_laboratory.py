"""The laboratory does to packets what it is told, and leaves nothing behind."""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.network.laboratory import ROOT, Laboratory, Link
from tests.process.conftest import wait_until

pytestmark = pytest.mark.process
PACKETS = Path(__file__).parent / "programs" / "packets.py"
PORT = 5000


def measured(link: Link, verb: str, count: int) -> Any:
    """What `packets.py VERB` measures from the second end of a link, with an echo at the first."""
    here, there = link.ends
    if not here.started:
        here.start_program(PACKETS, "echo", str(PORT)).wait_for("ready")
    return json.loads(there.run_program(PACKETS, verb, link.address_of(here), str(PORT), str(count)))


def test_a_round_trip_is_two_delays(lab):
    link = lab.link(*lab.machines("server", "laptop"), delay=0.03)
    times = measured(link, "ask", 20)
    assert None not in times
    assert min(times) >= 0.06
    assert statistics.median(times) < 0.09
    link.change(delay=0.0)
    assert statistics.median(measured(link, "ask", 20)) < 0.03
    link.change(delay=0.1, towards=link.ends[1])  # one way alone
    assert min(measured(link, "ask", 5)) >= 0.1


def test_jitter_spreads_and_keeps_the_order(lab):
    link = lab.link(*lab.machines("server", "laptop"), delay=0.01, jitter=0.04)
    times = measured(link, "ask", 40)
    assert min(times) >= 0.02 and max(times) - min(times) > 0.02
    came = measured(link, "flood", 300)
    assert came == list(range(300))


def test_packets_are_lost_as_often_as_asked_and_counted(lab):
    server, laptop = lab.machines("server", "laptop")
    link = lab.link(server, laptop, loss=0.1)
    before = link.passed(server)
    came = measured(link, "flood", 3000)
    there, back = link.passed(server), link.passed(laptop)
    assert there.packets - before.packets == 3000
    assert there.overflowed == back.overflowed == 0
    assert len(came) == 3000 - there.lost - back.lost  # each that is missing was lost on the line
    for one_way in (there, back):
        assert abs(one_way.lost - 0.1 * one_way.packets) < 5 * math.sqrt(0.09 * one_way.packets)


def test_tcp_sends_again_what_was_lost(lab):
    link = lab.link(*lab.machines("server", "laptop"), delay=0.005, loss=0.02)
    done = measured(link, "stream", 1 << 20)
    assert done["same"]
    assert done["again"] > 3
    assert link.passed(link.ends[0]).lost > 3


def test_a_narrow_line_takes_its_time_and_its_queue_overflows(lab):
    link = lab.link(*lab.machines("server", "laptop"), rate=200_000.0, queue=20_000)
    assert measured(link, "stream", 200_000)["seconds"] > 0.8
    link.change(rate=2_000.0, queue=1_000)
    assert len(measured(link, "flood", 300)) < 300
    assert link.passed(link.ends[0]).overflowed > 0


@pytest.mark.parametrize("kind", ["link", "cable"])
def test_what_is_cut_carries_nothing_until_it_is_healed(lab, kind):
    link = getattr(lab, kind)(*lab.machines("server", "laptop"))
    assert None not in measured(link, "ask", 3)
    link.cut()
    assert measured(link, "ask", 2) == [None, None]
    link.heal()
    assert None not in measured(link, "ask", 3)


def test_machines_are_apart(lab):
    server, laptop, other = lab.machines("server", "laptop", "other")
    lab.link(server, laptop)
    lab.cable(server, other)
    assert [machine.run(["hostname"]).strip() for machine in (server, laptop)] == ["server", "laptop"]
    server.run(["sh", "-c", "echo here > /dev/shm/mine"])
    assert laptop.run(["ls", "/dev/shm"]) == ""
    assert server.environment["ELYS_RUNTIME_DIR"] != laptop.environment["ELYS_RUNTIME_DIR"]
    with pytest.raises(subprocess.CalledProcessError):  # no way from one to the other
        laptop.run_program(PACKETS, "ask", lab.links[1].address_of(other), str(PORT), "1")


def test_nothing_is_left_behind_even_after_a_failure(laboratory_here, tmp_path):
    with pytest.raises(ZeroDivisionError), Laboratory(tmp_path) as lab:
        server, laptop = lab.machines("server", "laptop")
        lab.link(server, laptop)
        lab.cable(server, laptop)
        running = server.start_program(PACKETS, "echo", str(PORT))
        running.wait_for("ready")
        processes = [*lab.processes, running.process.pid]
        assert all(Path(f"/proc/{process}").exists() for process in processes)
        raise ZeroDivisionError
    assert not any(Path(f"/proc/{process}").exists() for process in processes)
    here = subprocess.run(["ip", "-brief", "link"], capture_output=True, text=True, check=True).stdout
    assert "link0" not in here and "cable1" not in here


KILLED = """
import os, sys, signal
from pathlib import Path
from tests.network.laboratory import Laboratory

lab = Laboratory(Path(sys.argv[1])).__enter__()
server, laptop = lab.machines("server", "laptop")
lab.link(server, laptop)
running = server.start_program(Path(sys.argv[2]), "echo", "5000")
running.wait_for("ready")
print(*lab.processes, running.process.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_nothing_is_left_behind_by_tests_that_are_killed(laboratory_here, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-c", KILLED, str(tmp_path), str(PACKETS)]
    said = subprocess.run(words, env=environment, cwd=ROOT, capture_output=True, text=True, check=False).stdout
    processes = said.split()
    assert len(processes) == 4
    wait_until(lambda: not any(Path(f"/proc/{process}").exists() for process in processes))
