"""Recording into files: one, or one after the other, each of them whole in itself, until there may be no more."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Final

from elys.bus import codec, topics
from elys.bus.compressed_video import VIDEO_PREFIX
from elys.bus.message_sieve import MessageSieve
from elys.bus.messages.scene import SceneDelta, Snapshot
from elys.bus.mirror import SceneMirror
from elys.bus.rate_budget import THINNED, RateBudget
from elys.bus.recording_names import is_made
from elys.bus.recording_plan import PLAIN, RecordingPlan, files_of, numbered_file
from elys.bus.rerun_base import RerunBase
from elys.bus.topics import Encoding
from elys.bus.transports.mcap import McapWriter
from elys.bus.transports.mcap_reading import McapReader
from elys.common.assets.store import references_in
from elys.common.errors import MessageError, RecordingError

_ASSET_TYPE: Final = "application/octet-stream"
_log = logging.getLogger(__name__)


class Recorder:
    """Writes a session's messages and assets into a recording, in the order in which they come, as a plan says."""

    def __init__(self, path: Path, *, session: str, scene: str, plan: RecordingPlan = PLAIN) -> None:
        """Raises RecordingError if the file cannot be written."""
        self.message_count = 0
        self.is_full = False  # it has reached its limit, and takes no more
        self._path, self._session, self._scene, self._plan = path, session, scene, plan
        self._files: list[Path] = []
        self._failure: RecordingError | None = None  # why there is no next file
        self._size = 0  # of the files before this one [bytes]
        self._assets: set[str] = set()
        self._facts: dict[str, dict[str, str]] = {}
        self._views: set[str] = set()
        self._sieve = MessageSieve(compact=plan.compact)
        self._budget = RateBudget(plan.limit_rate) if plan.limit_rate else None
        self._ended_size = 0  # of all files that were ended, deleted ones too [bytes]
        self._mirror: SceneMirror | None = None  # the scene as it is, for the next file to begin with
        self._base = RerunBase()  # likewise, and with what it can be run again
        self._begun = 0  # when the file was begun [ns]
        self._has_frame = False  # the file
        self._least_size = 0  # of a file, so that one that begins with much holds more than that [bytes]
        self._number = len(files_of(path)) and int(files_of(path)[-1].stem.rpartition(".")[2]) + 1
        self._writer = self._new_file()

    def message(self, channel: str, body: bytes, *, time_ns: int) -> None:
        """Adds a message without its protocol prefix, if it says something new."""
        if self.is_full or not (self._plan.takes(channel) or channel.startswith(VIDEO_PREFIX)):
            return
        self._check()
        if self._budget is not None and not self._budget.takes(channel, body, time_ns, self._grown):
            self._say_thinned()
            return
        kept = self._sieve.kept(channel, body, time_ns)
        if kept is None:
            return
        if self._plan.rotates:
            if channel == topics.STATE.name and self._is_due(time_ns):
                self._rotate(time_ns)
            self._has_frame |= channel == topics.STATE.name
            self._follow(channel, body)
            self._base.recorded(channel, kept, time_ns)
        self._begun = self._begun or time_ns
        self._writer.write(channel, kept, log_time=time_ns)
        self.message_count += 1
        if self._plan.limit_bytes and self._size + self._writer.expected_size >= self._plan.limit_bytes:
            self._end_here()

    def add_video(self, channel: str) -> None:
        """Makes room for pictures of a view; once is enough."""
        self._views.add(channel)
        self._writer.add_video(channel)

    def asset(self, reference: str, data: bytes) -> None:
        """Adds an asset, once."""
        if reference not in self._assets and not self.is_full:
            self._assets.add(reference)
            self._writer.attach(reference, data, media_type=_ASSET_TYPE)

    def facts(self, name: str, values: dict[str, str]) -> None:
        """Adds metadata, once under each name."""
        if name not in self._facts and not self.is_full:
            self._facts[name] = values
            self._writer.add_metadata(name, values)

    def lacking(self, body: bytes) -> list[str]:
        """The assets that a snapshot's or a delta's body names and that are not in the recording yet."""
        return [reference for reference in references_in(body) if reference not in self._assets]

    def keep_time(self) -> None:
        """Closes chunks and syncs when it is time; call it at least every `seconds_until_due`."""
        self._check()
        if not self.is_full:
            self._writer.keep_time()

    def seconds_until_due(self) -> float:
        """How long `keep_time` may wait."""
        return 1.0 if self.is_full else self._writer.seconds_until_due()

    def close(self) -> None:
        """Finishes the file."""
        self._writer.close()

    # --- one file after the other ----------------------------------------------------------------------------------

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _new_file(self) -> McapWriter:
        path = self._numbered_name() if self._plan.rotates else self._path
        writer = McapWriter(
            path,
            session=self._session,
            scene=self._scene,
            compact=self._plan.compact,
            overwrites=self._plan.overwrites and not self._plan.rotates,
        )
        self._files.append(path)
        return writer

    def _numbered_name(self) -> Path:
        """The next that nobody has taken meanwhile."""
        while True:
            path = numbered_file(self._path, self._number)
            self._number += 1
            if is_made(path):
                return path

    def _is_due(self, time_ns: int) -> bool:
        plan = self._plan
        if self._mirror is None or not (self._begun and self._has_frame):
            return False
        is_large = plan.rotate_bytes and self._writer.expected_size >= max(plan.rotate_bytes, self._least_size)
        return bool(is_large or (plan.rotate_seconds and time_ns - self._begun >= plan.rotate_seconds * 1e9))

    def _follow(self, channel: str, body: bytes) -> None:
        """Keeps the scene as it is now."""
        try:
            if channel == topics.SNAPSHOT.name:
                self._mirror = SceneMirror()
                self._mirror.apply_snapshot(codec.decode_body(body, Snapshot, Encoding.JSON))
            elif channel == topics.DELTA.name and self._mirror is not None:
                delta = codec.decode_body(body, SceneDelta, Encoding.JSON)
                if delta.resync:
                    self._mirror = None  # a snapshot follows
                else:
                    self._mirror.apply_delta(delta)
        except MessageError as error:
            _log.debug("the scene is not known until the next snapshot: %s", error)
            self._mirror = None

    def _rotate(self, time_ns: int) -> None:
        """Ends the file and begins the next with the scene as it is, all that it names, and from where it can be run again."""
        assert self._mirror is not None
        snapshot = codec.encode_body(self._mirror.to_snapshot(), Encoding.JSON)
        self._writer.close()
        last = self._files[-1]
        self._size += last.stat().st_size
        self._ended_size += last.stat().st_size
        try:
            self._writer = self._new_file()
        except RecordingError as error:
            self._failure = error
            raise
        self._begun, self._has_frame = time_ns, False
        self._sieve = MessageSieve(compact=self._plan.compact)
        for name, values in self._facts.items():
            self._writer.add_metadata(name, values)
        for channel in self._views:
            self._writer.add_video(channel)
        # All of them: a change to come may name one that the scene does not name now, and nobody sends it twice.
        with McapReader(last) as reader:
            for reference in sorted(self._assets):
                self._writer.attach(reference, reader.attachment(reference), media_type=_ASSET_TYPE)
        self._writer.write(topics.SNAPSHOT.name, snapshot, log_time=time_ns)
        for message in self._base.messages:
            self._writer.write(message.channel, message.body, log_time=message.log_time)
        self._least_size = self._writer.expected_size + self._plan.rotate_bytes // 4
        while self._plan.keep_files and len(self._files) > self._plan.keep_files:
            oldest = self._files.pop(0)
            try:
                self._size -= oldest.stat().st_size
                oldest.unlink()
            except OSError as error:
                _log.warning("the old recording %s cannot be deleted: %s", oldest, error.strerror)

    @property
    def _grown(self) -> int:
        """What was written so far, in all files [bytes]."""
        return self._ended_size + self._writer.expected_size

    def _say_thinned(self) -> None:
        """Once, in the log, and in every file from then on."""
        if THINNED in self._facts:
            return
        self.facts(THINNED, {"limit_rate": str(self._plan.limit_rate)})
        _log.warning(
            "the recording %s is thinned to stay below %g MB/s: of profiles, diagnostics and perhaps states; all else is kept",
            self._path,
            self._plan.limit_rate / 1e6,
        )

    def _end_here(self) -> None:
        self.is_full = True
        self._writer.close()
        _log.warning(
            "the recording %s has reached its limit of %g MB and ends here; the session goes on",
            self._path,
            self._plan.limit_bytes / 1e6,
        )


def require_files(path: Path) -> list[Path]:
    """The files of a recording that rotated; RecordingError if there is none."""
    files = files_of(path)
    if not files:
        raise RecordingError(f"nothing was recorded to {numbered_file(path, 0)}")
    return files
