"""What a host says of itself to those who ask: how it is loaded, and on the local network that it is there."""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import AsyncIterator, Callable
from typing import TYPE_CHECKING, Any, Final, cast

import elys
from elys.bus.beacon import Announcement, announced_endpoint, answering_askers
from elys.bus.messages.vitals import HostFacts
from elys.bus.session import HOST_KINDS, Session
from elys.common.errors import BusError

if TYPE_CHECKING:
    from elys.sim_node.node import SimulationNode

_TICKS: Final = 60  # the last ones, over which the load is taken


def facts_of(node: SimulationNode) -> Callable[[], HostFacts]:
    """What a simulation's session answers to who asks what it carries."""
    started = time.time()

    def facts() -> HostFacts:
        times = list(itertools.islice(reversed(node.tick_times), _TICKS))
        budget = 1000.0 / node.simulation.settings.tick_rate  # [ms]
        return HostFacts(
            scene=node.simulation.name,
            started=started,
            tick_rate=node.simulation.settings.tick_rate,
            realtime_factor=node.realtime_factor,
            load=sum(times) / len(times) / budget if times else -1.0,
        )

    return facts


def client_count(session: Session) -> int:
    """How many are attached to a session, routers between not counted."""
    return sum(node.kind not in (*HOST_KINDS, "router") for node in session.nodes.values())


def require_announceable(endpoint: str | None) -> None:
    """Raises BusError unless others could reach a session that listens there (None: loopback)."""
    if endpoint is None:
        raise BusError(
            "a session that listens at loopback alone is found by nobody else: add --listen tcp/0.0.0.0:7447 to --discover"
        )
    announced_endpoint(endpoint)


@contextlib.asynccontextmanager
async def discoverable(session: Session, endpoint: str, *, wanted: bool, needs_secret: bool) -> AsyncIterator[None]:
    """While this lasts, those who look around in the local network find the session, if that is `wanted`.

    Raises:
        BusError: nobody can reach the endpoint, or the port for their questions cannot be had.
    """
    if not wanted:
        yield
        return
    protocol, port = announced_endpoint(endpoint)
    began = time.monotonic()

    def announcements() -> list[Announcement]:
        facts = session.host_facts() if session.host_facts is not None else None
        return [
            Announcement(
                name=session.name,
                kind=cast(Any, session.node.kind),
                port=port,
                scene=facts.scene if facts is not None else "",
                protocol=cast(Any, protocol),
                age=time.monotonic() - began,
                load=facts.load if facts is not None else -1.0,
                clients=client_count(session),
                needs_secret=needs_secret,
                version=elys.__version__,
            )
        ]

    async with answering_askers(announcements):
        yield
