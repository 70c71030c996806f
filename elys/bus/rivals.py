"""Hosts of one name where they can meet, at a router: the second is refused, and who finds two of them is told.

Two can still come to be there, when one was cut off while the other took its name. Then what is seen is of the one that was
greeted: frames, deltas and snapshots of another epoch are left out (`following.py`).
"""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable, Sequence
from typing import Final

from elys.common.errors import BusError, ConnectionLost, RequestError

_PATIENCE: Final = 1.0  # [s] for another host of the same name to say so
_log = logging.getLogger(__name__)


async def require_free_name(name: str, greet: Callable[[float], Awaitable[object]]) -> None:
    """Returns when nobody answers to `greet(timeout)`; BusError when somebody hosts a session of that name."""
    try:
        await greet(_PATIENCE)
    except ConnectionLost:
        return  # nobody has it, or who had it is cut off
    except RequestError as error:
        _log.debug("who hosts %s refuses to say so: %s", name, error)
    raise BusError(f"another simulation or replay hosts a session called {name} there already: choose another --name")


def warn_of_rivals(name: str, hosts: Sequence[str]) -> None:
    """Says so when there is more than one host."""
    if len(hosts) > 1:
        _log.warning(
            "%s host a session called %s here at the same time: what is seen is of the one that was greeted first; end the "
            "other, or give it another --name",
            " and ".join(hosts),
            name,
        )
