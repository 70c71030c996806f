"""Shared memory through which pictures go from a render node to who asked for them, on one machine.

    who asks    PictureRing   an anonymous file of its own process; its address travels in every ViewRequest
    who draws   RingWriter    the same file, reached through /proc; which slot was filled is said by the ViewFrame

Slot i starts at byte i * slot_size and holds RGBA rows without padding, the bottom row first, as GL reads them. Nothing
appears in /dev/shm and nothing is left behind, however either side ends.
"""

from __future__ import annotations

import contextlib
import mmap
import os
from pathlib import Path
from typing import Final

from elys.bus.messages.views import SharedRing
from elys.common.errors import BusError

SLOT_COUNT: Final = 3  # one shown, one filled, one between
MAX_WIDTH: Final = 4096  # [pixels] of a picture that fits into a slot
MAX_HEIGHT: Final = 2304
_SLOT_COUNTS: Final = range(2, 65)  # of rings that are written to
_MAX_SLOT_SIZE: Final = 1 << 32  # [bytes]
_BOOT_ID: Final = Path("/proc/sys/kernel/random/boot_id")


class PictureRing:
    """The slots of who asks, and how to reach them from outside. Memory is taken only for what was written."""

    def __init__(self) -> None:
        """Raises BusError where the system cannot share memory so; then pictures come as JPEG."""
        self.slot_size = MAX_WIDTH * MAX_HEIGHT * 4
        size = SLOT_COUNT * self.slot_size
        try:
            self._descriptor = os.memfd_create("elys-view", os.MFD_CLOEXEC)
            os.ftruncate(self._descriptor, size)
            self._memory = mmap.mmap(self._descriptor, size)
        except (OSError, AttributeError) as error:  # AttributeError: no such call outside Linux
            raise BusError(f"this system shares no memory for pictures: {error}") from error
        self._view = memoryview(self._memory)
        self.address = SharedRing(
            machine=boot_id(),
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


class RingWriter:
    """Slots of another process' memory file."""

    def __init__(self, address: SharedRing) -> None:
        """Raises BusError, saying why, where the memory cannot be reached; then pictures are sent as JPEG."""
        if not address.machine or address.machine != boot_id():
            raise BusError("the memory is on another machine")
        if not (address.slot_count in _SLOT_COUNTS and 0 < address.slot_size <= _MAX_SLOT_SIZE):
            raise BusError(f"no ring has {address.slot_count} slots of {address.slot_size} bytes")
        self.address = address
        self._slot = -1
        self._memory = _map(address)
        self._view = memoryview(self._memory)

    def holds(self, width: int, height: int) -> bool:
        """Whether a picture of that size fits into a slot."""
        return width * height * 4 <= self.address.slot_size

    def next_slot(self) -> int:
        """Where the next picture goes: never where the last one is, which may be being read."""
        self._slot = (self._slot + 1) % self.address.slot_count
        return self._slot

    def pixels(self, slot: int, width: int, height: int) -> memoryview:
        """The bytes of a picture of that size in a slot."""
        start = slot * self.address.slot_size
        return self._view[start : start + width * height * 4]

    def close(self) -> None:
        """Lets go of the memory."""
        self._view.release()
        # A picture being written elsewhere would be a bug; the mapping then ends with the process.
        with contextlib.suppress(BufferError):
            self._memory.close()


def boot_id() -> str:
    """Names this run of this machine; "" where the system does not tell."""
    try:
        return _BOOT_ID.read_text().strip()
    except OSError:
        return ""


def _map(address: SharedRing) -> mmap.mmap:
    path = f"/proc/{address.process}/fd/{address.descriptor}"
    size = address.slot_count * address.slot_size
    try:
        # A message must not make this process write into just any file.
        if not str(Path(path).readlink()).startswith("/memfd:"):
            raise BusError(f"{path} is not shared memory")
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        try:
            # A shorter file would kill this process at the first write beyond its end.
            if os.fstat(descriptor).st_size < size:
                raise BusError(f"{path} is smaller than the {size} bytes it should have")
            return mmap.mmap(descriptor, size)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise BusError(f"{path} cannot be opened: {error.strerror}") from error
