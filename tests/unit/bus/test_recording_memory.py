"""What a recorder keeps in memory of what it has written: it may go on for days."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

from elys.bus.messages.state_frame import HEADER
from elys.bus.transports import mcap
from elys.bus.transports.mcap import McapWriter
from elys.bus.transports.mcap_index import STATE_CHANNEL, STATE_INDEX

TICKS = 20_000
CHUNK = 400  # [bytes] kept of a chunk at most
INSTANT = 8  # [bytes] of a frame beside its entry in the index


def test_of_a_frame_no_more_is_kept_than_the_file_has_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Seven chunks a second, as a recorder makes them; lists that grow have an eighth of room."""
    now = 0.0
    monkeypatch.setattr(mcap.time, "monotonic", lambda: now)
    writer = McapWriter(tmp_path / "long.mcap", session="s", scene="Nothing")
    kept = []
    for tick in range(TICKS):
        now = tick / 60.0
        frame = HEADER.pack(1, tick, now, tick, 0, tick, 0, 0)  # of no bodies
        writer.write(STATE_CHANNEL, frame, log_time=tick)
        if tick == TICKS // 10:
            tracemalloc.start()
            kept.append(tracemalloc.get_traced_memory()[0])
    kept.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    chunks = writer._writer.chunk_count
    assert chunks > TICKS // 12
    most = 1.2 * (TICKS * (STATE_INDEX.itemsize + INSTANT) + chunks * CHUNK)
    assert kept[1] - kept[0] < most
    writer.close()
