"""What players do, on its way from the bus to a tick's start; and who is gone holds nothing any more.

Input is not answered, as there is so much of it: what is refused is told on `commands`, once a second for each who sends it.
What a player did long ago, on a way that was cut for a while, counts no more; only that keys were let go does.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable
from typing import Final

import msgspec

from elys.bus import topics
from elys.bus.messages.commands import CommandRecord, CommandRequest, Input, Release
from elys.bus.session import Node, Session
from elys.common.errors import RequestError
from elys.sim_node.inputs import check_input
from elys.sim_node.simulation import Simulation

MOST_WAITING: Final = 64  # messages of a node between two ticks: a frame sends one
LONGEST_LATE: Final = (
    1.0  # [s] between what a player saw and the tick, above which what was pressed then is not pressed now
)
REFUSAL_INTERVAL: Final = 1.0  # [s] between two refusals told of the same node
_log = logging.getLogger(__name__)


class InputIntake:
    """`put` takes requests for the next tick, which `wake` brings about while time stands; in the past (`is_rewound`) nobody
    plays.
    """

    def __init__(
        self,
        simulation: Simulation,
        session: Session,
        *,
        put: Callable[[CommandRequest], object],
        wake: Callable[[], None],
        is_rewound: Callable[[], bool],
    ) -> None:
        self._simulation = simulation
        self._session = session
        self._put = put
        self._wake = wake
        self._is_rewound = is_rewound
        self._last: dict[tuple[str, int], int] = {}  # sequence of the last message, by who sent it for which player
        self._waiting: Counter[str] = Counter()  # messages by who sent them
        self._gone: set[str] = set()  # nodes that were here
        self._told_at: dict[str, float] = {}  # [s] when a refusal was told last

    def listen(self) -> None:
        """From now on."""
        self._session.subscribe(topics.INPUT, self._arrived)
        self._session.on_nodes(self._node_changed)

    def begin_tick(self) -> None:
        """Who is gone lets go of everything, and who sent so much that some was lost; the past stays as it was."""
        flooding = [node for node, count in self._waiting.items() if count > MOST_WAITING]
        self._waiting.clear()
        if self._is_rewound():
            return
        for node in flooding:
            self._let_go(node)
        for node in sorted(self._gone):
            if self._simulation.hands.holds(node):
                self._put(CommandRequest(origin=node, command=Release()))
            if self._simulation.inputs.holds(node):
                self._let_go(node)

    def _let_go(self, node: str) -> None:
        for player in self._simulation.inputs.players_of(node):
            self._put(CommandRequest(origin=node, command=Input(player=player, lets_go=True)))

    def _arrived(self, command: Input, node: str) -> None:
        try:
            if self._is_rewound():
                raise RequestError("this is the past: go on from here, or return to now, before playing")
            self._waiting[node] += 1
            if self._waiting[node] > MOST_WAITING:
                raise RequestError(
                    f"at most {MOST_WAITING} messages of input can be sent in a tick: merge them in order"
                )
            check_input(command)
            self._take_sequence(command, node)
        except RequestError as error:
            self._refuse(node, command, str(error))
            return
        late = time.time() - command.done_at if command.done_at > 0.0 else 0.0
        if late > LONGEST_LATE:
            self._refuse(node, command, f"what was done {late:.1f} s ago is too late: of it only letting go counts")
            command = _let_go_in(command)
        self._put(CommandRequest(origin=node, command=command))

    def _take_sequence(self, command: Input, node: str) -> None:
        """Refuses what came before; where some is missing, as when the way lost it, all is let go that it may have let go."""
        if not command.sequence:
            return
        sender = (node, command.player)
        last = self._last.get(sender) if command.sequence > 1 else None  # with 1 somebody begins anew
        if last is not None and command.sequence <= last:
            raise RequestError(f"message {command.sequence} of input came after {last}: number them in order")
        if last is not None and command.sequence > last + 1:
            self._let_go(node)
        self._last[sender] = command.sequence

    def _refuse(self, node: str, command: Input, reason: str) -> None:
        now = time.monotonic()
        if now - self._told_at.get(node, -REFUSAL_INTERVAL) < REFUSAL_INTERVAL:
            return
        self._told_at = {other: at for other, at in self._told_at.items() if now - at < REFUSAL_INTERVAL} | {node: now}
        _log.warning("input of %s: %s", node, reason)
        refused = CommandRecord(
            tick=self._simulation.tick, origin=node, command=Input(player=command.player), accepted=False, reason=reason
        )
        self._session.publish(topics.COMMANDS, refused)

    def _node_changed(self, node: Node, alive: bool) -> None:
        if alive:
            self._gone.discard(node.id)
            return
        self._gone.add(node.id)
        self._last = {sender: last for sender, last in self._last.items() if sender[0] != node.id}
        if self._simulation.hands.holds(node.id) or self._simulation.inputs.holds(node.id):
            self._wake()


def _let_go_in(command: Input) -> Input:
    """What is left of it where what was pressed counts no more: sticks stand where they stand."""
    changes = tuple(change for change in command.changes if not change[1])
    return msgspec.structs.replace(command, changes=changes, moved={}, text="")
