"""How it is written which keys, sticks and motions do something: texts of scenes, of files of bindings and of the bus.

    space, pad_a                              an action: any of them; +pad_left_x, -wheel_y: pushed or turned that way
    a/d, pad_left_x dead=0.2 curve=0.5        an axis: left or down, and right or up; -pad_left_y the other way round
    a/d/s/w, pad_left, pointer scale=1.5      a vector: left, right, down, up; a stick; the pointer

Controls are separated by commas, their options by spaces. Names are those of `input_names`.
"""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import Final, Literal

import msgspec

from elys.common.errors import InputError
from elys.common.input_names import AXES, BUTTONS, MOTIONS
from elys.common.input_response import MOST_DEAD_ZONE

Sort = Literal["action", "axis", "vector"]
SORTS: Final[tuple[Sort, ...]] = ("action", "axis", "vector")
STICKS: Final = {"pad_left": ("pad_left_x", "pad_left_y"), "pad_right": ("pad_right_x", "pad_right_y")}
GLIDES: Final = {"pointer": ("pointer_x", "pointer_y"), "wheel": ("wheel_x", "wheel_y")}
CROSSES: Final = {"pad_dpad": ("pad_dpad_left", "pad_dpad_right", "pad_dpad_down", "pad_dpad_up")}
LARGEST_SCALE: Final = 100.0
MOST_CONTROLS: Final = 16  # of one name
LONGEST: Final = 300  # characters of a text
LONGEST_NAME: Final = 60
_SHORTEST_WORD: Final = 40  # characters of a word as it stands in a sentence

Form = Literal["button", "pair", "cross", "axis", "stick", "motion", "glide"]
_ANALOG: Final = ("axis", "stick")


class Control(msgspec.Struct, frozen=True, kw_only=True):
    """One of the things that do something.

    Attributes:
        form: "button"; "pair" of buttons (less, more); "cross" of four (left, right, down, up); "axis" of a pad; "stick" (two of
            them); "motion" of pointer or wheel; "glide" (two of them).
        names: as `input_names` has them, as many as the form says.
        sign: -1.0 where it counts the other way round.
        dead_zone: of the way; None: the scene's. curve: likewise.
        scale: by which what it says is multiplied.
        flip_x, flip_y: whether a vector's parts are turned round.
    """

    form: Form
    names: tuple[str, ...]
    sign: float = 1.0
    dead_zone: float | None = None
    curve: float | None = None
    scale: float = 1.0
    flip_x: bool = False
    flip_y: bool = False

    @property
    def is_motion(self) -> bool:
        """Whether it says how far something went, and not where something stands."""
        return self.form in ("motion", "glide")


@lru_cache(maxsize=1024)
def controls_of(sort: Sort, text: str) -> tuple[Control, ...]:
    """The controls that a text names for an action, an axis or a vector; none for an empty one.

    Raises:
        InputError: something in it is no control, or none of that sort: which word, and what may stand there.
    """
    if len(text) > LONGEST:
        raise InputError(f"controls are told in at most {LONGEST} characters, not {len(text)}")
    if not text.strip():
        return ()
    parts = text.split(",")
    if len(parts) > MOST_CONTROLS:
        raise InputError(f"at most {MOST_CONTROLS} controls do one thing, not {len(parts)}")
    return tuple(_control(sort, part.split()) for part in parts)


def sorts_taking(text: str) -> tuple[Sort, ...]:
    """What a text could be the controls of; InputError if of nothing."""
    taking, reasons = [], []
    for sort in SORTS:
        try:
            controls_of(sort, text)
        except InputError as error:
            reasons.append(error)
        else:
            taking.append(sort)
    if not taking:
        raise reasons[-1] if "/" in text and text.count("/") > 2 else reasons[0]
    return tuple(taking)


def check_name(name: str) -> None:
    """Raises InputError for what cannot be the name of an action, an axis or a vector."""
    if len(name) > LONGEST_NAME or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        raise InputError(
            f"{name[:LONGEST_NAME]!r} is no name: up to {LONGEST_NAME} letters, digits and _, not beginning with a digit"
        )
    if name in AXES or name in MOTIONS:
        raise InputError(f"{name} is what a device is called: give what is done with it another name")


def _control(sort: Sort, words: list[str]) -> Control:
    if not words:
        raise InputError("between two commas stands no control")
    head, *options = words
    control = {"action": _of_action, "axis": _of_axis, "vector": _of_vector}[sort](head)
    values: dict[str, float | bool] = {}
    for option in options:
        for name, value in _option(control, sort, option).items():
            if name in values:
                raise InputError(f"{head} has the option {option.partition('=')[0]} twice")
            values[name] = value
    return msgspec.structs.replace(control, **values)


def _of_action(head: str) -> Control:
    sign, name = _signed(head)
    if name in BUTTONS and name == head:
        return Control(form="button", names=(name,))
    if name in AXES:
        return Control(form="axis", names=(name,), sign=sign)
    if name in MOTIONS:
        return Control(form="motion", names=(name,), sign=sign)
    raise InputError(
        f"{_shown(head)} is no control of an action: name a key or button (space, mouse_left, pad_a), or a way to push or turn "
        "(+pad_right_trigger, -wheel_y)"
    )


def _of_axis(head: str) -> Control:
    sign, name = _signed(head)
    keys = tuple(head.split("/"))
    if len(keys) == 2 and set(keys) <= BUTTONS:
        return Control(form="pair", names=keys)
    if name in BUTTONS:
        return Control(form="button", names=(name,), sign=sign)
    if name in AXES:
        return Control(form="axis", names=(name,), sign=sign)
    if name in MOTIONS:
        return Control(form="motion", names=(name,), sign=sign)
    raise InputError(
        f"{_shown(head)} is no control of an axis: name two keys (a/d), one key (w, -s), an axis of a pad (pad_left_x, "
        "-pad_left_trigger) or a motion (wheel_y, pointer_x)"
    )


def _of_vector(head: str) -> Control:
    keys = tuple(head.split("/"))
    if len(keys) == 4 and set(keys) <= BUTTONS:
        return Control(form="cross", names=keys)
    if head in CROSSES:
        return Control(form="cross", names=CROSSES[head])
    if head in STICKS:
        return Control(form="stick", names=STICKS[head])
    if head in GLIDES:
        return Control(form="glide", names=GLIDES[head])
    known = ", ".join((*STICKS, *CROSSES, *GLIDES))
    raise InputError(
        f"{_shown(head)} is no control of a vector: name four keys for left, right, down and up (a/d/s/w), or {known}"
    )


def _option(control: Control, sort: Sort, option: str) -> dict[str, float | bool]:
    name, is_given, value = option.partition("=")
    if name == "flip" and is_given and sort == "vector":
        if value not in ("x", "y", "xy"):
            raise InputError(f"flip is x, y or xy, not {_shown(value)}")
        return {f"flip_{part}": True for part in value}
    if name in ("dead", "curve") and is_given and sort != "action":
        if control.form not in _ANALOG:
            raise InputError(f"{'/'.join(control.names)} has no {name}: only sticks and triggers have")
        field, most = ("dead_zone", MOST_DEAD_ZONE) if name == "dead" else ("curve", 1.0)
        return {field: _number(name, value, 0.0, most)}
    if name == "scale" and is_given and sort != "action":
        return {"scale": _number(name, value, -LARGEST_SCALE, LARGEST_SCALE)}
    takes = {"action": "no options", "axis": "dead=, curve= and scale=", "vector": "dead=, curve=, scale= and flip="}
    raise InputError(
        f"{_shown(option)} is no option: controls of {'an' if sort != 'vector' else 'a'} {sort} take {takes[sort]}"
    )


def _number(name: str, text: str, least: float, most: float) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not least <= number <= most:
        raise InputError(f"{name} is a number from {least:g} to {most:g}, not {_shown(text)}")
    return number


def _signed(head: str) -> tuple[float, str]:
    return (-1.0 if head.startswith("-") else 1.0), head.removeprefix("-" if head.startswith("-") else "+")


def _shown(word: str) -> str:
    return repr(word if len(word) <= _SHORTEST_WORD else f"{word[:_SHORTEST_WORD]}...")
