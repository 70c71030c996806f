"""Routers, worlds behind one port and looking around, between real processes."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
from pathlib import Path

import pytest

from elys.bus.discovery import join_session
from tests.benchmarks.viewers import stage
from tests.process.clients import Client, client
from tests.process.network_spaces import two_machines

pytestmark = pytest.mark.process
LAUNCH = Path(__file__).parents[2] / "launch"


def endpoints(count: int) -> list[str]:
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    found = [f"tcp/127.0.0.1:{probe.getsockname()[1]}" for probe in probes]
    for probe in probes:
        probe.close()
    return found


def test_a_tree_goes_on_whatever_of_it_is_killed(elys):
    """Simulation, upper and lower router in turn: the viewer below shows the new run each time, and never an old frame."""
    top, upper, lower = endpoints(3)

    def simulation():
        started = elys("run", "stack", "--headless", "--listen", top, "--no-guard")
        started.wait_for("simulating")
        return started

    def router(own, above):
        started = elys("router", "--listen", own, "--connect", above)
        started.wait_for("routing at")
        return started

    processes = {"simulation": simulation(), "upper": router(upper, top), "lower": router(lower, upper)}
    again = {"simulation": simulation, "upper": lambda: router(upper, top), "lower": lambda: router(lower, upper)}

    async def main() -> None:
        async with client(lower) as viewer:
            await fresh_frames(viewer)
            for name in ("upper", "simulation", "lower", "simulation"):
                epoch = viewer.session.epoch
                processes[name].kill()
                await viewer.until(lambda: not viewer.session.connected)
                processes[name] = await asyncio.to_thread(again[name])
                await viewer.until(lambda: viewer.session.connected, seconds=40)
                assert (viewer.session.epoch != epoch) == (name == "simulation")
                viewer.frames.clear()
                await fresh_frames(viewer)
                assert {frame.epoch for frame in viewer.frames} == {viewer.session.epoch}

    asyncio.run(main())


async def fresh_frames(viewer: Client) -> None:
    await viewer.until(lambda: len(viewer.frames) > 10, seconds=40)
    assert [f.tick for f in viewer.frames] == sorted({f.tick for f in viewer.frames})


def test_of_many_viewers_below_a_tree_none_misses_a_change_of_the_scene(soak):
    """The benchmark's small sister: each viewer is a connection and a session of its own, four a router."""
    count = 100 if soak else 12
    with stage("stack", branches=3) as on:
        phase = on.phase(count, 20.0 if soak else 2.0)
        again = on.phase(0, 1.0)
    assert phase.ticks > 10 and phase.deltas >= 4 * count
    assert (phase.missed_states, phase.missed_deltas) == (0, 0)
    assert phase.fewest_states > 0.5 * phase.ticks
    assert len(phase.routers) == 4
    assert (again.states, again.deltas) == (0, 0)


def test_two_worlds_behind_one_port_are_told_apart(elys):
    """As launch/worlds.toml has them: listed, chosen by name, and one's end leaves the other alone."""
    (endpoint,) = endpoints(1)
    running = elys("launch", LAUNCH / "worlds.toml", "first=stack", "second=dominoes", f"endpoint={endpoint}")
    for name in ("first", "second"):
        running.wait_for(f"session {name} .* is here")
    unnamed = elys("topic", "echo", "status", "-n", "1", "--connect", endpoint)
    assert unnamed.wait() == 1
    assert "several sessions are here, first, second: name one with --session NAME" in unnamed.output
    for name, scene in (("first", "Stack of 10"), ("second", "Dominoes")):
        told = elys("topic", "echo", "status", "-n", "1", "--session", name)
        assert told.wait() == 0 and json.loads(told.lines[-1])["scene"] == scene
    wrong = elys("topic", "echo", "status", "-n", "1", "--connect", endpoint, "--session", "third")
    assert wrong.wait() == 1 and "there is no session third here; there is first, second" in wrong.output

    listed = elys("sessions", "--json")
    assert listed.wait() == 0
    rows = {row["name"]: row for row in json.loads(listed.output)}
    assert set(rows) == {"first", "second"} and all(
        row["answers"] and row["tick_rate"] == 60.0 for row in rows.values()
    )
    behind = elys("sessions", "--connect", endpoint, "--json")
    assert behind.wait() == 0 and [row["scene"] for row in json.loads(behind.output)] == ["Stack of 10", "Dominoes"]

    twin = elys("run", "stack", "--headless", "--router", endpoint, "--name", "first")
    assert twin.wait() == 1 and "a session called first runs already" in twin.output

    async def main() -> None:
        async with client(f"first@{endpoint}") as viewer:
            other = await join_session(f"second@{endpoint}", kind="tool")
            ended: list[bool] = []
            other.on_link(ended.append)
            end_process(rows["second"]["pid"])
            await viewer.until(lambda: ended == [False])
            viewer.frames.clear()
            await fresh_frames(viewer)
            assert viewer.session.connected
            await other.close()

    asyncio.run(main())


def end_process(pid: int) -> None:
    os.kill(pid, signal.SIGTERM)


def test_the_network_is_shown_and_says_who_is_there(elys):
    top, lower = endpoints(2)
    elys("run", "stack", "--headless", "--listen", top).wait_for("simulating")
    elys("router", "--listen", lower, "--connect", top).wait_for("session Stack-of-10 .* is here")

    async def main() -> None:
        async with client(lower) as viewer:
            await fresh_frames(viewer)
            shown = elys("top", "--network", "--json", "--connect", lower)
            assert await asyncio.to_thread(shown.wait) == 0
            report = json.loads(shown.output)
            rows = {row["kind"]: row for row in report["nodes"]}
            assert set(rows) == {"simulation", "router", "tool"} and report["host"]["tick_rate"] == 60.0
            mine = rows["tool"]
            assert mine["node"] == viewer.session.node.id and mine["answers"] and mine["state_rate"] > 1.0
            assert mine["address"].startswith("tcp/127.0.0.1:") and mine["round_trip"] > 0.0
            assert rows["router"]["links"] >= 2 and rows["simulation"]["sent_rate"] > mine["state_rate"] / 2
            plain = elys("top", "--network", "--once", "--connect", top)
            assert await asyncio.to_thread(plain.wait) == 0
            assert "\x1b" not in plain.output and viewer.session.node.id in plain.output
            lines = elys("top", "--network", "--connect", top)
            await asyncio.to_thread(lines.wait_for, r"Stack-of-10: 3 nodes.*states missed 0.*oldest")
            info = elys("topic", "info", "state", "--connect", lower)
            assert await asyncio.to_thread(info.wait) == 0
            assert rows["simulation"]["node"] in info.output and "state_hash" in info.output

    asyncio.run(main())


def test_sessions_are_found_on_a_network_by_those_who_ask_if_they_were_told_to_answer(elys):
    with two_machines() as (here, there):
        open_to_all = ("run", "stack", "--headless", "--listen", "tcp/0.0.0.0:7447")
        silent = elys(*open_to_all, "--name", "silent", before=here)
        silent.wait_for("simulating")
        assert found_from(elys, there) == []
        silent.end()
        elys(*open_to_all, "--name", "shown", "--discover", before=here).wait_for("simulating")
        (found,) = found_from(elys, there)
        assert (found["name"], found["endpoint"], found["scene"]) == ("shown", "tcp/10.77.0.1:7447", "Stack of 10")
        assert found["age"] >= 0.0 and not found["is_local"] and found["needs_secret"]
        echo = ("topic", "echo", "status", "-n", "1", "--connect", found["endpoint"])
        stranger = elys(*echo, before=there)
        assert stranger.wait() == 1 and "lets in only who shows a secret" in stranger.output
        viewer, owner = (key_of(elys, role) for role in ("viewer", "owner"))
        joined = elys(*echo, before=there, ELYS_SECRET=viewer)
        assert joined.wait() == 0, joined.output
        plain = elys("sessions", before=there, ELYS_RUNTIME_DIR="/nonexistent")
        assert plain.wait() == 0 and "No session is running on this machine" in plain.output

        route = ("router", "--listen", "tcp/0.0.0.0:7448", "--connect", found["endpoint"], "--discover")
        for secret, reason in (("", "none is here for tcp/10.77.0.1:7447"), (viewer, "needs the owner's key")):
            refused = elys(*route, before=there, ELYS_SECRET=secret)
            assert refused.wait() == 1 and reason in refused.output
        elys(*route, before=there, ELYS_SECRET=owner).wait_for("session shown .* is here")
        both = found_from(elys, here)
        assert {row["endpoint"] for row in both} == {"tcp/10.77.0.1:7447", "tcp/10.77.0.2:7448"}
    refused = elys("run", "stack", "--headless", "--discover")
    assert refused.wait() == 1 and "add --listen tcp/0.0.0.0:7447 to --discover" in refused.output


def key_of(elys, role: str) -> str:
    shown = elys("keys", "show", role)
    assert shown.wait() == 0
    return next(word for line in shown.lines for word in line.split() if word.startswith(f"{role}-"))


def found_from(elys, machine: tuple[str, ...]) -> list[dict]:
    looked = elys("sessions", "--discover", "--json", before=machine, ELYS_RUNTIME_DIR="/nonexistent")
    assert looked.wait() == 0, looked.output
    return json.loads(looked.output)
