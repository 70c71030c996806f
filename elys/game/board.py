"""The best times of each level: recordings in a folder of the user's, and a list of them.

An entry is a recording of the race from its countdown to its finish. It counts as proven when `elys verify` has run it again and
all of it came out the same (`proof`); it is also what races as a ghost.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import msgspec
import platformdirs

from elys.bus.messages.ghosts import Span
from elys.common.assets.store import replace_file
from elys.common.errors import ElysError
from elys.game.proof import PROVEN

KEPT: Final = 10  # entries of a level; the recordings of slower ones are taken away
GHOSTS: Final = 3  # that race along
_LIST: Final = "times.json"


class Entry(msgspec.Struct, frozen=True, kw_only=True):
    """A race that was finished.

    Attributes:
        file: its recording, beside the list.
        time: from the start to the finish [s].
        began: simulation time [s] of the recording at which the countdown ended, so that ghosts begin together.
        proof: the verdict on it, "" before there is one.
    """

    file: str
    player: str
    time: float
    medal: str
    date: str
    began: float
    splits: tuple[float, ...] = ()  # [s] at each gate
    pauses: tuple[tuple[float, float], ...] = ()  # of the recording's time: when it was held, and how long [s]
    proof: str = ""

    @property
    def ended(self) -> float:
        """Simulation time [s] of the recording at the finish: the race's own, and what of pauses lies behind the start."""
        return self.began + self.time + sum(length for _, length in since(self.began, self.pauses))


def since(began: float, spans: Iterable[Span]) -> tuple[Span, ...]:
    """What of some spans lies behind an instant."""
    return tuple(
        (max(start, began), min(length, start + length - began)) for start, length in spans if start + length > began
    )


class Board:
    """One level's times, fastest first: of who raced alone, or of races of so many players, who can be in each other's way."""

    def __init__(self, level: str, folder: Path | None = None, *, players: int = 1) -> None:
        """Raises ElysError where the list cannot be read, or is none."""
        name = level if players == 1 else f"{level}-{players}-players"
        self.folder = (folder or game_folder()) / name
        self.entries: list[Entry] = self._read()

    def __len__(self) -> int:
        return len(self.entries)

    def path_of(self, entry: Entry) -> Path:
        """Where its recording is."""
        return self.folder / entry.file

    def best(self, player: str = "") -> Entry | None:
        """The fastest, of one player or of all."""
        return next((entry for entry in self.entries if player in ("", entry.player)), None)

    def ghosts(self, player: str, *, count: int = GHOSTS) -> list[Entry]:
        """Whom to race: one's own best, and the fastest of others, one each."""
        found: dict[str, Entry] = {}
        for entry in self.entries:
            if self.path_of(entry).is_file():
                found.setdefault(entry.player, entry)
        own = [found.pop(player)] if player in found else []
        return [*own, *found.values()][:count]

    def add(self, entry: Entry) -> int:
        """Puts an entry in its place, from 1; 0 where it is too slow to be kept, and its recording is gone then."""
        self.entries = self._read()  # a verdict may have come meanwhile, or somebody else's time
        self.entries = sorted([*self.entries, entry], key=lambda one: (one.time, one.date))
        self._cut()
        return self.entries.index(entry) + 1 if entry in self.entries else 0

    def prove(self, file: str, proof: str) -> None:
        """Notes the verdict on an entry; one that came out otherwise is no entry any more."""
        self.entries = self._read()
        self.entries = [
            msgspec.structs.replace(entry, proof=proof) if entry.file == file else entry
            for entry in self.entries
            if entry.file != file or proof == PROVEN
        ]
        self._write()

    def _cut(self) -> None:
        gone, self.entries = self.entries[KEPT:], self.entries[:KEPT]
        self._write()
        for entry in gone:
            self.path_of(entry).unlink(missing_ok=True)

    def _read(self) -> list[Entry]:
        path = self.folder / _LIST
        try:
            entries = msgspec.json.decode(path.read_bytes(), type=list[Entry])
        except FileNotFoundError:
            return []
        except (OSError, msgspec.DecodeError, UnicodeDecodeError) as error:
            raise ElysError(f"the times in {path} cannot be read ({error}): mend the file or take it away") from error
        return [entry for entry in entries if Path(entry.file).name == entry.file]

    def _write(self) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(self.folder / _LIST, msgspec.json.format(msgspec.json.encode(self.entries), indent=2))
        except OSError as error:
            raise ElysError(f"the times cannot be written to {self.folder}: {error.strerror}") from error


def game_folder() -> Path:
    """Where races are kept: $ELYS_GAME_DIR, or in the user's data directory."""
    chosen = os.environ.get("ELYS_GAME_DIR")
    return Path(chosen) if chosen else Path(platformdirs.user_data_dir("elys")) / "game"
