"""What zenoh's router lets through, worked out from the table in `topics.py`: what stands in no rule goes nowhere.

    ingress: what a client may send to the host          egress: what the host may pass on to a client

Rules are of users, as every key that names a node must name one of the client's own. What the host's own process says and hears
passes no rule.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from elys.bus import topics
from elys.bus.access.roles import MARK, Role, ids_of, role_of_user
from elys.bus.topics import NODE_KINDS, QUERIES, ROOT, TOPICS, Query, Topic

_SAID: Final = ("put", "delete")
_DECLARED: Final = ("declare_subscriber", "declare_queryable", "declare_liveliness_subscriber")
_EVERYTHING: Final = (*_SAID, *_DECLARED, "query", "reply", "liveliness_token", "liveliness_query")
_IDS_OF_USERS: Final = f"$*{MARK}$*"
_ALL: Final = f"{ROOT}/**"


def access_control(users: Iterable[str]) -> dict[str, Any]:
    """zenoh's `access_control` of a host for these users, who are known by the name of a password or of a certificate."""
    return _control([(user_rules(user), _subjects(user)) for user in users])


def router_access_control(users: Iterable[str], inner_protocol: str) -> dict[str, Any]:
    """The same of a router: owners may host sessions below it, and what comes by the protocol of its own comes from above."""
    everything = [
        _rule("above", f"says and hears all ({flow})", flow, _EVERYTHING, [_ALL]) for flow in ("ingress", "egress")
    ]
    above = (everything, [{"id": "above", "link_protocols": [inner_protocol]}])
    return _control([*((user_rules(user, hosts=True), _subjects(user)) for user in users), above])


def _control(granted: Iterable[tuple[list[dict[str, Any]], list[dict[str, Any]]]]) -> dict[str, Any]:
    """From rules and subjects of each."""
    rules: list[dict[str, Any]] = []
    subjects, policies = [], []
    for own, known_by in granted:
        kept = [rule for rule in own if rule["key_exprs"]]
        rules += kept
        subjects += known_by
        policies.append({"rules": [rule["id"] for rule in kept], "subjects": [subject["id"] for subject in known_by]})
    return {"enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies}


def _subjects(user: str) -> list[dict[str, Any]]:
    """Two: zenoh asks all properties of one to hold, and a client shows a password or a certificate."""
    return [
        {"id": f"{user} by password", "usernames": [user]},
        {"id": f"{user} by certificate", "cert_common_names": [user]},
    ]


def user_rules(user: str, *, hosts: bool = False) -> list[dict[str, Any]]:
    """What one user may send and be sent; where owners may host sessions, they may say all that hosts do.

    Owners may bear the ids of other users: a router does, for all who are below it.
    """
    role, ids = role_of_user(user), ids_of(user)
    if role is Role.OWNER:
        role, ids = (Role.HOST, "*") if hosts else (role, _IDS_OF_USERS)
    heard = [expression(topic) for topic in TOPICS if role >= topic.reader]
    said = [expression(topic, key=ids if topic.by_node else "*") for topic in TOPICS if role >= topic.publisher]
    asked = [question(query, asker=ids) for query in QUERIES if role >= query.asker] + [expression(topics.HELLO)]
    answered = [question(query, key=ids) for query in QUERIES if role >= query.answerer]
    answered += [expression(topics.HELLO)] if role >= topics.HELLO.answerer else []
    shown = [topics.node_key("*", kind, ids) for kind, least in NODE_KINDS.items() if role >= least]
    nodes = [topics.node_key("*", "*", "*")]
    return [
        _rule(user, "says", "ingress", _SAID, said),
        _rule(user, "hears", "ingress", ("declare_subscriber",), heard),
        _rule(user, "asks", "ingress", ("query",), asked),
        _rule(user, "answers", "ingress", ("declare_queryable", "reply"), answered),
        _rule(user, "shows itself", "ingress", ("liveliness_token",), shown),
        _rule(user, "sees others", "ingress", ("declare_liveliness_subscriber", "liveliness_query"), nodes),
        _rule(user, "is told", "egress", _SAID, heard),
        _rule(user, "is asked", "egress", ("query",), answered),
        _rule(user, "is answered", "egress", ("reply",), asked),
        _rule(user, "is shown others", "egress", ("liveliness_token", "liveliness_query"), nodes),
        _rule(user, "learns who listens", "egress", _DECLARED, [_ALL]),
    ]


def expression(topic: Topic[Any] | Query[Any, Any], *, key: str = "*") -> str:
    """The keys of a topic in every session, or of a query where nobody says who asks."""
    return f"{ROOT}/*/{topic.name}" + (f"/{key}" if topic.keyed else "")


def question(query: Query[Any, Any], *, key: str = "*", asker: str = "*") -> str:
    """The keys on which a query is asked in every session."""
    return f"{ROOT}/*/{query.name}" + (f"/{key}" if query.keyed else "") + f"/{asker}"


def _rule(user: str, what: str, flow: str, messages: Iterable[str], keys: list[str]) -> dict[str, Any]:
    return {
        "id": f"{user} {what}",
        "permission": "allow",
        "flows": [flow],
        "messages": list(messages),
        "key_exprs": keys,
    }
