"""What one client can use up of a host: sizes that the router holds it to, and how many questions may wait.

The router drops what is larger than its topic ever is before anybody looks at it. How many there are is counted by the host:
the router can only keep a distance between two messages, and would drop the second of two keys pressed at once.
"""

from __future__ import annotations

import threading
import time
from collections import Counter
from typing import Any, Final

from elys.bus import topics
from elys.bus.access.roles import user_of

MAX_MESSAGE_SIZE: Final = 64 << 20  # [bytes] one message; what is longer is dropped by zenoh before it fills the memory
MOST_CLIENTS: Final = 1000
MOST_WAITING: Final = 256  # questions of one node that are not answered yet
MOST_WAITING_OF_USER: Final = 1024  # of all nodes of a user together: node ids are made up freely, users are not
MOST_PER_SECOND: Final = 2000.0  # questions of a user, in the long run
_BURST: Final = 2.0  # [s] of them that may come at once
_ACCEPTING: Final = 3000  # [ms] that somebody who connects has to say who he is


def host_limits() -> dict[str, Any]:
    """Settings of a host's zenoh session."""
    return {
        "transport/unicast/max_sessions": MOST_CLIENTS,
        "transport/unicast/max_links": 1,
        "transport/unicast/accept_timeout": _ACCEPTING,
        "transport/unicast/accept_pending": 200,  # that have not said who they are
        "low_pass_filter": size_limits(),
    }


def size_limits() -> list[dict[str, Any]]:
    """zenoh's `low_pass_filter`: the largest that a client may send to each topic and query."""
    said = [(topic.largest, f"{topics.ROOT}/*/{topic.name}{'/**' if topic.keyed else ''}") for topic in topics.TOPICS]
    asked = [(query.largest, f"{topics.ROOT}/*/{query.name}/**") for query in topics.QUERIES]
    return [
        _limit(f"{message} of at most {size} bytes", message, size, [key for largest, key in of if largest == size])
        for message, of in (("put", said), ("query", asked))
        for size in sorted({largest for largest, _ in of})
    ]


def _limit(name: str, message: str, size: int, keys: list[str]) -> dict[str, Any]:
    return {"id": name, "messages": [message], "flows": ["ingress"], "key_exprs": keys, "size_limit": size}


class Doorkeeper:
    """Counts the questions of each node and user that wait for an answer; called on any thread.

    Who asks more than it may is not answered: its questions end, and nobody else's wait longer for it.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: Counter[str] = Counter()  # by node and by user
        self._credit: dict[str, tuple[float, float]] = {}  # of each user: questions left, and when that was counted [s]
        self.turned_away = 0

    def admit(self, node: str) -> bool:
        """Whether a question of that node may wait; if so, `release` must follow."""
        user = user_of(node)
        with self._lock:
            if (
                self._waiting[node] >= MOST_WAITING
                or self._waiting["@" + user] >= MOST_WAITING_OF_USER
                or not self._spend(user)
            ):
                self.turned_away += 1
                return False
            self._waiting[node] += 1
            self._waiting["@" + user] += 1
            return True

    def release(self, node: str) -> None:
        """A question was answered."""
        with self._lock:
            for who in (node, "@" + user_of(node)):
                self._waiting[who] -= 1
                if self._waiting[who] <= 0:
                    del self._waiting[who]

    def _spend(self, user: str) -> bool:
        now = time.monotonic()
        left, since = self._credit.get(user, (MOST_PER_SECOND * _BURST, now))
        left = min(left + (now - since) * MOST_PER_SECOND, MOST_PER_SECOND * _BURST)
        self._credit[user] = (max(left - 1.0, 0.0), now)
        return left >= 1.0
