"""The frames of one recording in their order: decides what each is told against, so that any can be had from few others."""

from __future__ import annotations

from typing import Final

import numpy as np

from elys.bus.messages.state_frame import BODY_SIZE, HEADER, is_whole
from elys.bus.state_packing.bodies import Bodies, bodies_of, changed_rows
from elys.bus.state_packing.compact import Codes, changed_codes, codes_of
from elys.bus.state_packing.frames import MOST_BODIES, MOST_TAIL, Kind, Told, is_same, pack_told, pack_verbatim
from elys.bus.state_packing.planes import PlaneWriter

MOST_DIFFERENCES: Final = 60  # in a row, so that no frame is far from one that can be had by itself
_MOSTLY: Final = 0.5  # of the rows changed since the last key: another key costs hardly more than a refresh


class FramePacker:
    """Packs frames as they come; `compact` gives up bits for size, see `elys.bus.state_packing.compact`."""

    def __init__(self, *, compact: bool = False) -> None:
        self._compact = compact
        self._out = PlaneWriter()
        self._number = 0
        self._key: Told | None = None
        self._last: Told | None = None
        self._differences = 0

    def pack(self, body: bytes | memoryview, *, is_entry: bool) -> bytes | None:
        """A frame as it is stored; None for what is not even a header.

        With `is_entry` it is told against nothing or the last key, not against the frame before: a chunk begins with such a
        one, so that its frames need no other chunk but the key's.
        """
        if len(body) < HEADER.size:
            return None
        number, self._number = self._number, self._number + 1
        count = HEADER.unpack_from(body)[6]
        tail = len(body) - HEADER.size - count * BODY_SIZE
        if not is_whole(body) or count > MOST_BODIES or tail > 4 * MOST_TAIL:
            return pack_verbatim(body, number=number)
        kind, rows, base = self._decide(body, count, is_entry)
        stored, told = pack_told(self._out, body, rows, number=number, kind=kind, base=base)
        self._last = told
        self._differences = self._differences + 1 if kind is Kind.DIFFERENCE else 0
        if kind is Kind.KEY:
            self._key = told
        return stored

    def _decide(
        self, body: bytes | memoryview, count: int, is_entry: bool
    ) -> tuple[Kind, Bodies | Codes | None, Told | None]:
        """What a frame is told against, and its rows; None where they are those."""
        may_differ = not is_entry and self._differences < MOST_DIFFERENCES
        kind, base = (Kind.DIFFERENCE, self._last) if may_differ else (Kind.REFRESH, self._key)
        if base is not None and base.rows is not None and is_same(body, base.body):
            return kind, None, base
        with np.errstate(all="ignore"):
            bodies = bodies_of(body, count)
            rows = (codes_of(bodies) if self._compact else None) or bodies
            if may_differ and _is_alike(rows, self._last):
                return Kind.DIFFERENCE, rows, self._last
            if self._key is not None and _is_alike(rows, self._key) and _is_near(rows, self._key):
                return Kind.REFRESH, rows, self._key
        return Kind.KEY, rows, None


def _is_alike(rows: Bodies | Codes, base: Told | None) -> bool:
    """Whether rows can be told against a frame: it has some, of the same sort."""
    return base is not None and type(base.rows) is type(rows)


def _is_near(rows: Bodies | Codes, key: Told) -> bool:
    """Whether most rows are still as in the key."""
    base = key.rows
    if base is None or not np.array_equal(rows.entity, base.entity):
        return False
    changed = changed_rows(rows, base) if isinstance(rows, Bodies) else changed_codes(rows, base)  # type: ignore[arg-type]
    return bool(np.count_nonzero(changed) <= _MOSTLY * rows.body_count)
