"""Requests of several views to one render node: the newest of each arrives, and who makes up names displaces nobody for long."""

from __future__ import annotations

import asyncio

from elys.bus import topics
from elys.bus.mailbox import MOST_NAMES
from elys.bus.messages.views import ViewRequest
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker


def request(view: str, sequence: int) -> ViewRequest:
    return ViewRequest(view=view, sequence=sequence, width=64, height=64)


async def test_the_newest_of_each_view_arrives() -> None:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="s", kind="simulation", epoch=7)
    heard: list[tuple[str, int]] = []
    host.subscribe(topics.VIEW_REQUEST, lambda asked, _: heard.append((asked.view, asked.sequence)), key="render-1")
    for sequence in range(1, 4):
        for view in ("a", "b", "c", "d"):
            host.publish(topics.VIEW_REQUEST, request(view, sequence), key="render-1")
    await asyncio.sleep(0.05)
    assert sorted(heard) == [("a", 3), ("b", 3), ("c", 3), ("d", 3)]
    heard.clear()
    host.publish(topics.VIEW_REQUEST, request("honest", 9), key="render-1")
    for number in range(1000):
        host.publish(topics.VIEW_REQUEST, request(f"rogue-{number}", 1), key="render-1")
    await asyncio.sleep(0.05)
    assert len(heard) == MOST_NAMES + 1 and heard[0] == ("honest", 9)
    await host.close()
