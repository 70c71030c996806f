"""Shared memory into which a render node of the same machine puts its pictures: an anonymous file of this process.

Nothing appears in /dev/shm and nothing is left behind, however either side ends. Slot i starts at byte i * slot_size and holds
RGBA rows without padding, the bottom row first, as GL reads them; who says which slot is filled is the message on the bus.
"""

from __future__ import annotations

import mmap
import os
from pathlib import Path
from typing import Final

from elys.bus.messages.views import SharedRing

SLOT_COUNT: Final = 3  # one shown, one filled, one between
MAX_WIDTH: Final = 4096
MAX_HEIGHT: Final = 2304
_BOOT_ID: Final = Path("/proc/sys/kernel/random/boot_id")


class PictureRing:
    """The slots, and how to reach them from outside. Memory is taken only for what was written."""

    def __init__(self) -> None:
        """Makes it; OSError where the system has no anonymous files (then pictures come as JPEG)."""
        self.slot_size = MAX_WIDTH * MAX_HEIGHT * 4
        self._descriptor = os.memfd_create("elys-view", os.MFD_CLOEXEC)
        size = SLOT_COUNT * self.slot_size
        os.ftruncate(self._descriptor, size)
        self._memory = mmap.mmap(self._descriptor, size)
        self._view = memoryview(self._memory)
        self.address = SharedRing(
            machine=_BOOT_ID.read_text().strip(),
            process=os.getpid(),
            descriptor=self._descriptor,
            slot_count=SLOT_COUNT,
            slot_size=self.slot_size,
        )

    def pixels(self, slot: int, width: int, height: int) -> memoryview:
        """The bytes of the picture in a slot; ValueError when it cannot be there."""
        size = width * height * 4
        if not (0 <= slot < SLOT_COUNT and 0 < size <= self.slot_size):
            raise ValueError(f"no picture of {width} x {height} in slot {slot}")
        start = slot * self.slot_size
        return self._view[start : start + size]

    def close(self) -> None:
        """Gives the memory back; views handed out must be gone."""
        self._view.release()
        self._memory.close()
        os.close(self._descriptor)


def open_ring() -> PictureRing | None:
    """A ring, or None on systems that cannot share memory so."""
    if not hasattr(os, "memfd_create"):
        return None
    try:
        return PictureRing()
    except OSError:
        return None
