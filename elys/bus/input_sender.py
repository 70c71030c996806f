"""Keys, buttons and axes on their way to the simulation: what happens between two frames is one message, in order."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Any, Final

from elys.bus import topics
from elys.bus.messages.commands import Input
from elys.bus.session import Session
from elys.common.input_names import AXES, BUTTONS, MOTIONS

MOST_CHANGES: Final = 200  # of keys and buttons in one message; what comes beyond waits for the next
MOST_TEXT: Final = 200  # characters


class InputSender:
    """Speaks for one player. Nothing is sent while nothing happens; nobody answers: `commands` tells what was applied."""

    def __init__(self, session: Session, *, player: int = 1) -> None:
        self._session = session
        self.player = player
        self._bindings: dict[str, str] | None = None  # that wait to be sent
        self._held: set[str] = set()
        self.sequence = 0  # of the last message
        self._lets_go = False
        self._changes: deque[tuple[str, bool]] = deque()
        self._moved: dict[str, float] = {}
        self._axes: dict[str, float] = {}
        self._text = ""

    @property
    def held(self) -> frozenset[str]:
        """What is down."""
        return frozenset(self._held)

    def press(self, name: str) -> None:
        """A key or button went down; held ones and unknown ones are passed over."""
        if name in BUTTONS and name not in self._held:
            self._held.add(name)
            self._changes.append((name, True))

    def let_go(self, name: str) -> None:
        """It went up."""
        if name in self._held:
            self._held.discard(name)
            self._changes.append((name, False))

    def move(self, name: str, distance: float) -> None:
        """Pointer or wheel went on by a distance, see `input_names.MOTIONS`."""
        if name in MOTIONS and math.isfinite(distance):
            self._moved[name] = self._moved.get(name, 0.0) + distance

    def set_axis(self, name: str, place: float) -> None:
        """A stick stands elsewhere, see `input_names.AXES`; beyond its end it is at its end."""
        if name in AXES and math.isfinite(place):
            self._axes[name] = min(max(place, -1.0), 1.0)

    def type(self, text: str) -> None:
        """A text was typed."""
        self._text = (self._text + text)[:MOST_TEXT]

    def bind(self, bindings: Mapping[str, str]) -> None:
        """The player has bound names to controls of his own, see `input_controls`: these, and no others."""
        self._bindings = dict(bindings)

    def let_go_of_all(self) -> None:
        """Nobody plays here any more: what waits is dropped, and all that is held is let go."""
        self._lets_go = True
        self._held.clear()
        self._changes.clear()
        self._moved, self._axes, self._text = {}, {}, ""

    def send(self, *, seen_time: float = -1.0, host_time: float | None = None) -> bool:
        """Call it once a frame: sends what has happened since. Whether there was anything.

        The player saw a simulation time [s] when the host's clock said `host_time` [s since 1970], see `host_clock`.
        """
        stamps: dict[str, Any] = {"player": self.player, "seen_time": seen_time, "done_at": host_time or 0.0}
        bindings, self._bindings = self._bindings, None
        if bindings is not None:  # alone: they may be refused, and what was let go must not be with them
            self._publish(Input(sequence=self.sequence + 1, bindings=bindings, **stamps))
        changes = tuple(self._changes.popleft() for _ in range(min(len(self._changes), MOST_CHANGES)))
        moved = {name: distance for name, distance in self._moved.items() if distance}
        if not (self._lets_go or changes or moved or self._axes or self._text):
            return bindings is not None
        message = Input(
            sequence=self.sequence + 1,
            lets_go=self._lets_go,
            changes=changes,
            moved=moved,
            axes=self._axes,
            text=self._text,
            **stamps,
        )
        self._lets_go, self._moved, self._axes, self._text = False, {}, {}, ""
        self._publish(message)
        return True

    def _publish(self, message: Input) -> None:
        self.sequence = message.sequence
        self._session.publish(topics.INPUT, message, key=self._session.node.id)
