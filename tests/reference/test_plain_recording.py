"""A reader that was written from docs/recording-format.md alone reads recordings to the same bits."""

from __future__ import annotations

from pathlib import Path

import pytest

from elys.bus import codec
from elys.bus.messages.state_frame import HEADER, TOLD_AGAIN
from elys.bus.mirror import SceneMirror
from elys.bus.recording import Recording
from elys.bus.topics import Encoding
from elys.bus.transports.mcap import McapWriter
from elys.common.assets.store import AssetStore
from elys.common.scene import open_scene
from elys.samples.registry import write_sample
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.publish_state import state_frame
from tests.reference.plain_recording import frames
from tests.unit.bus.test_state_packing import moved

GOLDEN = Path(__file__).parents[1] / "golden" / "recordings" / "first_release.mcap"


def simulated(folder: Path) -> list[bytes]:
    """The yard for three seconds, of which bodies fall, strike and lie; one of them goes."""
    write_sample("yard", folder / "it.scene.json")
    assets = AssetStore()
    simulation = Simulation.load(open_scene(folder / "it.scene.json", assets), assets)
    bodies = []
    for _ in range(180):
        simulation.step()
        simulation.take_changes()
        frame = state_frame(simulation, epoch=1, delta_sequence=0, playing=True)
        bodies.append(codec.encode_body(frame, Encoding.STATE))
    return bodies


def written(path: Path, bodies: list[bytes], *, compact: bool) -> None:
    writer = McapWriter(path, session="s", compact=compact)
    mirror = SceneMirror()
    mirror.epoch, mirror.sequence = 1, 0
    writer.write("snapshot", codec.encode_body(mirror.to_snapshot(), Encoding.JSON), log_time=1)
    for number, body in enumerate(bodies):
        writer.write("state", body, log_time=number + 2)
        if number % 25 == 24:
            writer._flush()  # as time would
    writer.close()


@pytest.mark.parametrize("compact", [False, True])
@pytest.mark.parametrize("source", ["yard", "changing"])
def test_another_reader_sees_the_same_bits(tmp_path: Path, source: str, compact: bool) -> None:
    bodies = simulated(tmp_path) if source == "yard" else moved(4, count=60, ticks=90, tail=True)
    path = tmp_path / "it.mcap"
    written(path, bodies, compact=compact)
    seen = list(frames(path))
    if not compact:
        assert seen == bodies
    with Recording(path) as recording:
        assert [recording.frame_body(position) for position in range(len(recording))] == seen
        backwards = [recording.frame_body(position) for position in reversed(range(len(recording)))]
        assert backwards == seen[::-1]


def test_it_reads_the_first_release_as_well() -> None:
    seen = [body for body in frames(GOLDEN) if not HEADER.unpack_from(body)[7] & TOLD_AGAIN]
    with Recording(GOLDEN) as recording:
        kept = {recording.frame_body(position) for position in range(len(recording))}
    assert kept <= set(seen)
