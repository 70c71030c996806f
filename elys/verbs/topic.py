"""topic list | echo | hz: looking at the bus."""

from __future__ import annotations

import asyncio

import msgspec

from elys.bus import topics
from elys.verbs.output import print_json, print_table, size_text


def list_topics(*, json: bool) -> None:
    """Prints the one list of topics."""
    from elys.bus import topic_tools

    rows = topic_tools.list_topics()
    if json:
        print_json(rows)
    else:
        columns = ("topic", "message", "delivery", "encoding", "least role", "what")
        print_table(columns, ((r.name, r.message, r.delivery, r.encoding, r.roles, r.text) for r in rows))


def echo(name: str, connect: str | None, *, count: int) -> None:
    """Prints messages of one topic, a JSON line each."""
    from elys.bus import topic_tools
    from elys.verbs.nodes import joined

    topics.topic_named(name)

    async def work() -> None:
        async with joined(connect, kind="tool") as session:
            printed = 0
            async for message in topic_tools.echo(session, name):
                print(msgspec.json.encode(message).decode(), flush=True)
                printed += 1
                if printed == count:
                    return

    asyncio.run(work())


def hz(name: str, connect: str | None, *, seconds: float, json: bool) -> None:
    """Measures one topic, or all of them at once, for a while."""
    from elys.bus import topic_tools
    from elys.verbs.nodes import joined

    names = [topics.topic_named(name).name] if name else [topic.name for topic in topics.TOPICS]

    async def work() -> list[topic_tools.RateReport]:
        async with joined(connect, kind="tool") as session:
            return await asyncio.gather(*(anext(topic_tools.hz(session, n, interval=seconds)) for n in names))

    reports = asyncio.run(work())
    if json:
        print_json(dict(zip(names, reports, strict=True)))
        return
    rows = [
        (
            n,
            f"{r.rate:.1f}",
            f"{1000 * r.deviation:.2f} ms",
            f"{1000 * r.longest:.1f} ms",
            size_text(r.bandwidth) + "/s",
        )
        for n, r in zip(names, reports, strict=True)
    ]
    print_table(("topic", "messages/s", "deviation", "longest gap", "bandwidth"), rows)
