"""What a person does with window, mouse and keyboard, as values that travel down the layers.

Keys (see `keys.Key`), buttons and modifiers carry GLFW's numbers, so that its callbacks need no table.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass


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
    physical: int = 0  # by its place on the keyboard; 0: where `key` says

    @property
    def place(self) -> int:
        """Which key it is, whatever is printed on it."""
        return self.physical or self.key


@dataclass(frozen=True, slots=True)
class KeyReleased:
    """A key went up."""

    key: int
    modifiers: Modifiers = Modifiers.NONE
    physical: int = 0  # see KeyPressed

    @property
    def place(self) -> int:
        """Which key it is, whatever is printed on it."""
        return self.physical or self.key


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


@dataclass(frozen=True, slots=True)
class FilesDropped:
    """Files or folders were dragged here from another program and let go, at the last place of the pointer."""

    paths: tuple[str, ...]


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
    | FilesDropped
)
