"""Where a recording comes from: the one that it is a fork of, at which instant, and what was changed there."""

from __future__ import annotations

import hashlib
from pathlib import Path

import msgspec

from elys.bus.exact_keeping import LINEAGE
from elys.bus.recording import Recording
from elys.bus.transports.mcap import METADATA_NAME
from elys.common.errors import RecordingError


class Lineage(msgspec.Struct, frozen=True, kw_only=True):
    """Of a fork; as metadata each field is a text."""

    parent: str  # name of the file
    parent_hash: str  # of its content: blake2b, 32 hex digits
    parent_session: str
    parent_epoch: int
    instant: int  # of the parent, see CommandRecord
    tick: int
    time: float  # [s]
    repeats: bool  # whether what was done in the parent afterwards was done again
    edits: str  # what was changed there: a JSON list of commands
    ancestors: str = "[]"  # the parent's own lineage and that of its parents, a JSON list

    def facts(self) -> dict[str, str]:
        """As metadata has it."""
        return {name: str(value) for name, value in msgspec.structs.asdict(self).items()}


def lineage_of(recording: Recording) -> dict[str, str]:
    """What a recording says of where it comes from; {} of one that is no fork."""
    return dict(recording.reader.metadata.get(LINEAGE, {}))


def lineage_from(recording: Recording, *, instant: int, tick: int, time: float, repeats: bool, edits: str) -> Lineage:
    """The lineage of a fork of a recording; reads all of its file. Raises RecordingError if that cannot be done."""
    own = lineage_of(recording)
    older = _decoded(own.pop("ancestors", "[]"))
    ancestors = [own, *older] if own else []
    return Lineage(
        parent=recording.path.name,
        parent_hash=content_hash(recording.path),
        parent_session=recording.reader.metadata[METADATA_NAME].get("session", ""),
        parent_epoch=recording.epoch,
        instant=instant,
        tick=tick,
        time=time,
        repeats=repeats,
        edits=edits,
        ancestors=msgspec.json.encode(ancestors).decode(),
    )


def content_hash(path: Path) -> str:
    """What names a file's content."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error


def _decoded(text: str) -> list[dict[str, str]]:
    try:
        return msgspec.json.decode(text, type=list[dict[str, str]])
    except msgspec.MsgspecError:
        return []
