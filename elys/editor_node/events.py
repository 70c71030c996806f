"""What a person does with window, mouse and keyboard, as values that travel down the layers.

Keys, buttons and modifiers carry GLFW's numbers, so that its callbacks need no table; `Key` names those that ELYS knows.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

_KEYS = {
    "SPACE": 32, "APOSTROPHE": 39, "COMMA": 44, "MINUS": 45, "PERIOD": 46, "SLASH": 47, "SEMICOLON": 59, "EQUAL": 61,
    "LEFT_BRACKET": 91, "BACKSLASH": 92, "RIGHT_BRACKET": 93, "GRAVE_ACCENT": 96, "ESCAPE": 256, "ENTER": 257,
    "TAB": 258, "BACKSPACE": 259, "INSERT": 260, "DELETE": 261, "RIGHT_ARROW": 262, "LEFT_ARROW": 263,
    "DOWN_ARROW": 264, "UP_ARROW": 265, "PAGE_UP": 266, "PAGE_DOWN": 267, "HOME": 268, "END": 269,
    "KEYPAD_DECIMAL": 330, "KEYPAD_DIVIDE": 331, "KEYPAD_MULTIPLY": 332, "KEYPAD_SUBTRACT": 333, "KEYPAD_ADD": 334,
    "KEYPAD_ENTER": 335, "LEFT_SHIFT": 340, "LEFT_CTRL": 341, "LEFT_ALT": 342, "LEFT_SUPER": 343, "RIGHT_SHIFT": 344,
    "RIGHT_CTRL": 345, "RIGHT_ALT": 346, "RIGHT_SUPER": 347,
    **{chr(code): code for code in range(65, 91)},
    **{f"DIGIT_{digit}": 48 + digit for digit in range(10)},
    **{f"KEYPAD_{digit}": 320 + digit for digit in range(10)},
    **{f"F{number}": 289 + number for number in range(1, 13)},
}  # fmt: skip
Key = enum.IntEnum("Key", _KEYS)  # type: ignore[misc]


class Modifiers(enum.IntFlag):
    """Keys held while another is pressed."""

    NONE = 0
    SHIFT = 1
    CTRL = 2
    ALT = 4
    SUPER = 8


class MouseButton(enum.IntEnum):
    """The three buttons that mean something here."""

    LEFT = 0
    RIGHT = 1
    MIDDLE = 2


@dataclass(frozen=True, slots=True)
class KeyPressed:
    """A key went down, or is held long enough to repeat."""

    key: int
    modifiers: Modifiers = Modifiers.NONE
    repeated: bool = False


@dataclass(frozen=True, slots=True)
class KeyReleased:
    """A key went up."""

    key: int
    modifiers: Modifiers = Modifiers.NONE


@dataclass(frozen=True, slots=True)
class CharacterTyped:
    """A character to be inserted, after layout and dead keys."""

    codepoint: int


@dataclass(frozen=True, slots=True)
class MouseMoved:
    """The pointer's place from the top left [window units]."""

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class MousePressed:
    """A button went down at the last place of the pointer."""

    button: int
    modifiers: Modifiers = Modifiers.NONE


@dataclass(frozen=True, slots=True)
class MouseReleased:
    """A button went up."""

    button: int
    modifiers: Modifiers = Modifiers.NONE


@dataclass(frozen=True, slots=True)
class MouseScrolled:
    """The wheel turned; y is positive away from the hand."""

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class CursorEntered:
    """The pointer came into the window, or left it."""

    inside: bool


@dataclass(frozen=True, slots=True)
class WindowFocused:
    """The window got the keyboard, or lost it."""

    focused: bool


@dataclass(frozen=True, slots=True)
class WindowResized:
    """The picture the window shows has another size [pixels]."""

    width: int
    height: int


@dataclass(frozen=True, slots=True)
class WindowDamaged:
    """The window must be drawn again, because it was covered or its scale changed."""


Event = (
    KeyPressed
    | KeyReleased
    | CharacterTyped
    | MouseMoved
    | MousePressed
    | MouseReleased
    | MouseScrolled
    | CursorEntered
    | WindowFocused
    | WindowResized
    | WindowDamaged
)
