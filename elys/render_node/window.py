"""A GLFW window with OpenGL in it, on a real display or on none, and what the person does in it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, Literal, Protocol

from elys.bus.gamepads import PadState, pads_of
from elys.common.errors import DisplayError
from elys.common.input_names import KEY_NAMES, MOUSE_NAMES

NULL_PLATFORM_VARIABLE: Final = "ELYS_NULL_PLATFORM"  # "1": windows that need no display server and show nothing
CLICK: Final = 3.0  # [points] by which a pointer may go between down and up


def _is_null() -> bool:
    return os.environ.get(NULL_PLATFORM_VARIABLE) == "1"


def _prefer_newer_glfw() -> None:
    """The GLFW 3.4 of the glfw package cannot draw without a display server; the 3.5 that Dear ImGui's package brings can."""
    found = find_spec("imgui_bundle")
    if found is not None and found.origin is not None:
        library = Path(found.origin).with_name("libglfw.so.3")
        if library.exists():
            os.environ.setdefault("PYGLFW_LIBRARY", str(library))


if _is_null():
    _prefer_newer_glfw()
import glfw  # noqa: E402  reads the environment when it is imported

Button = Literal["left", "middle", "right"]
Key = Literal[
    "f", "c", "a", "d", "g", "m", "n", "p", "f1", "space", "escape", "0", "1", "2", "3", "4", "5", "6", "7", "8", "9"
]
_BUTTONS: Final[Mapping[int, Button]] = {
    glfw.MOUSE_BUTTON_LEFT: "left",
    glfw.MOUSE_BUTTON_MIDDLE: "middle",
    glfw.MOUSE_BUTTON_RIGHT: "right",
}
_KEYS: Final[Mapping[int, Key]] = {
    glfw.KEY_F: "f",
    glfw.KEY_C: "c",
    glfw.KEY_A: "a",
    glfw.KEY_D: "d",
    glfw.KEY_G: "g",
    glfw.KEY_M: "m",
    glfw.KEY_N: "n",
    glfw.KEY_P: "p",
    glfw.KEY_F1: "f1",
    glfw.KEY_0: "0",
    glfw.KEY_1: "1",
    glfw.KEY_2: "2",
    glfw.KEY_3: "3",
    glfw.KEY_4: "4",
    glfw.KEY_5: "5",
    glfw.KEY_6: "6",
    glfw.KEY_7: "7",
    glfw.KEY_8: "8",
    glfw.KEY_9: "9",
    glfw.KEY_SPACE: "space",
    glfw.KEY_ESCAPE: "escape",
}


@dataclass(frozen=True, slots=True)
class Dragged:
    """The pointer moved with a button down; `x`, `y` in window heights, right and down."""

    button: Button
    x: float
    y: float
    shift: bool = False


@dataclass(frozen=True, slots=True)
class Clicked:
    """The left button went down and up at one place; `x`, `y` in the window's width and height, right and down."""

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Scrolled:
    """The wheel was turned; away from the person is positive."""

    steps: float


@dataclass(frozen=True, slots=True)
class KeyPressed:
    """A key of those that mean something to a viewer went down."""

    key: Key


WindowEvent = Dragged | Clicked | Scrolled | KeyPressed


class Hands(Protocol):
    """Whom keys, mouse and what is typed reach, as `InputSender` takes them."""

    def press(self, name: str) -> None: ...
    def let_go(self, name: str) -> None: ...
    def move(self, name: str, distance: float) -> None: ...
    def type(self, text: str) -> None: ...


class Window:
    """One window whose context is current on this thread. What it hears goes to `on_event`, from `poll`."""

    def __init__(self, title: str, size: tuple[int, int] = (1280, 720)) -> None:
        """Raises DisplayError, with what to do, where no window can be opened."""
        self.is_null = _is_null()
        self.on_event: Callable[[WindowEvent], None] = lambda event: None
        self._pointer = (0.0, 0.0)
        self._pressed_at: tuple[float, float] | None = None  # where the left button went down
        self._player: Hands | None = None
        self.keeps: Callable[[str], bool] = (
            self._gives_back
        )  # whether a key is not for the player, who would have it else
        self.gave_back = False  # a player was here and is no more; whoever hears of it makes it false again
        _initialise()
        self._window = _create(title, size, visible=True)
        glfw.make_context_current(self._window)
        glfw.swap_interval(0)  # waiting for the display here would hold up the bus, and a hidden window's for ever
        glfw.set_cursor_pos_callback(self._window, self._moved)
        glfw.set_scroll_callback(self._window, self._scrolled)
        glfw.set_key_callback(self._window, self._key)
        glfw.set_mouse_button_callback(self._window, self._button)
        glfw.set_char_callback(self._window, self._typed)
        glfw.set_window_focus_callback(self._window, self._focused)
        self._title = title

    @property
    def framebuffer_size(self) -> tuple[int, int]:
        """Width and height [pixels], at least 1."""
        width, height = glfw.get_framebuffer_size(self._window)
        return max(width, 1), max(height, 1)

    @property
    def is_closing(self) -> bool:
        """Whether the person asked to close it."""
        return bool(glfw.window_should_close(self._window))

    @property
    def is_visible(self) -> bool:
        """Whether drawing makes sense."""
        return self.is_null or not glfw.get_window_attrib(self._window, glfw.ICONIFIED)

    @property
    def player(self) -> Hands | None:
        """Whom keys and mouse reach instead of `on_event`, with the pointer held, until Escape or another window ends it."""
        return self._player

    @player.setter
    def player(self, player: Hands | None) -> None:
        self.gave_back |= self._player is not None and player is None
        self._player = player
        mode = glfw.CURSOR_DISABLED if player is not None else glfw.CURSOR_NORMAL
        glfw.set_input_mode(self._window, glfw.CURSOR, mode)
        self._pointer = glfw.get_cursor_pos(self._window)

    def pads(self) -> dict[int, PadState]:
        """How the gamepads of this machine stand."""
        return pads_of(glfw)

    def request_close(self) -> None:
        """As if the person had pressed the close button."""
        glfw.set_window_should_close(self._window, True)

    def set_title(self, title: str) -> None:
        """What the frame around it says."""
        if title != self._title:
            glfw.set_window_title(self._window, title)
            self._title = title

    @property
    def title(self) -> str:
        """What the frame around it says now."""
        return self._title

    def poll(self) -> None:
        """Takes what the system has for us."""
        glfw.poll_events()

    def swap(self) -> None:
        """Shows what was drawn."""
        glfw.swap_buffers(self._window)

    def close(self) -> None:
        """Ends window and context. A second call does nothing."""
        if self._window is not None:
            glfw.destroy_window(self._window)
            self._window = None
            glfw.terminate()

    def _moved(self, _: Any, x: float, y: float) -> None:
        before, self._pointer = self._pointer, (x, y)
        if self._player is not None:
            self._player.move("pointer_x", x - before[0])
            self._player.move("pointer_y", y - before[1])
            return
        height = max(glfw.get_window_size(self._window)[1], 1)
        for number, button in _BUTTONS.items():
            if glfw.get_mouse_button(self._window, number) == glfw.PRESS:
                self.on_event(
                    Dragged(
                        button,
                        (x - before[0]) / height,
                        (y - before[1]) / height,
                        shift=self._is_down(glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT),
                    )
                )
                return

    def _key(self, _: Any, key: int, __: int, action: int, ___: int) -> None:
        if self._player is not None:
            name = KEY_NAMES.get(key, "")
            if action == glfw.RELEASE:
                self._player.let_go(name)
            elif action == glfw.PRESS and not self.keeps(name):
                self._player.press(name)
        elif action == glfw.PRESS and key in _KEYS:
            self.on_event(KeyPressed(_KEYS[key]))

    def _gives_back(self, name: str) -> bool:
        if name == "escape":
            self.player = None
        return name == "escape"

    def _button(self, _: Any, button: int, action: int, __: int) -> None:
        if self._player is not None and 0 <= button < len(MOUSE_NAMES):
            (self._player.press if action == glfw.PRESS else self._player.let_go)(MOUSE_NAMES[button])
        elif self._player is None and button == glfw.MOUSE_BUTTON_LEFT:
            at, pressed = glfw.get_cursor_pos(self._window), self._pressed_at
            self._pressed_at = at if action == glfw.PRESS else None
            if action == glfw.RELEASE and pressed is not None and max(map(abs, _difference(at, pressed))) <= CLICK:
                width, height = glfw.get_window_size(self._window)
                self.on_event(Clicked(at[0] / max(width, 1), at[1] / max(height, 1)))

    def _scrolled(self, _: Any, x: float, y: float) -> None:
        if self._player is None:
            self.on_event(Scrolled(y))
        else:
            self._player.move("wheel_x", x)
            self._player.move("wheel_y", y)

    def _typed(self, _: Any, codepoint: int) -> None:
        if self._player is not None:
            self._player.type(chr(codepoint))

    def _focused(self, _: Any, is_focused: int) -> None:
        if not is_focused and self._player is not None:
            self.player = None

    def _is_down(self, *keys: int) -> bool:
        return any(glfw.get_key(self._window, key) == glfw.PRESS for key in keys)


def probe_display() -> str:
    """What windows would open on, in a few words, found out by opening one that is not shown.

    Raises:
        DisplayError: there is no display, or no OpenGL 3.3 on it.
    """
    _initialise()
    window = _create("ELYS", (64, 64), visible=False)
    try:
        platform = _PLATFORMS.get(glfw.get_platform(), "a display")
        monitor = glfw.get_primary_monitor()
        mode = glfw.get_video_mode(monitor) if monitor else None
        return f"{platform}, {mode.size.width} x {mode.size.height}" if mode else platform
    finally:
        glfw.destroy_window(window)
        glfw.terminate()


def _difference(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return a[0] - b[0], a[1] - b[1]


_PLATFORMS: Final = {
    glfw.PLATFORM_X11: "X11",
    glfw.PLATFORM_WAYLAND: "Wayland",
    glfw.PLATFORM_WIN32: "Windows",
    glfw.PLATFORM_COCOA: "macOS",
    glfw.PLATFORM_NULL: "no display (null platform)",
}


def _initialise() -> None:
    glfw.ERROR_REPORTING = "ignore"  # errors are asked for below and become one sentence
    glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_NULL if _is_null() else glfw.ANY_PLATFORM)
    if not glfw.init():
        raise DisplayError(
            f"there is no display to open a window on ({_last_error()}): start it from a desktop, forward one with "
            "ssh -X, or draw without a window with `elys render`"
        )


def _create(title: str, size: tuple[int, int], *, visible: bool) -> Any:
    glfw.default_window_hints()
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
    glfw.window_hint(glfw.VISIBLE, visible)
    if _is_null():
        glfw.window_hint(glfw.CONTEXT_CREATION_API, glfw.EGL_CONTEXT_API)
    else:
        glfw.window_hint(glfw.SCALE_TO_MONITOR, True)
    window = glfw.create_window(*size, title, None, None)
    if not window:  # a NULL pointer, which is not None
        reason = _last_error()
        glfw.terminate()
        raise DisplayError(
            f"the display offers no OpenGL 3.3 ({reason}): update the graphics driver, or install Mesa's software "
            "renderer (Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri)"
        )
    return window


def _last_error() -> str:
    code, text = glfw.get_error()
    description = text.decode(errors="replace") if isinstance(text, bytes) else text
    return str(description or f"GLFW error {code:#x}")
