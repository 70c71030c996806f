"""What a damaged file lacks: which ticks stood in the parts that cannot be read, and which frames cannot be had without those."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.state_packing.frames import Kind, head_of
from elys.bus.transports.mcap_index import STATE_CHANNEL
from elys.bus.transports.mcap_reading import DamagedPart, McapReader, Place
from elys.common.errors import RecordingError


class LostPart(NamedTuple):
    """A part of a recording that cannot be read, and the ticks that are not there for it."""

    part: DamagedPart
    ticks: tuple[int, int] | None  # the first and the last; None: it held no state, or nobody knows of which ticks
    times: tuple[float, float] | None  # [s] of them, as far as they are known

    @property
    def sentence(self) -> str:
        """The same for a person."""
        if self.ticks is None:
            return f"{self.part.sentence} cannot be read, of no known tick"
        when = "" if self.times is None else f" ({self.times[0]:.3f} s to {self.times[1]:.3f} s)"
        return f"ticks {self.ticks[0]} to {self.ticks[1]}{when} cannot be read: {self.part.sentence}"


def readable_frames(
    reader: McapReader, frames: NDArray[Any], parts: Sequence[DamagedPart]
) -> tuple[NDArray[Any], tuple[LostPart, ...]]:
    """Of an index of frames those that can be had, and what the damaged parts cost."""
    stranded = _stranded(reader, parts) if reader.packs_frames else set()
    is_lost = np.isin(frames["chunk"], list(reader.damaged))
    if stranded:
        is_lost |= [
            place in stranded for place in zip(frames["chunk"].tolist(), frames["message"].tolist(), strict=True)
        ]
    lost = []
    for number, part in enumerate(parts):
        until = parts[number + 1].chunk if number + 1 < len(parts) else reader.chunk_count
        within = is_lost & (frames["chunk"] >= part.chunk) & (frames["chunk"] < max(until, part.chunk + 1))
        gone = frames[within]
        if not reader.mended:
            ticks = (int(gone["tick"][0]), int(gone["tick"][-1])) if len(gone) else None
            times = (float(gone["time"][0]), float(gone["time"][-1])) if len(gone) else None
            lost.append(LostPart(part, ticks, times))
        else:
            lost.append(_between(frames[~is_lost], part))
    return frames[~is_lost], tuple(lost)


def _between(frames: NDArray[Any], part: DamagedPart) -> LostPart:
    """A part of a file that has no index: what is not there between the frames before and after it."""
    before, after = frames[frames["chunk"] < part.chunk], frames[frames["chunk"] >= part.chunk]
    if not (part.is_chunk and len(before) and len(after)):
        return LostPart(part, None, None)
    first, last = int(before["tick"][-1]) + 1, int(after["tick"][0]) - 1
    if first > last or before["epoch"][-1] != after["epoch"][0]:
        return LostPart(part, None, None)
    return LostPart(part, (first, last), (float(before["time"][-1]), float(after["time"][0])))


def _stranded(reader: McapReader, parts: Sequence[DamagedPart]) -> set[tuple[int, int]]:
    """Where frames stand that were told against one that is lost: they follow it, up to the next that needs no other."""
    stranded: set[tuple[int, int]] = set()
    known: set[int] = set()  # numbers of frames that can be had
    damaged = [part.chunk for part in parts if part.is_chunk]
    for number, chunk in enumerate(damaged):
        until = Place(damaged[number + 1], 0) if number + 1 < len(damaged) else None
        start = chunk if reader.mended else chunk + 1
        keys = reader.key_places()
        for message in reader.stored_messages((STATE_CHANNEL,), start=Place(start, 0), end=until):
            try:
                head = head_of(message.body)
            except RecordingError:
                stranded.add(message.place)
                continue
            if head.kind is Kind.KEY:
                break  # what comes after it needs nothing from before
            if head.kind is Kind.REFRESH:
                key = keys.get(head.base)
                is_known = key is not None and key.chunk not in reader.damaged
            else:
                is_known = head.kind is Kind.VERBATIM or head.base in known
            if is_known:
                known.add(head.number)
            else:
                stranded.add(message.place)
    return stranded
