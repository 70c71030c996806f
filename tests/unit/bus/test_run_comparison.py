"""Two recorded runs side by side, against distances that are known in closed form."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.bus import codec
from elys.bus.messages.state_frame import StateFrame, pack_frame
from elys.bus.mirror import SceneMirror
from elys.bus.run_comparison import compare
from elys.bus.topics import Encoding
from elys.bus.transports.mcap import McapWriter
from elys.common.errors import ElysError, RecordingError
from elys.verbs.diff import diff, write_plot

RATE, TICKS = 60, 220
GROWTH = 4.0  # [1/s]
BEGIN = 1e-6  # [m]


def frame(
    tick: int, places: dict[int, tuple[float, float, float]], *, angle: float = 0.0, state_hash: int = 7
) -> StateFrame:
    count = len(places)
    rotation = np.tile(np.array([math.sin(angle / 2), 0.0, 0.0, math.cos(angle / 2)], "f4"), (count, 1))
    return StateFrame(
        epoch=1,
        tick=tick,
        simulation_time=tick / RATE,
        published_at=0,
        delta_sequence=0,
        state_hash=state_hash,
        playing=True,
        position=np.array([*places.values()], "f8").reshape(count, 3),
        rotation=rotation,
        linear_velocity=np.zeros((count, 3), "f4"),
        angular_velocity=np.zeros((count, 3), "f4"),
        entity=np.array([*places], "u4"),
    )


def written(path: Path, frames: list[StateFrame], *, compact: bool = False) -> Path:
    mirror = SceneMirror()
    mirror.epoch, mirror.sequence, mirror.scene = 1, 0, "Two"
    writer = McapWriter(path, session="s", compact=compact)
    writer.write("snapshot", codec.encode_body(mirror.to_snapshot(), Encoding.JSON), log_time=1)
    for number, one in enumerate(frames):
        writer.write("state", pack_frame(one), log_time=2 + number)
    writer.close()
    return path


def parting(path: Path, *, since: int, **options: Any) -> Path:
    """Body 1 stands; body 2 departs exponentially from tick `since` on."""

    def off(tick: int) -> float:
        return BEGIN * math.exp(GROWTH * (tick - since) / RATE) if tick >= since else 0.0

    frames = [frame(tick, {1: (0.0, 0.0, 0.0), 2: (5.0 + off(tick), 1.0, 0.0)}) for tick in range(TICKS)]
    return written(path, frames, **options)


def test_when_and_by_how_much_they_part(tmp_path: Path) -> None:
    a, b = parting(tmp_path / "a.mcap", since=10**6), parting(tmp_path / "b.mcap", since=60)
    found = compare(a, b, curves=3)
    assert found.differs
    assert (found.instants, found.first_tick, found.first_difference) == (TICKS, 60, 1.0)
    for horizon in found.horizons:
        after = math.log(horizon.distance / BEGIN) / GROWTH
        if 1.0 + after > (TICKS - 1) / RATE:
            assert math.isnan(horizon.time)
        else:
            assert 0.0 <= horizon.after - after <= 1.0 / RATE
    assert [horizon.distance for horizon in found.horizons if not math.isnan(horizon.time)] == [0.001, 0.01]
    (body,) = found.bodies
    last = BEGIN * math.exp(GROWTH * (TICKS - 1 - 60) / RATE)
    assert (body.entity, body.first_tick, body.largest_time) == (2, 60, (TICKS - 1) / RATE)
    assert body.largest == body.final == pytest.approx(last, rel=1e-9)
    assert [curve.name for curve in found.curves] == ["the farthest", "entity 2"]
    assert max(found.curves[1].distance) == pytest.approx(last, rel=1e-9)


def test_a_recording_and_itself_are_equal(tmp_path: Path) -> None:
    a = parting(tmp_path / "a.mcap", since=60)
    found = compare(a, a)
    assert (found.differs, found.bodies, found.lone, found.first_tick) == (False, [], [], -1)
    assert diff(a, a, plot=None, json=False) == 0


def test_what_compact_recordings_may_be_off_is_no_difference(tmp_path: Path) -> None:
    exact = parting(tmp_path / "exact.mcap", since=60)
    compact = parting(tmp_path / "compact.mcap", since=60, compact=True)
    assert not compare(exact, compact).differs
    moved = compare(parting(tmp_path / "c.mcap", since=10**6), compact)
    assert moved.differs
    bound = 0.0005  # [m]
    tick = 60 + RATE * math.log(bound / BEGIN) / GROWTH
    assert abs(moved.first_tick - tick) < RATE * math.log(3.0) / GROWTH


def test_small_turns_are_seen(tmp_path: Path) -> None:
    frames = [frame(tick, {1: (0.0, 0.0, 0.0)}) for tick in range(10)]
    turned = [*frames[:5], *(frame(tick, {1: (0.0, 0.0, 0.0)}, angle=1e-3) for tick in range(5, 10))]
    found = compare(written(tmp_path / "a.mcap", frames), written(tmp_path / "b.mcap", turned))
    assert (found.first_tick, found.bodies[0].entity, found.bodies[0].largest) == (5, 1, 0.0)
    within = compare(
        written(tmp_path / "c.mcap", frames, compact=True),
        written(tmp_path / "d.mcap", [frame(tick, {1: (0.0, 0.0, 0.0)}, angle=1e-4) for tick in range(10)]),
    )
    assert not within.differs


def test_bodies_that_one_run_has_alone(tmp_path: Path) -> None:
    places = {1: (0.0, 0.0, 0.0), 2: (5.0, 0.0, 0.0)}
    a = written(tmp_path / "a.mcap", [frame(tick, places) for tick in range(20)])
    b = written(
        tmp_path / "b.mcap", [frame(tick, places if tick < 7 else {2: places[2], 9: places[1]}) for tick in range(20)]
    )
    found = compare(a, b)
    assert (found.first_tick, found.bodies) == (7, [])
    assert [(lone.entity, Path(lone.only_in).name, lone.tick) for lone in found.lone] == [
        (1, "a.mcap", 7),
        (9, "b.mcap", 7),
    ]


def test_states_that_differ_in_what_is_not_seen(tmp_path: Path) -> None:
    a = written(tmp_path / "a.mcap", [frame(tick, {1: (0.0, 0.0, 0.0)}) for tick in range(9)])
    b = written(
        tmp_path / "b.mcap", [frame(tick, {1: (0.0, 0.0, 0.0)}, state_hash=7 + (tick > 3)) for tick in range(9)]
    )
    found = compare(a, b)
    assert (found.first_tick, found.bodies) == (4, [])
    assert "hash" in found.first_of


def test_runs_without_a_common_instant_are_a_sentence(tmp_path: Path) -> None:
    a = written(tmp_path / "a.mcap", [frame(tick, {1: (0.0, 0.0, 0.0)}) for tick in range(9)])
    b = written(tmp_path / "b.mcap", [frame(tick, {1: (0.0, 0.0, 0.0)}) for tick in range(100, 109)])
    with pytest.raises(RecordingError, match="have no instant in common"):
        compare(a, b)
    assert diff(a, b, plot=None, json=False) == 2


def test_what_is_printed_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = parting(tmp_path / "a.mcap", since=10**6), parting(tmp_path / "b.mcap", since=60)
    assert diff(a, b, plot=None, json=False) == 1
    told = capsys.readouterr().out
    assert "they part at tick 60 (1.000 s)" in told
    assert "farther apart than 100 mm: never" in told
    assert diff(a, b, plot=None, json=True) == 1
    assert json.loads(capsys.readouterr().out)["first_tick"] == 60
    pytest.importorskip("vl_convert")
    found = compare(a, b, curves=3)
    write_plot(found, tmp_path / "d.png")
    assert (tmp_path / "d.png").read_bytes().startswith(b"\x89PNG")
    write_plot(found, tmp_path / "d.html")
    page = (tmp_path / "d.html").read_text()
    assert "entity 2" in page and "https://cdn" not in page.split("<script")[0]
    with pytest.raises(ElysError, match="cannot be written"):
        write_plot(found, tmp_path / "no" / "d.png")
    assert diff(a, b, plot=tmp_path / "d.pdf", json=False) == 2
    assert "give it the suffix .png or .html" in capsys.readouterr().err
