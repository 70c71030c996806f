"""What zenoh's router lets through, worked out from the table in `topics.py`: what stands in no rule goes nowhere.

    ingress: what a client may send to the host          egress: what the host may pass on to a client

Rules are of users, as every key that names a node must name one of the client's own. What the host's own process says and hears
passes no rule.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from elys.bus import topics
from elys.bus.access.roles import ids_of, role_of_user
from elys.bus.topics import NODE_KINDS, QUERIES, ROOT, TOPICS, Query, Topic

_SAID: Final = ("put", "delete")
_DECLARED: Final = ("declare_subscriber", "declare_queryable", "declare_liveliness_subscriber")
_ALL: Final = f"{ROOT}/**"


def access_control(users: Iterable[str]) -> dict[str, Any]:
    """zenoh's `access_control` for these users, who are known by the name of a password or of a certificate."""
    rules: list[dict[str, Any]] = []
    subjects, policies = [], []
    for user in users:
        own = [rule for rule in user_rules(user) if rule["key_exprs"]]
        rules += own
        # Two subjects: zenoh asks all properties of one to hold, and a client shows a password or a certificate.
        subjects += [
            {"id": f"{user} by password", "usernames": [user]},
            {"id": f"{user} by certificate", "cert_common_names": [user]},
        ]
        policies.append(
            {"rules": [rule["id"] for rule in own], "subjects": [f"{user} by password", f"{user} by certificate"]}
        )
    return {"enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies}


def user_rules(user: str) -> list[dict[str, Any]]:
    """What one user may send and be sent."""
    role, ids = role_of_user(user), ids_of(user)
    heard = [expression(topic) for topic in TOPICS if role >= topic.reader]
    said = [expression(topic, key=ids if topic.by_node else "*") for topic in TOPICS if role >= topic.publisher]
    asked = [question(query, asker=ids) for query in QUERIES if role >= query.asker] + [expression(topics.HELLO)]
    answered = [question(query, key=ids) for query in QUERIES if role >= query.answerer]
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
