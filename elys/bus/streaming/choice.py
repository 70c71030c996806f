"""Who gets full states and who a stream of its own: by where the host is, or by what was asked for."""

from __future__ import annotations

import os
from typing import Final

from elys.bus.picture_ring import boot_id
from elys.bus.transports.reaching import is_near
from elys.common.errors import BusError

STATES: Final = "ELYS_STATES"  # environment: how states come to this process and those that it starts
FULL: Final = "full"
STREAM: Final = "stream"
AUTO: Final = "auto"
_EXACT_KINDS: Final = ("recorder", "streamer", "simulation", "replay")  # nothing but every bit will do


def wants_stream(kind: str, endpoint: str, machine: str) -> bool:
    """Whether a node of that kind gets a stream, of a host at that endpoint, on that machine ("": not told).

    An endpoint of loopback may be one end of a tunnel: only a host that is on this machine is near.

    Raises:
        BusError: the environment asks for something else.
    """
    choice = os.environ.get(STATES, AUTO)
    if choice not in (FULL, STREAM, AUTO):
        raise BusError(f"{STATES}={choice} says nothing: set it to {AUTO}, {FULL} or {STREAM}")
    if kind in _EXACT_KINDS or choice == FULL:
        return False
    return choice == STREAM or not is_near(endpoint) or (machine != "" and machine != boot_id())
