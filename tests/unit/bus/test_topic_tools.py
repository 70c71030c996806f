"""Looking at topics."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from elys.bus import topics
from elys.bus.messages.session import LogLine
from elys.bus.session import Session
from elys.bus.topic_tools import echo, hz, list_topics
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.errors import BusError


async def test_echo_and_hz_show_what_passes(random_host: Callable[..., Any]) -> None:
    broker = LoopbackBroker()
    session = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
    joined = await Session.join(broker.connect(), kind="tool")
    host = random_host(session)
    logs, frames, rates = echo(joined, "log"), echo(joined, "state"), hz(joined, "state", interval=0.1)

    async def publish() -> None:
        while True:
            host.publish_tick()
            session.publish(topics.LOG, LogLine(node="n", level="info", text="hello", time=1.0))
            session.publish_payload(topics.LOG, b"garbage")
            await asyncio.sleep(0.002)

    task = asyncio.create_task(publish())
    seen = [await anext(logs) for _ in range(2)]
    assert {"node": "n", "level": "info", "text": "hello", "time": 1.0, "tick": -1} in seen
    assert any("error" in line for line in seen)
    frame = await anext(frames)
    assert frame["body_count"] >= 5 and len(frame["first_bodies"]["position"]) == 3
    report = await anext(rates)
    assert report.count > 0 and report.rate > 0 and report.bandwidth > 0
    assert report.shortest <= 1 / report.rate <= report.longest
    task.cancel()
    for stream in (logs, frames, rates):
        await stream.aclose()  # type: ignore[attr-defined]
    await joined.close()
    await session.close()


async def test_silence_has_no_rate_and_an_unknown_topic_names_the_known() -> None:
    broker = LoopbackBroker()
    session = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
    report = await anext(hz(session, "state", interval=0.01))
    assert (report.count, report.rate) == (0, 0.0)
    with pytest.raises(BusError, match="there is no topic 'sate'; there are state"):
        await anext(echo(session, "sate"))
    await session.close()


def test_the_list_holds_every_topic_and_query_once() -> None:
    names = [row.name for row in list_topics()]
    assert sorted(names) == sorted(
        {*(topic.name for topic in topics.TOPICS), *(query.name for query in topics.QUERIES)}
    )
