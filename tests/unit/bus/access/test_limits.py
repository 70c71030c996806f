"""What one client can use up: questions that wait, messages that are not read, and nothing of anybody else's."""

from __future__ import annotations

import asyncio

import pytest

from elys.bus import topics
from elys.bus.access import limits
from elys.bus.access.limits import MOST_WAITING, MOST_WAITING_OF_USER, Doorkeeper
from elys.bus.mailbox import KEY_LIMIT, Mailbox
from elys.bus.messages.history import HistoryRequest
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.errors import ConnectionLost, RequestError


def test_of_one_node_only_so_many_questions_wait() -> None:
    door = Doorkeeper()
    assert all(door.admit("tool-1.viewer-a") for _ in range(MOST_WAITING))
    assert not door.admit("tool-1.viewer-a") and door.turned_away == 1
    assert door.admit("tool-2.viewer-a") and door.admit("tool-1.viewer-b")
    door.release("tool-1.viewer-a")
    assert door.admit("tool-1.viewer-a") and not door.admit("tool-1.viewer-a")


def test_making_up_names_of_nodes_helps_no_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_PER_SECOND", 1e9)
    door = Doorkeeper()
    admitted = sum(door.admit(f"tool-{number}.viewer-a") for number in range(10 * MOST_WAITING_OF_USER))
    assert admitted == MOST_WAITING_OF_USER
    assert door.admit("tool-1.viewer-b")
    for number in range(admitted):
        door.release(f"tool-{number}.viewer-a")
    assert door.admit("tool-1.viewer-a")
    door.release("tool-1.viewer-a")
    door.release("tool-1.viewer-b")
    assert not door._waiting  # nothing is remembered of who is gone


def test_questions_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(limits.time, "monotonic", lambda: now[0])
    door = Doorkeeper()

    def asked(user: str, count: int) -> int:
        admitted = 0
        for _ in range(count):
            if door.admit(f"tool-1.{user}"):
                door.release(f"tool-1.{user}")
                admitted += 1
        return admitted

    most = int(limits.MOST_PER_SECOND)
    assert asked("viewer-a", 10 * most) == 2 * most  # what was saved up
    assert asked("viewer-a", 10) == 0 and asked("viewer-b", 10) == 10
    now[0] += 0.5
    assert asked("viewer-a", 10 * most) == most // 2
    now[0] += 1000.0
    assert asked("viewer-a", 10 * most) == 2 * most


async def test_who_asks_without_waiting_delays_nobody_else() -> None:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
    flooding = await Session.join(broker.connect(user="viewer-aaaaaa"), kind="tool")
    honest = await Session.join(broker.connect(user="viewer-bbbbbb"), kind="tool")
    held = asyncio.Event()
    waiting: list[str] = []

    async def answer(request: bytes, key: str) -> bytes:
        waiting.append(key)
        await held.wait()
        return b"content"

    host.serve(topics.ASSET, answer)
    asked = [
        asyncio.create_task(flooding.request(topics.ASSET, b"", key="0a", timeout=30.0))
        for _ in range(3 * MOST_WAITING)
    ]
    lost = 0
    while lost < 2 * MOST_WAITING:  # those beyond are ended at once, not after their time
        done, _ = await asyncio.wait(asked, return_when=asyncio.FIRST_COMPLETED)
        lost = sum(isinstance(task.exception(), ConnectionLost) for task in done)
    other = asyncio.create_task(honest.request(topics.ASSET, b"", key="0a", timeout=30.0))
    while len(waiting) <= MOST_WAITING:
        await asyncio.sleep(0)
    held.set()
    assert await other == b"content"
    answers = await asyncio.gather(*asked, return_exceptions=True)
    assert sum(found == b"content" for found in answers) == MOST_WAITING
    for session in (flooding, honest, host):
        await session.close()


async def test_who_sends_more_than_is_read_loses_his_own() -> None:
    came: list[tuple[str, bytes]] = []
    box = Mailbox(asyncio.get_running_loop(), lambda key, payload: came.append((key, payload)), newest_only=False)
    box.put("input/honest", b"first")
    for number in range(3 * KEY_LIMIT):
        box.put("input/flood", b"%d" % number)
    box.put("input/honest", b"last")
    while not came:
        await asyncio.sleep(0)
    assert [payload for key, payload in came if key == "input/honest"] == [b"first", b"last"]
    assert sum(key == "input/flood" for key, _ in came) == KEY_LIMIT and box.lost == 2 * KEY_LIMIT


async def test_a_question_too_large_for_the_door_is_said_at_once() -> None:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
    joined = await Session.join(broker.connect(), kind="tool")
    request = HistoryRequest(person="x" * 100_000, node="tool-1")
    with pytest.raises(RequestError, match="a question on history may have 65536 bytes, this one has"):
        await joined.request(topics.HISTORY, request)
    await joined.close()
    await host.close()


def test_sizes_are_those_of_the_table() -> None:
    limited: dict[tuple[str, str], int] = {}
    for rule in limits.size_limits():
        assert rule["flows"] == ["ingress"]
        for key in rule["key_exprs"]:
            limited[rule["messages"][0], key.split("/", 2)[2].removesuffix("/**")] = rule["size_limit"]
    assert limited == {("put", topic.name): topic.largest for topic in topics.TOPICS} | {
        ("query", query.name): query.largest for query in topics.QUERIES
    }
    assert max(limited.values()) <= limits.MAX_MESSAGE_SIZE
