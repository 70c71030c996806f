"""Headless here, viewed from there: each node on a machine of its own, over lines of all kinds."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from elys.bus.recording import Recording
from tests.network.laboratory import PORT, Laboratory, Machine
from tests.network.truth import Account, Truth
from tests.process.conftest import Command

pytestmark = pytest.mark.process
PROGRAMS = Path(__file__).parent / "programs"
WATCHER = PROGRAMS / "watcher.py"
LISTEN = ("--headless", "--insecure", "--listen", f"tcp/0.0.0.0:{PORT}")


def simulating(server: Machine, scene: str, *options: str) -> Command:
    """A simulation that others can come to."""
    command = server.start("run", scene, *LISTEN, *options)
    command.wait_for("simulating", seconds=120)
    return command


def green_share(path: Path) -> float:
    """The share of pixels that are plainly green."""
    with Image.open(path) as image:
        red, green, blue = np.moveaxis(np.asarray(image.convert("RGB"), np.int32), 2, 0)
    return float(((green > 2 * red) & (green > 2 * blue) & (green > 40)).mean())


@pytest.mark.gl
@pytest.mark.timeout(240)
def test_edit_picture_and_recording_on_other_machines(lab: Laboratory) -> None:
    server, editor, viewer, archive = lab.machines("server", "editor", "viewer", "archive")
    ways = {machine: lab.link(server, machine, delay=0.01) for machine in (editor, viewer)}
    ways[archive] = lab.cable(server, archive)
    endpoints = {machine: f"tcp/{way.address_of(server)}:{PORT}" for machine, way in ways.items()}
    simulation = simulating(server, "stack", "--record", "own.mcap")
    recorder = archive.start("record", "--connect", endpoints[archive], "-o", "outside.mcap")
    recorder.wait_for("recording")
    watcher = viewer.start_program(WATCHER, endpoints[viewer])
    person = editor.start_program(WATCHER, endpoints[editor])
    for command in (watcher, person):
        command.wait_for(" state ")

    def picture(name: str) -> float:
        words = ("render", "-o", name, "--connect", endpoints[viewer], "--size", "320x180")
        assert viewer.start(*words).wait(seconds=120) == 0
        return green_share(viewer.folder / name)

    before = picture("before.png")
    person.tell("paint 'Cube 5' 0 1 0")
    person.wait_for("reply paint accepted")
    person.tell("rename 'Cube 5' Green")
    person.wait_for("reply rename accepted")
    assert picture("after.png") > before + 0.001  # a cube of ten, in the distance
    assert recorder.process.poll() is None
    recorder.process.terminate()
    assert recorder.wait() == 0
    simulation.process.terminate()
    assert simulation.wait() == 0

    truth = Truth()
    truth.add(server.folder / "own.mcap")
    assert_lossless(archive.folder / "outside.mcap", truth)
    states, scenes = Account.of(watcher).compared(truth)
    assert states > 60 and scenes > 0


def assert_lossless(path: Path, truth: Truth) -> None:
    """A recording from outside has each tick of its time, as it was, and the scene as it came to be."""
    recorded = Truth()
    recorded.add(path)
    ticks = [tick for _, tick in recorded.hashes]
    assert len(ticks) > 60
    assert ticks == list(range(ticks[0], ticks[-1] + 1))
    common = recorded.hashes.keys() & truth.hashes.keys()
    assert len(common) == len(ticks)
    assert all(recorded.hashes[place] == truth.hashes[place] for place in common)
    assert all(recorded.states[place] == truth.states[place] for place in common)
    with Recording(path) as recording:
        names = {entity.name for entity in recording.mirror_at(len(recording) - 1).entities.values()}
    assert "Green" in names


@pytest.mark.parametrize(("delay", "loss"), [(0.0, 0.0), (0.02, 0.02), (0.3, 0.0), (0.3, 0.02)])
@pytest.mark.timeout(120)
def test_who_comes_over_a_bad_line_has_the_whole_scene(lab: Laboratory, delay: float, loss: float) -> None:
    server, laptop = lab.machines("server", "laptop")
    link = lab.link(server, laptop, delay=delay, loss=loss)
    simulating(server, "stack")
    watcher = laptop.start_program(WATCHER, f"tcp/{link.address_of(server)}:{PORT}")
    assert int(watcher.wait_for(r" scene (\d+)")[1]) > 10
    first = watcher.wait_for(r" state \d+ (\d+) ")
    watcher.wait_for(rf" state \d+ (?!{first[1]} )\d+ ")


def test_through_one_port_of_another_machine(lab: Laboratory) -> None:
    """As through `ssh -L`: the address is not the host's, and one TCP port is all there is."""
    server, gateway, laptop = lab.machines("server", "gateway", "laptop")
    inside, outside = lab.cable(server, gateway), lab.link(gateway, laptop, delay=0.01)
    simulating(server, "stack")
    forwarder = gateway.start_program(PROGRAMS / "forwarder.py", "9000", inside.address_of(server), str(PORT))
    forwarder.wait_for("forwarding")
    watcher = laptop.start_program(WATCHER, f"tcp/{outside.address_of(gateway)}:9000")
    watcher.wait_for(" state ")
    watcher.tell("rename Ground Floor")
    watcher.wait_for("reply rename accepted")
    recorder = laptop.start(
        "record", "--connect", f"tcp/{outside.address_of(gateway)}:9000", "-o", "far.mcap", "--seconds", "2"
    )
    assert recorder.wait() == 0
    with Recording(laptop.folder / "far.mcap") as recording:
        assert len(recording) > 30
    assert re.search("1 connection", forwarder.output)
