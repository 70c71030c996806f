"""Two who race one another, each on a machine of his own, over lines that are slow and lose packets."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.network.laboratory import PORT, Laboratory

pytestmark = pytest.mark.process
RACER = Path(__file__).parent / "programs" / "racer.py"


@pytest.mark.timeout(300)
def test_two_race_from_two_machines_and_the_recording_proves_it(lab: Laboratory, tmp_path: Path) -> None:
    server, ann, bob = lab.machines("server", "ann", "bob")
    ways = {ann: lab.link(server, ann, delay=0.01), bob: lab.link(server, bob, delay=0.025, loss=0.01)}
    words = ("--headless", "--players", "2", "--races", "1", "--name", "club", "--no-ghosts", "--json")
    listen = ("--insecure", "--listen", f"tcp/0.0.0.0:{PORT}")
    game = server.start("game", "meadow", *words, *listen, ELYS_GAME_DIR=str(tmp_path / "times"))
    game.wait_for("first tick", seconds=120)
    racers = [
        machine.start_program(RACER, f"tcp/{ways[machine].address_of(server)}:{PORT}", "meadow", str(number))
        for number, machine in enumerate((ann, bob), start=1)
    ]
    times = [float(racer.wait_for(r"finished ([\d.]+)", seconds=150)[1]) for racer in racers]
    assert game.wait(seconds=120) == 0, game.output
    (entry,) = json.loads(game.output[game.output.index("[\n") :])
    assert entry["proof"] == "equal", game.output
    assert entry["time"] == pytest.approx(min(times), abs=1e-4)
    assert entry["player"] == f"club {times.index(min(times)) + 1}"
    assert all(18.0 < time < 45.0 for time in times)
    for racer in racers:
        gates = [int(line.split()[1]) for line in racer.output.splitlines() if line.startswith("gate")]
        assert gates == list(range(1, len(gates) + 1)) and len(gates) >= 5
