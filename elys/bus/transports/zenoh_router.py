"""The transport of a router: it listens, and itself connects upstream, to a host or to another router.

    host or router  <-- router  <-- viewers and routers

zenoh's routers tell one another who subscribes to what along the tree. So each message crosses a connection once however many
want it below, and one that nobody below wants crosses none. What is above or below may go and come back: connections are knocked
for again every 100 ms, and what was declared is declared anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import zenoh
from zenoh.handlers import Callback

from elys.bus.transports.transport import Closer
from elys.bus.transports.zenoh import ZenohTransport, _cause, _config, _insert
from elys.common.errors import BusError


class ZenohRouter(ZenohTransport):
    """A router's end; make it with `open`."""

    @classmethod
    def open(cls, listen: str, upstream: Sequence[str] = ()) -> ZenohRouter:
        """Listens at an endpoint and connects to one of those `upstream`, now or whenever one is there; none: a tree's root.

        Raises:
            BusError: an endpoint is in use or is none.
        """
        config = _config("router")
        try:
            _insert(config, "listen/endpoints", [listen])
            _insert(config, "connect/endpoints", list(upstream))
            _insert(config, "connect/timeout_ms", -1)  # knocks for ever, beside all else: what is above may start later
            _insert(config, "connect/exit_on_failure", False)
            session = zenoh.open(config)
        except zenoh.ZError as error:
            if "in use" in str(error):
                raise BusError(
                    f"{listen} is in use, perhaps by a session: choose another port with --listen"
                ) from error
            raise BusError(
                f"cannot route from '{listen}' to '{' or '.join(upstream)}' ({_cause(error)}): give tcp/ADDRESS:PORT"
            ) from error
        return cls(session, endpoint=listen, hosts=True)

    def watch_links(self, on_change: Callable[[str, str, bool], None]) -> Closer:
        """Calls `on_change(identity, kind, connected)` for connections there are and at every change, on zenoh's thread."""

        def changed(event: zenoh.TransportEvent) -> None:
            transport: Any = event.transport
            on_change(str(transport.zid), str(transport.whatami), event.kind == zenoh.SampleKind.PUT)

        with self._closed_said():
            handler = Callback(changed, indirect=False)
            return self._keep(self._session.info.declare_transport_events_listener(handler, history=True))
