"""The one list of what is said on the bus: every key with its message and how it is delivered.

A key is `elys/{session}/{name}` or, for keyed topics, `elys/{session}/{name}/{key}`; questions end with the id of the node that
asks. No other module spells one.

Each topic says which role may publish and hear it, each query who may ask and who may answer. The host's router holds everybody
to that (`access/rules.py`): what is not allowed here reaches nobody.
"""

from __future__ import annotations

import functools
import re
from typing import Any, Final, TypeVar

from elys.bus.access.roles import Role
from elys.bus.messages import (
    commands,
    exact_state,
    ghosts,
    history,
    physics,
    plan,
    scene,
    scripts,
    session,
    state_frame,
    streaming,
    timeline,
    views,
    vitals,
)
from elys.bus.topic_kinds import Delivery as Delivery
from elys.bus.topic_kinds import Encoding as Encoding
from elys.bus.topic_kinds import Query as Query
from elys.bus.topic_kinds import Topic as Topic
from elys.common.errors import BusError

Q = TypeVar("Q")

PROTOCOL_VERSION: Final = 5
READABLE_VERSIONS: Final = (2, 3, 4, 5)  # of recordings: what came since has defaults
ROOT: Final = "elys"

# What kind of node each role may show itself as. The host's alone are those that others take for the host.
NODE_KINDS: Final[dict[str, Role]] = {
    "simulation": Role.HOST,
    "replay": Role.HOST,
    "render": Role.EDITOR,
    "editor": Role.VIEWER,
    "viewer": Role.VIEWER,
    "recorder": Role.VIEWER,
    "ghost": Role.EDITOR,
    "tool": Role.VIEWER,
    "streamer": Role.OWNER,  # beside the host, started by it
    "router": Role.OWNER,  # speaks for all below it
}


def _asker_of_command(request: commands.CommandRequest) -> Role:
    return commands.role_for(request.command)


STATE: Final = Topic(
    name="state",
    message=state_frame.StateFrame,
    text="poses and velocities of all bodies, each tick",
    publisher=Role.HOST,
    delivery=Delivery.LATEST,
    encoding=Encoding.STATE,
)
DELTA: Final = Topic(
    name="delta",
    message=scene.SceneDelta,
    text="what changed in the scene, numbered",
    publisher=Role.HOST,
    delivery=Delivery.SEQUENCED,
)
STATUS: Final = Topic(
    name="status",
    message=session.SessionStatus,
    text="playing, time, speed; at changes and 4 times a second",
    publisher=Role.HOST,
    delivery=Delivery.LATEST,
)
EVENTS: Final = Topic(
    name="events",
    message=session.EventBatch,
    text="what happened in a tick",
    publisher=Role.HOST,
    delivery=Delivery.SEQUENCED,
)
CONTACTS: Final = Topic(
    name="contacts",
    message=physics.ContactBatch,
    text="contacts and visits to triggers that a tick began or ended",
    publisher=Role.HOST,
    delivery=Delivery.SEQUENCED,
)
COMMANDS: Final = Topic(
    name="commands",
    message=commands.CommandRecord,
    text="commands as they were applied or refused",
    publisher=Role.HOST,
    delivery=Delivery.SEQUENCED,
)
INPUT: Final = Topic(
    name="input",
    message=commands.Input,
    text="keys, buttons and axes of the node named by the key, for the game; `commands` tells what was applied when",
    publisher=Role.PLAYER,
    reader=Role.OWNER,
    by_node=True,
    delivery=Delivery.SEQUENCED,
    keyed=True,
    recorded=False,
)
LOG: Final = Topic(
    name="log",
    message=session.LogLine,
    text="lines of every node for the console",
    publisher=Role.EDITOR,
    delivery=Delivery.SEQUENCED,
)
PROFILE: Final = Topic(
    name="profile",
    message=session.TickProfile,
    text="what a tick cost, by stage",
    publisher=Role.HOST,
    delivery=Delivery.LATEST,
)
DIAGNOSTICS: Final = Topic(
    name="diagnostics",
    message=physics.Diagnostics,
    text="energy, momentum, overlap, errors of joints and of the solver, each tick; only while somebody listens or records",
    publisher=Role.HOST,
    delivery=Delivery.LATEST,
)
DEBUG_LINES: Final = Topic(
    name="debug_lines",
    message=physics.DebugLines,
    text="how physics sees the world, in lines of the kind named by the key (boxes, contacts, ...); only while somebody listens",
    publisher=Role.HOST,
    delivery=Delivery.LATEST,
    encoding=Encoding.MSGPACK,
    keyed=True,
    recorded=False,
)
VIEW_REQUEST: Final = Topic(
    name="view/request",
    message=views.ViewRequest,
    text="asks the render node named by the key for a picture",
    publisher=Role.VIEWER,
    largest=4 << 20,  # with everything that is selected and hidden
    reader=Role.EDITOR,
    delivery=Delivery.LATEST,
    keyed=True,
    recorded=False,
    newest_of="view",  # many ask one node: they must not push one another out
)
VIEW_FRAME: Final = Topic(
    name="view/frame",
    message=views.ViewFrame,
    text="a picture for the view named by the key",
    publisher=Role.EDITOR,
    largest=64 << 20,
    delivery=Delivery.LATEST,
    encoding=Encoding.MSGPACK,
    keyed=True,
    recorded=False,
)
GHOST: Final = Topic(
    name="ghost",
    message=ghosts.Ghost,
    text="a recorded run that can be seen beside the session, by its id; at changes and twice a second",
    publisher=Role.EDITOR,
    delivery=Delivery.LATEST,
    keyed=True,
    by_node=True,
    recorded=False,
)
RENDER_PROFILE: Final = Topic(
    name="render_profile",
    message=plan.RenderProfile,
    text="what a picture of the view named by the key cost, by stage, and its passes; only while somebody listens",
    publisher=Role.EDITOR,
    largest=1 << 20,
    delivery=Delivery.LATEST,
    keyed=True,
    recorded=False,
)
STREAM_FRAME: Final = Topic(
    name="stream/frame",
    message=bytes,
    text="states for one viewer behind a network, as far as its link carries them; the key is STREAM.LANE",
    publisher=Role.OWNER,  # the process that the host starts
    largest=16 << 20,
    delivery=Delivery.LATEST,
    encoding=Encoding.RAW,
    keyed=True,
    recorded=False,
)
STREAM_ACK: Final = Topic(
    name="stream/ack",
    message=bytes,
    text="what the viewer of the stream named by the key has",
    publisher=Role.VIEWER,
    reader=Role.OWNER,
    largest=1 << 10,
    by_node=True,
    delivery=Delivery.LATEST,
    encoding=Encoding.RAW,
    keyed=True,
    recorded=False,
)
STREAM_INTEREST: Final = Topic(
    name="stream/interest",
    message=streaming.StreamInterest,
    text="what matters to the viewer of the stream named by the key",
    publisher=Role.VIEWER,
    reader=Role.OWNER,
    by_node=True,
    delivery=Delivery.LATEST,
    encoding=Encoding.MSGPACK,
    keyed=True,
    recorded=False,
)
STREAM_REPORT: Final = Topic(
    name="stream/report",
    message=streaming.StreamReport,
    text="how old, how exact and how lossy the stream named by the key is, told by its viewer once a second",
    publisher=Role.VIEWER,
    by_node=True,
    delivery=Delivery.LATEST,
    keyed=True,
    recorded=False,
)

HELLO: Final = Query(
    name="hello",
    request=session.Hello,
    reply=session.Welcome,
    text="the handshake of versions",
    asker=Role.VIEWER,
    answerer=Role.HOST,
)
CLOCK: Final = Query(
    name="clock",
    request=session.ClockRequest,
    reply=session.ClockReply,
    text="what the host's clock says, for ages and round trips; see docs/clock.md",
    asker=Role.VIEWER,
    answerer=Role.HOST,
)
VITALS: Final = Query(
    name="vitals",
    request=vitals.VitalsRequest,
    reply=vitals.Vitals,
    text="asks the node named by the key how it does on the network",
    asker=Role.VIEWER,
    answerer=Role.VIEWER,  # each for itself
    keyed=True,
)
SNAPSHOT: Final = Query(
    name="snapshot",
    request=scene.SnapshotRequest,
    reply=scene.Snapshot,
    text="the whole scene as it is",
    asker=Role.VIEWER,
    answerer=Role.HOST,
)
EXACT: Final = Query(
    name="exact",
    request=exact_state.ExactRequest,
    reply=exact_state.ExactReply,
    text="all that decides how a simulation goes on, at one instant, for recordings",
    asker=Role.VIEWER,
    answerer=Role.HOST,
    reply_encoding=Encoding.MSGPACK,
)
COMMAND: Final = Query(
    name="command",
    request=commands.CommandRequest,
    reply=commands.CommandReply,
    text="asks for a change; answered with accepted or why not",
    asker=Role.EDITOR,
    answerer=Role.HOST,
    largest=64 << 20,  # a whole scene
    asker_for=_asker_of_command,
)
PLAN: Final = Query(
    name="plan",
    request=plan.PlanRequest,
    reply=plan.PhysicsPlan,
    text="which stages a step of physics has, and why the others are off",
    asker=Role.VIEWER,
    answerer=Role.HOST,
)
TOUCHING: Final = Query(
    name="touching",
    request=physics.TouchingRequest,
    reply=physics.Touching,
    text="all contacts that go on; the topic contacts tells what begins and ends from then on",
    asker=Role.VIEWER,
    answerer=Role.HOST,
)
HISTORY: Final = Query(
    name="history",
    request=history.HistoryRequest,
    reply=history.HistoryReply,
    text="what somebody can undo and redo here, and as whom",
    asker=Role.VIEWER,
    answerer=Role.HOST,
)
PREFAB: Final = Query(
    name="prefab",
    request=scene.PrefabRequest,
    reply=scene.PrefabContent,
    text="what stands in a prefab's file, which is on the host's disk",
    asker=Role.VIEWER,
    answerer=Role.HOST,
)
SCRIPT_FORM: Final = Query(
    name="script_form",
    request=scripts.ScriptFormRequest,
    reply=scripts.ScriptForm,
    text="the fields that a script of the scene declares, with their types, units and ranges",
    asker=Role.VIEWER,
    answerer=Role.HOST,
)
MARKERS: Final = Query(
    name="markers",
    request=timeline.MarkersRequest,
    reply=timeline.Markers,
    text="what stands out on the timeline: collisions, triggers, errors, edits",
    asker=Role.VIEWER,
    answerer=Role.HOST,
)
PICK: Final = Query(
    name="pick",
    request=views.PickRequest,
    reply=views.PickReply,
    text="asks the render node named by the key what is seen at a pixel",
    asker=Role.VIEWER,
    answerer=Role.EDITOR,
    largest=4 << 20,  # with everything that is hidden
    keyed=True,
)
THUMBNAIL: Final = Query(
    name="thumbnail",
    request=views.ThumbnailRequest,
    reply=views.Thumbnail,
    text="asks the render node named by the key for a small picture of entities that are in no scene",
    asker=Role.EDITOR,
    answerer=Role.EDITOR,
    largest=64 << 20,
    request_encoding=Encoding.MSGPACK,
    reply_encoding=Encoding.MSGPACK,
    keyed=True,
)
GHOST_PART: Final = Query(
    name="ghost_part",
    request=ghosts.GhostPartRequest,
    reply=ghosts.GhostPart,
    text="asks the ghost named by the key where its bodies are for a while",
    asker=Role.VIEWER,
    answerer=Role.EDITOR,
    reply_encoding=Encoding.MSGPACK,
    keyed=True,
)
GHOST_SCENE: Final = Query(
    name="ghost_scene",
    request=ghosts.GhostSceneRequest,
    reply=scene.Snapshot,
    text="asks the ghost named by the key what its scene is at a time",
    asker=Role.VIEWER,
    answerer=Role.EDITOR,
    keyed=True,
)
GHOST_ASSET: Final = Query(
    name="ghost_asset",
    request=bytes,
    reply=bytes,
    text="asks the ghost named by the key for the bytes of a reference",
    asker=Role.VIEWER,
    answerer=Role.EDITOR,
    request_encoding=Encoding.RAW,
    reply_encoding=Encoding.RAW,
    keyed=True,
)
GHOST_CHANGE: Final = Query(
    name="ghost_change",
    request=ghosts.GhostChange,
    reply=ghosts.Ghost,
    text="asks the ghost named by the key to be another colour, to run at another time, or to go away",
    asker=Role.EDITOR,
    answerer=Role.EDITOR,
    keyed=True,
)
ASSET: Final = Query(
    name="asset",
    request=bytes,
    reply=bytes,
    text="the bytes whose content hash is the key",
    asker=Role.VIEWER,
    answerer=Role.HOST,
    request_encoding=Encoding.RAW,
    reply_encoding=Encoding.RAW,
    keyed=True,
)
ASSET_OFFER: Final = Query(
    name="offer",
    request=bytes,
    reply=bytes,
    text="gives the host the bytes whose content hash is the key; none asks whether it has them; answered with has or wants",
    asker=Role.EDITOR,
    answerer=Role.HOST,
    largest=64 << 20,
    request_encoding=Encoding.RAW,
    reply_encoding=Encoding.RAW,
    keyed=True,
)

STREAM_ASK: Final = Query(
    name="stream/ask",
    request=streaming.StreamRequest,
    reply=streaming.StreamOffer,
    text="asks for states as a link carries them, instead of the topic state",
    asker=Role.VIEWER,
    answerer=Role.HOST,
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
    GHOST,
    RENDER_PROFILE,
    STREAM_FRAME,
    STREAM_ACK,
    STREAM_INTEREST,
    STREAM_REPORT,
)
QUERIES: Final[tuple[Query[Any, Any], ...]] = (
    HELLO,
    CLOCK,
    VITALS,
    SNAPSHOT,
    EXACT,
    PREFAB,
    SCRIPT_FORM,
    COMMAND,
    HISTORY,
    MARKERS,
    PLAN,
    TOUCHING,
    PICK,
    THUMBNAIL,
    GHOST_PART,
    GHOST_SCENE,
    GHOST_ASSET,
    GHOST_CHANGE,
    ASSET,
    ASSET_OFFER,
    STREAM_ASK,
)
# Made only while somebody listens: to listen to them costs whoever makes them.
ON_DEMAND: Final[frozenset[Topic[Any]]] = frozenset({DIAGNOSTICS, DEBUG_LINES, RENDER_PROFILE})

_CHUNK = re.compile(r"[A-Za-z0-9_.-]+\Z")


def key_of(session_name: str, topic: Topic[Any] | Query[Any, Any], key: str = "") -> str:
    """The key a message travels on. Keyed topics take "*" for every key."""
    return _joined(session_name, topic.name, key if topic.keyed else None)


def asked_key(session_name: str, query: Query[Any, Any], key: str = "", *, asker: str = "*") -> str:
    """The key a question of the node `asker` travels on; "*" is everybody, for who answers."""
    if asker != "*":
        _require_chunk("the id of a node", asker)
    return f"{key_of(session_name, query, key)}/{asker}"


def parts_of_question(query: Query[Any, Any], full_key: str) -> tuple[str, str]:
    """The key and the asker's id in what `asked_key` made; "" for what it does not carry."""
    parts = full_key.split("/")[3:]
    return (parts[0] if query.keyed and parts else ""), (parts[-1] if len(parts) > query.keyed else "")


def greeting_key(session_name: str, asker: str) -> str:
    """Where a node greets the host of a session, or of any if it is named "*"."""
    return f"{ROOT}/{session_name}/{HELLO.name}/{asker}"


def role_to_ask(query: Query[Q, Any], request: Q) -> Role:
    """What somebody must at least be to ask this."""
    return query.asker if query.asker_for is None else max(query.asker, query.asker_for(request))


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


def is_chunk(text: str) -> bool:
    """Whether a text can be a session's name or a key."""
    return _CHUNK.match(text) is not None


def _require_chunk(what: str, text: str) -> None:
    if not is_chunk(text):
        raise BusError(f"{what} may hold letters, digits, '.', '_' and '-', not {text!r}")
