"""tell: an event for the scripts of a running session, as any program can tell one over the bus."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

from elys.bus import topics
from elys.bus.messages.commands import CommandReply, CommandRequest, Tell
from elys.bus.messages.scene import SnapshotRequest
from elys.bus.session import Session
from elys.common.errors import RequestError


def tell(kind: str, values: Sequence[str], connect: str | None, *, to: str) -> None:
    """Tells an event, and says in which tick it was taken; RequestError where it is refused."""
    from elys.verbs.nodes import joined

    told = dict(map(_value_of, values))

    async def work() -> CommandReply:
        async with joined(connect, kind="tool") as session:
            command = Tell(kind=kind, entity=await _entity(session, to) if to else 0, values=told)
            return await session.request(topics.COMMAND, CommandRequest(origin=session.node.id, command=command))

    reply = asyncio.run(work())
    if not reply.accepted:
        raise RequestError(reply.reason)
    print(f"told at tick {reply.tick}")


def _value_of(text: str) -> tuple[str, Any]:
    """A value of the event: as in JSON where it is that (2.5, true, [1, 2], "2"), else a text."""
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise RequestError(f"'{text}' is no value of an event: write NAME=VALUE")
    try:
        return name, msgspec.json.decode(value)
    except msgspec.DecodeError:
        return name, value


async def _entity(session: Session, named: str) -> int:
    """The entity of an id, or of a name that only one has."""
    if named.isdecimal():
        return int(named)
    snapshot = await session.request(topics.SNAPSHOT, SnapshotRequest(), timeout=5.0)
    ids = np.frombuffer(snapshot.entities, np.uint32).tolist()
    found = [entity for entity, name in zip(ids, snapshot.names, strict=True) if name == named]
    if len(found) == 1:
        return int(found[0])
    if not found:
        raise RequestError(f"there is no entity called '{named}'")
    raise RequestError(
        f"{len(found)} entities are called '{named}': say which by its id, one of {', '.join(map(str, found[:8]))}"
    )
