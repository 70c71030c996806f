"""What a person has bound to which keys and sticks: a file of the user's, and what of it gets in each other's way.

    [bindings]                      # of whoever plays at this machine
    jump = "k, pad_b"
    move = ["i/j/k/l", "pad_left dead=0.25 curve=0.5"]

    [player.2]                      # of player 2 alone, over the others
    jump = "kp_0"

Names are those that scenes give their actions, axes and vectors; controls are written as in `input_controls`.
"""

from __future__ import annotations

import json
import logging
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import platformdirs

from elys.common.assets.store import replace_file
from elys.common.errors import InputError
from elys.common.input_controls import Control, check_name, sorts_taking

LAST_PLAYER: Final = 16
MOST_NAMES: Final = 64  # of a player
_log = logging.getLogger(__name__)
LARGEST_FILE: Final = 1 << 18  # [bytes]
_HEAD: Final = "# Which keys, sticks and motions do what: see `elys input list` and docs/playing.md.\n"


class BindingsFile(NamedTuple):
    """What it says."""

    everybody: Mapping[str, str] = {}
    players: Mapping[int, Mapping[str, str]] = {}

    def of(self, player: int) -> dict[str, str]:
        """What a player has bound."""
        return {**self.everybody, **self.players.get(player, {})}

    def told(self, player: int | None) -> dict[str, str]:
        """What stands in the file for a player, or for everybody."""
        return dict(self.everybody if player is None else self.players.get(player, {}))

    def with_told(self, player: int | None, bindings: Mapping[str, str]) -> BindingsFile:
        """Another file, in which this stands for a player, or for everybody."""
        if player is None:
            return self._replace(everybody=dict(bindings))
        players = {**self.players, player: dict(bindings)}
        return self._replace(players={number: players[number] for number in sorted(players) if players[number]})

    def rebound(self, player: int, wanted: Mapping[str, str]) -> BindingsFile:
        """Another file, in which a player has bound this and nothing else: what stands there for this player alone is changed
        there, all else for everybody. InputError for more names than a player may bind.
        """
        if len(wanted) > MOST_NAMES:
            raise InputError(f"a player may bind {MOST_NAMES} names, not {len(wanted)}")
        before, everybody, own = self.of(player), dict(self.everybody), self.told(player)
        for name in before.keys() - wanted.keys():
            everybody.pop(name, None)
            own.pop(name, None)
        for name, text in wanted.items():
            if before.get(name) != text:
                (own if name in own else everybody)[name] = text
        return self.with_told(None, everybody).with_told(player, own)


def user_file() -> Path:
    """Where the user's own bindings are kept."""
    return Path(os.environ.get("ELYS_CONFIG_DIR") or platformdirs.user_config_dir("elys")) / "bindings.toml"


def load_bindings(path: Path | None = None) -> BindingsFile:
    """What a file says, by default the user's, which need not be there.

    Raises:
        InputError: it cannot be read, or something in it is no binding: the line, the name, and what may stand there.
    """
    if path is None:
        path = user_file()
        if not path.exists():
            return BindingsFile()
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"the bindings {path} cannot be read: {error.strerror}") from error
    if len(data) > LARGEST_FILE:
        raise InputError(f"the bindings {path} are larger than {LARGEST_FILE >> 10} KiB: this is another file")
    try:
        text = data.decode()
        content = tomllib.loads(text)
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"the bindings {path} are no TOML: {error}") from error
    return _parsed(content, _Lines(path, text))


class FollowedBindings:
    """What a file says whenever it is asked, by default the user's; one that cannot be read any more says what it said."""

    def __init__(self, path: Path | None = None) -> None:
        """InputError if it cannot be read now."""
        self._path = path
        self._last = load_bindings(path)

    def __call__(self, player: int) -> dict[str, str]:
        """What a player has bound."""
        try:
            self._last = load_bindings(self._path)
        except InputError as error:
            _log.warning("%s; what it said before counts", error)
        return self._last.of(player)

    def keep(self, player: int, bindings: Mapping[str, str]) -> None:
        """Writes that a player has bound this and nothing else. InputError if that cannot be; the file stays as it is then."""
        path = self._path or user_file()
        self._last = (load_bindings(path) if path.exists() else BindingsFile()).rebound(player, bindings)
        save_bindings(self._last, path)


def save_bindings(file: BindingsFile, path: Path | None = None) -> Path:
    """Writes it, by default as the user's; comments that stood in it are gone. InputError if that fails."""
    path = path or user_file()
    tables = [("bindings", file.everybody), *((f"player.{number}", told) for number, told in file.players.items())]
    parts = [
        f"\n[{title}]\n" + "".join(f"{name} = {_quoted(controls)}\n" for name, controls in told.items())
        for title, told in tables
        if told
    ]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, "".join((_HEAD, *parts)).encode())
    except OSError as error:
        raise InputError(f"the bindings {path} cannot be written: {error.strerror}") from error
    return path


def shared_controls(controls: Mapping[str, tuple[Control, ...]]) -> list[tuple[str, tuple[str, ...]]]:
    """Keys, axes and motions that do more than one thing, each with the names of what it does, in order."""
    users: dict[str, dict[str, None]] = {}
    for name, several in controls.items():
        for control in several:
            for part in control.names:
                users.setdefault(part, {})[name] = None
    return [(part, tuple(names)) for part, names in users.items() if len(names) > 1]


class _Lines(NamedTuple):
    """A file's text, to say where in it something stands."""

    path: Path
    text: str

    def place(self, table: str, name: str = "") -> str:
        """The file and the line of a table, or of a name in it."""
        found, is_inside = 0, False
        for number, line in enumerate(self.text.splitlines(), 1):
            head = re.match(r"\s*\[\s*([^\]]*?)\s*\]", line)
            if head:
                title = head[1].replace('"', "").replace(" ", "")
                is_inside = title == table
                found = number if not found and (is_inside or title.startswith(f"{table}.")) else found
            elif is_inside and name and re.match(rf"\s*[\"']?{re.escape(name)}[\"']?\s*=", line):
                found = number
                break
        return f"{self.path}:{found}" if found else str(self.path)


def _parsed(content: Mapping[str, Any], lines: _Lines) -> BindingsFile:
    for table in content:
        if table not in ("bindings", "player"):
            raise InputError(
                f"{lines.place(str(table))}: there is no table [{str(table)[:40]}] of bindings: write [bindings] or [player.2]"
            )
    everybody = _bindings(content.get("bindings", {}), "bindings", lines)
    players: dict[int, dict[str, str]] = {}
    told = content.get("player", {})
    if not isinstance(told, dict):
        raise InputError(f"{lines.path}: bindings of one player stand in a table: write [player.2]")
    for key, table in told.items():
        if not (key.isascii() and key.isdecimal() and 1 <= int(key) <= LAST_PLAYER):
            raise InputError(
                f"{lines.place(f'player.{key}')}: there is no player {key[:40]!r}: they are numbered from 1 to {LAST_PLAYER}"
            )
        players[int(key)] = _bindings(table, f"player.{key}", lines)
    return BindingsFile(everybody, players)


def _bindings(table: Any, title: str, lines: _Lines) -> dict[str, str]:
    if not isinstance(table, dict):
        raise InputError(f"{lines.path}: [{title}] is a table of names, not {type(table).__name__}")
    if len(table) > MOST_NAMES:
        raise InputError(f"{lines.place(title)}: a player may bind {MOST_NAMES} names, not {len(table)}")
    bindings = {}
    for name, value in table.items():
        where = f"{lines.place(title, name)}: {name[:60]}"
        if isinstance(value, list) and all(isinstance(item, str) for item in value):
            value = ", ".join(value)
        if not isinstance(value, str):
            raise InputError(f'{where} is bound to a text, such as "space, pad_a", or to a list of such')
        try:
            check_name(name)
            sorts_taking(value)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        bindings[name] = value
    return bindings


def _quoted(text: str) -> str:
    """As a basic string of TOML, which JSON's are."""
    return json.dumps(text, ensure_ascii=False)
