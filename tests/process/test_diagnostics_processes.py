"""The figures of a real simulation, seen by `elys top` and found in its recording; and the guard's file of what went wrong."""

from __future__ import annotations

import asyncio
import json
import signal
from pathlib import Path

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.messages.commands import Rename, SetComponent
from elys.bus.recording import Recording
from tests.process.clients import client
from tests.process.conftest import wait_until
from tests.process.terminals import CTRL_C, HIDE_CURSOR, SHOW_CURSOR, Terminal

pytestmark = pytest.mark.process

MASS = 500.0  # [kg] of each cube of the sample `stack`
TOWER = MASS * sum(k + 0.5 for k in range(10))  # [kg m] of the cubes on one another


def test_top_tells_of_a_session_and_the_recording_keeps_it(elys, free_port, tmp_path):
    endpoint, recording = f"tcp/127.0.0.1:{free_port}", tmp_path / "stack.mcap"
    run = elys("run", "stack", "--headless", "--listen", endpoint, "--record", recording)
    run.wait_for("first tick", seconds=250)
    told = elys("top", "--once", "--json", "--connect", endpoint)
    assert told.wait() == 0
    facts = json.loads(told.output)
    assert facts["status"]["playing"]
    assert facts["diagnostics"]["bodies"] == 11
    assert facts["diagnostics"]["potential"] == pytest.approx(9.81 * TOWER, rel=0.2)
    assert "physics.finish_step" in facts["profile"]["stages"]
    lines = elys("top", "--connect", endpoint)
    lines.wait_for(r"bodies awake, .*energy .* J.*tick .* ms")
    lines.end()
    run.end()
    exported = elys("export", recording, tmp_path / "stack.npz")
    assert exported.wait() == 0, exported.output
    arrays = np.load(tmp_path / "stack.npz")
    assert arrays["energy"].shape == arrays["time"].shape == arrays["overlap"].shape
    heights, speeds = arrays["position"][..., 1], arrays["linear_velocity"]
    there = ~np.isnan(arrays["energy"]) & ~np.isnan(heights).any(1)
    assert there.sum() > 10
    expected = MASS * (9.81 * heights.sum(1) + 0.5 * (speeds**2).sum((1, 2)))
    np.testing.assert_allclose(arrays["energy"][there], expected[there], rtol=1e-4)


def test_top_in_a_terminal_is_live_says_when_the_session_ends_and_leaves_by_ctrl_c(
    elys, environment, free_port, tmp_path
):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    run = elys("run", "stack", "--headless", "--listen", endpoint)
    run.wait_for("first tick", seconds=250)
    terminal = Terminal(("top", "--connect", endpoint), environment, tmp_path)
    try:
        first = terminal.wait_for(r"Stack of 10 \(simulation\), playing, tick (\d+)")
        energy = terminal.wait_for(r"energy +(\S+) J, of it kinetic")
        assert float(energy.group(1)) == pytest.approx(9.81 * TOWER, rel=0.2)
        terminal.wait_for(r"physics\.finish step +\S+ ms")
        terminal.wait_for(rf"playing, tick (?!{first.group(1)},)\d+, ", start=energy.end())  # it is live
        run.end()
        gone = terminal.wait_for("the session is gone; waiting for it to return")
        terminal.wait_for("the session is gone", start=gone.end())  # and goes on saying so
        terminal.press(CTRL_C)
        assert terminal.wait() == 0
        assert terminal.attributes == terminal.before
        assert terminal.raw.rindex(SHOW_CURSOR) > terminal.raw.rindex(HIDE_CURSOR)
        assert "Traceback" not in terminal.text
    finally:
        terminal.close()


def test_what_went_wrong_is_named_and_its_last_seconds_are_playable(elys, free_port, tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    run = elys("run", "stack", "--headless", "--listen", endpoint)
    run.wait_for("first tick", seconds=250)
    heard = []

    async def spoil() -> int:
        async with client(endpoint) as other:
            other.session.subscribe(topics.EVENTS, lambda batch, _: heard.extend(batch.events))
            await other.until(lambda: bool(other.frames) and other.frames[-1].tick > 30)
            cube = next(e.id for e in other.mirror.entities.values() if "RigidBody" in e.components)
            faster = {"linear_velocity": (0.0, 3e4, 0.0)}
            assert (await other.ask(SetComponent(entity=cube, component="RigidBody", values=faster))).accepted
            await other.until(lambda: any(event.values.get("cause") for event in heard))
            return cube

    cube = asyncio.run(spoil())
    told = next(event for event in heard if event.values.get("cause"))
    assert (told.entity, told.values["cause"]) == (cube, "too_fast")
    path = tmp_path / run.wait_for(r"elys play (elys-problem-[\w-]+\.mcap)").group(1)
    run.end()
    with Recording(path) as kept:
        assert 30 <= len(np.unique(kept.tick)) <= 301
        assert path.stem.endswith(f"-{int(kept.tick[-1])}")
        assert cube in kept.frame(len(kept) - 1).entity
    facts = elys("info", path, "--json")
    assert facts.wait() == 0
    channels = {channel["name"]: channel["count"] for channel in json.loads(facts.output)["channels"]}
    assert channels["events"] and channels["commands"] and channels["diagnostics"] and channels["profile"]
    played = elys("play", path, "--listen", f"tcp/127.0.0.1:{free_port}")
    played.wait_for("playing")


@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGKILL])
def test_a_simulation_that_crashes_leaves_its_last_seconds(elys, environment, free_port, tmp_path, number):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    run = elys("run", "stack", "--headless", "--listen", endpoint, "--guard", "2s")
    run.wait_for("first tick", seconds=250)

    async def watch() -> int:
        async with client(endpoint) as watcher:
            await watcher.until(lambda: bool(watcher.frames) and watcher.frames[-1].tick > 150)
            reply = await watcher.ask(Rename(entity=watcher.entity("Camera"), name="Witness"))
            assert reply.accepted
            await watcher.until(lambda: watcher.frames[-1].tick > reply.tick + 5)
            return watcher.frames[-1].tick

    seen = asyncio.run(watch())
    run.process.send_signal(number)
    assert run.wait() == -number  # and those who hold its output have ended
    path = Path(run.wait_for(r"ended without a word; its last seconds are in (\S+\.mcap):")[1])
    assert path.parent == tmp_path and path.name.startswith("elys-problem-")
    with Recording(path) as recording:
        assert not recording.reader.mended
        ticks = recording.tick.tolist()
        assert ticks == list(range(ticks[0], ticks[0] + len(ticks)))
        assert ticks[-1] >= seen and 120 <= len(ticks) <= 160
        assert "Witness" in {entity.name for entity in recording.mirror_at(len(ticks) - 1).entities.values()}
    verified = elys("verify", path)
    assert verified.wait() == 0, verified.output
    assert not list(Path(environment["ELYS_RUNTIME_DIR"]).glob("last-*"))


def test_a_simulation_that_ends_in_peace_leaves_nothing(elys, environment, free_port, tmp_path):
    run = elys("run", "stack", "--headless", "--listen", f"tcp/127.0.0.1:{free_port}")
    run.wait_for("first tick", seconds=250)
    runtime = Path(environment["ELYS_RUNTIME_DIR"])
    wait_until(lambda: len(list(runtime.glob("last-*/said-0"))) == 1)
    run.process.terminate()
    assert run.wait() == 0
    assert not list(runtime.glob("last-*")) and not list(tmp_path.glob("*.mcap"))
