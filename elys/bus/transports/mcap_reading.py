"""Reading a recording: through its summary, or, where a kill left none, through what can be found from its beginning.

A chunk that is damaged is as if it were not there: who reads messages reads around it, and `damaged` tells of it. Which chunks
are is seen when they are read, or of all of them with `check`.

Nothing in the file is believed before it has been compared with the file: offsets, lengths and sizes of chunks are checked,
so that a damaged or a hostile file costs a sentence, not the memory or the process. State frames come out as they were on the
bus, however they are stored (`mcap_frames`).
"""

from __future__ import annotations

import io
import logging
import os
import struct
import zlib
from collections import OrderedDict
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader

from elys.bus.state_packing.frames import STATE_ENCODING, Kind, head_of
from elys.bus.topics import STATE
from elys.bus.transports.mcap_frames import STATE_KEYS, STATE_KEYS_NAME, FrameReader, StoredFrames
from elys.bus.transports.mcap_records import BEGINNING as BEGINNING
from elys.bus.transports.mcap_records import (
    RECORD,
    ChunkFacts,
    Contents,
    channels_in,
    messages_in,
    unpacked_chunk,
)
from elys.bus.transports.mcap_records import DamagedPart as DamagedPart
from elys.bus.transports.mcap_records import Place as Place
from elys.bus.transports.mcap_records import RecordedMessage as RecordedMessage
from elys.common.errors import RecordingError

_MAGIC: Final = b"\x89MCAP0\r\n"
_FOOTER: Final = struct.Struct("<BQQQI")
_CACHED_CHUNKS: Final = 4
_CACHED_BYTES: Final = 64 << 20  # of what those hold, the newest left out
NEAR: Final = 3  # recordings that are named beside one that is missing
# What the library raises on bytes that are no MCAP.
UNREADABLE: Final = (
    McapError,
    struct.error,
    zstandard.ZstdError,
    ValueError,
    LookupError,
    OverflowError,
    MemoryError,
    RuntimeError,
)
_log = logging.getLogger(__name__)


class McapReader:
    """An open recording. `mended` says that it was never finished and has been read as far as it goes.

    Attributes:
        damaged: by their numbers, chunks that were found to be damaged, and how.
        damage: what was left out when a file without a summary was read.

    Raises:
        RecordingError: there is no such file, it is no MCAP file, or nothing in it can be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = path.open("rb")
        except OSError as error:
            text = f"the recording {path} cannot be opened: {error.strerror}{_remedy(path)}"
            raise RecordingError(text) from error
        try:
            self.size = os.fstat(self._file.fileno()).st_size
            self._check_magic()
            summary = self._read_summary()
            self.mended = summary is None
            contents = self._find_contents() if summary is None else summary
        except BaseException:
            self._file.close()
            raise
        self._contents = contents
        self.metadata = contents.metadata
        self.attachments = contents.attachments
        self.start_time, self.end_time = contents.start_time, contents.end_time  # [ns]
        self.definitions = contents.definitions
        self.damage = contents.damage
        self.whole_size = contents.whole_size if self.mended else self.size
        self.chunk_count = len(contents.chunks)
        self.damaged: dict[int, str] = {}
        self._unpacked: OrderedDict[int, list[RecordedMessage]] = OrderedDict()
        self.packs_frames = contents.encodings.get(STATE.name) == STATE_ENCODING
        self._frames = FrameReader(StoredFrames(self.chunk, self.key_places))
        self._key_places: dict[int, Place] | None = None

    def close(self) -> None:
        """Closes the file."""
        self._file.close()

    def __enter__(self) -> McapReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def message_counts(self) -> dict[str, int]:
        """How many messages each channel holds, those with none included."""
        return {name: self._contents.counts.get(number, 0) for number, name in self._contents.channels.items()}

    def messages(
        self, channels: Collection[str] | None = None, *, start: Place = BEGINNING, end: Place | None = None
    ) -> Iterator[RecordedMessage]:
        """Messages in the order of the file, from `start` on and before `end`; of some channels or of all.

        Raises:
            RecordingError: a frame is damaged, or told against one that is.
        """
        for message in self.stored_messages(channels, start=start, end=end):
            yield self._as_said(message)

    def stored_messages(
        self, channels: Collection[str] | None = None, *, start: Place = BEGINNING, end: Place | None = None
    ) -> Iterator[RecordedMessage]:
        """The same as they stand in the file: state frames packed, if it packs them."""
        wanted = None if channels is None else {n for n, name in self._contents.channels.items() if name in channels}
        last = self.chunk_count if end is None else min(end.chunk + 1, self.chunk_count)
        for number in range(start.chunk, last):
            within = self._contents.chunks[number].channels
            if wanted is not None and within is not None and not wanted & within:
                continue
            for message in self._readable(number):
                if message.place < start or (channels is not None and message.channel not in channels):
                    continue
                if end is not None and message.place >= end:
                    return
                yield message

    def check(self) -> None:
        """Reads all chunks, so that `damaged` names each that cannot be read."""
        if not self.mended:  # else all have been read
            for number in range(self.chunk_count):
                self._readable(number)

    def damaged_parts(self) -> list[DamagedPart]:
        """All that is known to be damaged, in the order of the file."""
        chunks = [
            DamagedPart(number, True, *self.chunk_place(number), self.damaged[number])
            for number in sorted(self.damaged)
        ]
        return [*self.damage, *chunks]

    def _readable(self, number: int) -> list[RecordedMessage]:
        """The messages of a chunk, none of one that is damaged."""
        try:
            return self.chunk(number)
        except RecordingError:
            if number not in self.damaged:
                raise
            return []

    def message_at(self, place: Place) -> RecordedMessage:
        """The message at a place; RecordingError if there is none."""
        if 0 <= place.chunk < self.chunk_count and 0 <= place.message < len(messages := self.chunk(place.chunk)):
            return self._as_said(messages[place.message])
        raise RecordingError(f"{self.path} has no message {place.message} in a chunk {place.chunk}")

    def attachment(self, name: str) -> bytes:
        """The content of an attachment; RecordingError if there is none or it is damaged."""
        data = self.attachment_record(name).data
        assert isinstance(data, bytes)
        return data

    def attachment_record(self, name: str) -> Any:
        """The same with what stands beside it, as the library has it."""
        if name not in self.attachments:
            raise RecordingError(f"{self.path} has no attachment {name!r}")
        offset, length = self.attachments[name]
        raw = self._read(offset, length)[RECORD.size :]
        try:
            checksum = int.from_bytes(raw[-4:], "little")
            if checksum and zlib.crc32(raw[:-4]) != checksum:  # the library does not look at it
                raise ValueError("its checksum is wrong")
            return Attachment.read(ReadDataStream(io.BytesIO(raw)))
        except UNREADABLE as error:
            raise RecordingError(f"the attachment {name!r} of {self.path} is damaged: {error}") from error

    def chunk(self, number: int) -> list[RecordedMessage]:
        """All messages of a chunk as they stand in the file; the last few chunks are remembered.

        Raises:
            RecordingError: it is damaged, which `damaged` tells from then on.
        """
        if number in self._unpacked:
            self._unpacked.move_to_end(number)
            return self._unpacked[number]
        if number in self.damaged:
            raise RecordingError(f"chunk {number} of {self.path} is damaged: {self.damaged[number]}")
        chunk = self._contents.chunks[number]
        raw = self._read(chunk.offset, chunk.length)
        try:
            messages = list(messages_in(unpacked_chunk(raw), number, self._contents.channels))
        except UNREADABLE as error:
            self.damaged[number] = str(error)
            raise RecordingError(f"chunk {number} of {self.path} is damaged: {error}") from error
        held = sum(len(message.body) for known in self._unpacked.values() for message in known)
        while len(self._unpacked) >= _CACHED_CHUNKS or held > _CACHED_BYTES:
            _, gone = self._unpacked.popitem(last=False)
            held -= sum(len(message.body) for message in gone)
        self._unpacked[number] = messages
        return messages

    def chunk_place(self, number: int) -> tuple[int, int]:
        """Where a chunk's record stands in the file, and how long it is [bytes]."""
        return self._contents.chunks[number].offset, self._contents.chunks[number].length

    def chunk_records(self, number: int) -> bytes:
        """The records of a chunk as they are: schemas, channels and messages. RecordingError if it is damaged."""
        try:
            return unpacked_chunk(self._read(*self.chunk_place(number)))
        except UNREADABLE as error:
            raise RecordingError(f"chunk {number} of {self.path} is damaged: {error}") from error

    def _as_said(self, message: RecordedMessage) -> RecordedMessage:
        if not self.packs_frames or message.channel != STATE.name:
            return message
        try:
            return message._replace(body=self._frames.body(message))
        except RecordingError as error:
            raise RecordingError(f"{self.path} is damaged: {error}") from error

    def key_places(self) -> dict[int, Place]:
        """Where the frames stand that are told against nothing, by number."""
        if self._key_places is None:
            self._key_places = self._known_keys() or self._find_keys()
        return self._key_places

    def _known_keys(self) -> dict[int, Place]:
        # What is left of the chunks of a mended file need not be numbered as they were.
        if self.mended or STATE_KEYS_NAME not in self.attachments:
            return {}
        try:
            data = self.attachment(STATE_KEYS_NAME)
        except RecordingError as error:
            _log.debug("%s", error)
            return {}
        if len(data) % STATE_KEYS.itemsize:
            return {}
        keys = np.frombuffer(data, STATE_KEYS)
        keys = keys[keys["chunk"] < self.chunk_count]
        return {number: Place(chunk, message) for number, chunk, message in keys.tolist()}

    def _find_keys(self) -> dict[int, Place]:
        stored = self.stored_messages((STATE.name,))
        heads = ((head_of(message.body), message.place) for message in stored)
        return {head.number: place for head, place in heads if head.kind is Kind.KEY}

    # --- opening ---------------------------------------------------------------------------------------------------

    def _check_magic(self) -> None:
        if self.size == 0:
            raise RecordingError(f"the recording {self.path} is empty")
        if os.pread(self._file.fileno(), len(_MAGIC), 0) != _MAGIC:
            raise RecordingError(f"{self.path} is no recording: it does not start as an MCAP file does")

    def _read(self, offset: int, length: int) -> bytes:
        if offset < 0 or length < 0 or offset + length > self.size:
            raise RecordingError(f"{self.path} is damaged: it names bytes {offset} to {offset + length} of {self.size}")
        data = os.pread(self._file.fileno(), length, offset)
        while len(data) < length:  # Linux reads at most 2 GiB at once
            more = os.pread(self._file.fileno(), length - len(data), offset + len(data))
            if not more:
                raise RecordingError(f"{self.path} became shorter while it was read")
            data += more
        return data

    def _read_summary(self) -> Contents | None:
        """The summary at the end of the file; None if there is none that can be used."""
        tail = _FOOTER.size + len(_MAGIC)
        if self.size < len(_MAGIC) + tail or os.pread(self._file.fileno(), len(_MAGIC), self.size - 8) != _MAGIC:
            return None
        opcode, _, start, _, checksum = _FOOTER.unpack(self._read(self.size - tail, _FOOTER.size))
        if opcode != Opcode.FOOTER or not 0 < start <= self.size - tail:
            return None
        data = self._read(start, self.size - len(_MAGIC) - start)
        if checksum and zlib.crc32(data[:-4]) != checksum:
            return None
        try:
            return self._collect(data)
        except (*UNREADABLE, RecordingError) as error:
            _log.debug("the summary of %s cannot be used: %s", self.path, error)
            return None

    def _collect(self, summary: bytes) -> Contents:
        contents = Contents()
        for record in StreamReader(
            io.BytesIO(summary + _MAGIC), skip_magic=True, record_size_limit=len(summary)
        ).records:
            if isinstance(record, (Schema, Channel)):
                contents.definitions.append(record)
            if isinstance(record, Channel):
                contents.channels[record.id] = record.topic
                contents.encodings[record.topic] = record.message_encoding
            elif isinstance(record, ChunkIndex):
                known = frozenset(record.message_index_offsets) or None
                contents.chunks.append(ChunkFacts(record.chunk_start_offset, record.chunk_length, known))
            elif isinstance(record, AttachmentIndex):
                contents.attachments[record.name] = (record.offset, record.length)
            elif isinstance(record, MetadataIndex):
                raw = self._read(record.offset, record.length)[RECORD.size :]
                contents.metadata[record.name] = Metadata.read(ReadDataStream(io.BytesIO(raw))).metadata
            elif isinstance(record, Statistics):
                contents.counts.update(record.channel_message_counts)
                contents.start_time, contents.end_time = record.message_start_time, record.message_end_time
        contents.chunks.sort(key=lambda chunk: chunk.offset)
        for chunk in contents.chunks:
            if chunk.offset < len(_MAGIC) or chunk.offset + chunk.length > self.size:
                raise RecordingError(f"a chunk at {chunk.offset} lies outside the file")
        return contents

    def _find_contents(self) -> Contents:
        """What can be read from the beginning on, up to where the file was cut or is damaged."""
        contents = Contents()
        for opcode, offset, length in self._records():
            contents.whole_size = offset + length
            if opcode == Opcode.DATA_END:
                break
            try:
                self._find(contents, opcode, offset, length)
            except UNREADABLE as error:
                part = DamagedPart(len(contents.chunks), opcode == Opcode.CHUNK, offset, length, str(error))
                contents.damage.append(part)
        if not contents.chunks:
            raise RecordingError(
                f"{self.path} holds nothing that can be read: it ends before the first second was written"
            )
        if not contents.damage:  # of what is damaged the recording tells, with its ticks
            _log.warning("the recording %s was never finished: it is read as far as it is whole", self.path)
        return contents

    def _records(self) -> Iterator[tuple[int, int, int]]:
        """Opcode, offset and whole length of each record that lies within the file."""
        offset = len(_MAGIC)
        while offset + RECORD.size <= self.size:
            opcode, length = RECORD.unpack(self._read(offset, RECORD.size))
            if opcode == 0 or offset + RECORD.size + length > self.size:
                return
            yield opcode, offset, RECORD.size + length
            offset += RECORD.size + length

    def _find(self, contents: Contents, opcode: int, offset: int, length: int) -> None:
        if opcode not in (Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA, Opcode.HEADER):
            return
        raw = self._read(offset, length)
        if opcode == Opcode.CHUNK:
            data = unpacked_chunk(raw)
            for record in channels_in(data):
                contents.channels[record.id] = record.topic
                contents.encodings[record.topic] = record.message_encoding
            messages = list(messages_in(data, len(contents.chunks), contents.channels))
            numbers = {name: number for number, name in contents.channels.items()}
            contents.counts.update(numbers[message.channel] for message in messages)
            contents.chunks.append(ChunkFacts(offset, length, frozenset(numbers[m.channel] for m in messages)))
            if times := [message.log_time for message in messages]:
                contents.start_time = min(times) if not contents.start_time else min(contents.start_time, *times)
                contents.end_time = max(contents.end_time, *times)
            return
        stream = ReadDataStream(io.BytesIO(raw[RECORD.size :]))
        if opcode == Opcode.ATTACHMENT:
            contents.attachments[Attachment.read(stream).name] = (offset, length)
        elif opcode == Opcode.METADATA:
            record = Metadata.read(stream)
            contents.metadata[record.name] = record.metadata
        else:
            Header.read(stream)


def _remedy(path: Path) -> str:
    """What to do about a recording that is not there: those that are, or how one is made."""
    if path.exists():
        return ""
    try:
        near = sorted(path.absolute().parent.glob("*.mcap"), key=lambda file: file.stat().st_mtime, reverse=True)
    except OSError:  # one went while they were looked at
        near = []
    if near:
        more = f" and {len(near) - NEAR} more" if len(near) > NEAR else ""
        return f"; in {path.absolute().parent} there are {', '.join(file.name for file in near[:NEAR])}{more}, newest first"
    return "; `elys run SCENE --record FILE.mcap` makes one"
