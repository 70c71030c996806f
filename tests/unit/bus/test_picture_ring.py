"""Pictures through shared memory: what one side writes the other reads, and addresses that cannot be are refused."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import msgspec
import pytest

from elys.bus.messages.views import SharedRing
from elys.bus.picture_ring import SLOT_COUNT, PictureRing, RingWriter, boot_id
from elys.common.errors import BusError


def test_what_is_written_on_one_side_is_read_on_the_other() -> None:
    ring = PictureRing()
    writer = RingWriter(ring.address)
    assert writer.holds(4096, 2304) and not writer.holds(4097, 2304)
    slots = []
    for value in range(2 * SLOT_COUNT):
        slots.append(writer.next_slot())
        with writer.pixels(slots[-1], 3, 2) as pixels:
            pixels[:] = bytes([value] * 24)
        with ring.pixels(slots[-1], 3, 2) as pixels:
            assert pixels.tobytes() == bytes([value] * 24)
    assert sorted(set(slots)) == list(range(SLOT_COUNT))
    for slot, width, height in ((-1, 3, 2), (SLOT_COUNT, 3, 2), (0, 0, 2), (0, 5000, 5000)):
        with pytest.raises(ValueError, match="no picture"):
            ring.pixels(slot, width, height)
    writer.close()
    ring.close()


def test_a_machine_without_a_name_is_no_machine_of_ours() -> None:
    ring = PictureRing()
    with pytest.raises(BusError, match="another machine"):
        RingWriter(msgspec.structs.replace(ring.address, machine=""))
    ring.close()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"machine": "elsewhere"}, "another machine"),
        ({"process": 2**22 + 5}, "cannot be opened"),
        ({"slot_count": 1}, "no ring has"),
        ({"slot_size": 1 << 40}, "no ring has"),
        ({"slot_count": 9}, "smaller"),
        ({"descriptor": 1}, "not shared memory"),
    ],
)
def test_a_ring_that_cannot_be_is_refused_with_a_reason(changes: dict[str, Any], said: str) -> None:
    descriptor = os.memfd_create("elys-test")
    os.ftruncate(descriptor, 3 * 64)
    values: dict[str, Any] = {
        "machine": boot_id(),
        "process": os.getpid(),
        "descriptor": descriptor,
        "slot_count": 3,
        "slot_size": 64,
    }
    try:
        RingWriter(SharedRing(**values)).close()
        with pytest.raises(BusError, match=said):
            RingWriter(SharedRing(**(values | changes)))
    finally:
        os.close(descriptor)


READER = """
import mmap, os, sys
descriptor = os.memfd_create("elys-test")
os.ftruncate(descriptor, 3 * 64)
print(os.getpid(), descriptor, flush=True)
for line in sys.stdin:
    slot = int(line)
    print(mmap.mmap(descriptor, 3 * 64)[slot * 64 : slot * 64 + 4].hex(), flush=True)
"""


def test_a_ring_reaches_another_process_and_outlives_it() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", READER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdin is not None and other.stdout is not None
        process, descriptor = map(int, other.stdout.readline().split())
        address = SharedRing(machine=boot_id(), process=process, descriptor=descriptor, slot_count=3, slot_size=64)
        ring = RingWriter(address)
        for value in (1, 2, 3, 4):
            slot = ring.next_slot()
            with ring.pixels(slot, 1, 1) as pixels:
                pixels[:] = bytes([value] * 4)
            other.stdin.write(f"{slot}\n")
            other.stdin.flush()
            assert other.stdout.readline().strip() == f"{value:02x}" * 4
        other.kill()
        other.wait()
        with ring.pixels(ring.next_slot(), 1, 1) as pixels:
            pixels[:] = b"gone"
        ring.close()
