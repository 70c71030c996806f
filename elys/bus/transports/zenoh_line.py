"""The zenoh session that a transport speaks through, and the next one when nothing more comes through it.

zenoh comes back by itself when a connection has ended, but only then, and as slowly as TCP knocks: a cut line is silent for the
whole lease, and a connection that survives an outage waits for TCP's next attempt, seconds later. So who connects sees by
himself that the line is silent (`silence`, asked by `elys.bus.vigil`), knocks, and opens another zenoh session when a door opens
before the old one speaks again. All that was declared is declared there anew; what the old one still brings is not listened to.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from elys.bus.transports.transport import Closer

_PAUSE: Final = 0.1  # [s] between two attempts, where a door opens and nobody is behind it
_log = logging.getLogger(__name__)

Open = Callable[[threading.Event], zenoh.Session | None]  # opens another session, or None when the event is set


class Line:
    """One zenoh session; `is_live` until another takes its place."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session
        self.is_live = True
        self.is_up = True
        self.listener: Any = None  # kept, for it ends when nobody holds it


Declare = Callable[[Line], Any]


class Lines:
    """The line there is now, what is declared on it, and who hears whether it is up.

    Without `open_again` (a host's side) there is one line for ever.
    """

    def __init__(self, session: zenoh.Session, open_again: Open | None) -> None:
        self.now = Line(session)
        self.changes = 0  # how often another line took the place of one
        self._open_again = open_again
        self._heard_at = time.monotonic()
        self._standing: dict[object, tuple[Declare, Any]] = {}
        self._listeners: list[Callable[[bool], None]] = []
        self._lock = threading.RLock()
        self._returning: threading.Thread | None = None
        self._stop = threading.Event()
        if open_again is not None:
            self._listen(self.now)

    @property
    def session(self) -> zenoh.Session:
        """The zenoh session there is now."""
        return self.now.session

    def heard(self) -> None:
        """Notes a sign of life from the other side."""
        self._heard_at = time.monotonic()

    @property
    def silence(self) -> float:
        """[s] since the other side was last heard."""
        return time.monotonic() - self._heard_at

    def stand(self, declare: Declare) -> Closer:
        """Declares something on this line and on all that follow, until closed. Raises ZError."""
        place = object()
        with self._lock:
            self._standing[place] = (declare, declare(self.now))

        def close() -> None:
            with self._lock:
                _, held = self._standing.pop(place, (None, None))
            if held is not None:
                with contextlib.suppress(zenoh.ZError):  # the zenoh session closed meanwhile and took it along
                    held.undeclare()

        return close

    def on_link(self, listener: Callable[[bool], None]) -> Closer:
        """Calls `listener(connected)` now and when the line goes or comes."""
        with self._lock:
            self._listeners.append(listener)
            listener(self.now.is_up)

        def close() -> None:
            with self._lock, contextlib.suppress(ValueError):
                self._listeners.remove(listener)

        return close

    def suspect(self) -> None:
        """Nothing was heard for a while: looks for a better line, unless this one speaks first."""
        with self._lock:
            if self._open_again is None or self._stop.is_set() or self._returning is not None:
                return
            since = self._heard_at
            self._returning = threading.Thread(target=self._return, args=[since], name="elys-returning", daemon=True)
            self._returning.start()

    def close(self) -> None:
        """Ends it for good."""
        self._stop.set()
        with self._lock:
            self._standing.clear()
            self._listeners.clear()
            line = self.now
        line.session.close()  # type: ignore[no-untyped-call]

    # --- inside ----------------------------------------------------------------------------------------------------

    def _listen(self, line: Line) -> None:
        def changed(event: zenoh.TransportEvent) -> None:
            self._link_changed(line, event.kind == zenoh.SampleKind.PUT)

        handler = Callback(changed, indirect=False)
        line.listener = line.session.info.declare_transport_events_listener(handler, history=True)
        if not line.session.info.routers_zid():
            self._link_changed(line, False)

    def _link_changed(self, line: Line, is_up: bool) -> None:
        with self._lock:
            if not line.is_live or line.is_up == is_up:
                return
            line.is_up = is_up
            if is_up:
                self.heard()
            self._tell(is_up)
            if not is_up:
                self.suspect()

    def _tell(self, is_up: bool) -> None:
        for listener in list(self._listeners):
            listener(is_up)

    def _is_wanted(self, since: float) -> bool:
        """Whether the line is still down, or has said nothing since."""
        return not self._stop.is_set() and (not self.now.is_up or self._heard_at <= since)

    def _return(self, since: float) -> None:
        assert self._open_again is not None
        while True:
            with self._lock:
                if not self._is_wanted(since):
                    self._returning = None
                    return
            session = self._open_again(self._stop)
            if session is None:
                self._stop.wait(_PAUSE)
                continue
            with self._lock:
                is_better = self._is_wanted(since)
                useless = self._take(session) if is_better else session
                since = -1.0  # of the new line it counts alone whether it is up
            # It may take long: it waits for the other side.
            threading.Thread(target=_close, args=[useless], name="elys-closing", daemon=True).start()

    def _take(self, session: zenoh.Session) -> zenoh.Session:
        """Goes on with another session; returns the one before. With the lock held."""
        old, self.now = self.now, Line(session)
        old.is_live = False
        self.changes += 1
        self.heard()
        self._tell(False)
        for place, (declare, _) in list(self._standing.items()):
            try:
                self._standing[place] = (declare, declare(self.now))
            except zenoh.ZError as error:
                _log.error("something could not be declared again: %s", error)
        self._listen(self.now)
        if self.now.is_up:
            self._tell(True)
        return old.session


def _close(session: zenoh.Session) -> None:
    with contextlib.suppress(zenoh.ZError):  # it is gone already
        session.close()  # type: ignore[no-untyped-call]
