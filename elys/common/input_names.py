"""What keys, buttons and axes are called, the same in every program and on every keyboard.

A key is called by its place on an American keyboard, as GLFW calls it, in small letters: "w" is above "s" on a French keyboard
too, where Z is printed on it. Buttons and keys are told apart by their names alone, so that an action may mean either.
"""

from __future__ import annotations

import string
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

_NAMED: Final = (
    (32, "space"), (39, "apostrophe"), (44, "comma"), (45, "minus"), (46, "period"), (47, "slash"), (59, "semicolon"),
    (61, "equal"), (91, "left_bracket"), (92, "backslash"), (93, "right_bracket"), (96, "grave_accent"), (161, "world_1"),
    (162, "world_2"), (256, "escape"), (257, "enter"), (258, "tab"), (259, "backspace"), (260, "insert"), (261, "delete"),
    (262, "right"), (263, "left"), (264, "down"), (265, "up"), (266, "page_up"), (267, "page_down"), (268, "home"), (269, "end"),
    (280, "caps_lock"), (281, "scroll_lock"), (282, "num_lock"), (283, "print_screen"), (284, "pause"), (330, "kp_decimal"),
    (331, "kp_divide"), (332, "kp_multiply"), (333, "kp_subtract"), (334, "kp_add"), (335, "kp_enter"), (336, "kp_equal"),
    (340, "left_shift"), (341, "left_control"), (342, "left_alt"), (343, "left_super"), (344, "right_shift"),
    (345, "right_control"), (346, "right_alt"), (347, "right_super"), (348, "menu"),
)  # fmt: skip
KEY_NAMES: Final[Mapping[int, str]] = MappingProxyType(
    {
        **dict(_NAMED),
        **{ord(letter): letter.lower() for letter in string.ascii_uppercase},
        **{ord(digit): digit for digit in string.digits},
        **{290 + number: f"f{number + 1}" for number in range(25)},
        **{320 + number: f"kp_{number}" for number in range(10)},
    }
)  # by GLFW's numbers
MOUSE_NAMES: Final = (
    "mouse_left",
    "mouse_right",
    "mouse_middle",
    *(f"mouse_{number}" for number in range(4, 9)),
)  # by number
PAD_NAMES: Final = tuple(
    f"pad_{name}"
    for name in ("a", "b", "x", "y", "left_bumper", "right_bumper", "back", "start", "guide", "left_thumb", "right_thumb",
                 "dpad_up", "dpad_right", "dpad_down", "dpad_left")
)  # fmt: skip
BUTTONS: Final = frozenset({*KEY_NAMES.values(), *MOUSE_NAMES, *PAD_NAMES})
# How far something was moved since before: the pointer [points, right and down], the wheel [notches, away from the hand].
MOTIONS: Final = frozenset({"pointer_x", "pointer_y", "wheel_x", "wheel_y"})
# Where something stands: sticks from -1 to 1 (right and down), triggers from 0 to 1.
AXES: Final = frozenset(
    f"pad_{name}" for name in ("left_x", "left_y", "right_x", "right_y", "left_trigger", "right_trigger")
)
