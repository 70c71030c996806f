"""What players do: as systems see it in a tick, what is refused, and that time goes the same way again with it."""

from __future__ import annotations

import asyncio
import math
import time

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.input_echo import InputEcho
from elys.bus.input_sender import InputSender
from elys.bus.messages.commands import CommandRecord, CommandRequest, Input
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.errors import RequestError
from elys.common.input_names import BUTTONS, KEY_NAMES
from elys.common.scene import EntityRecord, SceneSettings
from elys.sim_node.flight_recorder import FlightRecorder
from elys.sim_node.input_intake import LONGEST_LATE, MOST_WAITING
from elys.sim_node.inputs import MOST_DEVICES, MOST_TEXT, Inputs
from elys.sim_node.node import SimulationNode
from elys.sim_node.scene.loading import load_records
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State
from elys.sim_node.systems.apply_edits import apply_again


def played(**what) -> Input:
    return Input(**{"player": 1, "source": "pad", **what})


def down(*names: str) -> tuple[tuple[str, bool], ...]:
    return tuple((name, True) for name in names)


def up(*names: str) -> tuple[tuple[str, bool], ...]:
    return tuple((name, False) for name in names)


def test_keys_are_held_until_they_go_up_and_pressed_for_one_tick():
    inputs = Inputs()
    inputs.take(played(changes=down("w", "mouse_left")))
    player = inputs[1]
    assert (player.is_down("w"), player.was_pressed("w"), player.was_released("w")) == (True, True, False)
    inputs.end_tick()
    player = inputs[1]
    assert (player.is_down("w"), player.was_pressed("w")) == (True, False)
    inputs.take(played(changes=up("w") + down("w")))  # in one tick: it was both, and is down
    player = inputs[1]
    assert (player.is_down("w"), player.was_pressed("w"), player.was_released("w")) == (True, True, True)
    inputs.end_tick()
    inputs.take(played(changes=up("w")))
    inputs.take(played(changes=down("space") + up("space")))  # a tap that no tick saw down
    player = inputs[1]
    assert (player.is_down("space"), player.was_pressed("space"), player.was_released("space")) == (False, True, True)
    assert player.held == ("mouse_left",)
    inputs.end_tick()
    assert not inputs[1].was_pressed("space")
    inputs.take(played(changes=down("mouse_left") + up("q")))  # held already, and not held
    assert not inputs[1].was_pressed("mouse_left")
    assert not inputs[1].was_released("q")


def test_what_moves_adds_up_in_a_tick_and_sticks_stay_where_they_are():
    inputs = Inputs()
    inputs.take(played(moved={"pointer_x": 2.5, "wheel_y": 1.0}, axes={"pad_left_x": -0.5}, text="bonj"))
    inputs.take(played(moved={"pointer_x": -0.75}, text="our"))
    player = inputs[1]
    assert player.moved("pointer_x") == 1.75
    assert (player.moved("wheel_y"), player.moved("pointer_y")) == (1.0, 0.0)
    assert (player.axis("pad_left_x"), player.text) == (-0.5, "bonjour")
    inputs.end_tick()
    player = inputs[1]
    assert (player.moved("pointer_x"), player.axis("pad_left_x"), player.text) == (0.0, -0.5, "")
    inputs.take(played(axes={"pad_left_x": 0.0}))
    inputs.end_tick()
    assert inputs.players == ()  # nothing is left to be remembered


def test_players_are_apart_and_devices_of_one_are_together():
    inputs = Inputs()
    inputs.take(Input(player=1, source="a", changes=down("w"), axes={"pad_left_x": 0.25}))
    inputs.take(Input(player=1, source="b", changes=down("w", "s"), axes={"pad_left_x": -0.75}))
    inputs.take(Input(player=2, source="b", changes=down("d")))
    assert inputs.players == (1, 2)
    assert (inputs[1].held, inputs[2].held, inputs[3].held) == (("w", "s"), ("d",), ())
    assert inputs[1].axis("pad_left_x") == -0.75
    assert inputs.players_of("b") == (1, 2)
    inputs.take(Input(player=1, source="b", lets_go=True))
    assert inputs[1].held == ("w",)  # the other one holds it still
    assert inputs[1].was_released("s")
    assert inputs[1].axis("pad_left_x") == 0.25


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ({"changes": down("W")}, "no key or button 'W'"),
        ({"changes": down("w" * 999)}, "no key or button"),
        ({"changes": down("w") * 300}, "256 keys, not 300"),
        ({"moved": {"pointer_z": 1.0}}, "no motion 'pointer_z': there are pointer_x"),
        ({"moved": {"pointer_x": math.nan}}, "pointer_x must lie between"),
        ({"moved": {"wheel_y": 1e300}}, "wheel_y must lie between"),
        ({"axes": {"pad_left_x": 1.5}}, "between -1 and 1, not be 1.5"),
        ({"axes": {"pad_left_x": math.inf}}, "between -1 and 1"),
        ({"text": "a" * (MOST_TEXT + 1)}, "1024 characters"),
        ({"player": 0}, "numbered from 1 to 16, not 0"),
        ({"player": 17}, "numbered from 1 to 16, not 17"),
    ],
)
def test_what_is_none_is_refused_and_changes_nothing(what, said):
    inputs = Inputs()
    inputs.take(played(changes=down("a")))
    before = inputs._devices
    with pytest.raises(RequestError, match=said):
        inputs.take(played(**{"changes": down("b"), **what}))
    assert inputs._devices == before


def test_there_are_not_endlessly_many_devices_nor_endless_motion():
    inputs = Inputs()
    for number in range(MOST_DEVICES):
        inputs.take(Input(player=1, source=f"node {number}", changes=down("w")))
    with pytest.raises(RequestError, match="64 devices play already"):
        inputs.take(Input(player=1, source="one more", changes=down("w")))
    for _ in range(5):
        inputs.take(Input(player=1, source="node 0", moved={"pointer_x": 9e5}, text="x" * MOST_TEXT))
    assert inputs[1].moved("pointer_x") == 1e6
    assert len(inputs[1].text) == MOST_TEXT


def test_systems_that_ask_for_what_is_no_key_are_told():
    player = Inputs()[1]
    for ask in (player.is_down, player.was_pressed, player.was_released, player.moved, player.axis):
        with pytest.raises(ValueError, match=r"no .* 'Jump'"):
            ask("Jump")
    assert len(set(KEY_NAMES.values())) == len(KEY_NAMES)
    assert {"w", "0", "kp_0", "f12", "left_shift", "mouse_left", "pad_a"} <= BUTTONS


BALL = [
    EntityRecord(name="Ball", components={"Transform": {}, "RigidBody": {}, "Collider": {"shape": "sphere"}}),
]


def steered() -> tuple[Simulation, int]:
    """A ball that w, s and the pointer push, without gravity."""
    simulation = Simulation(settings=SceneSettings(gravity=(0.0, 0.0, 0.0)), assets=AssetStore())
    (ball,) = load_records(simulation.world, BALL)

    def steer(world) -> None:
        player = simulation.inputs[1]
        push = 10.0 * (player.is_down("w") - player.is_down("s"))
        kick = 30.0 * player.was_pressed("space")
        force = np.array((push, kick, player.moved("pointer_x")))
        if force.any():
            simulation.physics.apply_force([int(ball)], force)

    simulation.systems = (steer, *simulation.systems)
    simulation.settle()
    return simulation, int(ball)


def test_rewound_input_gives_the_same_bits_again():
    simulation, ball = steered()
    recorder = FlightRecorder(simulation)
    script = {3: played(changes=down("w")), 40: played(moved={"pointer_x": 7.0}), 75: played(changes=up("w"))}
    hashes = [simulation.state_hash()]
    for tick in range(150):
        done = [script[tick]] if tick in script else []
        for command in done:
            apply_again(simulation, command)
        simulation.step()
        hashes.append(simulation.state_hash())
        recorder.note(done, steps=True, is_told=False, seconds=0.001)
    assert simulation.physics.bodies.position[simulation.physics.bodies.entity == ball][0][0] > 1.0
    for instant in (60, 150, 2, 149, 41):
        recorder.go_to(instant)
        assert simulation.state_hash() == hashes[instant]
        assert simulation.inputs[1].is_down("w") == (3 < instant <= 75)
    state = State.from_bytes(simulation.capture().to_bytes())
    other, _ = steered()
    other.restore(state)
    assert other.inputs[1].is_down("w")
    for tick in range(41, 75):
        other.step()
        assert other.state_hash() == hashes[tick + 1]


async def until(condition) -> None:
    async with asyncio.timeout(20.0):
        while not condition():
            await asyncio.sleep(0.001)


def in_session(scenario, *, playing: bool = True) -> None:
    """Runs `await scenario(node, session, records, join)` beside a node that simulates a steered ball."""

    async def main() -> None:
        broker = LoopbackBroker()
        session = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
        simulation, _ = steered()
        node = SimulationNode(simulation, session, playing=playing)
        running = asyncio.create_task(node.run())
        player = await Session.join(broker.connect(), kind="editor")
        records: list[CommandRecord] = []
        player.subscribe(topics.COMMANDS, lambda record, _: records.append(record))
        try:
            await scenario(node, player, records, lambda: Session.join(broker.connect(), kind="view"))
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            await player.close()
            await session.close()

    asyncio.run(main())


def test_keys_reach_the_simulation_in_order_and_are_told_with_their_tick():
    async def scenario(node, session, records, join):
        sender = InputSender(session)
        assert not sender.send()  # nothing happened
        for name in ("w", "w", "no key", "a"):
            sender.press(name)
        sender.let_go("a")
        sender.move("pointer_x", 1.5)
        sender.move("pointer_x", 2.0)
        assert sender.send()
        assert not sender.send()
        await until(lambda: records)
        command = records[0].command
        assert command == Input(
            player=1,
            source=session.node.id,
            changes=(("w", True), ("a", True), ("a", False)),
            moved={"pointer_x": 3.5},
            sequence=1,
        )
        assert records[0].accepted
        await until(lambda: node.simulation.tick > records[0].tick + 5)
        assert node.simulation.inputs[1].held == ("w",)
        sender.let_go_of_all()
        sender.send()
        await until(lambda: not node.simulation.inputs[1].held)
        await until(lambda: len(records) == 2)

    in_session(scenario)


def test_who_is_gone_holds_no_key():
    async def scenario(node, session, records, join):
        other = await join()
        sender = InputSender(other, player=2)
        sender.press("d")
        sender.send()
        await until(lambda: node.simulation.inputs[2].is_down("d"))
        await other.close()
        await until(lambda: not node.simulation.inputs[2].is_down("d"))

    in_session(scenario)


def test_floods_and_nonsense_are_refused_with_one_sentence_each():
    async def scenario(node, session, records, join):
        sender = InputSender(session)
        sender.press("w")
        sender.send()
        await until(lambda: records and node.simulation.inputs[1].is_down("w"))
        records.clear()
        for _ in range(20):
            session.publish(topics.INPUT, Input(player=1, changes=(("Jump", True),)), key=session.node.id)
        await until(lambda: records)
        tick = node.simulation.tick
        await until(lambda: node.simulation.tick > tick + 5)
        assert [record.accepted for record in records] == [False]
        assert "no key or button 'Jump'" in records[0].reason
        assert node.simulation.inputs[1].is_down("w")
        other = await join()
        for _ in range(3 * MOST_WAITING):  # between two ticks: none can come in between
            session.publish(topics.INPUT, Input(player=1, moved={"pointer_x": 1.0}), key=session.node.id)
        # What was lost may have been a key that went up: nothing stays held.
        await until(lambda: not node.simulation.inputs[1].is_down("w"))
        accepted = [record for record in records if record.accepted and record.command.moved]
        assert len(accepted) <= MOST_WAITING
        await other.close()

    in_session(scenario)


def test_what_came_before_is_refused_and_what_is_missing_lets_go():
    async def scenario(node, session, records, join):
        def tell(sequence: int, changes: tuple[tuple[str, bool], ...]) -> None:
            session.publish(topics.INPUT, Input(player=1, sequence=sequence, changes=changes), key=session.node.id)

        def held() -> tuple[str, ...]:
            return tuple(sorted(node.simulation.inputs[1].held))

        tell(1, down("w"))
        tell(2, down("a"))
        await until(lambda: held() == ("a", "w"))
        tell(2, up("w", "a"))
        await until(lambda: any("message 2 of input came after 2" in record.reason for record in records))
        assert held() == ("a", "w")
        tell(5, down("d"))  # 3 and 4 were lost, and may have let go of anything
        await until(lambda: held() == ("d",))
        tell(1, down("s"))  # a sender that begins anew
        tell(2, down("e"))
        await until(lambda: held() == ("d", "e", "s"))
        session.publish(topics.INPUT, Input(player=2, sequence=2, changes=down("q")), key=session.node.id)
        await until(lambda: tuple(node.simulation.inputs[2].held) == ("q",))

    in_session(scenario)


def test_of_what_comes_too_late_only_letting_go_counts():
    async def scenario(node, session, records, join):
        sender = InputSender(session)
        sender.press("w")
        sender.send(host_time=time.time())
        await until(lambda: node.simulation.inputs[1].is_down("w"))
        sender.let_go("w")
        sender.press("space")
        sender.move("pointer_x", 100.0)
        sender.type("late")
        sender.send(host_time=time.time() - LONGEST_LATE - 0.5)
        await until(lambda: not node.simulation.inputs[1].held)
        late = [record for record in records if "too late" in record.reason]
        assert len(late) == 1
        assert not late[0].accepted
        await until(lambda: records[-1].accepted and records[-1].command.sequence == 2)
        assert records[-1].command.changes == up("w")
        assert (records[-1].command.moved, records[-1].command.text) == ({}, "")
        sender.press("a")
        sender.send(seen_time=-5.0, host_time=time.time() + 3.0)  # by a clock that is not known well
        await until(lambda: node.simulation.inputs[1].is_down("a"))

    in_session(scenario)


def test_how_long_it_takes_until_keys_count_and_are_seen():
    async def scenario(node, session, records, join):
        now = [100.0]
        sender, echo = InputSender(session), InputEcho(session, clock=lambda: now[0])
        echo.start()
        assert (echo.until_applied, echo.until_seen) == (None, None)
        for _ in range(3):
            count = len(records)
            sender.press("w")
            sender.send()
            echo.sent(sender.sequence)
            now[0] += 0.02
            await until(lambda count=count: len(records) > count)
            sender.let_go("w")
            echo.shown(records[-1].tick)  # what was before it
            assert echo.until_seen is None or len(records) > 1
            now[0] += 0.03
            echo.shown(records[-1].tick + 1)
            sender.send()
            await until(lambda count=count: len(records) > count + 1)
        assert echo.until_applied == pytest.approx(0.02)
        assert echo.until_seen == pytest.approx(0.05)
        echo.stop()
        assert echo.until_seen is None

    in_session(scenario)


def test_nobody_plays_in_the_past():
    async def scenario(node, session, records, join):
        await until(lambda: node.simulation.tick > 30)

        async def ask(command):
            request = CommandRequest(origin=session.node.id, command=command)
            return await session.request(topics.COMMAND, request)

        from elys.bus.messages.commands import Grab, Rewind, SetPlaying

        other = await join()
        ball = int(node.simulation.physics.bodies.entity[0])
        request = CommandRequest(
            origin=other.node.id, command=Grab(entity=ball, anchor=(0, 0, 0), target=(1.0, 0.0, 0.0))
        )
        assert (await other.request(topics.COMMAND, request)).accepted
        sender = InputSender(other)
        sender.press("w")
        sender.send()
        await until(lambda: node.simulation.inputs[1].is_down("w"))
        tick = node.simulation.tick
        await until(lambda: node.simulation.tick > tick + 10)
        assert (await ask(Rewind(tick=tick + 5))).accepted
        assert not (await ask(Input(player=1, changes=(("a", True),)))).accepted
        mine = InputSender(session)
        mine.press("a")
        mine.send()
        await until(lambda: any("the past" in record.reason for record in records))
        # Who dies meanwhile lets go as soon as time goes on from here.
        await other.close()
        await until(lambda: other.node.id not in session.nodes)
        assert node.simulation.inputs[1].is_down("w")
        assert node.simulation.hands.holds(other.node.id)
        from elys.bus.messages.commands import Resume

        assert (await ask(Resume())).accepted
        await until(lambda: not node.simulation.inputs[1].is_down("w"))
        await until(lambda: not node.simulation.hands.holds(other.node.id))
        assert (await ask(SetPlaying(playing=False))).accepted

    in_session(scenario)
