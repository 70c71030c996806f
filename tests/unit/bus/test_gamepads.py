"""Gamepads: from states as GLFW gives them to what the host hears, and as whom further pads play."""

from __future__ import annotations

import asyncio
import math
from typing import NamedTuple

import pytest

from elys.bus import topics
from elys.bus.gamepads import AXES, FINENESS, Gamepads, pads_of, places_of
from elys.bus.input_sender import InputSender
from elys.bus.local_players import LocalPlayers
from elys.bus.messages.commands import CommandRecord, Input
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.input_names import PAD_NAMES

glfw = pytest.importorskip("glfw")
REST = (0.0, 0.0, 0.0, 0.0, -1.0, -1.0)


class State(NamedTuple):
    """As `glfw.get_gamepad_state` returns it."""

    buttons: list[int]
    axes: list[float]


def state(*down: str, axes: tuple[float, ...] = REST) -> State:
    return State([int(name in down) for name in PAD_NAMES], list(axes))


def in_session(scenario) -> None:
    """A host that notes what it hears of players, and a session with a window."""

    async def main() -> None:
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
        session = await Session.join(broker.connect(), kind="view")
        heard: list[Input] = []
        host.subscribe(topics.INPUT, lambda message, _: heard.append(message))
        try:
            await scenario(host, session, heard, lambda: Session.join(broker.connect(), kind="far"))
        finally:
            await session.close()
            await host.close()

    asyncio.run(main())


def refused_to(session: Session) -> CommandRecord:
    return CommandRecord(tick=1, origin=session.node.id, command=Input(player=1), accepted=False, reason="no such key")


async def until(condition) -> None:
    async with asyncio.timeout(20):
        while not condition():
            await asyncio.sleep(0.001)


def test_names_and_order_are_those_of_glfw() -> None:
    for number, name in enumerate(PAD_NAMES):
        assert getattr(glfw, f"GAMEPAD_BUTTON_{name.removeprefix('pad_').upper()}") == number
    for number, name in enumerate(AXES):
        assert getattr(glfw, f"GAMEPAD_AXIS_{name.removeprefix('pad_').upper()}") == number
    blank = glfw._GLFWgamepadstate().unwrap()
    assert (len(blank.buttons), len(blank.axes)) == (len(PAD_NAMES), len(AXES))


def test_places_are_in_range_and_in_steps() -> None:
    places = places_of(state(axes=(0.5001, -1.2, math.nan, 0.0004, -1.0, 1.0)))
    assert places == {
        "pad_left_x": 0.5,
        "pad_left_y": -1.0,
        "pad_right_x": 0.0,
        "pad_right_y": 0.0,
        "pad_left_trigger": 0.0,
        "pad_right_trigger": 1.0,
    }
    assert places_of(state(axes=(0.3, 0, 0, 0, 0.0, 0)))["pad_left_trigger"] == 0.5
    assert all((place * FINENESS).is_integer() for place in places.values())


def test_only_what_glfw_knows_the_buttons_of_is_a_pad() -> None:
    class Glfw:
        JOYSTICK_LAST = 3

        def joystick_is_gamepad(self, number: int) -> bool:
            return number in (1, 3)

        def get_gamepad_state(self, number: int) -> State | None:
            return state("pad_a") if number == 1 else None  # 3 was pulled out in between

    assert pads_of(Glfw()) == {1: state("pad_a")}


def test_a_pad_tells_what_changes_and_lets_go_when_it_is_pulled_out() -> None:
    async def scenario(host, session, heard, join) -> None:
        sender = InputSender(session)
        pads = Gamepads(sender, join=lambda: None)
        pads.update({})
        assert not sender.send()
        pads.update({0: state("pad_b")})  # what is down when it comes counts when it is pressed again
        pads.update({0: state("pad_a", axes=(0.25, 0, 0, 0, 1, -1))})
        pads.update({0: state("pad_a", axes=(0.2501, 0, 0, 0, 1, -1))})
        assert sender.send()
        pads.update({0: state("pad_a", axes=(0.2502, 0, 0, 0, 1, -1))})  # it trembles
        assert not sender.send()
        pads.update({0: state("pad_a", "pad_b", axes=(0.25, 0, 0, 0, 1, -1))})
        sender.send()
        pads.update({})
        sender.send()
        pads.update({0: state("pad_x")})
        pads.update({0: state("pad_x", "pad_y")})
        sender.send()
        await until(lambda: len(heard) == 4)
        assert heard[0].changes == (("pad_a", True),)
        assert heard[0].axes == {"pad_left_x": 0.25, "pad_left_trigger": 1.0}
        assert heard[1].changes == (("pad_b", True),)
        assert heard[2].changes == (("pad_a", False), ("pad_b", False))
        assert heard[2].axes == {"pad_left_x": 0.0, "pad_left_trigger": 0.0}
        assert heard[3].changes == (("pad_x", True), ("pad_y", True))

    in_session(scenario)


def test_further_pads_play_as_the_next_free_players_once_start_is_pressed() -> None:
    async def scenario(host, session, heard, join) -> None:
        players = LocalPlayers(session, player=2, bindings=lambda player: {"jump": f"kp_{player}"})
        start = state("pad_start")
        players.start({0: state(), 1: start})  # held before: that is no wish to play
        other = Input(player=3, source="far")
        host.publish(topics.COMMANDS, CommandRecord(tick=1, origin="far", command=other, accepted=True))
        host.publish(topics.COMMANDS, refused_to(session))
        await until(lambda: players.refusal == "no such key")
        for states in ({0: state(), 1: start, 5: state()}, {0: start, 1: state(), 5: state()}):
            players.update(states)
            assert [sender.player for sender in players.senders] == [2]
        players.update({0: start, 1: start, 5: state()})
        assert [sender.player for sender in players.senders] == [2, 4]  # 3 plays elsewhere
        players.update({0: start, 1: state("pad_start", "pad_a"), 5: start})
        players.update({0: start, 1: state("pad_a"), 5: state("pad_b")})
        assert [sender.player for sender in players.senders] == [2, 4, 5]
        assert players.send(seen_time=1.5, host_time=7.0)
        await until(lambda: len(heard) == 6)
        assert [(m.player, m.sequence, m.bindings, m.changes) for m in heard] == [
            (2, 1, {"jump": "kp_2"}, ()),
            (2, 2, None, (("pad_start", True),)),
            (4, 1, {"jump": "kp_4"}, ()),
            (4, 2, None, (("pad_a", True),)),
            (5, 1, {"jump": "kp_5"}, ()),
            (5, 2, None, (("pad_b", True),)),
        ]
        assert {(message.seen_time, message.done_at) for message in heard} == {(1.5, 7.0)}
        heard.clear()
        players.update({1: state("pad_a"), 5: state("pad_b")})  # the window's own is pulled out
        players.update({1: state("pad_a"), 5: state("pad_b"), 7: state()})  # whoever comes now is the window's player's
        players.update({1: state("pad_a"), 5: state("pad_b"), 7: state("pad_y")})
        players.send()
        await until(lambda: heard)
        assert [(m.player, m.changes) for m in heard] == [(2, (("pad_start", False), ("pad_y", True)))]
        heard.clear()
        players.stop()
        players.send()
        await until(lambda: len(heard) == 3)
        assert all(message.lets_go and not message.changes for message in heard)

    in_session(scenario)


def test_who_begins_again_holds_what_sticks_say_and_no_button() -> None:
    async def scenario(host, session, heard, join) -> None:
        players = LocalPlayers(session)
        pushed = (1.0, 0, 0, 0, -1, -1)
        players.start({0: state()})
        players.update({0: state("pad_a", axes=pushed)})
        players.send()
        players.stop()
        players.send()
        players.start({0: state("pad_a", axes=pushed)})
        players.update({0: state("pad_a", axes=pushed)})
        players.send()
        await until(lambda: len(heard) == 5)
        assert heard[1].changes == (("pad_a", True),) and heard[2].lets_go
        assert heard[4].changes == () and heard[4].axes == {"pad_left_x": 1.0}

    in_session(scenario)


def test_sixteen_play_and_no_more() -> None:
    async def scenario(host, session, heard, join) -> None:
        players = LocalPlayers(session, player=16)
        for step in ((), ("pad_start",)):
            players.update({number: state(*(step if number else ())) for number in range(16)})
        assert sorted(sender.player for sender in players.senders) == list(range(1, 17))
        players.update({16: state()})
        players.update({16: state("pad_start")})
        assert len(players.senders) == 16

    in_session(scenario)


@pytest.mark.parametrize("how", ["stays", "leaves", "lets go"])
def test_the_number_of_who_is_gone_is_free_again(how: str) -> None:
    async def scenario(host, session, heard, join) -> None:
        other = await join()
        players = LocalPlayers(session)
        players.start({})
        record = CommandRecord(tick=1, origin=other.node.id, command=Input(player=2), accepted=True)
        host.publish(topics.COMMANDS, record)
        if how == "lets go":
            let_go = CommandRecord(tick=2, origin=other.node.id, command=Input(player=2, lets_go=True), accepted=True)
            host.publish(topics.COMMANDS, let_go)
        host.publish(topics.COMMANDS, refused_to(session))
        await until(lambda: players.refusal)  # so the ones before were heard
        if how == "leaves":
            await other.close()
            await until(lambda: other.node.id not in session.nodes)
        states = {0: state(), 1: state()}
        players.update(states)
        players.update({**states, 1: state("pad_start")})
        assert players.senders[1].player == (3 if how == "stays" else 2)
        await other.close()

    in_session(scenario)
