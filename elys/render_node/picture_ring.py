"""The asking process' shared memory, into which pictures of the same machine are put instead of sent.

Slot i starts at byte i * slot_size and holds RGBA rows without padding, the bottom row first, as GL reads them.
"""

from __future__ import annotations

import contextlib
import mmap
import os
from pathlib import Path
from typing import Final

from elys.bus.messages.views import SharedRing
from elys.common.errors import BusError

MIN_SLOTS: Final = 2
MAX_SLOTS: Final = 64
_BOOT_ID: Final = Path("/proc/sys/kernel/random/boot_id")


class PictureRing:
    """Slots of another process' memory file."""

    def __init__(self, address: SharedRing) -> None:
        """Raises BusError, saying why, where the memory cannot be reached; then pictures are sent as JPEG."""
        if address.machine != boot_id():
            raise BusError("the memory is on another machine")
        if not (MIN_SLOTS <= address.slot_count <= MAX_SLOTS and 0 < address.slot_size <= 1 << 32):
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
