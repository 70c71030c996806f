"""A control is chosen by using it: what somebody presses, pushes or moves does something from now on.

What has a name has controls at keyboard and mouse and others at gamepads; one that is chosen takes the place of those of its
own kind.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final, Literal

from elys.common.input_bindings import shared_controls
from elys.common.input_controls import CROSSES, STICKS, Control, Sort, controls_of
from elys.common.input_names import AXES, BUTTONS, MOTIONS

Device = Literal["hands", "pad"]
DEVICES: Final[tuple[Device, ...]] = ("hands", "pad")  # keyboard and mouse; gamepads
PUSHED: Final = 0.6  # of a way, from which on a stick or a trigger is meant
AT_REST: Final = 0.4  # below which it was before: one that hangs is not meant
SWEEP: Final = 250.0  # [points] of the pointer's way from which on it is meant
_ASKED: Final[Mapping[Sort, tuple[str, ...]]] = {
    "action": ("it",),
    "axis": ("less", "more"),
    "vector": ("left", "right", "down", "up"),
}
_PARTS: Final = {"kp": "keypad", "pad": ""}  # words of a name that are said otherwise
_WHOLE: Final = {
    "pad_left": "left stick",
    "pad_right": "right stick",
    "pad_dpad": "cross",
    "pointer": "mouse",
    "wheel": "wheel",
    "pad_left_x": "left stick, across",
    "pad_left_y": "left stick, down",
    "pad_right_x": "right stick, across",
    "pad_right_y": "right stick, down",
    "pointer_x": "mouse, across",
    "pointer_y": "mouse, down",
    "wheel_x": "wheel, across",
    "wheel_y": "wheel",
}
_WAYS: Final = {  # of an action, by the sign and the end of the name
    ("+", "_x"): " right",
    ("-", "_x"): " left",
    ("+", "_y"): " down",
    ("-", "_y"): " up",
}


class Rebinding:
    """Listens until it has heard the control of an action, an axis or a vector.

    An action takes a key, a button, a push of a stick or trigger or a turn of the wheel; an axis two keys or buttons one after
    the other, a stick's axis, one trigger for each way or the wheel; a vector four keys or buttons, a stick, the cross or the
    pointer.
    """

    def __init__(self, sort: Sort, *, pushed: Iterable[str] = ()) -> None:
        """`pushed` are the sticks and triggers that are pushed already: they count when they were let go of."""
        self.sort = sort
        self.heard = ""  # the control as it is written, once it is whole
        self._names: list[str] = []  # keys, buttons or triggers so far
        self._hanging = set(pushed)
        self._swept = 0.0  # [points]

    @property
    def asked(self) -> str:
        """What is to be pressed next: "it", or a way: "less", "left", ...; "" once it is whole."""
        return "" if self.heard else _ASKED[self.sort][len(self._names)]

    def press(self, name: str) -> None:
        """A key or button went down; unknown ones are passed over, as are those of another kind of device than before."""
        if self.heard or name not in BUTTONS or name in self._names:
            return
        if self.sort == "vector" and not self._names and (cross := _cross_with(name)):
            self.heard = cross
        elif not self._names or (
            _device_of_name(name) == _device_of_name(self._names[0]) and self._names[0] in BUTTONS
        ):
            self._take(name)

    def push(self, axis: str, place: float) -> None:
        """A stick (-1 to 1) or a trigger (0 to 1) stands there."""
        if abs(place) < AT_REST:
            self._hanging.discard(axis)
        if self.heard or abs(place) < PUSHED or axis not in AXES or axis in self._hanging:
            return
        is_trigger = axis.endswith("_trigger")
        if self.sort == "vector":
            stick = next((stick for stick, axes in STICKS.items() if axis in axes), "")
            self.heard = "" if self._names else stick
        elif self.sort == "action":
            self.heard = ("+" if place > 0.0 else "-") + axis
        elif not is_trigger and not self._names:
            self.heard = axis if place < 0.0 else f"-{axis}"  # it was pushed to where there is to be less
        elif is_trigger and axis not in self._names and all(name in AXES for name in self._names):
            self._take(axis)

    def move(self, motion: str, distance: float) -> None:
        """The pointer [points] or the wheel [notches] went on."""
        if self.heard or self._names or motion not in MOTIONS or not distance:
            return
        if motion.startswith("wheel") and self.sort != "vector":
            is_less = distance > 0.0
            self.heard = (
                ("+" if distance > 0.0 else "-") + motion
                if self.sort == "action"
                else (f"-{motion}" if is_less else motion)
            )
        elif motion.startswith("pointer") and self.sort == "vector":
            self._swept += abs(distance)
            self.heard = "pointer" if self._swept >= SWEEP else ""

    def _take(self, name: str) -> None:
        self._names.append(name)
        if len(self._names) == len(_ASKED[self.sort]):
            # Two triggers are no pair of buttons: each says how far.
            pushed = self.sort == "axis" and self._names[0] in AXES
            self.heard = f"-{self._names[0]}, {self._names[1]}" if pushed else "/".join(self._names)


def device_of(control: Control) -> Device:
    """At which kind of device it is."""
    return _device_of_name(control.names[0])


def controls_at(sort: Sort, text: str, device: Device) -> tuple[str, ...]:
    """Those of a text's controls that are at a device, as they are written. InputError as `controls_of`."""
    words = (word.strip() for word in text.split(","))
    return tuple(
        word
        for word, control in zip(words, controls_of(sort, text), strict=bool(text.strip()))
        if device_of(control) == device
    )


def with_control(sort: Sort, text: str, chosen: str) -> str:
    """A text in which what was chosen is the only control at its device. It keeps what another of the same form was fine-tuned to
    (`dead=`, `curve=`, `scale=`, `flip=`). InputError as `controls_of`.
    """
    device, form = device_of(controls_of(sort, chosen)[0]), controls_of(sort, chosen)[0].form
    kept: dict[Device, list[str]] = {each: list(controls_at(sort, text, each)) for each in DEVICES}
    options = next((" ".join(one.split()[1:]) for one in kept[device] if controls_of(sort, one)[0].form == form), "")
    kept[device] = [f"{word.strip()} {options}".strip() for word in chosen.split(",")]
    return ", ".join(word for each in DEVICES for word in kept[each])


def told_controls(sort: Sort, text: str, device: Device) -> str:
    """A text's controls at a device as people call them: "W A S D, arrows" is `a/d/s/w, left/right/down/up`."""
    return ", ".join(_told(sort, word.split()[0]) for word in controls_at(sort, text, device))


def told_name(name: str) -> str:
    """What an action, an axis or a vector is called: `high_jump` is "High jump"."""
    return name.replace("_", " ").strip().capitalize()


def conflicts_of(name: str, controls: Mapping[str, tuple[Control, ...]]) -> str:
    """With what it shares controls, in a sentence; "" where it shares none."""
    shared = [(part, names) for part, names in shared_controls(controls) if name in names]
    return "; ".join(
        f"{_told('action', part)} does {', '.join(told_name(other) for other in names if other != name)} as well"
        for part, names in shared
    )


def _told(sort: Sort, word: str) -> str:
    keys = word.split("/")
    if len(keys) == 4:
        left, right, down, up = keys
        arrows = keys == ["left", "right", "down", "up"]
        return "arrows" if arrows else " ".join(map(_told_key, (up, left, down, right)))
    if len(keys) > 1:
        return " ".join(map(_told_key, keys))
    sign = word[0] if word[0] in "+-" else ""
    name = word.removeprefix(sign)
    if sort != "action":
        return _WHOLE.get(name, _told_key(name)) + (" (turned round)" if sign == "-" else "")
    if name.startswith("wheel"):
        sign = "-" if sign == "+" else "+"  # it counts away from the hand, which is up; all else counts down
    stem, way = (name[:-2], _WAYS.get((sign, name[-2:]), "")) if name in AXES | MOTIONS else (name, "")
    return (_WHOLE.get(stem, _told_key(stem)) if way else _told_key(name)) + way


def _told_key(name: str) -> str:
    words = [said for word in name.split("_") if (said := _PARTS.get(word, word))]
    return " ".join(words).upper() if len(words) == 1 and len(words[0]) == 1 else " ".join(words)


def _device_of_name(name: str) -> Device:
    return "pad" if name.startswith("pad_") else "hands"


def _cross_with(name: str) -> str:
    return next((cross for cross, buttons in CROSSES.items() if name in buttons), "")
