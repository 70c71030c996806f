"""What this side's role may do, known before the router refuses it, so that whoever wished it hears at once."""

from __future__ import annotations

import logging
from typing import Any, TypeVar

from elys.bus import topics
from elys.bus.access.roles import Role, role_of_node
from elys.bus.topics import Query
from elys.common.errors import AccessError, RequestError

Q = TypeVar("Q")
_log = logging.getLogger(__name__)


class Permissions:
    """Of one role."""

    def __init__(self, role: Role) -> None:
        self.role = role
        self._said: set[str] = set()  # topics of which it was said that this role may not have them

    def may(self, topic: str, least: Role, what: str) -> bool:
        """Whether this role may `what` a topic that asks for `least`; if not, that is said once."""
        if self.role >= least:
            return True
        if topic not in self._said and topic != topics.LOG.name:  # lines for others' consoles are no wish of anybody's
            self._said.add(topic)
            _log.warning("%s", refusal(self.role, least, f"{what} {topic}"))
        return False

    def require_kind(self, kind: str) -> None:
        """Raises AccessError for a kind of node that this role may not show itself as."""
        if self.role < (least := topics.NODE_KINDS.get(kind, Role.VIEWER)):
            raise AccessError(refusal(self.role, least, f"be a {kind} node"))

    def require(self, query: Query[Q, Any], request: Q) -> None:
        """Raises RequestError for a question that the host would refuse."""
        if self.role < (least := topics.role_to_ask(query, request)):
            raise RequestError(refusal(self.role, least, f"ask for {query.name}"))


def check_asker(query: Query[Q, Any], request: Q, asker: str) -> None:
    """Raises RequestError unless the node of that id may ask this: the host's own look, where it depends on what is asked."""
    role = role_of_node(asker)
    if role < (least := topics.role_to_ask(query, request)):
        raise RequestError(refusal(role, least, f"ask for {query.name}"))


def check_size(query: Query[Any, Any], payload: bytes) -> None:
    """Raises RequestError for a question that the host's router would drop unread."""
    if len(payload) > query.largest:
        raise RequestError(
            f"a question on {query.name} may have {query.largest} bytes, this one has {len(payload)}: ask for less at once"
        )


def refusal(role: Role, least: Role, what: str) -> str:
    """Why a role may not do something, and who may."""
    if least is Role.HOST:
        return f"{_with_article(role)} may not {what}: the host alone does"
    return f"{_with_article(role)} may not {what}: join with the key of {_with_article(least)}"


def _with_article(role: Role) -> str:
    return f"{'an' if role.title[0] in 'aeo' else 'a'} {role.title}"
