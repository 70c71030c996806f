"""Pictures on their way to browsers: as many as each can take, the newest, and no browser waits for another."""

from __future__ import annotations

import asyncio
from typing import Any

import msgspec
import pytest

from elys.bus.access.roles import Role
from elys.common.errors import ConnectionLost
from elys.web_node import outbox, picture_stream
from elys.web_node.outbox import MOST_ANSWERS, Outbox
from elys.web_node.picture_stream import MOST_PIXELS, ON_THE_WAY
from tests.unit.web_node.conftest import PATIENCE

LOOK: dict[str, Any] = {"number": 1, "width": 64, "height": 48}
CAMERA = {"position": [1.0, 2.0, 3.0], "rotation": [0.0, 0.0, 0.0, 1.0]}


async def until(condition):
    async with asyncio.timeout(PATIENCE):
        while not condition():
            await asyncio.sleep(0.002)


def pump(web):
    """The scene goes on by a tick, and who waits for one is answered."""
    web.painter.tick += 1
    newest = {request.view: request for request in web.painter.asked}
    for request in newest.values():
        if request.newer_than_tick == web.painter.tick - 1:
            web.painter.draw(request)


def test_a_look_is_answered_with_its_picture(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        await visitor.say("look", **LOOK)
        first = await visitor.picture()
        assert (first["look"], first["width"], first["height"], first["encoding"]) == (1, 64, 48, "jpeg")
        assert first["data"] == b"jpeg"
        await visitor.say("shown", picture=first["picture"])
        await visitor.say("look", **LOOK | {"number": 2, "camera": CAMERA, "selection": [5]})
        second = await visitor.picture()
        assert (second["look"], second["camera"]["position"]) == (2, [1.0, 2.0, 3.0])
        asked = web.painter.asked[-1]
        assert asked.selection == (5,) or web.painter.asked[-2].selection == (5,)

    on_the_web(scenario)


def test_nothing_is_asked_for_again_while_nothing_changes(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        await visitor.say("look", **LOOK)
        await visitor.say("shown", picture=(await visitor.picture())["picture"])
        await until(lambda: web.painter.asked[-1].newer_than_tick == 1)
        count = len(web.painter.asked)
        await visitor.say("ping", time=1.0)
        await visitor.hear("pong")
        assert len(web.painter.asked) == count
        pump(web)
        assert (await visitor.picture())["tick"] == 2

    on_the_web(scenario)


def test_a_slow_browser_gets_fewer_pictures_and_holds_up_nobody(on_the_web):
    async def scenario(web):
        slow, quick = await web.visitor(Role.VIEWER), await web.visitor(Role.VIEWER)
        for visitor in (slow, quick):
            await visitor.say("look", **LOOK)
        ticks = []
        async with asyncio.timeout(PATIENCE):
            while len(ticks) < 40:
                pump(web)
                picture = await quick.picture()
                await quick.say("shown", picture=picture["picture"])
                ticks.append(picture["tick"])
        assert ticks == sorted(ticks)
        assert ticks[-1] >= 40
        await slow.say("ping", time=1.0)
        await slow.hear("pong")
        assert len(slow.pictures) <= ON_THE_WAY  # it has said of none that it was shown
        for picture in slow.pictures:
            await slow.say("shown", picture=picture["picture"])
        slow.pictures.clear()
        assert (await slow.picture())["tick"] >= ticks[-1] - 1  # the newest, and none of those between

    on_the_web(scenario)


def test_a_stream_with_a_gap_goes_on_with_a_keyframe(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        await visitor.say("look", **LOOK | {"encoding": "h264"})
        first = await visitor.picture()
        assert (first["encoding"], first["keyframe"], first["data"]) == ("h264", True, b"h264")
        await visitor.say("shown", picture=first["picture"])
        await until(lambda: web.painter.asked[-1].newer_than_tick == 1)
        web.painter.number += 1  # one was lost between the render node and here
        pump(web)
        assert (await visitor.picture())["keyframe"]

    on_the_web(scenario)


def test_a_browser_that_cannot_decode_gets_a_keyframe(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        await visitor.say("look", **LOOK | {"encoding": "h264"})
        first = await visitor.picture()
        await visitor.say("shown", picture=first["picture"], lost=True)
        assert (await visitor.picture())["keyframe"]

    on_the_web(scenario)


def test_what_is_lost_on_the_way_to_the_render_node_is_asked_for_again(on_the_web, monkeypatch):
    monkeypatch.setattr(picture_stream, "ANSWER_TIMEOUT", 0.05)

    async def scenario(web):
        web.painter.is_quick = False
        visitor = await web.visitor(Role.VIEWER)
        await visitor.say("look", **LOOK)
        await until(lambda: len(web.painter.asked) == 2)
        web.painter.draw(web.painter.asked[0])  # the late answer to the first: shown, but not as what is wanted now
        assert (await visitor.picture())["look"] == 0
        web.painter.draw(web.painter.asked[-1])
        assert (await visitor.picture())["look"] == 1

    on_the_web(scenario)


def test_a_page_that_is_not_in_sight_asks_for_nothing(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        await visitor.say("look", **LOOK | {"is_seen": False})
        await visitor.say("ping", time=1.0)
        await visitor.hear("pong")
        assert web.painter.asked == []
        await visitor.say("look", **LOOK)
        await visitor.picture()

    on_the_web(scenario)


def test_a_huge_view_is_drawn_smaller(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        await visitor.say("look", **LOOK | {"width": 8192, "height": 8192})
        await visitor.picture()
        asked = web.painter.asked[-1]
        assert asked.width == asked.height
        assert 0.99 * MOST_PIXELS < asked.width * asked.height <= MOST_PIXELS

    on_the_web(scenario)


def test_a_browser_gets_no_more_a_second_than_it_may(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        loop = asyncio.get_running_loop()
        began = loop.time()
        for number in range(1, 6):
            await visitor.say("look", **LOOK | {"number": number})
            picture = await visitor.picture()
            await visitor.say("shown", picture=picture["picture"])
        assert loop.time() - began >= 4 / 20.0 - 0.01  # five pictures are four intervals, however quick the machine

    on_the_web(scenario, most_a_second=20.0)


class StuckSocket:
    """Takes nothing until it is let."""

    def __init__(self) -> None:
        self.may = asyncio.Event()
        self.sent: list[Any] = []

    async def send_str(self, data: str) -> None:
        await self.may.wait()
        self.sent.append(msgspec.json.decode(data))

    async def send_bytes(self, data: bytes) -> None:
        await self.may.wait()
        self.sent.append(data)


def test_of_news_only_the_newest_waits_and_answers_keep_their_order():
    async def scenario():
        box, socket = Outbox(), StuckSocket()
        sending = asyncio.create_task(box.run(socket))
        box.answer("pong", time=0)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        for tick in range(1000):
            box.tell("status", tick=tick, kind="simulation")
        box.answer("pong", time=1)
        box.put_picture({"picture": 1}, b"pixels")
        box.tell("link", connected=True)
        socket.may.set()
        await until(lambda: len(socket.sent) == 5)
        sending.cancel()
        assert [one.get("time") for one in socket.sent if isinstance(one, dict) and one["type"] == "pong"] == [0, 1]
        assert [one["tick"] for one in socket.sent if isinstance(one, dict) and one["type"] == "status"] == [999]
        (picture,) = (one for one in socket.sent if isinstance(one, bytes))
        assert picture == (13).to_bytes(4, "little") + b'{"picture":1}' + b"pixels"

    asyncio.run(scenario())


def test_who_asks_and_does_not_listen_is_let_go(monkeypatch):
    monkeypatch.setattr(outbox, "PATIENCE", 0.01)

    async def scenario():
        box = Outbox()
        for _ in range(MOST_ANSWERS):
            box.answer("pong")
        with pytest.raises(ConnectionLost, match="has taken nothing"):
            await box.run(StuckSocket())
        for _ in range(2 * MOST_ANSWERS):
            box.answer("pong")
        with pytest.raises(ConnectionLost, match="asks and does not listen"):
            await box.run(StuckSocket())

    asyncio.run(scenario())
