"""Playing in a viewer's window: keys, mouse and gamepads go to the running game, until Escape gives them back.

F1, or a script that tells the event `controls_wanted`, puts a card over the picture on which the player binds them anew.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from elys.bus import topics
from elys.bus.gamepads import Gamepad
from elys.bus.input_echo import InputEcho
from elys.bus.local_players import LocalPlayers
from elys.bus.messages.session import EventBatch
from elys.bus.scene_controls import asked_input_map
from elys.bus.session import Session
from elys.bus.transports.transport import Closer
from elys.common.components import InputMap
from elys.common.errors import BusError, MessageError
from elys.render_node.controls_card import ControlsCard
from elys.render_node.overlays import Overlays
from elys.render_node.play_control import PlayControl
from elys.render_node.window import Window

NOTE: Final = "keys, mouse and gamepads play the game - F1 shows which does what, Escape gives them back"
WANTED: Final = "controls_wanted"  # an event of scripts, with the player whose card is to be shown


class Seen(NamedTuple):
    """What the player has before the eyes."""

    tick: int = -1
    time: float = -1.0  # [s] of simulation; below 0: nothing yet


@dataclass(frozen=True, slots=True)
class Seating:
    """As whom the person at a window plays, what players there have bound to which controls, whether the game has keys and
    mouse as soon as there is one, and who keeps what players bind there: it may raise InputError.
    """

    player: int = 1
    bindings: Callable[[int], Mapping[str, str]] = lambda player: {}
    plays_at_once: bool = False
    keep: Callable[[int, Mapping[str, str]], None] = lambda player, bindings: None


class GameInput:
    """Lends a window's keys and mouse to the game. `seen` tells what is on the screen when something is done, `declared` what
    players can do in the scene; by default the host is asked.
    """

    def __init__(
        self,
        session: Session,
        window: Window,
        play: PlayControl,
        *,
        seen: Callable[[], Seen] = Seen,
        host_time: Callable[[], float | None] = lambda: None,
        seating: Seating = Seating(),
        declared: Callable[[], Awaitable[InputMap]] | None = None,
    ) -> None:
        self._session = session
        self._seating = seating
        self._seen, self._host_time = seen, host_time
        self._declared = declared or (lambda: asked_input_map(session))
        self._card: _OpenCard | None = None
        self._is_asking = False  # what there is to be bound
        self._trouble = ""  # why the card cannot be shown
        self._close_events: Closer | None = None
        window.keeps = self._keeps
        self._echo = InputEcho(session)
        self._window = window
        self._play = play
        self._begins = seating.plays_at_once
        self._players = LocalPlayers(session, player=seating.player, bindings=seating.bindings)

    @property
    def is_on(self) -> bool:
        """Whether the game has them."""
        return self._window.player is self._players.main

    @property
    def is_busy(self) -> bool:
        """Whether somebody plays or binds keys: the window is to be looked at often."""
        return self._window.player is not None

    @property
    def card_version(self) -> int:
        """Another number whenever the card looks otherwise; -1 where none is shown."""
        return -1 if self._card is None else self._card.card.version

    def over(self, overlays: Overlays) -> Overlays:
        """What a scene shows over the picture, with the card over that."""
        if self._card is None:
            return overlays
        nodes = overlays.nodes
        return overlays._replace(nodes=(*nodes, *self._card.card.nodes(len(nodes))))

    @property
    def note(self) -> tuple[str, ...]:
        """What is told on the picture of it."""
        trouble = (self._trouble,) if self._trouble else ()
        if not self.is_on:
            return trouble
        others = [sender.player for sender in self._players.senders[1:]]
        also = f" - other pads play as {', '.join(map(str, others))}" if others else ""
        refusal = (f"input was refused: {self._players.refusal}",) if self._players.refusal else ()
        return (f"{NOTE}{also}", *refusal, *trouble)

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
            self._lend()
            if not self._play.is_playing:
                self._play.toggle()

    def show_controls(self) -> None:
        """Puts the card over the picture as soon as it is known what there is to be bound; where there is no game, nothing."""
        if self._card is None and not self._is_asking and self._is_possible():
            self._is_asking = True
            self._session.start(self._open_card())

    def update(self) -> bool:
        """Call it after each look at the window: sends what was done. Whether keys and mouse were just given back."""
        if self._begins and self._is_possible():
            self._begins = False
            self.start()
        if self.is_busy and not self._is_possible():
            self._window.player = None
        if self._card is not None:
            return self._use_card(self._card)
        has_ended = self._window.gave_back
        self._window.gave_back = False
        if has_ended:
            self._end()
        if self.is_on:
            self._players.update(self._window.pads())
        seen = self._seen()
        if (self.is_on or has_ended) and self._send(seen) and self.is_on:
            self._echo.sent(self._players.main.sequence)
        if self.is_on:
            self._echo.shown(seen.tick)
        return has_ended

    def _lend(self) -> None:
        self._window.player = self._players.main
        self._players.start(self._window.pads())
        self._echo.start()
        if self._close_events is None:
            self._close_events = self._session.subscribe(topics.EVENTS, self._heard)

    def _end(self) -> None:
        self._players.stop()
        self._echo.stop()
        if self._close_events is not None:
            self._close_events()
            self._close_events = None

    def _keeps(self, name: str) -> bool:
        """A key of the window's own; while the card is shown it has them all."""
        if self._card is not None or name not in ("escape", "f1"):
            return False
        if name == "escape":
            self._window.player = None
        else:
            self.show_controls()
        return True

    def _heard(self, batch: EventBatch, _: str) -> None:
        if any(event.kind == WANTED and event.values.get("player") == self._seating.player for event in batch.events):
            self.show_controls()

    async def _open_card(self) -> None:
        self._trouble = ""
        try:
            declared = await self._declared()
        except (BusError, MessageError) as error:
            self._trouble = f"what can be bound here is not known: {error}"
            return
        finally:
            self._is_asking = False
        if not self._is_possible():
            return
        player = self._seating.player
        card = ControlsCard(declared, self._seating.bindings(player), lambda bound: self._seating.keep(player, bound))
        plays = self.is_on
        if plays:  # nobody plays who binds keys: all that is held is let go of
            self._end()
            self._send(self._seen())
        self._card = _OpenCard(card, plays=plays)
        self._card.look(self._window, is_first=True)
        self._window.player = card

    def _use_card(self, shown: _OpenCard) -> bool:
        """Whether the picture is to be drawn anew."""
        has_left, self._window.gave_back = self._window.gave_back, False
        shown.look(self._window)
        if has_left or not shown.card.is_open:
            self._card = None
            if shown.plays and not has_left:
                self._lend()
            else:
                self._window.player, self._window.gave_back = None, False
            return True
        return shown.is_news()

    def _send(self, seen: Seen) -> bool:
        return self._players.send(seen_time=seen.time, host_time=self._host_time())

    def _is_possible(self) -> bool:
        status = self._play.status
        is_live = status is not None and status.kind == "simulation" and not status.is_rewound
        return is_live and not self._play.is_lost()


class _OpenCard:
    """The card, with the gamepad that works it besides the window's keys."""

    def __init__(self, card: ControlsCard, *, plays: bool) -> None:
        self.card = card
        self.plays = plays  # as it was opened: then they play again when it is closed
        self._pad = Gamepad(card)
        self._drawn = -1

    def look(self, window: Window, *, is_first: bool = False) -> None:
        """Hears what the first pad does; what is down already `is_first` counts when it is pressed again."""
        pads = window.pads()
        state = pads[min(pads)] if pads else None
        if is_first and state is not None:
            self._pad.ignore(state)
        self._pad.update(state)

    def is_news(self) -> bool:
        """Whether it looks otherwise than when this was asked last."""
        drawn, self._drawn = self._drawn, self.card.version
        return drawn != self._drawn
