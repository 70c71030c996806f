"""The golden recording of the first release: it opens, plays and exports in every later version, to the same values.

It was made once, by the first release, of a stack that was struck, edited, animated, wound back and forked; what stands beside it
was written down from what the session published, not from the file. Never make it anew: what it proves is its age.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.export import export_npz
from elys.bus.following import follow_scene
from elys.bus.messages.commands import CommandRequest, Seek
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.player import Player
from elys.bus.recording import Recording
from elys.bus.recording_info import recording_info
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.clip import decode_clips

GOLDEN = Path(__file__).with_name("recordings") / "first_release.mcap"
FACTS = json.loads(GOLDEN.with_suffix(".json").read_text())


@pytest.fixture
def recording() -> Recording:
    with Recording(GOLDEN) as opened:
        yield opened


def test_it_opens_to_the_same_bits(recording: Recording) -> None:
    assert not recording.reader.mended
    assert recording.tick.tolist() == FACTS["ticks"]
    frames = [recording.frame_body(position) for position in range(len(recording))]
    assert hashlib.sha256(b"".join(frames)).hexdigest() == FACTS["frames_sha256"]
    assert [f"{recording.frame(p).state_hash:016x}" for p in range(len(recording))] == FACTS["hashes"]


def test_its_scene_its_asset_and_what_was_said_are_there(recording: Recording) -> None:
    mirror = recording.mirror_at(len(recording) - 1)
    assert {str(entity.id): entity.name for entity in mirror.entities.values()} == FACTS["names"]
    (reference,) = recording.asset_references()
    (clip,) = decode_clips(recording.asset(reference))
    assert clip.name == "Slide"
    counts = recording.reader.message_counts()
    assert counts["commands"] == 10 and counts["log"] == 1 and counts["delta"] > 0
    said = b"".join(message.body for message in recording.reader.messages(("commands", "events")))
    for text in (b"entity 999 does not exist", b'"forked"', b"The struck one"):
        assert text in said


def test_a_cut_copy_of_it_is_mended(tmp_path: Path) -> None:
    whole = GOLDEN.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: whole.rindex(b"elys/state_index.v1")])
    cut.write_bytes(cut.read_bytes()[: cut.read_bytes().index(b"elys/state_index.v1")])
    with Recording(cut) as mended, Recording(GOLDEN) as golden:
        assert mended.reader.mended
        assert mended.tick.tolist() == FACTS["ticks"]
        assert all(mended.frame_body(p) == golden.frame_body(p) for p in range(len(golden)))


def test_it_plays() -> None:
    async def play() -> StateFrame:
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="golden", kind="replay", epoch=5)
        with Recording(GOLDEN) as recording:
            playing = asyncio.create_task(Player(recording, host, playing=False).run())
            session = await Session.join(broker.connect(), kind="tool")
            seen: asyncio.Queue[StateFrame] = asyncio.Queue()
            session.subscribe(topics.STATE, lambda frame, _: seen.put_nowait(frame))
            mirror = SceneMirror()
            await follow_scene(session, mirror)
            there = float(recording.time[-1])
            request = CommandRequest(origin=session.node.id, command=Seek(time=there))
            assert (await session.request(topics.COMMAND, request)).accepted
            while (frame := await seen.get()).simulation_time < there:
                pass
            playing.cancel()
            await session.close()
            await host.close()
        return frame

    frame = asyncio.run(play())
    assert frame.tick == FACTS["ticks"][-1]
    assert f"{frame.state_hash:016x}" == FACTS["hashes"][-1]


def test_it_exports_and_tells_of_itself(tmp_path: Path) -> None:
    export_npz(GOLDEN, tmp_path / "golden.npz")
    with np.load(tmp_path / "golden.npz") as arrays, Recording(GOLDEN) as recording:
        assert arrays["tick"].tolist() == sorted(set(FACTS["ticks"]))
        assert "The struck one" in arrays["name"]
        last = recording.frame(len(recording) - 1)
        row = np.searchsorted(arrays["entity"], last.entity)
        assert np.array_equal(arrays["position"][-1, row], last.position)
        assert np.isfinite(arrays["energy"][1:]).all()
    info = recording_info(shutil.copy(GOLDEN, tmp_path / "copy.mcap"))
    assert info.complete and info.protocol == 3 and info.entity_count > 0
