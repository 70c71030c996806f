"""Playing in a viewer's window: keys, mouse and gamepads go to the running game, until Escape gives them back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from elys.bus.input_echo import InputEcho
from elys.bus.local_players import LocalPlayers
from elys.bus.session import Session
from elys.render_node.play_control import PlayControl
from elys.render_node.window import Window

NOTE: Final = "keys, mouse and gamepads play the game - Escape gives them back"


class Seen(NamedTuple):
    """What the player has before the eyes."""

    tick: int = -1
    time: float = -1.0  # [s] of simulation; below 0: nothing yet


@dataclass(frozen=True, slots=True)
class Seating:
    """As whom the person at a window plays, what players there have bound to which controls, and whether the game has keys and
    mouse as soon as there is one.
    """

    player: int = 1
    bindings: Callable[[int], Mapping[str, str]] = lambda player: {}
    plays_at_once: bool = False


class GameInput:
    """Lends a window's keys and mouse to the game. `seen` tells what is on the screen when something is done."""

    def __init__(
        self,
        session: Session,
        window: Window,
        play: PlayControl,
        *,
        seen: Callable[[], Seen] = Seen,
        host_time: Callable[[], float | None] = lambda: None,
        seating: Seating = Seating(),
    ) -> None:
        self._seen, self._host_time = seen, host_time
        self._echo = InputEcho(session)
        self._window = window
        self._play = play
        self._begins = seating.plays_at_once
        self._players = LocalPlayers(session, player=seating.player, bindings=seating.bindings)

    @property
    def is_on(self) -> bool:
        """Whether the game has them."""
        return self._window.player is not None

    @property
    def note(self) -> tuple[str, ...]:
        """What is told on the picture of it."""
        if not self.is_on:
            return ()
        others = [sender.player for sender in self._players.senders[1:]]
        also = f" - other pads play as {', '.join(map(str, others))}" if others else ""
        refusal = (f"input was refused: {self._players.refusal}",) if self._players.refusal else ()
        return (f"{NOTE}{also}", *refusal)

    @property
    def latency(self) -> tuple[str, ...]:
        """How long it takes until something counts, and until it is seen, once that is known."""
        told = [
            f"{what} after {seconds * 1e3:.0f} ms"
            for what, seconds in (("applied", self._echo.until_applied), ("seen", self._echo.until_seen))
            if seconds is not None
        ]
        return (f"keys {', '.join(told)}",) if told else ()

    def start(self) -> None:
        """Lends them, and lets time go on; where there is a recording or the past, which nobody plays, it does nothing."""
        if self._is_possible():
            self._window.player = self._players.main
            self._players.start(self._window.pads())
            self._echo.start()
            if not self._play.is_playing:
                self._play.toggle()

    def update(self) -> bool:
        """Call it after each look at the window: sends what was done. Whether keys and mouse were just given back."""
        if self._begins and self._is_possible():
            self._begins = False
            self.start()
        if self.is_on and not self._is_possible():
            self._window.player = None
        has_ended = self._window.gave_back
        self._window.gave_back = False
        if has_ended:
            self._players.stop()
            self._echo.stop()
        if self.is_on:
            self._players.update(self._window.pads())
        seen = self._seen()
        if (self.is_on or has_ended) and self._send(seen) and self.is_on:
            self._echo.sent(self._players.main.sequence)
        if self.is_on:
            self._echo.shown(seen.tick)
        return has_ended

    def _send(self, seen: Seen) -> bool:
        return self._players.send(seen_time=seen.time, host_time=self._host_time())

    def _is_possible(self) -> bool:
        status = self._play.status
        is_live = status is not None and status.kind == "simulation" and not status.is_rewound
        return is_live and not self._play.is_lost()
