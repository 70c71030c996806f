"""The editor's window: opened with GLFW, on a real display or on none, and turned into events."""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Callable
from typing import Any, Final

import imgui_bundle  # noqa: F401  its libglfw must be the one that is loaded, so it comes before glfw

import glfw  # isort: skip

from elys.bus.gamepads import PadState, pads_of
from elys.common.errors import DisplayError
from elys.editor_node.events import (
    CharacterTyped,
    CursorEntered,
    Event,
    FilesDropped,
    KeyPressed,
    KeyReleased,
    Modifiers,
    MouseMoved,
    MousePressed,
    MouseReleased,
    MouseScrolled,
    WindowDamaged,
    WindowFocused,
    WindowResized,
)

NULL_PLATFORM_VARIABLE: Final = "ELYS_NULL_PLATFORM"
_NO_DISPLAY: Final = (
    "no display to open the editor's window on ({reason}): start it from a desktop, forward one with ssh -X, or use "
    "'elys render' to draw without a window"
)
_NO_CONTEXT: Final = (
    "the display has no OpenGL 3.3 ({reason}): update the graphics driver, or install Mesa's software one "
    "(Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri)"
)


class Window:
    """One window with a current OpenGL context. Everything it hears goes to `on_event`, from `poll`, on the same thread."""

    def __init__(self, title: str, size: tuple[int, int], *, null_platform: bool = False) -> None:
        """Opens it; `null_platform` (or ELYS_NULL_PLATFORM=1) needs no display server and shows nothing.

        Raises:
            DisplayError: there is no display, or no OpenGL on it; the sentence says what to do.
        """
        self.null_platform = null_platform or os.environ.get(NULL_PLATFORM_VARIABLE) == "1"
        self.on_event: Callable[[Event], object] = lambda event: None
        _initialise(null_platform=self.null_platform)
        self._window = _create_window(title, size, null_platform=self.null_platform)
        glfw.make_context_current(self._window)
        # The frame's pace is set by the application: waiting for the display here would hold up the bus.
        glfw.swap_interval(0)
        self._listen()

    @property
    def address(self) -> int:
        """GLFW's own pointer, for ImGui's backend."""
        return int(ctypes.cast(self._window, ctypes.c_void_p).value or 0)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [window units]."""
        width, height = glfw.get_window_size(self._window)
        return width, height

    @property
    def framebuffer_size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        width, height = glfw.get_framebuffer_size(self._window)
        return width, height

    @property
    def content_scale(self) -> float:
        """How much larger than at 96 dpi text should be, in window units."""
        width, framebuffer_width = self.size[0], self.framebuffer_size[0]
        scale, _ = glfw.get_window_content_scale(self._window)
        # macOS and Wayland enlarge window units already; X11 and Windows leave it to the program.
        return float(scale) * width / framebuffer_width if framebuffer_width else float(scale)

    @property
    def is_visible(self) -> bool:
        """Whether drawing makes sense."""
        return self.null_platform or not glfw.get_window_attrib(self._window, glfw.ICONIFIED)

    @property
    def is_focused(self) -> bool:
        """Whether the keyboard is ours."""
        return bool(glfw.get_window_attrib(self._window, glfw.FOCUSED))

    @property
    def is_closing(self) -> bool:
        """Whether the person asked to close it."""
        return bool(glfw.window_should_close(self._window))

    def request_close(self, closing: bool = True) -> None:
        """As if the person had pressed the close button, or had thought better of it."""
        glfw.set_window_should_close(self._window, closing)

    def hold_pointer(self, is_held: bool) -> None:
        """Hides the pointer and lets it move without end, or gives it back where it was."""
        mode = glfw.CURSOR_DISABLED if is_held else glfw.CURSOR_NORMAL
        glfw.set_input_mode(self._window, glfw.CURSOR, mode)

    def read(self) -> str:
        """The text on the system's clipboard; empty where there is none."""
        text: Any = None
        with contextlib.suppress(glfw.GLFWError):
            text = glfw.get_clipboard_string(self._window)
        return text.decode(errors="replace") if isinstance(text, bytes) else text or ""

    def write(self, text: str) -> None:
        """Puts a text on the system's clipboard."""
        glfw.set_clipboard_string(self._window, text)

    def pads(self) -> dict[int, PadState]:
        """How the gamepads of this machine stand."""
        return pads_of(glfw)

    def set_title(self, title: str) -> None:
        """What the frame around it says."""
        glfw.set_window_title(self._window, title)

    def poll(self) -> None:
        """Takes what the system has for us; calls `on_event` for each."""
        glfw.poll_events()

    def swap(self) -> None:
        """Shows what was drawn."""
        glfw.swap_buffers(self._window)

    def close(self) -> None:
        """Ends window and context."""
        if self._window is not None:
            glfw.destroy_window(self._window)
            self._window = None
            glfw.terminate()

    def _listen(self) -> None:
        window = self._window

        def say(event: Event) -> None:
            self.on_event(event)

        def on_key(_: Any, key: int, scancode: int, action: int, modifiers: int) -> None:
            if key == glfw.KEY_UNKNOWN:
                return
            place, held = key, Modifiers(modifiers & 0xF)
            key = _key_of_layout(key, scancode) if not self.null_platform else key
            if action == glfw.RELEASE:
                say(KeyReleased(key, held, physical=place))
            else:
                say(KeyPressed(key, held, repeated=action == glfw.REPEAT, physical=place))

        def on_button(_: Any, button: int, action: int, modifiers: int) -> None:
            made = MousePressed if action == glfw.PRESS else MouseReleased
            say(made(button, Modifiers(modifiers & 0xF)))

        def on_drop(_: Any, *heard: Any) -> None:
            say(FilesDropped(tuple(heard[-1])))  # the binding hands over a list, and not GLFW's count and array

        glfw.set_key_callback(window, on_key)
        glfw.set_mouse_button_callback(window, on_button)
        glfw.set_char_callback(window, lambda _, codepoint: say(CharacterTyped(codepoint)))
        glfw.set_cursor_pos_callback(window, lambda _, x, y: say(MouseMoved(x, y)))
        glfw.set_scroll_callback(window, lambda _, x, y: say(MouseScrolled(x, y)))
        glfw.set_cursor_enter_callback(window, lambda _, entered: say(CursorEntered(bool(entered))))
        glfw.set_window_focus_callback(window, lambda _, focused: say(WindowFocused(bool(focused))))
        glfw.set_drop_callback(window, on_drop)
        glfw.set_framebuffer_size_callback(window, lambda _, width, height: say(WindowResized(width, height)))
        glfw.set_window_refresh_callback(window, lambda _: say(WindowDamaged()))
        glfw.set_window_content_scale_callback(window, lambda _, x, y: say(WindowDamaged()))


def _initialise(*, null_platform: bool) -> None:
    glfw.ERROR_REPORTING = "ignore"  # errors are asked for below and become one sentence
    glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_NULL if null_platform else glfw.ANY_PLATFORM)
    if not glfw.init():
        raise DisplayError(_NO_DISPLAY.format(reason=_last_error()))


def _create_window(title: str, size: tuple[int, int], *, null_platform: bool) -> Any:
    glfw.default_window_hints()
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
    if null_platform:
        glfw.window_hint(glfw.CONTEXT_CREATION_API, glfw.EGL_CONTEXT_API)
    else:
        glfw.window_hint(glfw.SCALE_TO_MONITOR, True)
    window = glfw.create_window(*size, title, None, None)
    if not window:  # a NULL pointer, which is not None
        reason = _last_error()
        glfw.terminate()
        raise DisplayError(_NO_CONTEXT.format(reason=reason))
    return window


def _last_error() -> str:
    code, text = glfw.get_error()
    description = text.decode(errors="replace") if isinstance(text, bytes) else text
    return str(description or f"GLFW error {code:#x}")


def _key_of_layout(key: int, scancode: int) -> int:
    """The key as printed on this keyboard: GLFW names keys by their place on an American one, people by what they say."""
    if glfw.KEY_KP_0 <= key <= glfw.KEY_KP_EQUAL:
        return key
    name = None
    with contextlib.suppress(glfw.GLFWError):
        name = glfw.get_key_name(key, scancode)
    return ord(name.upper()) if name and len(name) == 1 and name.isascii() and name.isalnum() else key
