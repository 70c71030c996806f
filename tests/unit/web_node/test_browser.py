"""What browsers say and are told: each as far as its role may, and nobody else is touched by what one of them gets wrong."""

from __future__ import annotations

import asyncio

import pytest

from elys.bus import topics
from elys.bus.access.roles import Role
from elys.bus.messages import commands as c
from elys.bus.messages.views import PickReply
from elys.web_node import browser
from elys.web_node.requests import MOST_BYTES, MOST_ROWS
from tests.unit.web_node.conftest import PATIENCE

CAMERA = {"position": [0.0, 0.0, 5.0], "rotation": [0.0, 0.0, 0.0, 1.0]}
LOOK = {"number": 1, "width": 64, "height": 48}


def entity_named(web, name):
    return next(entity.id for entity in web.host.mirror.entities.values() if entity.name == name)


def mass(web, entity):
    return web.host.mirror.entities[entity].components["RigidBody"].mass


def set_mass(web, value):
    return {
        "type": "set_component",
        "entity": entity_named(web, "Crate"),
        "component": "RigidBody",
        "values": {"mass": value},
    }


async def until(condition):
    async with asyncio.timeout(PATIENCE):
        while not condition():
            await asyncio.sleep(0.002)


def test_who_comes_in_is_told_how_things_stand(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.PLAYER)
        welcome = await visitor.hear("welcome")
        assert (welcome["role"], welcome["session"]) == ("player", "play")
        body = next(one for one in welcome["components"] if one["name"] == "RigidBody")
        field = next(one for one in body["fields"] if one["name"] == "mass")
        assert (field["kind"], field["unit"], field["minimum"]) == ("float", "kg", 1e-6)
        assert await visitor.hear("link") == {"type": "link", "connected": True, "renderer": True}
        web.host.tick = 7
        web.host.publish_status()
        assert (await visitor.hear("status", tick=7))["scene"] == "yard"

    on_the_web(scenario)


def test_an_edit_reaches_the_session_and_comes_back(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.EDITOR)
        crate = entity_named(web, "Crate")
        await visitor.say("inspect", entity=crate)
        before = await visitor.hear("entity", entity=crate)
        assert before["components"]["RigidBody"]["mass"] == 1.0
        answer = await visitor.ask(1, set_mass(web, 5.0), label="Set mass", made_from=before["revision"])
        assert answer["accepted"], answer
        after = await visitor.hear("entity", entity=crate)
        assert after["components"]["RigidBody"]["mass"] == 5.0
        assert after["revision"] > before["revision"]
        refused = await visitor.ask(2, set_mass(web, -1.0))
        assert not refused["accepted"]
        assert "must be at least" in refused["reason"]
        assert mass(web, crate) == 5.0

    on_the_web(scenario)


def test_each_browser_undoes_its_own_edits_and_refuses_to_write_over_an_unseen_one(on_the_web):
    async def scenario(web):
        first, second = await web.visitor(Role.EDITOR), await web.visitor(Role.EDITOR)
        crate, lamp = entity_named(web, "Crate"), entity_named(web, "Lamp")
        assert (await first.ask(1, set_mass(web, 2.0)))["accepted"]
        assert (await second.ask(1, {"type": "rename", "entity": lamp, "name": "Sun"}))["accepted"]
        stale = await second.ask(2, set_mass(web, 3.0), made_from=0)
        assert not stale["accepted"] and mass(web, crate) == 2.0
        assert (await first.ask(2, {"type": "undo"}))["accepted"]
        assert mass(web, crate) == 1.0
        assert web.host.mirror.entities[lamp].name == "Sun"
        await first.socket.close()
        await until(lambda: web.node.nodes)  # the loop has gone round: its place is free
        again = await web.visitor(Role.EDITOR)  # as a page that is loaded anew
        assert (await again.ask(1, {"type": "redo"}))["accepted"]
        assert mass(web, crate) == 2.0

    on_the_web(scenario)


@pytest.mark.parametrize("role", [Role.VIEWER, Role.PLAYER])
def test_what_a_role_may_not_reaches_nobody(on_the_web, role):
    async def scenario(web):
        visitor = await web.visitor(role)
        crate = entity_named(web, "Crate")
        forbidden = [
            set_mass(web, 5.0),
            {"type": "rename", "entity": crate, "name": "Mine"},
            {"type": "despawn", "entity": crate},
            {"type": "set_playing", "playing": True},
            {"type": "step_ticks", "count": 1},
            {"type": "seek", "time": 0.0},
            {"type": "resume"},
            {"type": "undo"},
        ]
        for number, command in enumerate(forbidden):
            answer = await visitor.ask(number, command)
            assert not answer["accepted"]
            assert answer["reason"] == f"this takes the role editor; yours is {role.title}"
        assert web.host.received == []

    on_the_web(scenario)


def test_keys_of_players_reach_the_game_and_those_of_viewers_do_not(on_the_web):
    async def scenario(web):
        heard: list[tuple[str, c.Input]] = []
        web.host.session.subscribe(topics.INPUT, lambda keys, node: heard.append((node, keys)))
        viewer = await web.visitor(Role.VIEWER)
        await viewer.say("keys", changes=[["w", True]])
        assert (await viewer.hear("answer"))["reason"].startswith("this takes the role player")
        assert heard == []
        first, second = await web.visitor(Role.PLAYER), await web.visitor(Role.PLAYER)
        await first.say("keys", changes=[["w", True], ["no such key", True]], moved={"pointer_x": 3.0}, text="w")
        await until(lambda: len(heard) == 1)
        await second.say("keys", changes=[["mouse_left", True]])
        await until(lambda: len(heard) == 2)
        (node, one), (_, two) = heard
        assert node == web.node.node.id
        assert (one.changes, one.moved, one.text) == ((("w", True),), {"pointer_x": 3.0}, "w")
        assert one.player != two.player  # what one lets go of, the other still holds
        await first.socket.close()
        await until(lambda: len(heard) == 3)
        assert heard[2][1].lets_go and heard[2][1].player == one.player

    on_the_web(scenario)


def test_a_click_finds_an_entity(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        crate = entity_named(web, "Crate")
        web.painter.picked = PickReply(entity=crate, position=(1.0, 2.0, 3.0))
        await visitor.say("pick", id=4, camera=CAMERA, width=64, height=48, x=10, y=20)
        answer = await visitor.hear("answer", id=4)
        assert (answer["entity"], answer["name"], answer["position"]) == (crate, "Crate", [1.0, 2.0, 3.0])

    on_the_web(scenario)


def test_the_inspector_follows_a_body_that_moves_and_one_that_ends(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        crate = entity_named(web, "Crate")
        await visitor.say("inspect", entity=crate)
        await visitor.hear("entity", entity=crate)
        async with asyncio.timeout(PATIENCE):
            place = None
            while place != [1.0, 2.0, 3.0]:
                web.host.publish_frame({crate: (1.0, 2.0, 3.0)})
                await visitor.next_message()
                place = visitor.others[-1].get("components", {}).get("Transform", {}).get("position", place)
        editor = await web.visitor(Role.EDITOR)
        assert (await editor.ask(1, {"type": "despawn", "entity": crate}))["accepted"]
        assert await visitor.hear("entity", lives=False) is not None

    on_the_web(scenario)


@pytest.mark.parametrize(
    "said",
    [
        "{",
        "",
        "null",
        "[]",
        "\x00",
        '"look"',
        '{"type": "look"}',
        '{"type": "nothing"}',
        '{"type": "look", "number": 1, "width": 64, "height": 48, "more": 1}',
        '{"type": "look", "number": -1, "width": 64, "height": 48}',
        '{"type": "look", "number": 1, "width": 100000, "height": 48}',
        '{"type": "look", "number": 1, "width": 64, "height": 48, "selection": ["x"]}',
        '{"type": "look", "number": 1, "width": 64, "height": 48, "encoding": "gif"}',
        '{"type": "rows", "first": 0, "count": 100000}',
        '{"type": "ask", "id": 1, "command": {"type": "load_scene", "name": "x", "records": []}}',
        '{"type": "ask", "id": 1, "command": {"type": "input", "player": 1}}',
        '{"type": "ask", "id": 1, "command": {"type": "batch", "edits": []}}',
        '{"type": "keys", "moved": {"axis": 1.0}}',
        '{"type": "keys", "moved": {"pointer_x": NaN}}',
        '{"type": "ping", "time": 1e999}',
        "[" * 20_000,
        b"\x00\x01",
    ],
)
def test_what_is_no_request_ends_only_its_own_connection_with_a_reason(on_the_web, said):
    async def scenario(web):
        other, visitor = await web.visitor(Role.VIEWER), await web.visitor(Role.EDITOR)
        await visitor.hear("welcome")
        await (visitor.socket.send_bytes(said) if isinstance(said, bytes) else visitor.socket.send_str(said))
        code, reason = await visitor.last_words()
        assert code == 1008
        assert reason.startswith("this is no request: ")
        await other.say("ping", time=5.0)
        assert (await other.hear("pong"))["time"] == 5.0
        assert web.host.received == []

    on_the_web(scenario)


def test_a_message_that_is_too_long_ends_its_connection(on_the_web):
    async def scenario(web):
        other, visitor = await web.visitor(Role.VIEWER), await web.visitor(Role.EDITOR)
        await visitor.say("rows", first=0, count=1, search="x" * MOST_BYTES)
        code, _ = await visitor.last_words()
        assert code == 1009
        await other.say("ping", time=5.0)
        await other.hear("pong")

    on_the_web(scenario)


def test_a_flood_ends_its_connection(on_the_web, monkeypatch):
    monkeypatch.setattr(browser, "MOST_A_SECOND", 20.0)

    async def scenario(web):
        other, visitor = await web.visitor(Role.VIEWER), await web.visitor(Role.VIEWER)
        for _ in range(200):
            if visitor.socket.closed:
                break
            await visitor.say("inspect", entity=0)
        code, reason = await visitor.last_words()
        assert (code, reason) == (1008, "more than 20 messages a second")
        await other.say("ping", time=5.0)
        await other.hear("pong")

    on_the_web(scenario)


def test_who_looks_at_a_body_later_sees_where_it_has_come_to(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        crate = entity_named(web, "Crate")
        web.host.publish_frame({crate: (4.0, 5.0, 6.0)})  # and nothing after it: the session is paused
        await visitor.say("ping", time=1.0)
        await visitor.hear("pong")
        await visitor.say("inspect", entity=crate)
        assert (await visitor.hear("entity"))["components"]["Transform"]["position"] == [4.0, 5.0, 6.0]

    on_the_web(scenario)


def test_the_tree_tells_only_what_is_in_sight(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        await visitor.say("rows", first=0, count=2)
        told = await visitor.hear("rows")
        assert [(line["name"], line["depth"], line["kind"]) for line in told["lines"]] == [
            ("Table", 0, "Empty"),
            ("Crate", 1, "Mesh"),
        ]
        assert (told["total"], told["entities"]) == (3, 3)
        table = entity_named(web, "Table")
        await visitor.say("open", entity=table, is_open=False)
        assert [line["name"] for line in (await visitor.hear("rows", total=2))["lines"]] == ["Table", "Lamp"]
        await visitor.say("rows", first=0, count=MOST_ROWS, search="t:Light")
        found = await visitor.hear("rows", search="t:Light")
        assert ([line["name"] for line in found["lines"]], found["found"]) == (["Lamp"], 1)
        await visitor.say("rows", first=0, count=MOST_ROWS, search="q:x")
        wrong = await visitor.hear("rows", search="q:x")
        assert wrong["wrong"]["values"] == {"key": "q"}
        await visitor.say("rows", first=0, count=MOST_ROWS)
        await visitor.say("reveal", entity=entity_named(web, "Crate"))
        shown = await visitor.hear("rows", total=3)
        assert shown["revealed"] == {"entity": entity_named(web, "Crate"), "place": 1}

    on_the_web(scenario)


def test_the_tree_follows_what_changes(on_the_web):
    async def scenario(web):
        visitor, editor = await web.visitor(Role.VIEWER), await web.visitor(Role.EDITOR)
        await visitor.say("rows", first=0, count=50)
        await visitor.hear("rows")
        lamp = entity_named(web, "Lamp")
        await editor.ask(1, {"type": "rename", "entity": lamp, "name": "Sun"})
        assert [line["name"] for line in (await visitor.hear("rows"))["lines"]] == ["Table", "Crate", "Sun"]
        await editor.ask(2, {"type": "set_enabled", "entity": lamp, "enabled": False})
        assert [line["on"] for line in (await visitor.hear("rows"))["lines"]] == [True, True, False]
        await editor.ask(3, {"type": "despawn", "entity": entity_named(web, "Table")})
        assert [line["name"] for line in (await visitor.hear("rows", total=1))["lines"]] == ["Sun"]

    on_the_web(scenario)


def test_when_the_host_goes_it_is_said(on_the_web):
    async def scenario(web):
        visitor = await web.visitor(Role.VIEWER)
        await visitor.hear("link", connected=True)
        await web.host.session.close()
        assert (await visitor.hear("link", connected=False))["renderer"] is True

    on_the_web(scenario)
