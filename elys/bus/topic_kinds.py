"""What a topic and a query are: the columns of the table in `topics.py`."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from elys.bus.access.roles import Role

M = TypeVar("M")
Q = TypeVar("Q")
R = TypeVar("R")


class Delivery(enum.Enum):
    """What may be lost for whom."""

    LATEST = "latest"  # newest wins: a slow reader loses older ones and delays nobody
    SEQUENCED = "sequenced"  # reliable and in order


class Encoding(enum.Enum):
    """How a message becomes bytes, after the protocol prefix."""

    JSON = "json"  # readable in every tool, exact for floats
    MSGPACK = "msgpack"  # where pictures or arrays travel along
    STATE = "state"  # the packed state frame
    RAW = "raw"  # bytes as they are


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic(Generic[M]):
    """Something published."""

    name: str
    message: type[M]
    text: str
    publisher: Role  # whoever is less may not say it
    delivery: Delivery
    reader: Role = Role.VIEWER  # whoever is less may not hear it
    encoding: Encoding = Encoding.JSON
    keyed: bool = False
    largest: int = 1 << 16  # [bytes] that a client may publish at once
    by_node: bool = False  # the key is the id of the node that publishes, and of no other
    recorded: bool = True
    newest_of: str = ""  # field of a message: of those with one key the newest is kept for each of its values


@dataclass(frozen=True, slots=True, kw_only=True)
class Query(Generic[Q, R]):
    """Something asked and answered."""

    name: str
    request: type[Q]
    reply: type[R]
    text: str
    asker: Role  # whoever is less may not ask
    answerer: Role  # whoever is less may not answer
    asker_for: Callable[[Q], Role] | None = None  # where it depends on what is asked; never less than `asker`
    largest: int = 1 << 16  # [bytes] of a question
    request_encoding: Encoding = Encoding.JSON
    reply_encoding: Encoding = Encoding.JSON
    keyed: bool = False
