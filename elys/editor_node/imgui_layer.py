"""The layer of widgets: Dear ImGui on top of the stack, drawing what it is given and consuming what its widgets want."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from imgui_bundle import imgui, imguizmo, implot

from elys.editor_node.events import (
    CharacterTyped,
    CursorEntered,
    Event,
    KeyPressed,
    KeyReleased,
    MouseMoved,
    MousePressed,
    MouseReleased,
    MouseScrolled,
    WindowFocused,
)
from elys.editor_node.gpu import WindowContext
from elys.editor_node.keys import Key
from elys.editor_node.preferences import Preferences
from elys.editor_node.theme import BACKGROUND, apply_theme, load_fonts
from elys.editor_node.window import Window

_GLSL_VERSION: Final = "#version 330"
_LONGEST_HOLD: Final = 0.1  # [s] less than ImGui waits until a key that is held repeats
_ANY_POPUP: Final = imgui.PopupFlags_.any_popup_id.value | imgui.PopupFlags_.any_popup_level.value


class ImGuiLayer:
    """Feeds ImGui every event it is offered and builds its frame with `draw`.

    `reserves` says of an event whether a panel takes it raw from a layer below (the viewport does), so that it is not consumed.
    """

    def __init__(
        self,
        window: Window,
        context: WindowContext,
        *,
        draw: Callable[[float], None],
        reserves: Callable[[Event], bool],
        layout_file: Path | None,
        preferences: Preferences,
    ) -> None:
        self._window = window
        self._context = context
        self._draw = draw
        self._reserves = reserves
        self._held: set[int] = set()  # keys that are down
        self._closes_menus = False
        self._docking = ""  # to be loaded
        self._preferences = preferences
        self._look: tuple[object, ...] = ()  # what theme and sizes were made of
        self._imgui = imgui.create_context()
        self._implot = implot.create_context()
        self.build_time = 0.0  # [s] that the widgets of the last frame took
        self.draw_time = 0.0  # [s] that handing them to OpenGL took
        io = imgui.get_io()
        io.config_flags |= imgui.ConfigFlags_.docking_enable.value
        io.config_windows_move_from_title_bar_only = True
        io.config_input_trickle_event_queue = True
        if layout_file is not None:
            layout_file.parent.mkdir(parents=True, exist_ok=True)
        io.set_ini_filename(str(layout_file) if layout_file is not None else "")
        self.fonts = load_fonts()
        self._apply_look()
        # Callbacks stay ours: events reach ImGui through the stack, like every other layer.
        imgui.backends.glfw_init_for_opengl(window.address, False)
        imgui.backends.opengl3_init(_GLSL_VERSION)
        if window.null_platform:
            self.on_event(CursorEntered(True))

    def on_event(self, event: Event) -> bool:
        """Tells ImGui; consumes what its widgets want, unless a panel reserves it for a layer below."""
        io = imgui.get_io()
        match event:
            case MouseMoved(x, y):
                io.add_mouse_pos_event(x, y)
            case MousePressed(button) | MouseReleased(button):
                if button < imgui.MouseButton_.count.value:
                    io.add_mouse_button_event(button, isinstance(event, MousePressed))
                return io.want_capture_mouse and isinstance(event, MousePressed) and not self._reserves(event)
            case MouseScrolled(x, y):
                io.add_mouse_wheel_event(x, y)
                return io.want_capture_mouse and not self._reserves(event)
            case KeyPressed(key) | KeyReleased(key):
                self._feed_key(key, pressed=isinstance(event, KeyPressed))
                is_open = imgui.is_popup_open("", _ANY_POPUP)
                self._closes_menus |= is_open and key == Key.ESCAPE and isinstance(event, KeyPressed)
                return io.want_text_input or is_open
            case CharacterTyped(codepoint):
                io.add_input_character(codepoint)
                return io.want_text_input
            case CursorEntered(inside):
                imgui.backends.glfw_cursor_enter_callback(self._window.address, int(inside))
            case WindowFocused(focused):
                self._held.clear()
                io.add_focus_event(focused)
        return False

    def update(self, elapsed: float) -> None:
        """Builds and draws one frame of widgets."""
        start = time.perf_counter()
        self._apply_look()
        if self._docking:
            imgui.load_ini_settings_from_memory(self._docking)
            self._docking = ""
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        if self._held:  # while one frame takes long, nobody can let go of a key: that alone must not repeat it
            io = imgui.get_io()
            io.delta_time = min(io.delta_time, _LONGEST_HOLD)
        imgui.new_frame()
        imguizmo.im_guizmo.begin_frame()
        if self._closes_menus:  # ImGui itself does so only where keys move the focus
            self._closes_menus = False
            imgui.internal.close_popups_except_modals()
        self._draw(elapsed)
        imgui.render()
        built = time.perf_counter()
        self._context.clear(*self._window.framebuffer_size, BACKGROUND)
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())
        if self._window.null_platform:
            self._context.retire_unseen()
        self.build_time, self.draw_time = built - start, time.perf_counter() - built

    def load_docking(self, docking: str) -> None:
        """Places windows as `imgui.save_ini_settings_to_memory` once told, before the next frame."""
        self._docking = docking

    @property
    def is_typing(self) -> bool:
        """Whether a text cursor blinks somewhere."""
        return imgui.get_io().want_text_input

    def close(self) -> None:
        """Ends ImGui; the window's context must still be current."""
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        implot.destroy_context(self._implot)
        imgui.destroy_context(self._imgui)

    def _apply_look(self) -> None:
        """Theme and sizes anew, where the person or the display wants others than in the last frame."""
        wanted = self._preferences
        look = (self._window.content_scale, wanted.theme, wanted.font_scale)
        if look != self._look:
            self._look = look
            apply_theme(look[0], theme=wanted.theme, font_scale=wanted.font_scale)

    def _feed_key(self, key: int, *, pressed: bool) -> None:
        io = imgui.get_io()
        (self._held.add if pressed else self._held.discard)(key)
        if key in _MODIFIER_OF:
            for modifier in (imgui.Key.mod_ctrl, imgui.Key.mod_shift, imgui.Key.mod_alt, imgui.Key.mod_super):
                io.add_key_event(modifier, any(_MODIFIER_OF.get(held) == modifier for held in self._held))
        named = _IMGUI_KEYS.get(key)
        if named is not None:
            io.add_key_event(named, pressed)


_MODIFIER_OF: Final[dict[int, imgui.Key]] = {
    Key.LEFT_CTRL: imgui.Key.mod_ctrl,
    Key.RIGHT_CTRL: imgui.Key.mod_ctrl,
    Key.LEFT_SHIFT: imgui.Key.mod_shift,
    Key.RIGHT_SHIFT: imgui.Key.mod_shift,
    Key.LEFT_ALT: imgui.Key.mod_alt,
    Key.RIGHT_ALT: imgui.Key.mod_alt,
    Key.LEFT_SUPER: imgui.Key.mod_super,
    Key.RIGHT_SUPER: imgui.Key.mod_super,
}


def _imgui_key(key: Key) -> imgui.Key:
    """ImGui names its keys as `Key` does, but for digits that stand alone."""
    name = key.name.lower().replace("digit_", "_").replace("keypad_", "keypad")
    special = {"keypaddecimal": "keypad_decimal", "keypaddivide": "keypad_divide", "keypadmultiply": "keypad_multiply",
               "keypadsubtract": "keypad_subtract", "keypadadd": "keypad_add", "keypadenter": "keypad_enter"}  # fmt: skip
    named: imgui.Key = getattr(imgui.Key, special.get(name, name))
    return named


_IMGUI_KEYS: Final[dict[int, imgui.Key]] = {key: _imgui_key(key) for key in Key}
