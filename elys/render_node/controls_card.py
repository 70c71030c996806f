"""The card over the picture on which a player sees what can be done and with which controls, and chooses others by using them.

It is laid out with the overlays that scenes have, but it is the window's own: no simulation knows of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from elys.common.components import InputMap, Overlay, OverlayPanel, OverlayText
from elys.common.errors import InputError
from elys.common.input_controls import Sort, controls_of
from elys.common.input_rebinding import AT_REST, Rebinding, conflicts_of, told_controls, told_name, with_control
from elys.render_node.overlays import OverlayNode

ORDER: Final = 1_000_000  # above whatever a scene shows
WIDTH: Final = 1.3  # heights of the picture
ROW: Final = 0.052
SIZE: Final = 0.03  # of letters
SHOWN: Final = 11  # rows at a time
COLUMNS: Final = (0.03, 0.36, 0.86)  # name, keyboard and mouse, gamepad, from the card's left edge
PUSHED: Final = 0.5  # of a stick's way, from which on it leans
PLAIN, CHOSEN, FAINT, OWN, WARNING = (
    (0.75, 0.77, 0.8),
    (1.0, 0.8, 0.25),
    (0.4, 0.42, 0.46),
    (0.45, 0.8, 1.0),
    (1.0, 0.35, 0.15),
)
UP, DOWN = frozenset({"up", "w", "pad_dpad_up"}), frozenset({"down", "s", "pad_dpad_down"})
CHOOSE: Final = frozenset({"enter", "kp_enter", "space", "mouse_left", "pad_a"})
RESET: Final = frozenset({"backspace", "delete", "pad_x"})
CLOSE: Final = frozenset({"escape", "f1", "mouse_right", "pad_b", "pad_start"})
SHOW: Final = "f1"
CANCEL: Final = "escape"  # this one and the one before cannot be bound
ALL: Final = "All as the scene has them"
HELP: Final = "up, down: choose    enter: bind anew    backspace: as the scene has it    escape: back"
_ASKS: Final[Mapping[str, str]] = {
    "it": "press the key or button for it, push a stick or turn the wheel",
    "less": "press the key or button for less, or push a stick that way",
    "more": "and now for more",
    "left": "press the key for left, push a stick or the cross, or sweep with the mouse",
    "right": "and now for right",
    "down": "and now for down",
    "up": "and now for up",
}


class Row(NamedTuple):
    """What can be done: its name, and its controls in the scene."""

    sort: Sort
    name: str
    usual: str


class ControlsCard:
    """Hears what the player does, as `InputSender` would, while it is open.

    `keep` writes down what was bound, and raises InputError with a sentence where that cannot be.
    """

    def __init__(
        self, declared: InputMap, bindings: Mapping[str, str], keep: Callable[[Mapping[str, str]], None]
    ) -> None:
        self.rows = rows_of(declared)
        self.is_open = True
        self.bindings = dict(bindings)
        self.chosen = 0
        self.message = ""  # what came of the last thing that was done
        self._keep = keep
        self._listening: Rebinding | None = None
        self._lean = 0  # which way a stick leans: -1 up, 1 down
        self._places: dict[str, float] = {}  # of sticks and triggers
        self.version = 0  # rises when it looks otherwise

    # --- what the player does

    def press(self, name: str) -> None:
        """A key or a button went down."""
        self.version += 1
        if self._listening is not None:
            if name == CANCEL:
                self._listening, self.message = None, ""
            elif name == SHOW:
                self.message = "F1 shows this card, and can do nothing else"
            else:
                self._listening.press(name)
                self._take_heard()
        elif name in UP:
            self._step(-1)
        elif name in DOWN:
            self._step(1)
        elif name in CHOOSE:
            self._choose()
        elif name in RESET:
            self._reset(self.rows[self.chosen].name if self.chosen < len(self.rows) else "")
        elif name in CLOSE:
            self.is_open = False

    def let_go(self, name: str) -> None:
        """A key or a button went up."""

    def set_axis(self, name: str, place: float) -> None:
        """A stick or a trigger stands there."""
        self._places[name] = place
        if self._listening is not None:
            self._listening.push(name, place)
            self._take_heard()
        elif name == "pad_left_y":
            leaned, self._lean = self._lean, (place > PUSHED) - (place < -PUSHED)
            if self._lean and self._lean != leaned:
                self._step(self._lean)

    def move(self, name: str, distance: float) -> None:
        """The pointer or the wheel went on."""
        if self._listening is not None:
            self._listening.move(name, distance)
            self._take_heard()
        elif name == "wheel_y" and distance:
            self._step(-1 if distance > 0.0 else 1)

    def type(self, text: str) -> None:
        """A text was typed."""

    # --- what comes of it

    def text_of(self, row: Row) -> str:
        """The controls of a name as they are now; those of the scene where what is bound to the name means nothing here."""
        bound = self.bindings.get(row.name)
        if bound is None:
            return row.usual
        try:
            controls_of(row.sort, bound)
        except InputError:  # bound in another scene, where the name is of another sort
            return row.usual
        return bound

    def _step(self, step: int) -> None:
        self.version += 1
        self.chosen = (self.chosen + step) % (len(self.rows) + 1)
        self.message = ""

    def _choose(self) -> None:
        if self.chosen == len(self.rows):
            self._reset("")
            return
        pushed = (name for name, place in self._places.items() if abs(place) >= AT_REST)
        self._listening, self.message = Rebinding(self.rows[self.chosen].sort, pushed=pushed), ""

    def _take_heard(self) -> None:
        listening = self._listening
        if listening is None or not listening.heard:
            return
        self._listening = None
        self.version += 1
        row = self.rows[self.chosen]
        if self._write({**self.bindings, row.name: with_control(row.sort, self.text_of(row), listening.heard)}):
            controls = {row.name: controls_of(row.sort, self.text_of(row)) for row in self.rows}
            self.message = conflicts_of(row.name, controls)

    def _reset(self, name: str) -> None:
        """One name as the scene has it; "": all that this scene has."""
        names = {name} if name else {row.name for row in self.rows}
        self._write({bound: text for bound, text in self.bindings.items() if bound not in names})

    def _write(self, bindings: dict[str, str]) -> bool:
        self.message = ""
        try:
            if bindings != self.bindings:
                self._keep(bindings)
        except InputError as error:
            self.message = str(error)
            return False
        self.bindings = bindings
        return True

    # --- what is seen

    def nodes(self, first: int = 0) -> tuple[OverlayNode, ...]:
        """As overlays, of which the first will be in row `first` of a picture's."""
        lines = [(told_name(row.name), *self._told(row), row.name in self.bindings) for row in self.rows]
        lines.append((ALL, "", "", False))
        start = min(max(self.chosen - SHOWN // 2, 0), max(len(lines) - SHOWN, 0))
        shown = lines[start : start + SHOWN]
        height = ROW * (len(shown) + 4.2)
        made = [
            _node(-1, Overlay(anchor="center", width=WIDTH, height=height, order=ORDER), OverlayPanel(opacity=0.92))
        ]

        def write(x: float, y: float, text: str, color: tuple[float, float, float], size: float = SIZE) -> None:
            place = Overlay(x=x, y=y, order=ORDER)
            # No braces: they stand for a number in the texts of overlays.
            told = OverlayText(text=text.replace("{", "(").replace("}", ")"), size=size, color=color)
            made.append(_node(first, place, text=told))

        write(COLUMNS[0], 0.02, "Controls", CHOSEN, SIZE * 1.3)
        write(COLUMNS[1], 0.028, "keyboard and mouse", FAINT)
        write(COLUMNS[2], 0.028, "gamepad", FAINT)
        y = ROW * 1.5
        for number, (name, hands, pad, is_own) in enumerate(shown, start):
            is_chosen = number == self.chosen
            if is_chosen:
                band = Overlay(x=0.015, y=y - 0.007, width=WIDTH - 0.03, height=ROW * 0.95, order=ORDER)
                made.append(_node(first, band, OverlayPanel(color=(0.1, 0.12, 0.16), opacity=0.9, radius=0.01)))
            color = CHOSEN if is_chosen else OWN if is_own else PLAIN
            for x, text in zip(COLUMNS, (name, hands, pad), strict=True):
                write(x, y, text, color)
            y += ROW
        if (hidden := len(lines) - len(shown)) > 0:
            write(COLUMNS[0], y, f"{hidden} more", FAINT, SIZE * 0.8)
        y += ROW * 0.6
        asked = self._listening.asked if self._listening is not None else ""
        if asked:
            write(COLUMNS[0], y, f"{told_name(self.rows[self.chosen].name)}: {_ASKS[asked]}", CHOSEN, SIZE * 0.9)
        else:
            write(COLUMNS[0], y, _shortened(self.message), WARNING, SIZE * 0.8)
        write(COLUMNS[0], y + ROW, "escape: as it was" if asked else HELP, FAINT, SIZE * 0.8)
        return tuple(made)

    def _told(self, row: Row) -> tuple[str, str]:
        text = self.text_of(row)
        return told_controls(row.sort, text, "hands") or "-", told_controls(row.sort, text, "pad") or "-"


def rows_of(declared: InputMap) -> list[Row]:
    """All that can be done in a scene: directions, then actions, then axes, each in the scene's order."""
    sorts: tuple[tuple[Sort, Mapping[str, object]], ...] = (
        ("vector", declared.vectors),
        ("action", declared.actions),
        ("axis", declared.axes),
    )
    return [Row(sort, name, str(text)) for sort, names in sorts for name, text in names.items()]


def _node(
    parent: int, overlay: Overlay, panel: OverlayPanel | None = None, text: OverlayText | None = None
) -> OverlayNode:
    return OverlayNode(0, parent, overlay, panel, None, None, text)


def _shortened(text: str, most: int = 96) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"
