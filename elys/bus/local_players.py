"""Who plays at one window: the person at keyboard and mouse, and others with gamepads.

keys, mouse, first pad ──> InputSender of the window's player ──┐
each further pad ────────> InputSender of the next free number ─┴─> `input/NODE`
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from elys.bus import topics
from elys.bus.gamepads import Gamepads, PadState
from elys.bus.input_sender import InputSender
from elys.bus.messages.commands import CommandRecord, Input
from elys.bus.session import Node, Session
from elys.bus.transports.transport import Closer

LAST_PLAYER: Final = 16


class Told:
    """What the host tells of players since `start`: as whom others play, and what of this node's input was refused."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._close: Closer | None = None
        self._players: dict[int, set[str]] = {}  # nodes by player
        self.refusal = ""  # of the last that was refused here: why
        session.on_nodes(self._node_changed)

    def start(self) -> None:
        """Listens from now on."""
        self.refusal, self._players = "", {}
        if self._close is None:
            self._close = self._session.subscribe(topics.COMMANDS, self._heard)

    def stop(self) -> None:
        """Listens no more."""
        if self._close is not None:
            self._close()
            self._close = None

    @property
    def players(self) -> frozenset[int]:
        """Numbers that are taken."""
        return frozenset(self._players)

    def _heard(self, record: CommandRecord, _: str) -> None:
        command = record.command
        if not isinstance(command, Input):
            return
        if record.origin == self._session.node.id:
            self.refusal = self.refusal if record.accepted else record.reason
        elif record.accepted and command.lets_go and not command.changes and not command.axes:
            self._forget(
                record.origin, command.player
            )  # he gave his keys back, or is gone: viewers do not hear of that
        elif record.accepted:
            self._players.setdefault(command.player, set()).add(record.origin)

    def _node_changed(self, node: Node, alive: bool) -> None:
        if not alive:
            for player in list(self._players):
                self._forget(node.id, player)

    def _forget(self, node: str, player: int) -> None:
        nodes = self._players.get(player, set())
        nodes.discard(node)
        if not nodes:
            self._players.pop(player, None)


class LocalPlayers:
    """Sends for all of them. `bindings` tells what a player has bound to which controls."""

    def __init__(
        self,
        session: Session,
        *,
        player: int = 1,
        bindings: Callable[[int], Mapping[str, str]] = lambda player: {},
    ) -> None:
        self._session = session
        self._bindings = bindings
        self._told = Told(session)
        self.main = InputSender(session, player=player)  # of who sits at the window
        self._others: dict[int, InputSender] = {}
        self._pads = Gamepads(self.main, join=self._join)

    @property
    def senders(self) -> tuple[InputSender, ...]:
        """All who play here, the window's player first."""
        return (self.main, *self._others.values())

    @property
    def refusal(self) -> str:
        """Why something that was done here counted for nothing, since `start`."""
        return self._told.refusal

    def start(self, states: Mapping[int, PadState]) -> None:
        """They play from now on, with their own bindings; what is down on pads already counts when it is pressed again."""
        self._told.start()
        for sender in self.senders:
            sender.bind(self._bindings(sender.player))
        self._pads.begin(states)

    def update(self, states: Mapping[int, PadState]) -> None:
        """What pads do; call it once a frame."""
        self._pads.update(states)

    def stop(self) -> None:
        """Nobody plays here any more: all let go of everything. It goes out with `send`."""
        self._told.stop()
        for sender in self.senders:
            sender.let_go_of_all()

    def send(self, *, seen_time: float = -1.0, host_time: float | None = None) -> bool:
        """Call it once a frame, see `InputSender.send`. Whether the window's player did anything."""
        sent = [sender.send(seen_time=seen_time, host_time=host_time) for sender in self.senders]
        return sent[0]

    def _join(self) -> InputSender | None:
        taken = {self.main.player, *self._others, *self._told.players}
        own = self.main.player
        for player in (*range(own + 1, LAST_PLAYER + 1), *range(1, own)):  # whoever is below may sit still elsewhere
            if player not in taken:
                sender = self._others[player] = InputSender(self._session, player=player)
                sender.bind(self._bindings(player))
                return sender
        return None
