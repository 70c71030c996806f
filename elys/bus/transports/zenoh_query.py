"""A question as zenoh brings it to the one who serves it."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import zenoh

from elys.bus.transports.transport import Link

REFUSAL: Final = "elys/refusal"  # encoding that tells our refusals from zenoh's own errors (a timeout)
_log = logging.getLogger(__name__)


class ZenohQuery:
    """A question as the one who serves it sees it."""

    def __init__(self, query: zenoh.Query, answer_key: str, answering: ThreadPoolExecutor) -> None:
        self.key = str(query.key_expr)
        self.payload = b"" if query.payload is None else query.payload.to_bytes()
        self._query: zenoh.Query | None = query
        self._answer_key = answer_key
        self._answering = answering

    def reply(self, payload: bytes) -> None:
        """Answers, on a thread that may wait for the asker."""
        self._send(lambda query: query.reply(self._answer_key, payload))

    def refuse(self, reason: str) -> None:
        """Says why there is no answer."""
        self._send(lambda query: query.reply_err(reason.encode(), encoding=REFUSAL))

    def drop(self) -> None:
        """Ends the question for the asker, answered or not."""
        self._query = None

    def _send(self, send: Callable[[zenoh.Query], None]) -> None:
        # Taken here, not on the thread that answers: of two answers the first one counts, whichever thread is faster.
        query, self._query = self._query, None
        if query is None:
            return  # answered already

        def work() -> None:
            try:
                send(query)
            except zenoh.ZError as error:
                _log.debug("an answer on %s found nobody: %s", self.key, cause(error))

        with contextlib.suppress(RuntimeError):  # the transport is closing: nobody is left to answer
            self._answering.submit(work)


def cause(error: zenoh.ZError) -> str:
    """What zenoh says, without the places in its sources."""
    return str(error).split(" at /")[0].strip()


def asking(payload: bytes, timeout: float) -> dict[str, Any]:
    """How questions are asked: of all who may answer, each answer as it comes."""
    return {
        "payload": payload,
        "timeout": timeout,
        "target": zenoh.QueryTarget.ALL,
        "consolidation": zenoh.ConsolidationMode.NONE,
        "congestion_control": zenoh.CongestionControl.BLOCK,
        "priority": zenoh.Priority.INTERACTIVE_LOW,  # of the answer too: it must not wait behind states on a slow line
    }


def links_of(session: zenoh.Session) -> list[Link]:
    """The connections of a zenoh session."""
    info = session.info
    kinds = {str(transport.zid): str(transport.whatami) for transport in info.transports()}
    return [Link(str(o.zid), kinds.get(str(o.zid), ""), str(o.src), str(o.dst)) for o in info.links()]
