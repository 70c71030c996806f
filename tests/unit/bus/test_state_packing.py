"""Stored frames give back every bit, or what a compact recording promises; what is damaged costs a sentence."""

from __future__ import annotations

import random
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.spatial.transform import Rotation

from elys.bus.messages.state_frame import BODY_SIZE, HAS_TAIL, HEADER, StateFrame, pack_frame, unpack_frame
from elys.bus.state_packing import compact
from elys.bus.state_packing.frames import HEAD_SIZE, Kind, Told, head_of, unpack_told
from elys.bus.state_packing.numbers import folded, from_ordered, ordered, unfolded
from elys.bus.state_packing.stream import FramePacker
from elys.common.errors import RecordingError

DT = 1.0 / 60.0


def moved(seed: int, *, count: int = 40, ticks: int = 30, tail: bool = False) -> list[bytes]:
    """Frames of bodies that fly and turn, in the solver's precision, some of them asleep, some coming and going."""
    source = np.random.default_rng(seed)
    entity = np.arange(1, count + 1, dtype=np.uint32)
    position = source.normal(size=(count, 3)) * 10.0
    rotation = Rotation.random(count, random_state=seed)
    linear = source.normal(size=(count, 3)).astype(np.float32)
    angular = source.normal(size=(count, 3)).astype(np.float32)
    bodies = []
    for tick in range(ticks):
        awake = np.arange(len(entity)) >= len(entity) // 3
        linear[awake] += source.normal(size=(int(awake.sum()), 3)).astype(np.float32) * np.float32(0.01)
        position[awake] += (linear[awake] * np.float32(DT)).astype(np.float64)
        turn = np.where(awake[:, None], angular * DT, 0.0)
        rotation = Rotation.from_rotvec(turn) * rotation
        if tick % 11 == 10:
            kept = np.flatnonzero(source.random(len(entity)) > 0.1)
            new = np.uint32(1000 + tick)
            entity = np.concatenate([entity[kept], [new]]).astype(np.uint32)
            position = np.concatenate([position[kept], [[0.5, 1.5, -2.0]]])
            linear, angular = (
                np.concatenate([column[kept], [[0, 0, 0]]]).astype(np.float32) for column in (linear, angular)
            )
            rotation = Rotation.from_quat(np.concatenate([rotation.as_quat()[kept], [[0, 0, 0, 1]]]))
        awake = awake[: len(entity)] if len(awake) >= len(entity) else np.ones(len(entity), bool)
        moves = np.float32(tick) * np.ones((2, 3), np.float32)
        animated = (
            {
                "local_position": moves,
                "local_rotation": np.ones((2, 4), np.float32),
                "local_scale": np.ones((2, 3), np.float32),
                "local_entity": np.array([7, 9], np.uint32),
                "weight": np.float32([0.1 * tick]),
                "weight_entity": np.uint32([7]),
                "weight_target": np.uint32([0]),
            }
            if tail and tick % 5
            else {}
        )
        frame = StateFrame(
            epoch=1,
            tick=tick,
            simulation_time=tick * DT,
            published_at=tick * 16_666_667,
            delta_sequence=0,
            state_hash=tick * 77,
            playing=True,
            position=position,
            rotation=rotation.as_quat().astype(np.float32),
            linear_velocity=linear,
            angular_velocity=angular,
            entity=entity,
            **animated,
        )
        bodies.append(pack_frame(frame))
    return bodies


def stored(bodies: Sequence[bytes], *, in_compact: bool = False, chunk: int = 12) -> list[bytes]:
    packer = FramePacker(compact=in_compact)
    packed = [packer.pack(body, is_entry=number % chunk == 0) for number, body in enumerate(bodies)]
    assert None not in packed
    return packed  # type: ignore[return-value]


def read(messages: Sequence[bytes]) -> list[bytes]:
    """In the order of the file, as any reader could."""
    told: dict[int, Told] = {}
    for message in messages:
        head = head_of(message)
        told[head.number] = unpack_told(message, told.get(head.base))
    return [bytes(frame.body) for frame in told.values()]


@pytest.mark.parametrize("tail", [False, True])
def test_every_bit_comes_back(tail: bool) -> None:
    bodies = moved(1, tail=tail)
    messages = stored(bodies)
    assert read(messages) == bodies
    kinds = [head_of(message).kind for message in messages]
    assert kinds[0] is Kind.KEY and kinds.count(Kind.DIFFERENCE) == 27


def test_a_frame_at_rest_is_a_head_alone() -> None:
    bodies = moved(2, ticks=1)
    header = list(HEADER.unpack_from(bodies[0]))
    for tick in range(1, 200):
        header[1] = tick
        bodies.append(HEADER.pack(*header) + bodies[0][HEADER.size :])
    messages = stored(bodies)
    assert read(messages) == bodies
    assert {len(message) for message in messages[1:]} == {HEAD_SIZE}
    assert {head_of(message).kind for message in messages[1:]} == {Kind.REFRESH, Kind.DIFFERENCE}


def test_no_frame_is_far_from_one_that_can_be_had_by_itself() -> None:
    kinds = [head_of(message).kind for message in stored(moved(3, ticks=200), chunk=1000)]
    longest = max(len(run) for run in "".join("d" if k is Kind.DIFFERENCE else " " for k in kinds).split())
    assert longest == 60


@settings(max_examples=60, deadline=None)
@given(data=st.data(), in_compact=st.booleans())
def test_any_bits_come_back(data: st.DataObject, in_compact: bool) -> None:
    """Columns are noise: NaN with payloads, infinities, subnormals, the same id twice; frames that are no frames among them."""
    bodies = []
    for tick in range(data.draw(st.integers(1, 5))):
        count = data.draw(st.sampled_from([0, 1, 3, 3, 3, 70]))
        noise = data.draw(arrays.arrays(np.uint8, count * BODY_SIZE, elements=st.integers(0, 255), fill=st.just(0)))
        claimed = data.draw(st.sampled_from([count, count, count, count + 1, 1 << 31]))
        time = data.draw(st.floats(allow_nan=True))
        bodies.append(
            HEADER.pack(1, tick, time, 0, 0, 0, claimed, data.draw(st.sampled_from([0, 1]))) + noise.tobytes()
        )
    if not in_compact:
        assert read(stored(bodies)) == bodies
    else:
        for body, seen in zip(bodies, read(stored(bodies, in_compact=True)), strict=True):
            assert seen[: HEADER.size] == body[: HEADER.size] and len(seen) == len(body)


def test_compact_frames_are_as_near_as_they_promise() -> None:
    bodies = moved(5, count=3000, ticks=60, tail=True)
    messages = stored(bodies, in_compact=True)
    assert sum(map(len, messages)) < 0.4 * sum(map(len, stored(bodies)))
    for body, seen in zip(bodies, read(messages), strict=True):
        exact, kept = unpack_frame(body), unpack_frame(seen)
        assert seen[: HEADER.size] == body[: HEADER.size] and np.array_equal(exact.entity, kept.entity)
        for name, error in (
            ("position", compact.POSITION_ERROR),
            ("linear_velocity", compact.LINEAR_ERROR),
            ("angular_velocity", compact.ANGULAR_ERROR),
        ):
            off = np.linalg.norm(getattr(exact, name).astype(float) - getattr(kept, name), axis=1)
            assert off.max() <= error * 1.0001, name
        turned = Rotation.from_quat(exact.rotation) * Rotation.from_quat(kept.rotation).inv()
        assert np.degrees(turned.magnitude()).max() <= compact.ROTATION_ERROR
        assert (np.sum(exact.rotation * kept.rotation, axis=1) > 0.99).all()  # the sign is kept as well
        assert body[HEADER.size + exact.body_count * BODY_SIZE :] == seen[HEADER.size + exact.body_count * BODY_SIZE :]
    assert compact.POSITION_ERROR <= 0.5e-3 and compact.ROTATION_ERROR <= 0.01


def test_what_is_beyond_steps_is_kept_exactly() -> None:
    bodies = moved(6, ticks=6)
    far = np.frombuffer(bodies[3], "<f8", 3, HEADER.size).copy()
    for value in (1e9, np.nan, np.inf):
        far[1] = value
        bodies[3] = bodies[3][: HEADER.size] + far.tobytes() + bodies[3][HEADER.size + 24 :]
        messages = stored(bodies, in_compact=True)
        assert read(messages)[3] == bodies[3]
        assert [head_of(message).is_compact for message in messages] == [True, True, True, False, True, True]


def test_what_is_told_against_another_frame_is_refused() -> None:
    messages = stored(moved(7, ticks=4))
    first, second, third = (unpack_told(messages[0], None), messages[1], messages[2])
    with pytest.raises(RecordingError, match="frame 1, which it is told against, is not there"):
        unpack_told(third, first)
    with pytest.raises(RecordingError, match="frame 0, which it is told against, is not there"):
        unpack_told(second, None)
    exact_of_compact = unpack_told(stored(moved(7, ticks=1), in_compact=True)[0], None)
    with pytest.raises(RecordingError, match="is not there"):
        unpack_told(second, exact_of_compact)


@pytest.mark.parametrize("in_compact", [False, True])
def test_damage_costs_a_sentence(in_compact: bool) -> None:
    source = random.Random(1)
    bodies = moved(8, count=400, ticks=8, tail=True)
    messages = stored(bodies, in_compact=in_compact)
    for _ in range(400):
        number = source.randrange(len(messages))
        base = None
        for message in messages[:number]:
            base = unpack_told(message, base)
        damaged = bytearray(messages[number])
        for _ in range(source.randrange(1, 4)):
            damaged[source.randrange(len(damaged))] = source.randrange(256)
        if source.random() < 0.3:
            del damaged[source.randrange(len(damaged)) :]
        try:
            told = unpack_told(bytes(damaged), base)
        except RecordingError as error:
            assert str(error)
        else:
            count, flags = HEADER.unpack_from(told.body)[6:]
            assert told.rows is None or flags & HAS_TAIL or len(told.body) == HEADER.size + count * BODY_SIZE


def test_a_bomb_is_refused_before_it_unpacks() -> None:
    import zstandard

    (message,) = stored(moved(9, ticks=1))
    many = HEADER.pack(1, 0, 0.0, 0, 0, 0, 1 << 22, 1)
    with pytest.raises(RecordingError, match="says that it has 4194304 bodies"):
        unpack_told(many + message[HEADER.size :], None)
    packed = zstandard.compress(bytes(100 << 20))
    plane = struct.pack("<BI", 2, len(packed)) + packed
    few = HEADER.pack(1, 0, 0.0, 0, 0, 0, 1000, 1) + message[HEADER.size : HEAD_SIZE]
    with pytest.raises(RecordingError, match="unpacks to another size"):
        unpack_told(few + plane, None)


@given(values=arrays.arrays(np.uint32, 20))
def test_numbers_and_back(values: Any) -> None:
    numbers = values.view(np.int32)
    assert np.array_equal(unfolded(folded(numbers)), numbers)
    floats = values.view(np.float32)
    assert from_ordered(ordered(floats), np.float32).tobytes() == floats.tobytes()
    whole = np.sort(floats[np.isfinite(floats)])
    assert (np.diff(ordered(whole).astype(np.int64)) >= 0).all() or (whole == 0.0).any()
