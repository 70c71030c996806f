"""What a router lets through: it holds those below to their roles as a host does, and passes on what comes from above.

    above <-- the owner's key -- [ upper end <-- local socket --> lower end ] <-- each with a key of his own -- below

Rules of zenoh know connections by who has shown what; whoever is above shows nothing, and could be taken for somebody below.
So a router has two ends: only the upper one connects upward, and the lower one knows it by the socket that joins them, which
stands in a directory of this user's alone and at which nobody listens for others.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

from elys.bus.access.credentials import Credentials
from elys.bus.access.host import HostAccess, client_settings
from elys.bus.access.rules import router_access_control
from elys.common.errors import AccessError

INNER: Final = "unixsock-stream"  # the protocol between the two ends, spoken with nobody else


@contextlib.contextmanager
def lower_settings(access: HostAccess, shown: Credentials | None) -> Iterator[dict[str, Any]]:
    """Settings of the lower end inside this block; the upper one has to prove what it shows above here too.

    Raises AccessError where that cannot be.
    """
    users = dict(access.users)
    if shown is not None and users.setdefault(shown.user, shown.secret) != shown.secret:
        raise AccessError(
            f"{shown.user} has one secret above this router and another one here: renew one of the two with `elys keys renew`"
        )
    with replace(access, users=tuple(users.items())).settings() as settings:
        yield settings | {"access_control": router_access_control((user for user, _ in access.users), INNER)}


def upper_settings(upstream: Sequence[str], shown: Credentials, *, speaks_tls: bool) -> dict[str, Any]:
    """Settings of the upper end, whose lower one speaks TLS or not. Raises AccessError where the two do not fit together."""
    by_certificate = [endpoint.startswith("tls/") for endpoint in upstream]
    if set(by_certificate) != {speaks_tls}:
        raise AccessError(
            "a router asks below for what it shows above, certificates or secrets: give endpoints of tls/ to both --listen "
            "and --connect, or to neither"
        )
    if speaks_tls and not shown.has_certificate:
        raise AccessError(f"{shown.source} has no certificate: make a file with `elys keys export owner`")
    return client_settings(shown, by_certificate=speaks_tls)
