"""The transport of a router: it listens, and itself connects upstream, to a host or to another router.

    host or router  <-- router  <-- viewers and routers

zenoh's routers tell one another who subscribes to what along the tree. So each message crosses a connection once however many
want it below, and one that nobody below wants crosses none. What is above or below may go and come back: connections are knocked
for again every 100 ms, and what was declared is declared anew.

A router that knows whom it lets in has two ends, so that it can tell those above from those below: see `access/router.py`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import zenoh
from zenoh.handlers import Callback

from elys.bus.access.credentials import Credentials
from elys.bus.access.host import HostAccess
from elys.bus.access.limits import host_limits
from elys.bus.access.router import INNER, lower_settings, upper_settings
from elys.bus.transports.router_socket import RouterSocket
from elys.bus.transports.transport import Closer, Link
from elys.bus.transports.zenoh import ZenohTransport, _config
from elys.bus.transports.zenoh_query import cause, links_of
from elys.common.errors import AccessError, BusError


class ZenohRouter(ZenohTransport):
    """A router's end; make it with `open`."""

    _upper: zenoh.Session | None = None  # what connects upward, if not this end itself
    _socket: RouterSocket | None = None  # between the two

    def __init__(self, session: zenoh.Session, *, endpoint: str, user: str = "") -> None:
        super().__init__(session, endpoint=endpoint, hosts=True, user=user)
        self._held: list[Any] = []  # listeners, which end when nobody holds them

    @classmethod
    def open(
        cls,
        listen: str,
        upstream: Sequence[str] = (),
        *,
        access: HostAccess | None = None,
        credentials: Credentials | None = None,
    ) -> ZenohRouter:
        """Listens at an endpoint and connects to those `upstream` as soon as they are there; none: a tree's root.

        It lets in whom `access` names, or everybody, and shows `credentials` above.

        Raises:
            BusError: an endpoint is in use or is none.
            AccessError: there is only one of the two, with somebody above; or they do not fit together.
        """
        if upstream and (access is None) != (credentials is None):
            raise AccessError(
                "a router that shows a key above asks those below for theirs, and one that asks shows one: whoever it let in "
                "otherwise would be taken for its owner"
            )
        with _causes_said(listen, upstream):
            if access is None:
                return cls(_opened([listen], upstream, {}), endpoint=listen)
            if not upstream or credentials is None:
                with lower_settings(access, None) as settings:
                    return cls(_opened([listen], (), settings), endpoint=listen)
            return cls._with_two_ends(listen, upstream, access, credentials)

    @classmethod
    def _with_two_ends(
        cls, listen: str, upstream: Sequence[str], access: HostAccess, credentials: Credentials
    ) -> ZenohRouter:
        speaks_tls = listen.startswith("tls/")
        above = upper_settings(upstream, credentials, speaks_tls=speaks_tls)
        between = RouterSocket()
        inner = f"{INNER}/{between.endpoint_path}"
        try:
            with lower_settings(access, None if speaks_tls else credentials) as settings:
                lower = _opened([listen, inner], (), settings)
            try:
                upper = _opened([], [*upstream, inner], above)
            except zenoh.ZError:
                lower.close()  # type: ignore[no-untyped-call]
                raise
        except BaseException:
            between.remove()
            raise
        router = cls(lower, endpoint=listen, user=credentials.user)
        router._upper, router._socket = upper, between
        return router

    def identity(self) -> str:
        """What it is called by those above; those below know it by its other end."""
        return str(self._upper.info.zid()) if self._upper is not None else super().identity()

    def links(self) -> list[Link]:
        """Those above and below, and none between its own ends."""
        ends = self._ends()
        own = {str(end.info.zid()) for end in ends}
        return [link for end in ends for link in links_of(end) if link.peer not in own]

    def watch_links(self, on_change: Callable[[str, str, bool], None]) -> Closer:
        """Calls `on_change(identity, kind, connected)` for connections there are and at every change, on zenoh's thread."""
        ends = self._ends()
        own = {str(end.info.zid()) for end in ends}

        def changed(event: zenoh.TransportEvent) -> None:
            transport: Any = event.transport
            if str(transport.zid) not in own:
                on_change(str(transport.zid), str(transport.whatami), event.kind == zenoh.SampleKind.PUT)

        handler = Callback(changed, indirect=False)
        with self._closed_said():
            held: list[Any] = [end.info.declare_transport_events_listener(handler, history=True) for end in ends]
        self._held += held

        def close() -> None:
            for listener in held:
                self._held.remove(listener)
                with contextlib.suppress(zenoh.ZError):  # the zenoh session closed meanwhile and took it along
                    listener.undeclare()

        return close

    def close(self) -> None:
        """Leaves and frees everything. A second call does nothing."""
        super().close()
        upper, self._upper = self._upper, None
        if upper is not None:
            upper.close()  # type: ignore[no-untyped-call]
        between, self._socket = self._socket, None
        if between is not None:
            between.remove()

    def _ends(self) -> list[zenoh.Session]:
        return [self._lines.session] if self._upper is None else [self._lines.session, self._upper]


def _opened(listen: Sequence[str], connect: Sequence[str], settings: dict[str, Any]) -> zenoh.Session:
    chosen = {
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "connect/timeout_ms": -1,  # knocks for ever, beside all else: what is above may start later
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 100, "period_increase_factor": 1},
        **host_limits(is_router=True),
        **settings,
    }
    return zenoh.open(_config("router", chosen))


@contextlib.contextmanager
def _causes_said(listen: str, upstream: Sequence[str]) -> Iterator[None]:
    try:
        yield
    except zenoh.ZError as error:
        if "in use" in str(error):
            raise BusError(f"{listen} is in use, perhaps by a session: choose another port with --listen") from error
        raise BusError(
            f"cannot route from '{listen}' to '{' or '.join(upstream)}' ({cause(error)}): give tcp/ADDRESS:PORT"
        ) from error
