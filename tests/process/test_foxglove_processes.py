"""`elys run --foxglove`: a client of the app's protocol hears the running session, and the process goes with the run."""

from __future__ import annotations

import asyncio
import json
import socket

import pytest

pytestmark = pytest.mark.process
pytest.importorskip("foxglove")
websockets = pytest.importorskip("websockets")


def test_a_running_session_is_heard_and_ends_cleanly(elys, free_port):
    port = free_port
    run = elys("run", "stack", "--headless", "--steps", "900", "--realtime", "--foxglove", str(port))
    run.wait_for("Foxglove: open a connection to ws://127.0.0.1")

    async def hear() -> tuple[set[str], int]:
        address = f"ws://127.0.0.1:{port}"
        async with websockets.connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None) as connection:
            channels: dict[str, int] = {}
            while "/tf" not in channels:
                told = await asyncio.wait_for(connection.recv(), 20)
                if isinstance(told, str) and (message := json.loads(told))["op"] == "advertise":
                    channels.update({channel["topic"]: channel["id"] for channel in message["channels"]})
            asked = [{"id": 1, "channelId": channels["/tf"]}]
            await connection.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
            frames = [b""]
            while len(frames) < 30:
                told = await asyncio.wait_for(connection.recv(), 20)
                if isinstance(told, bytes) and told[0] == 1:
                    frames.append(told[13:])
            return set(channels), len(set(frames))

    topics, different = asyncio.run(hear())
    assert {"/tf", "/scene", "/log", "/status", "/robot_description"} <= topics
    assert different > 20
    assert run.wait() == 0, run.output
    assert "900 ticks" in run.output and "Traceback" not in run.output
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0  # nobody listens there any more


def test_without_a_session_there_is_a_sentence(elys, free_port):
    alone = elys("foxglove", "--port", str(free_port))
    assert alone.wait() == 1
    assert "no session is running on this machine" in alone.output
