"""What a person wants of every editor: theme, language, size of text, keys, and what was open lately. One JSON file."""

from __future__ import annotations

import contextlib
import logging
from pathlib import Path
from typing import Final, Literal

import msgspec

from elys.bus.messages.views import Debug, Shows

_log = logging.getLogger(__name__)

RECENT_LIMIT: Final = 12
SESSION_LIMIT: Final = 24
SCENE_LIMIT: Final = 48

Theme = Literal["dark", "light"]


class Layout(msgspec.Struct, frozen=True, kw_only=True):
    """Where the panels are."""

    docking: str  # as ImGui writes it into its file
    hidden_panels: tuple[str, ...] = ()
    viewports: tuple[int, ...] = (1,)  # that are open, by number


class CameraPose(msgspec.Struct, frozen=True, kw_only=True):
    """A point of view that can be gone back to."""

    target: tuple[float, float, float]  # [m] what the camera turns about
    yaw: float  # [rad]
    pitch: float  # [rad]
    distance: float  # [m]
    field_of_view: float = 0.9  # [rad] vertical
    is_parallel: bool = False  # rather than in perspective


class ViewState(msgspec.Struct, frozen=True, kw_only=True):
    """A viewport that was open: from where it looked, and what it showed."""

    number: int
    camera: CameraPose
    shows_grid: bool = True
    shows: Shows = "shaded"
    debug: tuple[Debug, ...] = ()
    debugs_selection: bool = False


class SessionState(msgspec.Struct, frozen=True, kw_only=True):
    """How a session was looked at when the editor left it."""

    views: tuple[ViewState, ...] = ()  # none: as the scene wants it
    places: dict[str, CameraPose] = {}  # that cameras can go back to, by the digit of their keys
    tools: dict[str, str | bool | float] = {}  # of `ui.Tools`, by the names of its fields


class SceneLook(msgspec.Struct, frozen=True, kw_only=True):
    """What this editor shows of a scene, and leaves alone: entities by the names that lead to them; lines over the picture."""

    locked: tuple[tuple[str, ...], ...] = ()
    hidden: tuple[tuple[str, ...], ...] = ()
    debug: tuple[str, ...] = ()
    debugs_selection: bool = False


class Preferences(msgspec.Struct, kw_only=True):
    """Anything that is missing in the file is as it is here; what another version wrote and this does not know is dropped."""

    theme: Theme = "dark"
    language: str = "en"  # of `language.LANGUAGES`
    font_scale: float = 1.0  # of the text, beside the display's own
    keys: dict[str, tuple[str, ...]] = {}  # chords by the names of actions, where they differ from the actions' own
    recent_scenes: list[str] = []  # paths, the newest first
    recent_recordings: list[str] = []
    recent_endpoints: list[str] = []
    recent_folders: list[str] = []  # of assets
    asset_size: float = 96.0  # [px at 96 dpi] of a tile in the browser of assets; below the smallest it is a list
    recent_actions: list[str] = []  # what was chosen in the palette, by `PaletteEntry.key`
    folded: list[str] = []  # components that the inspector shows folded
    has_seen_tour: bool = False
    hidden_panels: tuple[str, ...] = ()  # by name
    layouts: dict[str, Layout] = {}  # those a person gave a name
    sessions: dict[str, SessionState] = {}  # by the names of sessions, the one seen last at the end
    scenes: dict[str, SceneLook] = {}  # by their files, the one seen last at the end


def load_preferences(path: Path) -> Preferences:
    """Reads them. A file that cannot be read is put aside as *.broken and said in the log; the editor starts all the same."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Preferences)
    except FileNotFoundError:
        return Preferences()
    except (OSError, msgspec.DecodeError, UnicodeDecodeError) as error:
        broken = path.with_suffix(".broken")
        with contextlib.suppress(OSError):
            path.replace(broken)
        _log.warning("%s cannot be read (%s): starting with the defaults; it was put aside as %s", path, error, broken)
        return Preferences()


def save_preferences(preferences: Preferences, path: Path) -> None:
    """Writes them, whole or not at all; a disk that refuses is said in the log."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_suffix(".draft")
        draft.write_bytes(msgspec.json.format(msgspec.json.encode(preferences), indent=2))
        draft.replace(path)
    except OSError as error:
        _log.warning("the editor's preferences were not saved: %s", error)


def keep_session(preferences: Preferences, name: str, state: SessionState) -> None:
    """Remembers how a session was looked at, and forgets the one that was left longest ago where there are too many."""
    preferences.sessions.pop(name, None)
    preferences.sessions[name] = state
    for oldest in list(preferences.sessions)[:-SESSION_LIMIT]:
        del preferences.sessions[oldest]


def keep_scene(preferences: Preferences, owner: str, look: SceneLook) -> None:
    """Remembers what was marked and switched on in a scene; nothing where nothing was."""
    preferences.scenes.pop(owner, None)
    if look != SceneLook():
        preferences.scenes[owner] = look
    for oldest in list(preferences.scenes)[:-SCENE_LIMIT]:
        del preferences.scenes[oldest]


def remember(recent: list[str], newest: str) -> None:
    """Puts what was opened on top of a list of what was open lately."""
    if newest in recent:
        recent.remove(newest)
    recent.insert(0, newest)
    del recent[RECENT_LIMIT:]
