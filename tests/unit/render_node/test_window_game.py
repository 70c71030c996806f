"""A viewer's window lends its keys and mouse to the game, told by GLFW's own callbacks, on the null platform."""

from __future__ import annotations

import pytest

from tests.unit.render_node.test_view_window import in_process

SCRIPT = """
import glfw
from collections import namedtuple
from elys.render_node.game_input import Seating
from elys.bus.messages.session import SessionStatus
from elys.render_node import thin_window
from elys.render_node.game_input import NOTE, GameInput
from elys.render_node.play_control import PlayControl

def status(kind="simulation", is_rewound=False):
    return SessionStatus(epoch=1, kind=kind, scene="play", tick=3, simulation_time=0.0, playing=False, tick_rate=60.0,
                         rate=1.0, realtime_factor=0.0, entity_count=1, is_rewound=is_rewound)

async def main():
    host, session = await open_session()
    heard, asked, events = [], [], []
    async def command(request, key):
        asked.append(request.command.playing)
        return CommandReply(accepted=True, tick=1)
    host.serve(topics.COMMAND, command)
    host.subscribe(topics.INPUT, lambda message, node: heard.append((message, node)))
    async def until(condition):
        async with asyncio.timeout(20):
            while not condition():
                await asyncio.sleep(0.001)
    window = Window("test", (96, 64))
    window.on_event = events.append
    play = PlayControl(session)
    game = GameInput(session, window, play, seating=Seating(3, lambda player: {"jump": f"f{player}"}))
    assert window.pads() == {}  # the null platform has none
    game.start()
    assert not game.is_on  # nobody has said yet that there is a game
    for wrong in (status(kind="replay"), status(is_rewound=True)):
        host.publish(topics.STATUS, wrong)
        await until(lambda: play.status == wrong)
        game.start()
        assert not game.is_on
    host.publish(topics.STATUS, status())
    await until(lambda: play.status == status())
    game.start()
    assert game.is_on and game.note == (NOTE,)
    await until(lambda: asked == [True])
    w = window
    w._key(None, glfw.KEY_W, 0, glfw.PRESS, 0)
    w._key(None, glfw.KEY_W, 0, glfw.REPEAT, 0)
    w._key(None, glfw.KEY_SPACE, 0, glfw.PRESS, 0)
    w._key(None, glfw.KEY_SPACE, 0, glfw.RELEASE, 0)
    w._typed(None, ord("w"))
    x, y = w._pointer
    w._moved(None, x + 3.0, y - 1.0)
    w._moved(None, x + 5.0, y - 1.0)
    w._button(None, glfw.MOUSE_BUTTON_RIGHT, glfw.PRESS, 0)
    w._scrolled(None, 0.0, 2.0)
    assert not game.update()
    await until(lambda: len(heard) == 2)
    (bound, _), (message, node) = heard
    assert (bound.player, bound.bindings, bound.changes) == (3, {"jump": "f3"}, ())
    assert node == session.node.id
    assert message.changes == (("w", True), ("space", True), ("space", False), ("mouse_right", True)), message
    assert (message.player, message.bindings, message.sequence) == (3, None, 2)
    assert message.moved == {"pointer_x": 5.0, "pointer_y": -1.0, "wheel_y": 2.0} and message.text == "w"
    assert events == []
    game.update(); game.update()
    w._key(None, glfw.KEY_ESCAPE, 0, glfw.PRESS, 0)
    assert game.update() and not game.is_on and game.note == ()
    await until(lambda: len(heard) == 3)
    assert heard[2][0].lets_go and heard[2][0].bindings is None
    heard.clear()
    Pad = namedtuple("Pad", "buttons axes")
    def pad(*down):
        return Pad([int(number in down) for number in range(15)], [0.5, 0.0, 0.0, 0.0, -1.0, -1.0])
    window.pads = lambda: {0: pad(), 2: pad()}
    game.start()
    assert not game.update()
    window.pads = lambda: {0: pad(glfw.GAMEPAD_BUTTON_A), 2: pad(glfw.GAMEPAD_BUTTON_START)}
    game.update()
    await until(lambda: len(heard) == 5)
    assert [(m.player, m.changes, m.axes, m.bindings) for m, _ in heard] == [
        (3, (), {}, {"jump": "f3"}), (3, (), {"pad_left_x": 0.5}, None), (3, (("pad_a", True),), {}, None),
        (4, (), {}, {"jump": "f4"}), (4, (), {"pad_left_x": 0.5}, None)]
    assert game.note == (NOTE + " - other pads play as 4",)
    heard.clear()
    w._key(None, glfw.KEY_ESCAPE, 0, glfw.PRESS, 0)
    assert game.update()
    await until(lambda: len(heard) == 2)
    assert all(m.lets_go for m, _ in heard)
    window.pads = dict
    w._key(None, glfw.KEY_SPACE, 0, glfw.PRESS, 0)  # the viewer's own again
    w._scrolled(None, 0.0, 1.0)
    assert events == [KeyPressed("space"), Scrolled(1.0)]
    for how in ("focus", "rewound"):
        game.start()
        w._key(None, glfw.KEY_D, 0, glfw.PRESS, 0)
        if how == "focus":
            w._focused(None, 0)
        else:
            host.publish(topics.STATUS, status(is_rewound=True))
            await until(lambda: play.status.is_rewound)
        assert game.update() and not game.is_on
        heard.clear()
        game.start()
    assert not game.is_on
    window.close()
    await session.close(); await host.close()
    print("done")
asyncio.run(main())
"""


@pytest.mark.gl
def test_keys_and_mouse_are_lent_until_escape() -> None:
    assert in_process(SCRIPT) == "done"


CARD = (
    SCRIPT[: SCRIPT.index("async def main")]
    + """
from elys.bus.messages.session import Event, EventBatch
from elys.common.components import InputMap
from elys.render_node.overlays import NO_OVERLAYS

async def main():
    host, session = await open_session()
    heard, events, kept = [], [], []
    async def command(request, key):
        return CommandReply(accepted=True, tick=1)
    host.serve(topics.COMMAND, command)
    host.subscribe(topics.INPUT, lambda message, node: heard.append(message))
    async def until(condition):
        async with asyncio.timeout(20):
            while not condition():
                game.update()
                await asyncio.sleep(0.001)
    window = Window("test", (96, 64))
    window.on_event = events.append
    play = PlayControl(session)
    bindings = {"jump": "f3, pad_b"}
    def keep(player, bound):
        kept.append((player, dict(bound)))
        bindings.clear(); bindings.update(bound)
    async def declared():
        return InputMap(actions={"jump": "space, pad_a"}, vectors={})
    seating = Seating(3, lambda player: dict(bindings), keep=keep)
    game = GameInput(session, window, play, seating=seating, declared=declared)
    key = lambda number, action=glfw.PRESS: window._key(None, number, 0, action, 0)
    def tap(number):
        key(number); key(number, glfw.RELEASE)
    game.show_controls()
    host.publish(topics.STATUS, status())
    await until(lambda: play.status is not None)
    assert game.card_version == -1  # nobody had said that there is a game
    game.start()
    key(glfw.KEY_W)
    await until(lambda: len(heard) == 2)
    tap(glfw.KEY_F1)
    await until(lambda: game.card_version >= 0)
    assert not game.is_on and game.is_busy and game.over(NO_OVERLAYS).nodes
    await until(lambda: len(heard) == 3)
    assert heard[2].lets_go  # nobody plays who binds keys
    key(glfw.KEY_W, glfw.RELEASE)
    before = game.card_version
    tap(glfw.KEY_ENTER)
    tap(glfw.KEY_ESCAPE)  # takes back the choice, not the keys
    tap(glfw.KEY_ENTER)
    tap(glfw.KEY_J)
    assert game.update() and not game.update() and game.card_version > before
    assert kept == [(3, {"jump": "j, pad_b"})] and game.is_busy
    tap(glfw.KEY_ESCAPE)
    await until(lambda: game.is_on)
    key(glfw.KEY_J)
    await until(lambda: len(heard) == 5)
    assert (heard[3].bindings, heard[4].changes) == ({"jump": "j, pad_b"}, (("j", True),))
    for player in (2, 3):  # a script asks for it; for another player, and for this one
        batch = EventBatch(epoch=1, tick=9, events=(Event(kind="controls_wanted", values={"player": player}),))
        host.publish(topics.EVENTS, batch)
        await until(lambda: player == 2 or game.card_version >= 0)
    window._focused(None, 0)  # another window: the card is gone, and nobody plays
    await until(lambda: game.card_version == -1)
    assert not game.is_busy and window.player is None
    tap(glfw.KEY_F1)
    tap(glfw.KEY_SPACE)
    assert events == [KeyPressed("f1"), KeyPressed("space")]
    game.show_controls()  # also while nobody plays: then nobody does afterwards
    await until(lambda: game.card_version >= 0)
    tap(glfw.KEY_F1)
    await until(lambda: game.card_version == -1)
    assert not game.is_busy and heard[5:] and all(message.lets_go for message in heard[5:])
    window.close()
    await session.close(); await host.close()
    print("done")
asyncio.run(main())
"""
)


@pytest.mark.gl
def test_f1_binds_keys_anew_in_the_middle_of_a_game() -> None:
    assert in_process(CARD) == "done"
