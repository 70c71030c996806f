"""Topics while somebody looks: counted as they come, decoded when asked, listened to no longer than that."""

from __future__ import annotations

import asyncio
import time

import pytest

from elys.bus import topics
from elys.bus.messages.session import LogLine, TickProfile
from elys.bus.messages.views import ViewCamera, ViewFrame
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.editor_node.topic_watch import TopicKey, TopicWatch
from elys.editor_node.value_tree import CHILDREN_SHOWN, tree_rows


def watching(scenario) -> None:
    async def main():
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
        session = await Session.join(broker.connect(), kind="editor")
        try:
            await scenario(host, session, TopicWatch(session))
        finally:
            await session.close()
            await host.close()

    asyncio.run(main())


async def until(condition) -> None:
    async with asyncio.timeout(5.0):
        while not condition():
            await asyncio.sleep(0.001)


def line(text="ready") -> LogLine:
    return LogLine(node="simulation-1", level="info", text=text, time=1.0)


def test_every_message_is_counted_and_the_last_one_can_be_read():
    async def scenario(host, session, watch):
        stop = watch.start()
        flow = watch.flow(TopicKey("log", ""))
        assert flow.message() is None
        for number in range(5):
            host.publish(topics.LOG, line(f"line {number}"))
        await until(lambda: flow.total == 5)
        assert flow.message()["text"] == "line 4"
        assert flow.latency is None  # it does not say when it was published
        assert flow.bytes_total > 5 * len("line 4")
        assert flow.rate().count == 5
        stop()
        host.publish(topics.LOG, line())
        host.publish(topics.LOG, line())
        await asyncio.sleep(0)
        assert flow.total == 5

    watching(scenario)


def test_nobody_listens_when_nobody_looks():
    async def scenario(host, session, watch):
        def heard():
            return [t.name for t in topics.TOPICS if host.has_listener(t, key="x" if t.keyed else "")]

        assert heard() == []
        stop = watch.start()
        await until(lambda: "log" in heard())
        assert not {topic.name for topic in topics.ON_DEMAND} & set(heard())
        watch.choose("diagnostics")
        await until(lambda: "diagnostics" in heard())
        watch.choose("log")
        await until(lambda: "diagnostics" not in heard())
        assert "log" in heard()
        watch.choose("debug_lines")
        stop()
        await until(lambda: heard() == [])
        assert not watch.is_running

    watching(scenario)


def test_keys_stand_apart_and_latency_is_since_the_state():
    async def scenario(host, session, watch):
        stop = watch.start()
        published = time.time_ns() - 250_000_000
        for view in ("main", "side"):
            frame = ViewFrame(
                view=view,
                sequence=1,
                tick=1,
                state_published_at=published,
                camera=ViewCamera(position=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0, 1.0)),
                width=4,
                height=4,
                jpeg=bytes(100),
            )
            host.publish(topics.VIEW_FRAME, frame, key=view)
        await until(lambda: watch.flow(TopicKey("view/frame", "side")) is not None)
        names = [flow.name for flow in watch.flows() if flow.topic is topics.VIEW_FRAME]
        assert names == [("view/frame", "main"), ("view/frame", "side")]  # no line without a key beside them
        flow = watch.flow(TopicKey("view/frame", "main"))
        assert flow.latency == pytest.approx(flow.last_at - published * 1e-9)
        assert flow.latency >= 0.25
        assert flow.message()["jpeg"].startswith("100 bytes: 00 00")
        stop()

    watching(scenario)


def test_what_cannot_be_read_says_why():
    async def scenario(host, session, watch):
        stop = watch.start()
        host.publish(topics.PROFILE, TickProfile(tick=1, total=2.0, stages={"a": 1.0}))
        flow = watch.flow(TopicKey("profile", ""))
        await until(lambda: flow.total == 1)
        assert (flow.message()["total"], flow.error) == (2.0, "")
        host.transport.publish(topics.key_of("yard", topics.PROFILE), b"garbage instead", topics.PROFILE.delivery)
        await until(lambda: flow.total == 2)
        assert flow.message() is None
        assert "not a message of ELYS" in flow.error
        stop()

    watching(scenario)


def test_a_tree_shows_what_is_open():
    value = {
        "name": "Box",
        "position": [1.0, 2.5, -3.0],
        "parts": {"lid": {"mass": 2}},
        "none": [],
        "many": list(range(500)),
    }
    closed = tree_rows(value, ())
    assert [(row.label, row.text, row.is_open) for row in closed] == [
        ("name", "'Box'", None),
        ("position", "1  2.5  -3", None),
        ("parts", "{1}", False),
        ("none", "[0]", None),
        ("many", "[500]", False),
    ]
    opened = tree_rows(value, {"/parts", "/parts/lid", "/many"})
    assert [(row.path, row.depth, row.text) for row in opened[3:5]] == [
        ("/parts/lid", 1, "{1}"),
        ("/parts/lid/mass", 2, "2"),
    ]
    assert len(opened) == 5 + 2 + CHILDREN_SHOWN + 1
    assert opened[-1].text == "+ 300"
    assert tree_rows(value, (), label="state")[0] == ("", 0, "state", "{5}", True)


def test_long_texts_are_cut():
    (row,) = tree_rows({"text": "x" * 5000}, ())
    assert len(row.text) < 250
    assert row.text.endswith("(5002)")
