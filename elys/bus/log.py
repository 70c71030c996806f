"""Logging of nodes: to stderr for who started them, and to the LOG topic for everybody's console."""

from __future__ import annotations

import contextlib
import logging
import sys
from typing import Final

from elys.bus import topics
from elys.bus.messages.session import LogLevel, LogLine
from elys.bus.session import Session

LONGEST: Final = 10_000  # characters of a line
_LEVELS: Final[tuple[tuple[int, LogLevel], ...]] = (
    (logging.ERROR, "error"),
    (logging.WARNING, "warning"),
    (logging.INFO, "info"),
)


def start_logging(level: int = logging.INFO) -> None:
    """Sends what ELYS logs to stderr, one line each; other libraries only from warnings on."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_LineFormatter())
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    logging.getLogger("elys").setLevel(level)


def log_to_session(session: Session, *, level: int = logging.INFO) -> SessionLogHandler:
    """From now on the node's log lines also go to the session's LOG topic; call the handler's `detach` at the end."""
    handler = SessionLogHandler(session)
    handler.setLevel(level)
    logging.getLogger("elys").addHandler(handler)
    return handler


class SessionLogHandler(logging.Handler):
    """Publishes log records. Lines from other threads are handed to the session's loop."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self._session = session
        self._publishing = False

    def emit(self, record: logging.LogRecord) -> None:
        """Publishes one record; what publishing itself logs is not published again."""
        if self._publishing:
            return
        line = LogLine(
            node=self._session.node.id,
            level=_level_of(record.levelno),
            text=readable(record.getMessage()),
            time=record.created,
        )
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._session.call_soon(self._publish, line)

    def _publish(self, line: LogLine) -> None:
        self._publishing = True
        try:
            self._session.publish(topics.LOG, line)
        finally:
            self._publishing = False

    def detach(self) -> None:
        """Stops publishing."""
        logging.getLogger("elys").removeHandler(self)


class _LineFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        level = "" if record.levelno == logging.INFO else f"{record.levelname.lower()}: "
        text = f"{level}{readable(record.getMessage())}"
        if record.exc_info:
            text = f"{text}\n{self.formatException(record.exc_info)}"
        return text


def readable(text: str) -> str:
    """A text as consoles can show it, whoever wrote it: no control characters, which terminals obey, no half letters, which the
    bus does not carry, and no more of it than anybody reads.
    """
    hidden = len(text) - LONGEST
    if hidden > 0:
        text = f"{text[:LONGEST]} ... and {hidden} characters more"
    if text.isprintable():
        return text
    shown = "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)
    return shown.encode(errors="backslashreplace").decode()


def _level_of(number: int) -> LogLevel:
    for threshold, name in _LEVELS:
        if number >= threshold:
            return name
    return "debug"
