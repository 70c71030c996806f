"""Forks of recordings: without edits they are the original to the bit, with edits they part where they were edited."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import msgspec
import pytest

from elys.bus.access.listening import LOOPBACK
from elys.bus.lineage import content_hash, lineage_of
from elys.bus.messages.commands import Batch, Grab, Rename, SetComponent
from elys.bus.recording import Recording
from elys.common.errors import RecordingError, SceneError
from elys.sim_node.verification import verify
from elys.verbs.edit_file import Change, edits_schema
from elys.verbs.fork import opened_at
from elys.verbs.simulate import simulate
from tests.unit.sim_node.test_verification import another_scene, edits_of_two, forks, record


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    stories = (edits_of_two, forks, another_scene)
    return {
        story.__name__: record(tmp_path_factory.mktemp(story.__name__), story, outside=False)[0] for story in stories
    }


def forked(source: Path, target: Path, at: float, **options: object) -> Path:
    """What `elys fork` does, in this process."""
    simulation, origin = opened_at(source, at, **options)  # type: ignore[arg-type]
    asyncio.run(
        simulate(
            simulation,
            listen=LOOPBACK,
            step_limit=0,
            record=target,
            realtime=False,
            paused=False,
            name="",
            keep=0.0,
            origin=origin,
        )
    )
    return target


def frames_of(path: Path, since: float) -> list[tuple[float, bytes]]:
    """Time and columns of the last frame of each tick, in runs of all tick rates."""
    found: dict[tuple[int, float], bytes] = {}
    with Recording(path) as recording:
        runs = recording.run_count
    for number in range(runs):
        with Recording(path, run=number) as run:
            for place in range(len(run)):
                frame = run.frame(place)
                if frame.simulation_time > since:
                    columns = (frame.position, frame.rotation, frame.linear_velocity, frame.angular_velocity)
                    body = frame.state_hash.to_bytes(8) + b"".join(column.tobytes() for column in columns)
                    found[frame.tick, frame.simulation_time] = body
    return [(time, body) for (_, time), body in found.items()]


@pytest.mark.parametrize("name", ["edits_of_two", "forks", "another_scene"])
@pytest.mark.parametrize("at", [0.0, 0.9, 1.2, 1.6])
def test_a_fork_without_edits_is_the_original_to_its_end(
    sessions: dict[str, Path], tmp_path: Path, name: str, at: float
) -> None:
    source = sessions[name]
    target = forked(source, tmp_path / "g.mcap", at)
    assert verify(target).cause == "equal"
    with Recording(target) as fork:
        since = float(fork.time[0])
    expected, got = frames_of(source, since), frames_of(target, since)
    assert len(expected) > 20
    assert got == expected


def test_an_edit_makes_another_future_and_is_kept_in_the_lineage(sessions: dict[str, Path], tmp_path: Path) -> None:
    source, edits = sessions["edits_of_two"], tmp_path / "edits.json"
    changes = [
        {
            "type": "set_component",
            "entity": "Cube 3",
            "component": "Transform",
            "values": {"position": [0.4, 2.5, 0.0]},
        },
        {"type": "batch", "edits": [{"type": "rename", "entity": "Cube 4", "name": "Four"}]},
    ]
    edits.write_text(json.dumps(changes))
    target = forked(source, tmp_path / "g.mcap", 0.5, edits=edits, seconds=1.0)
    assert verify(target).cause == "equal"
    with Recording(target) as fork, Recording(source) as original:
        lineage = lineage_of(fork)
        assert (lineage["parent"], lineage["parent_hash"]) == ("beside.mcap", content_hash(source))
        assert (lineage["parent_session"], lineage["tick"], lineage["repeats"]) == ("stage", "30", "True")
        told = msgspec.json.decode(lineage["edits"], type=list[Change])
        assert isinstance(told[0], SetComponent) and isinstance(told[1], Batch)
        assert (int(fork.tick[0]), int(fork.tick[-1])) == (30, 90)
        assert fork.frame(0).state_hash == original.frame(original.position_at(0.5)).state_hash
        assert fork.frame(5).state_hash != original.frame(original.position_at(float(fork.time[5]))).state_hash
        assert fork.mirror_at(5).entities[told[1].edits[0].entity].name == "Four"
    again = forked(target, tmp_path / "h.mcap", 1.0, seconds=0.5)
    with Recording(again) as grandchild:
        ancestors = json.loads(lineage_of(grandchild)["ancestors"])
        assert [one["parent"] for one in ancestors] == ["beside.mcap"]


def test_a_fork_can_leave_out_what_was_done_afterwards(sessions: dict[str, Path], tmp_path: Path) -> None:
    target = forked(sessions["edits_of_two"], tmp_path / "g.mcap", 0.5, repeats=False)
    assert verify(target).cause == "equal"
    with Recording(target) as fork:
        assert fork.reader.message_counts()["commands"] == 0


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("{}", "must be a list of commands"),
        ("[", "is no JSON"),
        ('[{"type": "explode"}]', "edit 1 of .*Invalid value 'explode'"),
        ('[{"type": "rename", "entity": "Nobody", "name": "x"}]', "edit 1 of .*no entity called 'Nobody'"),
        (
            '[{"type": "rename", "entity": "Cube 1", "name": "Cube 2"}, {"type": "despawn", "entity": "Cube 2"}]',
            "edit 2 of .*2 entities",
        ),
        ('[{"type": "despawn", "entity": 4000000}]', "edit 1 of .*4000000"),
    ],
)
def test_wrong_edits_are_a_sentence(sessions: dict[str, Path], tmp_path: Path, content: str, sentence: str) -> None:
    edits = tmp_path / "edits.json"
    edits.write_text(content)
    with pytest.raises(SceneError, match=sentence):
        opened_at(sessions["edits_of_two"], 0.5, edits=edits)


def test_times(sessions: dict[str, Path]) -> None:
    with pytest.raises(RecordingError, match=r"can be gone on with from 0.000 s to .* s, not from 50 s"):
        opened_at(sessions["forks"], 50.0)


def test_the_schema_of_edits_knows_all_of_them() -> None:
    schema = json.dumps(edits_schema())
    for tag in ("set_component", "spawn", "batch", "load_scene", "grab"):
        assert f'"{tag}"' in schema
    assert msgspec.convert([{"type": "rename", "entity": 3, "name": "x"}], list[Change]) == [Rename(entity=3, name="x")]
    assert Grab in Change.__args__
