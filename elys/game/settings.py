"""What was chosen in the menu, and is chosen next time: a file of the game's folder."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any, Final, Literal, get_args

import msgspec

from elys.common.assets.store import replace_file
from elys.game.board import game_folder

MOST_PLAYERS: Final = 4
LOOK_SPEEDS: Final = {"slow": 1.6, "normal": 2.8, "fast": 4.5}  # [rad/s] of a stick at its end
_FILE: Final = "settings.json"
_log = logging.getLogger(__name__)

Switch = Literal["on", "off"]
Pace = Literal["slow", "normal", "fast"]


class Settings(msgspec.Struct, frozen=True, kw_only=True):
    """One host's.

    Attributes:
        ghosts: whether former runs race along.
        look: how fast a hand turns the camera.
        camera: whether it turns behind the ball by itself.
    """

    ghosts: Switch = "on"
    look: Pace = "normal"
    camera: Switch = "on"

    @classmethod
    def load(cls, folder: Path | None = None) -> Settings:
        """Those that were kept; where there are none, or what was kept is none, as they are at first."""
        path = (folder or game_folder()) / _FILE
        try:
            return msgspec.json.decode(path.read_bytes(), type=cls)
        except FileNotFoundError:
            return cls()
        except (OSError, msgspec.DecodeError) as error:
            _log.warning("the settings %s cannot be read (%s): the game begins with its own", path, error)
            return cls()

    def save(self, folder: Path | None = None) -> None:
        """For the next time. Where that cannot be, it is said, and the game goes on."""
        path = (folder or game_folder()) / _FILE
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(path, msgspec.json.format(msgspec.json.encode(self), indent=1))
        except OSError as error:
            _log.warning("the settings cannot be kept in %s: %s", path, error.strerror)

    def changed(self, name: str, value: str) -> Settings:
        """With another choice; the same where there is no such name or choice."""
        if value not in CHOICES.get(name, ()) or name not in self.__struct_fields__:
            return self
        return msgspec.structs.replace(self, **{name: value})

    def of_ball(self) -> dict[str, Any]:
        """As values of the script of a ball."""
        return {"look_speed": LOOK_SPEEDS[self.look], "is_followed": self.camera == "on"}


CHOICES: Final[dict[str, tuple[str, ...]]] = {
    "players": tuple(map(str, range(1, MOST_PLAYERS + 1))),
    "ghosts": get_args(Switch),
    "look": get_args(Pace),
    "camera": get_args(Switch),
}
_TITLES: Final = {"players": "Players", "ghosts": "Ghosts", "look": "Turning by hand", "camera": "Camera follows"}


def lines(settings: Settings, players: int) -> str:
    """As the menu is told of them: name|title|choice|choices, a line each."""
    now = {**msgspec.structs.asdict(settings), "players": str(players)}
    return "\n".join(f"{name}|{_TITLES[name]}|{now[name]}|{','.join(CHOICES[name])}" for name in CHOICES)
