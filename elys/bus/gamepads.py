"""Gamepads: from what GLFW says of them to what is sent, and which pad plays as whom.

The first pad is of the player who sits at the window. On others somebody presses start, and plays as another from then on. Who a
pad plays as stays, though it be unplugged and come again while play goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final, Generic, Protocol, TypeVar

from elys.bus.input_sender import InputSender
from elys.common.input_names import PAD_NAMES

AXES: Final = (
    "pad_left_x",
    "pad_left_y",
    "pad_right_x",
    "pad_right_y",
    "pad_left_trigger",
    "pad_right_trigger",
)  # in GLFW's order
FINENESS: Final = 512  # steps of a whole way: sticks tremble, and each step is a message
START: Final = PAD_NAMES.index("pad_start")


class PadState(Protocol):
    """What GLFW's `GLFWgamepadstate` holds."""

    @property
    def buttons(self) -> Sequence[int]:
        """1 for each that is down, in the order of `PAD_NAMES`."""

    @property
    def axes(self) -> Sequence[float]:
        """Of sticks -1 to 1, right and down; of triggers -1 (let go) to 1."""


class Glfw(Protocol):
    """What is asked of GLFW, whose module each node that has a window imports."""

    JOYSTICK_LAST: int

    def joystick_is_gamepad(self, joystick_id: int) -> bool: ...
    def get_gamepad_state(self, joystick_id: int) -> PadState | None: ...


def pads_of(glfw: Glfw) -> dict[int, PadState]:
    """How all pads that GLFW knows stand, by the number of the joystick; joysticks of which it knows no buttons are left out."""
    numbers = (number for number in range(glfw.JOYSTICK_LAST + 1) if glfw.joystick_is_gamepad(number))
    states = ((number, glfw.get_gamepad_state(number)) for number in numbers)
    return {number: state for number, state in states if state is not None}


class PadHands(Protocol):
    """Who hears what a pad does, as `InputSender` does."""

    def press(self, name: str) -> None: ...
    def let_go(self, name: str) -> None: ...
    def set_axis(self, name: str, place: float) -> None: ...


_Hands = TypeVar("_Hands", bound=PadHands)


class Gamepad(Generic[_Hands]):
    """One pad: tells a sender what is another than it was."""

    def __init__(self, sender: _Hands) -> None:
        self.sender = sender
        self._down: frozenset[str] = frozenset()
        self._places: dict[str, float] = dict.fromkeys(AXES, 0.0)

    def update(self, state: PadState | None) -> None:
        """As it is now; None: it is unplugged, and lets go of everything."""
        down = frozenset() if state is None else buttons_of(state)
        for name in PAD_NAMES:  # in a fixed order
            if name in down - self._down:
                self.sender.press(name)
            elif name in self._down - down:
                self.sender.let_go(name)
        places = dict.fromkeys(AXES, 0.0) if state is None else places_of(state)
        for name, place in places.items():
            if place != self._places[name]:
                self.sender.set_axis(name, place)
        self._down, self._places = down, places

    def ignore(self, state: PadState) -> None:
        """What is down now counts when it is pressed again; sticks count where they stand."""
        self._down = buttons_of(state)

    def forget(self) -> None:
        """The sender has let go of everything: what is still pushed is told again."""
        self._places = dict.fromkeys(AXES, 0.0)


def buttons_of(state: PadState) -> frozenset[str]:
    """What is down."""
    return frozenset(name for name, is_down in zip(PAD_NAMES, state.buttons, strict=True) if is_down)


def places_of(state: PadState) -> dict[str, float]:
    """Where sticks (-1 to 1) and triggers (0 to 1) stand, in steps."""
    places = {}
    for name, raw in zip(AXES, state.axes, strict=True):
        place = raw / 2.0 + 0.5 if name.endswith("trigger") else raw
        least = 0.0 if name.endswith("trigger") else -1.0
        # NaN, as of a driver that knows no better, is no place: the stick rests.
        places[name] = round(min(max(place, least), 1.0) * FINENESS) / FINENESS if place == place else 0.0
    return places


class Gamepads:
    """All pads of a window. `join` gives the sender of another player, or None where nobody else may play."""

    def __init__(self, sender: InputSender, *, join: Callable[[], InputSender | None]) -> None:
        self._sender = sender
        self._join = join
        self._pads: dict[int, Gamepad[InputSender]] = {}  # by GLFW's number of the joystick
        self._waiting: dict[int, bool] = {}  # whether start was down already, of those that play as nobody yet

    @property
    def senders(self) -> tuple[InputSender, ...]:
        """Of those who play with pads."""
        return tuple(pad.sender for pad in self._pads.values())

    def update(self, states: Mapping[int, PadState]) -> None:
        """Call it once a frame with all pads there are."""
        for number, pad in self._pads.items():
            pad.update(states.get(number))
        self._waiting = {number: was_down for number, was_down in self._waiting.items() if number in states}
        for number in sorted(states.keys() - self._pads.keys()):
            self._meet(number, states)

    def begin(self, states: Mapping[int, PadState]) -> None:
        """Somebody begins to play: what is down already counts when it is pressed again; pads that are gone are nobody's."""
        self._waiting = dict.fromkeys(states, True)
        self._pads = {number: pad for number, pad in self._pads.items() if number in states}
        for number, pad in self._pads.items():
            pad.ignore(states[number])
            pad.forget()
        self.update(states)

    def _meet(self, number: int, states: Mapping[int, PadState]) -> None:
        state = states[number]
        is_first = not any(pad.sender is self._sender and other in states for other, pad in self._pads.items())
        if is_first:
            sender: InputSender | None = self._sender
        else:
            is_down, was_down = bool(state.buttons[START]), self._waiting.get(number, True)
            self._waiting[number] = is_down
            sender = self._join() if is_down and not was_down else None
        if sender is not None:
            self._waiting.pop(number, None)
            pad = self._pads[number] = Gamepad(sender)
            pad.ignore(state)
            pad.update(state)
