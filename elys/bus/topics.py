"""The one list of what is said on the bus: every key with its message and how it is delivered.

A key is `elys/{session}/{name}` or, for keyed topics, `elys/{session}/{name}/{key}`. No other module spells one.
"""

from __future__ import annotations

import enum
import functools
import re
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from elys.bus.messages import (
    commands,
    exact_state,
    history,
    physics,
    plan,
    scene,
    session,
    state_frame,
    timeline,
    views,
)
from elys.common.errors import BusError

M = TypeVar("M")
Q = TypeVar("Q")
R = TypeVar("R")

PROTOCOL_VERSION: Final = 4
READABLE_VERSIONS: Final = (2, 3, 4)  # of recordings: what came since has defaults
ROOT: Final = "elys"


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
    delivery: Delivery
    encoding: Encoding = Encoding.JSON
    keyed: bool = False
    recorded: bool = True
    newest_of: str = ""  # field of a message: of those with one key the newest is kept for each of its values


@dataclass(frozen=True, slots=True, kw_only=True)
class Query(Generic[Q, R]):
    """Something asked and answered."""

    name: str
    request: type[Q]
    reply: type[R]
    text: str
    request_encoding: Encoding = Encoding.JSON
    reply_encoding: Encoding = Encoding.JSON
    keyed: bool = False


STATE: Final = Topic(
    name="state",
    message=state_frame.StateFrame,
    text="poses and velocities of all bodies, each tick",
    delivery=Delivery.LATEST,
    encoding=Encoding.STATE,
)
DELTA: Final = Topic(
    name="delta",
    message=scene.SceneDelta,
    text="what changed in the scene, numbered",
    delivery=Delivery.SEQUENCED,
)
STATUS: Final = Topic(
    name="status",
    message=session.SessionStatus,
    text="playing, time, speed; at changes and 4 times a second",
    delivery=Delivery.LATEST,
)
EVENTS: Final = Topic(
    name="events",
    message=session.EventBatch,
    text="what happened in a tick",
    delivery=Delivery.SEQUENCED,
)
CONTACTS: Final = Topic(
    name="contacts",
    message=physics.ContactBatch,
    text="contacts and visits to triggers that a tick began or ended",
    delivery=Delivery.SEQUENCED,
)
COMMANDS: Final = Topic(
    name="commands",
    message=commands.CommandRecord,
    text="commands as they were applied or refused",
    delivery=Delivery.SEQUENCED,
)
INPUT: Final = Topic(
    name="input",
    message=commands.Input,
    text="keys, buttons and axes of the node named by the key, for the game; `commands` tells what was applied when",
    delivery=Delivery.SEQUENCED,
    keyed=True,
    recorded=False,
)
LOG: Final = Topic(
    name="log",
    message=session.LogLine,
    text="lines of every node for the console",
    delivery=Delivery.SEQUENCED,
)
PROFILE: Final = Topic(
    name="profile",
    message=session.TickProfile,
    text="what a tick cost, by stage",
    delivery=Delivery.LATEST,
)
DIAGNOSTICS: Final = Topic(
    name="diagnostics",
    message=physics.Diagnostics,
    text="energy, momentum, overlap, errors of joints and of the solver, each tick; only while somebody listens or records",
    delivery=Delivery.LATEST,
)
DEBUG_LINES: Final = Topic(
    name="debug_lines",
    message=physics.DebugLines,
    text="how physics sees the world, in lines of the kind named by the key (boxes, contacts, ...); only while somebody listens",
    delivery=Delivery.LATEST,
    encoding=Encoding.MSGPACK,
    keyed=True,
    recorded=False,
)
VIEW_REQUEST: Final = Topic(
    name="view/request",
    message=views.ViewRequest,
    text="asks the render node named by the key for a picture",
    delivery=Delivery.LATEST,
    keyed=True,
    recorded=False,
    newest_of="view",  # many ask one node: they must not push one another out
)
VIEW_FRAME: Final = Topic(
    name="view/frame",
    message=views.ViewFrame,
    text="a picture for the view named by the key",
    delivery=Delivery.LATEST,
    encoding=Encoding.MSGPACK,
    keyed=True,
    recorded=False,
)
RENDER_PROFILE: Final = Topic(
    name="render_profile",
    message=plan.RenderProfile,
    text="what a picture of the view named by the key cost, by stage, and its passes; only while somebody listens",
    delivery=Delivery.LATEST,
    keyed=True,
    recorded=False,
)

HELLO: Final = Query(
    name="hello",
    request=session.Hello,
    reply=session.Welcome,
    text="the handshake of versions",
)
CLOCK: Final = Query(
    name="clock",
    request=session.ClockRequest,
    reply=session.ClockReply,
    text="what the host's clock says, for ages and round trips; see docs/clock.md",
)
SNAPSHOT: Final = Query(
    name="snapshot",
    request=scene.SnapshotRequest,
    reply=scene.Snapshot,
    text="the whole scene as it is",
)
EXACT: Final = Query(
    name="exact",
    request=exact_state.ExactRequest,
    reply=exact_state.ExactReply,
    text="all that decides how a simulation goes on, at one instant, for recordings",
    reply_encoding=Encoding.MSGPACK,
)
COMMAND: Final = Query(
    name="command",
    request=commands.CommandRequest,
    reply=commands.CommandReply,
    text="asks for a change; answered with accepted or why not",
)
PLAN: Final = Query(
    name="plan",
    request=plan.PlanRequest,
    reply=plan.PhysicsPlan,
    text="which stages a step of physics has, and why the others are off",
)
TOUCHING: Final = Query(
    name="touching",
    request=physics.TouchingRequest,
    reply=physics.Touching,
    text="all contacts that go on; the topic contacts tells what begins and ends from then on",
)
HISTORY: Final = Query(
    name="history",
    request=history.HistoryRequest,
    reply=history.HistoryReply,
    text="what somebody can undo and redo here, and as whom",
)
PREFAB: Final = Query(
    name="prefab",
    request=scene.PrefabRequest,
    reply=scene.PrefabContent,
    text="what stands in a prefab's file, which is on the host's disk",
)
MARKERS: Final = Query(
    name="markers",
    request=timeline.MarkersRequest,
    reply=timeline.Markers,
    text="what stands out on the timeline: collisions, triggers, errors, edits",
)
PICK: Final = Query(
    name="pick",
    request=views.PickRequest,
    reply=views.PickReply,
    text="asks the render node named by the key what is seen at a pixel",
    keyed=True,
)
THUMBNAIL: Final = Query(
    name="thumbnail",
    request=views.ThumbnailRequest,
    reply=views.Thumbnail,
    text="asks the render node named by the key for a small picture of entities that are in no scene",
    request_encoding=Encoding.MSGPACK,
    reply_encoding=Encoding.MSGPACK,
    keyed=True,
)
ASSET: Final = Query(
    name="asset",
    request=bytes,
    reply=bytes,
    text="the bytes whose content hash is the key",
    request_encoding=Encoding.RAW,
    reply_encoding=Encoding.RAW,
    keyed=True,
)
ASSET_OFFER: Final = Query(
    name="offer",
    request=bytes,
    reply=bytes,
    text="gives the host the bytes whose content hash is the key; none asks whether it has them; answered with has or wants",
    request_encoding=Encoding.RAW,
    reply_encoding=Encoding.RAW,
    keyed=True,
)

TOPICS: Final[tuple[Topic[Any], ...]] = (
    STATE,
    DELTA,
    STATUS,
    EVENTS,
    CONTACTS,
    COMMANDS,
    INPUT,
    LOG,
    PROFILE,
    DIAGNOSTICS,
    DEBUG_LINES,
    VIEW_REQUEST,
    VIEW_FRAME,
    RENDER_PROFILE,
)
QUERIES: Final[tuple[Query[Any, Any], ...]] = (
    HELLO,
    CLOCK,
    SNAPSHOT,
    EXACT,
    PREFAB,
    COMMAND,
    HISTORY,
    MARKERS,
    PLAN,
    TOUCHING,
    PICK,
    THUMBNAIL,
    ASSET,
    ASSET_OFFER,
)
# Made only while somebody listens: to listen to them costs whoever makes them.
ON_DEMAND: Final[frozenset[Topic[Any]]] = frozenset({DIAGNOSTICS, DEBUG_LINES, RENDER_PROFILE})

_CHUNK = re.compile(r"[A-Za-z0-9_.-]+\Z")


def key_of(session_name: str, topic: Topic[Any] | Query[Any, Any], key: str = "") -> str:
    """The key a message travels on. Keyed topics take "*" for every key."""
    return _joined(session_name, topic.name, key if topic.keyed else None)


@functools.lru_cache(maxsize=4096)  # the same few in each tick
def _joined(session_name: str, topic: str, key: str | None) -> str:
    _require_chunk("a session's name", session_name)
    if key is None:
        return f"{ROOT}/{session_name}/{topic}"
    if key != "*":
        _require_chunk(f"the key of {topic}", key)
    return f"{ROOT}/{session_name}/{topic}/{key}"


def node_key(session_name: str, kind: str, node: str) -> str:
    """The liveliness token of a node; "*" as kind and node names all."""
    return f"{ROOT}/{session_name}/node/{kind}/{node}"


def topic_of(key: str) -> tuple[Topic[Any], str] | None:
    """The topic a key belongs to and the key's last part for keyed topics; None for what is no topic."""
    parts = key.split("/", 2)
    if len(parts) != 3 or parts[0] != ROOT:
        return None
    for topic in TOPICS:
        if not topic.keyed and parts[2] == topic.name:
            return topic, ""
        if topic.keyed and parts[2].startswith(topic.name + "/"):
            return topic, parts[2][len(topic.name) + 1 :]
    return None


def topic_named(name: str) -> Topic[Any]:
    """The topic of that name; BusError naming those there are."""
    for topic in TOPICS:
        if topic.name == name:
            return topic
    raise BusError(f"there is no topic '{name}'; there are {', '.join(topic.name for topic in TOPICS)}")


def _require_chunk(what: str, text: str) -> None:
    if not _CHUNK.match(text):
        raise BusError(f"{what} may hold letters, digits, '.', '_' and '-', not {text!r}")
