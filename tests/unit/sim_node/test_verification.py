"""Verifying recordings of real sessions: equal where nothing was touched, and what was touched is found where it is."""

from __future__ import annotations

import asyncio
import dataclasses
from collections.abc import Callable, Container, Coroutine
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from elys.bus import codec, topics
from elys.bus.course import read_course
from elys.bus.messages.commands import (
    Batch,
    CommandRecord,
    Despawn,
    Grab,
    LoadScene,
    Redo,
    Release,
    Rename,
    Resume,
    Rewind,
    SetComponent,
    SetEnabled,
    SetPlaying,
    SetSettings,
    Spawn,
    StepTicks,
    Undo,
)
from elys.bus.messages.exact_state import unpack_head
from elys.bus.messages.state_frame import StateFrame, pack_frame, unpack_frame
from elys.bus.recording import Recording
from elys.bus.recording_recovery import recover
from elys.bus.topics import Encoding
from elys.bus.transports.mcap_reading import McapReader
from elys.common.errors import RecordingError, StateError
from elys.common.scene import EntityRecord, SceneSettings
from elys.sim_node import verification
from elys.sim_node.reexecution import Reexecution
from elys.sim_node.scene.loading import records_of
from elys.sim_node.simulation import Simulation
from elys.sim_node.verification import verify
from elys.verbs import verify as verb
from tests.recorded_sessions import Stage, altered, in_short_chunks, recorded, recorded_outside

BOX = EntityRecord(
    name="Late", components={"Transform": {"position": [0.1, 9.0, 0.0]}, "RigidBody": {}, "Collider": {}}
)


def move(entity: int, height: float) -> SetComponent:
    return SetComponent(entity=entity, component="Transform", values={"position": [0.2, height, 0.1]})


def any_body(stage: Stage) -> int:
    return int(stage.simulation.moving_bodies().entity[3])


async def edits_of_two(stage: Stage) -> None:
    """Edits while time goes on and while it stands, undone and made again, by two people."""
    anna, bert = await stage.person("Anna"), await stage.person("Bert")
    await anna.step(40)
    (late,) = await anna.do(Spawn(records=(BOX,)))
    await bert.do(SetComponent(entity=late, component="RigidBody", values={"mass": 9.0}), Rename(entity=late, name="B"))
    await bert.step(30)
    await anna.do(move(late, 7.0), Undo(), Redo(), Undo())  # physics is put back
    await anna.step(5)
    await asyncio.gather(anna.ask(move(late, 6.0)), bert.ask(SetSettings(settings=SceneSettings(substeps=3))))
    await bert.do(Undo())
    await anna.step(25)
    await anna.together(move(late, 5.0), Batch(edits=(Rename(entity=late, name="C"), Despawn(entity=10**6))))
    await bert.do(Grab(entity=late, anchor=(0.0, 0.0, 0.0), target=(1.0, 4.0, 0.0)))
    await bert.step(20)
    await bert.do(Grab(entity=late, anchor=(0.1, 0.0, 0.0), target=(-1.0, 4.0, 0.0)))
    await bert.step(20)
    await bert.do(Release())
    await anna.do(Despawn(entity=late), Undo())
    await anna.step(20)


async def forks(stage: Stage) -> None:
    """The past is looked at, told again, and left for other futures."""
    anna, bert = await stage.person("Anna"), await stage.person("Bert")
    await anna.step(80)
    (late,) = await anna.do(Spawn(records=(BOX,)))
    await anna.step(80)
    await anna.do(Rewind(tick=70), StepTicks(count=30))
    await stage.stands()
    await bert.do(move(late, 3.0))  # at 100, a fork
    await bert.step(50)
    await bert.do(Rewind(tick=120), Resume(), SetPlaying(playing=False))
    await bert.together(move(late, 4.0), StepTicks(count=-1), StepTicks(count=7))
    await stage.stands()
    await bert.do(move(late, 8.0))
    await anna.step(40)
    await anna.do(Rewind(tick=90), StepTicks(count=5))
    await stage.stands()  # and ends in the past


async def forks_left_at_once(stage: Stage) -> None:
    """In the tick in which a fork begins somebody goes elsewhere: where it began is told all the same."""
    anna = await stage.person("Anna")
    body = any_body(stage)
    await anna.step(60)
    await anna.together(Rewind(tick=30), move(body, 5.0), Rewind(tick=30), move(body, 6.0))
    await anna.step(50)
    await anna.together(Rewind(tick=40), move(body, 7.0), Rewind(tick=20))
    await anna.step(50)
    await anna.together(Rewind(tick=60), Resume(), Rewind(tick=50), SetPlaying(playing=False))
    await anna.step(70)


async def forks_of_another_pace(stage: Stage) -> None:
    """The first step of another future leads beyond all that was told of the old one, whose ticks were shorter."""
    anna = await stage.person("Anna")
    await anna.step(40)
    for rate in (20, 10, 5):
        await anna.step(1)
        await anna.together(StepTicks(count=-1), Resume(), SetSettings(settings=SceneSettings(tick_rate=rate)))
        await anna.do(SetPlaying(playing=False))
        await stage.stands()
    await anna.step(60)


async def other_paces(stage: Stage) -> None:
    """Tick rates of 120, 7, 60 and 1 Hz, from which on a tick takes otherwise long, and one that was refused with a batch."""
    anna = await stage.person("Anna")
    await anna.step(25)
    for rate, count in ((120, 31), (7, 5), (60, 25), (1, 4), (60, 30)):
        await anna.do(SetSettings(settings=SceneSettings(tick_rate=rate)))
        await anna.step(count)
    nobody = SetEnabled(entity=4_000_000, enabled=False)
    await anna.ask(Batch(edits=(SetSettings(settings=SceneSettings(tick_rate=9)), nobody)))
    await anna.step(10)


async def another_scene(stage: Stage) -> None:
    anna = await stage.person("Anna")
    await anna.step(30)
    records = tuple(records_of(stage.simulation.world))
    await anna.do(LoadScene(name="again", records=records, settings=stage.simulation.settings))
    await anna.step(20)
    await anna.do(SetSettings(settings=SceneSettings(tick_rate=30)))
    await anna.step(20)
    await anna.do(SetSettings(settings=SceneSettings(tick_rate=120)), move(any_body(stage), 6.0))
    await anna.step(60)


Story = Callable[[Stage], Coroutine[Any, Any, None]]


def record(folder: Path, story: Story, **options: Any) -> tuple[Path, Path]:
    async def session() -> Stage:
        async with recorded(folder, **options) as stage:
            await story(stage)
        return stage

    stage = asyncio.run(session())
    return stage.beside, stage.outside


@pytest.mark.parametrize("keep", [60.0, 0.0])
@pytest.mark.parametrize(
    "story", [edits_of_two, forks, forks_left_at_once, forks_of_another_pace, other_paces, another_scene]
)
def test_sessions_come_out_equal(tmp_path: Path, story: Story, keep: float) -> None:
    if story in (forks, forks_left_at_once) and not keep:
        pytest.skip("without a flight recorder there is no going back")
    for path in record(tmp_path, story, keep=keep):
        verdict = verify(path)
        assert (verdict.cause, verdict.difference, verdict.notes) == ("equal", None, []), verdict
        assert verdict.ticks > 100
        assert not verdict.other


def test_ticks_and_time_go_on_where_another_tick_rate_begins(tmp_path: Path) -> None:
    for path in record(tmp_path, other_paces):
        with Recording(path) as recording:
            assert recording.run_count == 1
            tick, time = recording.tick.astype(int), recording.time
            _, first = np.unique(tick, return_index=True)
            assert tick[first].tolist() == list(range(tick[0], 131))
            spans = [(25, 60), (31, 120), (5, 7), (25, 60), (4, 1), (40, 60)]
            steps = [1.0 / rate for count, rate in spans for _ in range(count)]
            times = np.cumsum([0.0, *steps])[tick[0] :]
            np.testing.assert_allclose(time[first], times, rtol=0.0, atol=1e-12)


def test_a_recorder_that_comes_late_and_a_fork_before_it(tmp_path: Path) -> None:
    path = tmp_path / "late.mcap"

    async def story(stage: Stage) -> None:
        anna = await stage.person("Anna")
        await anna.step(60)
        (late,) = await anna.do(Spawn(records=(BOX,)))
        await anna.do(move(late, 6.0))
        async with recorded_outside(stage, path):
            await anna.do(Undo())  # physics is put back to what no recorder has seen
            await anna.step(40)
            await anna.do(Rewind(tick=30))
            await anna.do(Spawn(records=(BOX,)))  # a fork of what was before
            await anna.step(60)

    record(tmp_path, story, outside=False)
    verdict = verify(path)
    assert verdict.cause == "equal", verdict
    assert verdict.ticks >= 60


# --- what was altered ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("session"), edits_of_two, outside=False)[0]


def flipped(frame: StateFrame, column: str, row: int, bit: int) -> StateFrame:
    values = getattr(frame, column).copy()
    values.view(f"u{values.dtype.itemsize}")[(row, *(0,) * (values.ndim - 1))] ^= 1 << bit
    return dataclasses.replace(frame, **{column: values})


@pytest.mark.parametrize(
    ("column", "component", "field"),
    [
        ("position", "Transform", "position (world)"),
        ("rotation", "Transform", "rotation (world)"),
        ("linear_velocity", "RigidBody", "linear_velocity"),
        ("angular_velocity", "RigidBody", "angular_velocity"),
    ],
)
def test_a_flipped_bit_is_found_where_it_is(
    session: Path, tmp_path: Path, column: str, component: str, field: str
) -> None:
    tick, row, bit = 57, 4, 3
    entities = []

    def flip(message: Any) -> bytes:
        if message.channel == topics.STATE.name and (frame := unpack_frame(message.body)).tick == tick:
            entities.append(int(frame.entity[row]))
            return pack_frame(flipped(frame, column, row, bit))
        return message.body  # type: ignore[no-any-return]

    verdict = verify(altered(session, tmp_path / "a.mcap", flip))
    assert verdict.cause == "altered"
    found = verdict.difference
    assert found is not None
    assert (found.tick, found.entity, found.component, found.field) == (tick, entities[0], component, field)
    assert found.recorded != found.computed
    assert 0.0 < found.difference < 1e-3
    assert verdict.ticks == 57  # 0 to 56


def test_a_compact_recording_is_equal_within_its_bounds(session: Path, tmp_path: Path) -> None:
    path = altered(session, tmp_path / "compact.mcap", lambda message: message.body, compact=True)
    assert verify(path).cause == "equal"

    def move(message: Any) -> bytes:
        if message.channel == topics.STATE.name and (frame := unpack_frame(message.body)).tick == 57:
            position = frame.position.copy()
            position[4, 1] += 0.003
            return pack_frame(dataclasses.replace(frame, position=position))
        return message.body  # type: ignore[no-any-return]

    found = verify(altered(session, tmp_path / "moved.mcap", move, compact=True)).difference
    assert found is not None
    assert (found.tick, found.field) == (57, "position (world)")


def test_a_flipped_bit_of_the_hash_is_found(session: Path, tmp_path: Path) -> None:
    def flip(message: Any) -> bytes:
        if message.channel == topics.STATE.name and (frame := unpack_frame(message.body)).tick == 33:
            return pack_frame(dataclasses.replace(frame, state_hash=frame.state_hash ^ 1))
        return message.body  # type: ignore[no-any-return]

    verdict = verify(altered(session, tmp_path / "a.mcap", flip))
    assert verdict.cause == "altered"
    assert verdict.difference is not None and verdict.difference.tick == 33
    assert "hash" in verdict.difference.text


def numbered(path: Path) -> list[CommandRecord]:
    with Recording(path) as recording:
        bodies = [message.body for message in recording.reader.messages((topics.COMMANDS.name,))]
    records = [codec.decode_body(body, CommandRecord, Encoding.JSON) for body in bodies]
    return [record for record in records if record.number > 0]


def test_each_command_that_is_taken_out_is_named_at_its_tick(session: Path, tmp_path: Path) -> None:
    records = numbered(session)
    assert [record.number for record in records] == list(range(1, len(records) + 1))
    assert len(records) > 15
    for gone in records:

        def take_out(message: Any, gone: CommandRecord = gone) -> bytes | None:
            if message.channel != topics.COMMANDS.name:
                return message.body  # type: ignore[no-any-return]
            number = codec.decode_body(message.body, CommandRecord, Encoding.JSON).number
            return None if number == gone.number else message.body

        verdict = verify(altered(session, tmp_path / "a.mcap", take_out))
        assert verdict.cause == "altered", gone
        assert verdict.difference is not None
        assert verdict.difference.missing_command == gone.number
        if gone is not records[-1]:
            assert verdict.difference.tick == gone.tick, (gone, verdict.difference)


def test_a_command_that_says_something_else_is_found_at_the_next_tick(session: Path, tmp_path: Path) -> None:
    gone = next(record for record in numbered(session) if isinstance(record.command, Grab))

    def change(message: Any) -> bytes:
        if message.channel == topics.COMMANDS.name:
            record = codec.decode_body(message.body, CommandRecord, Encoding.JSON)
            if record.number == gone.number:
                command = msgspec.structs.replace(record.command, target=(1.0, 4.0, 0.5))
                return codec.encode_body(msgspec.structs.replace(record, command=command), Encoding.JSON)
        return message.body  # type: ignore[no-any-return]

    verdict = verify(altered(session, tmp_path / "a.mcap", change))
    assert verdict.cause == "altered"
    assert verdict.difference is not None
    assert verdict.difference.tick == gone.tick + 1
    assert verdict.difference.entity == gone.command.entity


def test_what_cannot_be_followed_to_the_end_is_not_called_equal(session: Path, tmp_path: Path) -> None:
    """A command that failed in the middle is told by the exact state after it; here there is none."""
    broken = next(record for record in numbered(session) if record.tick > 20)

    def change(message: Any) -> bytes | None:
        if message.channel == topics.COMMANDS.name:
            record = codec.decode_body(message.body, CommandRecord, Encoding.JSON)
            if record.number == broken.number:
                return codec.encode_body(msgspec.structs.replace(record, is_broken=True), Encoding.JSON)
        if message.channel == topics.EXACT.name and message.log_time > exact_times[0]:
            return None
        return message.body  # type: ignore[no-any-return]

    with McapReader(session) as reader:
        exact_times = sorted(message.log_time for message in reader.messages((topics.EXACT.name,)))
    verdict = verify(altered(session, tmp_path / "a.mcap", change))
    assert verdict.cause == "incomplete" and verdict.difference is None
    assert verdict.ticks <= broken.tick + 1 and "told by an exact state" in " ".join(verdict.notes)


def test_a_damaged_exact_state_is_a_sentence(session: Path, tmp_path: Path) -> None:
    def flip(message: Any) -> bytes:
        if message.channel != topics.EXACT.name:
            return message.body  # type: ignore[no-any-return]
        return message.body[:5000] + bytes([message.body[5000] ^ 1]) + message.body[5001:]  # type: ignore[no-any-return]

    with pytest.raises(StateError, match="damaged"):
        verify(altered(session, tmp_path / "a.mcap", flip))


def test_a_recording_without_exact_states_is_a_sentence(session: Path, tmp_path: Path) -> None:
    path = altered(session, tmp_path / "a.mcap", lambda m: None if m.channel == topics.EXACT.name else m.body)
    with pytest.raises(RecordingError, match="holds no exact state"):
        verify(path)


def test_a_cut_file_is_verified_as_far_as_it_goes(session: Path, tmp_path: Path) -> None:
    whole, path = in_short_chunks(session, tmp_path / "whole.mcap").read_bytes(), tmp_path / "cut.mcap"
    ticks = []
    for share in (0.5, 0.7, 0.95):
        path.write_bytes(whole[: int(share * len(whole))])
        verdict = verify(path)
        assert verdict.cause == "equal", verdict
        ticks.append(verdict.ticks)
    assert 0 < ticks[0] < ticks[-1] <= verify(session).ticks


# --- what is not there -----------------------------------------------------------------------------------------------


def without_ticks(session: Path, target: Path, gone: Container[int]) -> Path:
    def take_out(message: Any) -> bytes | None:
        if message.channel == topics.STATE.name and unpack_frame(message.body).tick in gone:
            return None
        return message.body  # type: ignore[no-any-return]

    return altered(session, target, take_out)


def test_ticks_that_were_taken_out_are_counted_and_named(session: Path, tmp_path: Path) -> None:
    whole = verify(session)
    assert (whole.cause, whole.missing_ticks, whole.gaps, whole.jumps) == ("equal", 0, [], [])
    verdict = verify(without_ticks(session, tmp_path / "a.mcap", {*range(20, 60), 80}))
    assert (verdict.cause, verdict.difference) == ("incomplete", None)
    assert (verdict.ticks, verdict.missing_ticks) == (whole.ticks - 41, 41)
    assert verdict.gaps == [(20, 59), (80, 80)]
    said = verb.describe(verdict)
    assert f"equal: {whole.ticks - 41} of {whole.ticks} ticks compared, 41 are missing (first: ticks 20-59)" in said
    assert verb.EXIT_CODES[verdict.cause] == 5
    part = verify(without_ticks(session, tmp_path / "b.mcap", range(20, 60)), first=1.2)
    assert (part.cause, part.missing_ticks, part.lead_ticks) == ("equal", 0, 0)  # of that time nothing is missing


def test_a_beginning_that_was_taken_out_is_told(session: Path, tmp_path: Path) -> None:
    """It is no error: each of several files of a session may begin so."""
    verdict = verify(without_ticks(session, tmp_path / "a.mcap", range(20)))
    assert (verdict.cause, verdict.missing_ticks, verdict.lead_ticks) == ("equal", 0, 19)  # the state is at tick 0
    assert verdict.first_time == pytest.approx(20 / 60)
    assert "older by 19 ticks" in verb.describe(verdict)


def test_what_was_done_in_a_gap_is_found_behind_it(session: Path, tmp_path: Path) -> None:
    """Who takes out a command and the ticks around it hides neither: the states after them do not come of the rest."""
    grabbed = next(record for record in numbered(session) if isinstance(record.command, Grab))

    def cheat(message: Any) -> bytes | None:
        if message.channel == topics.STATE.name and abs(unpack_frame(message.body).tick - grabbed.tick) < 8:
            return None
        if message.channel == topics.COMMANDS.name:
            record = codec.decode_body(message.body, CommandRecord, Encoding.JSON)
            if record.number == grabbed.number:
                command = msgspec.structs.replace(record.command, target=(1.0, 9.0, 0.0))
                return codec.encode_body(msgspec.structs.replace(record, command=command), Encoding.JSON)
        return message.body  # type: ignore[no-any-return]

    verdict = verify(altered(session, tmp_path / "a.mcap", cheat))
    assert verdict.cause == "altered"
    assert verdict.difference is not None and verdict.difference.tick == grabbed.tick + 8


def test_a_recording_without_any_state_to_compare_is_not_equal(session: Path, tmp_path: Path) -> None:
    path = altered(session, tmp_path / "a.mcap", lambda message: message.body)
    assert verify(path, first=1e6).cause == "incomplete"
    assert "nothing was compared" in verb.describe(verify(path, first=1e6))


def test_a_state_that_nothing_leads_to_is_told(session: Path, tmp_path: Path) -> None:
    """Whoever writes a state into a file can say that it goes on from there: what comes out is no proof of the way to it."""
    with Recording(session) as recording:
        course = read_course(recording)
        again = Reexecution(recording, course, verification.simulation_for(recording))
        again.begin(course.first)
        while again.simulation.tick < 25:
            again.advance()
        head = unpack_head(next(iter(recording.reader.messages((topics.EXACT.name,)))).body)
        simulation = again.simulation
        head = head._replace(
            instant=again.instant,
            tick=simulation.tick,
            time=simulation.time,
            state_hash=simulation.state_hash(),
            is_unexplained=True,
        )
        forged = head.pack() + simulation.capture().to_bytes()
    verdict = verify(in_short_chunks(session, tmp_path / "a.mcap", more=[(topics.EXACT.name, forged)]))
    assert (verdict.cause, verdict.jumps) == ("equal", [25])
    assert "tick 25" in verb.describe(verdict)


# --- what is damaged -------------------------------------------------------------------------------------------------


def chunk_with(path: Path, tick: int) -> tuple[int, int, list[int]]:
    """Where the chunk stands that has the frame of a tick, and which ticks are in it."""
    with Recording(path) as recording:
        number = recording.place(recording.position_at(tick / 60)).chunk
        ticks = {int(recording.tick[k]) for k in range(len(recording)) if recording.place(k).chunk == number}
        return *recording.reader.chunk_place(number), sorted(ticks)


def flip(path: Path, place: int) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 0x10
    path.write_bytes(data)


@pytest.mark.parametrize("has_summary", [True, False])
def test_a_flipped_bit_of_the_file_costs_its_ticks_and_is_said(
    session: Path, tmp_path: Path, has_summary: bool, caplog: Any
) -> None:
    path = in_short_chunks(session, tmp_path / "flipped.mcap")
    whole = verify(path)
    assert whole.cause == "equal"
    offset, length, ticks = chunk_with(path, 20)  # before the first edit
    flip(path, offset + length - 30)
    if not has_summary:
        path.write_bytes(path.read_bytes()[:-100])
    verdict = verify(path)
    assert (verdict.cause, verdict.difference) == ("incomplete", None)
    (gap,) = verdict.gaps
    assert gap[0] <= ticks[0] and ticks[-1] <= gap[1]
    assert verdict.ticks + verdict.missing_ticks == whole.ticks
    assert f"ticks {gap[0]} to {gap[1]}" in verdict.damage[0]
    assert f"{length} bytes from byte {offset} on" in verdict.damage[0]
    warnings = [record.getMessage() for record in caplog.records if "elys recover" in record.getMessage()]
    assert len(warnings) == 1 and f"ticks {gap[0]} to {gap[1]}" in warnings[0]
    assert verify(path, first=1.5).cause == "equal"  # of that time nothing is damaged
    report = recover(path, tmp_path / "mended.mcap")
    assert report.missing == (gap,)
    mended = verify(report.path)
    assert (mended.cause, mended.gaps, mended.damage) == ("incomplete", [gap], [])


def test_a_command_in_a_damaged_part_is_not_called_taken_out(session: Path, tmp_path: Path) -> None:
    path = in_short_chunks(session, tmp_path / "flipped.mcap")
    first = numbered(path)[0]
    with Recording(path) as recording:
        place = next(
            message.place
            for message in recording.reader.messages((topics.COMMANDS.name,))
            if codec.decode_body(message.body, CommandRecord, Encoding.JSON).number == first.number
        )
        offset, length = recording.reader.chunk_place(place.chunk)
    flip(path, offset + length - 30)
    verdict = verify(path)
    assert verdict.cause == "incomplete"
    assert verdict.difference is not None and verdict.difference.missing_command >= first.number
    assert "a part of the file that is damaged" in verdict.difference.text


# --- why it differs --------------------------------------------------------------------------------------------------


def test_another_build_is_told_from_an_altered_file(session: Path, tmp_path: Path, monkeypatch: Any) -> None:
    facts = {**verification.build_facts(), "numba": "0.1"}
    monkeypatch.setattr(verification, "build_facts", lambda: facts)
    assert verify(session).cause == "equal"
    assert verify(session).other

    def flip(message: Any) -> bytes:
        if message.channel == topics.STATE.name and (frame := unpack_frame(message.body)).tick == 9:
            return pack_frame(flipped(frame, "position", 0, 0))
        return message.body  # type: ignore[no-any-return]

    verdict = verify(altered(session, tmp_path / "a.mcap", flip))
    assert verdict.cause == "other build"
    assert "numba" in verdict.other[0]


def test_what_is_not_deterministic_is_told_as_such(session: Path, monkeypatch: Any) -> None:
    """A system with a memory of its own, which no state holds."""
    runs = iter(range(1, 100))

    def forgetful(*arguments: Any, **options: Any) -> Simulation:
        simulation, run = made(*arguments, **options), next(runs)

        def push(world: Any) -> None:
            if simulation.tick == 20:
                bodies = simulation.moving_bodies()
                simulation.physics.apply_force(
                    [int(bodies.entity[9])], np.array((100.0 * run, 0.0, 0.0)), bodies.position[9]
                )

        simulation.systems = (push, *simulation.systems)
        return simulation

    made = verification.simulation_for
    monkeypatch.setattr(verification, "simulation_for", forgetful)
    verdict = verify(session)
    assert verdict.cause == "not deterministic"
    assert verdict.difference is not None and verdict.difference.tick == 21


def test_a_part_is_verified_from_the_state_before_it(session: Path) -> None:
    verdict = verify(session, first=1.0, last=1.5)
    assert verdict.cause == "equal"
    assert verdict.ticks == 31


def test_any_instant_is_had_again(session: Path) -> None:
    from elys.sim_node.reexecution import simulation_for

    with Recording(session) as recording:
        again = Reexecution(recording, read_course(recording), simulation_for(recording))
        again.begin(again.course.first)
        while again.simulation.tick < 71:
            again.advance()
        frame = recording.frame(recording.position_at(71 / 60))
        assert again.simulation.state_hash() == frame.state_hash


def test_hostile_commands_and_states_are_a_verdict_or_a_sentence(session: Path, tmp_path: Path) -> None:
    """Bytes that are changed, numbers that nobody counts to: bounded time, no crash, and never equal by accident."""
    chance = np.random.default_rng(7)
    numbers = (b'"number":', b'"beat":', b'"previous":', b'"fork":', b'"forked_from":', b'"physics_of":', b'"epoch":')
    for round_number in range(24):
        name = topics.COMMANDS.name if round_number % 3 else topics.EXACT.name
        key = numbers[round_number % len(numbers)]
        value = (b"999999999999999999", b"-5", b"0")[round_number % 3]

        def spoil(message: Any, name: str = name, key: bytes = key, value: bytes = value) -> bytes:
            body: bytes = message.body
            if message.channel != name or chance.random() < 0.5:
                return body
            if name == topics.COMMANDS.name and chance.random() < 0.7:
                place = body.index(key) + len(key)
                return body[:place] + value + body[place:].lstrip(b"-0123456789")
            place = int(chance.integers(min(len(body), 80)))
            return body[:place] + bytes([body[place] ^ int(chance.integers(1, 256))]) + body[place + 1 :]

        path = altered(session, tmp_path / "a.mcap", spoil)
        try:
            verdict = verify(path)
        except (RecordingError, StateError):
            continue
        assert verdict.cause in ("equal", "altered"), verdict
