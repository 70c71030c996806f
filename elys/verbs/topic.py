"""topic list | info | echo | hz: looking at the bus."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Final

import msgspec

from elys.bus import topics
from elys.verbs.output import print_json, print_table, size_text

if TYPE_CHECKING:
    from elys.bus.network import TopicUse
    from elys.bus.topic_tools import TopicInfo

_DELIVERIES: Final = {
    topics.Delivery.LATEST.value: "latest: who is slow misses older ones and delays nobody",
    topics.Delivery.SEQUENCED.value: "sequenced: reliable and in order",
}


def list_topics(*, json: bool) -> None:
    """Prints the one list of topics."""
    from elys.bus import topic_tools

    rows = topic_tools.list_topics()
    if json:
        print_json(rows)
    else:
        columns = ("topic", "message", "delivery", "encoding", "least role", "what")
        print_table(columns, ((r.name, r.message, r.delivery, r.encoding, r.roles, r.text) for r in rows))


def info(name: str, connect: str | None, *, seconds: float, json: bool) -> None:
    """Prints who says and hears topics in a session, and how much; of one topic also what its messages hold."""
    from elys.bus import topic_tools
    from elys.verbs.nodes import joined

    names = [topics.topic_named(name).name] if name else [topic.name for topic in topics.TOPICS]

    async def work() -> list[topic_tools.TopicInfo]:
        async with joined(connect, kind="tool") as session:
            return await topic_tools.info(session, names, interval=seconds)

    found = asyncio.run(work())
    if json:
        print_json(found)
    elif name:
        print_table(("", ""), _lines_of(found[0]))
    else:
        columns = ("topic", "says", "hear", "messages/s", "size", "age p50 / p99", "delivery")
        print_table(columns, map(_row_of, found))


def _row_of(found: TopicInfo) -> tuple[str, ...]:
    use = found.use
    return (
        found.name,
        ", ".join(use.publishers),
        str(len(use.listeners) or ""),
        f"{use.rate:.1f}" if use.rate else "",
        size_text(use.size) if use.size else "",
        _age(use),
        found.delivery,
    )


def _lines_of(found: TopicInfo) -> list[tuple[str, str]]:
    use = found.use
    made = ", made only while somebody listens" if found.on_demand else ""
    return [
        ("topic", f"{found.name}: {found.text}"),
        ("says", ", ".join(use.publishers) or "nobody so far"),
        ("hear", ", ".join(use.listeners) or "nobody"),
        ("rate", f"{use.rate:.1f} messages/s of {size_text(use.size)}, {size_text(use.rate * use.size)}/s"),
        ("age", _age(use) or "its messages do not tell"),
        ("who may", f"{found.publisher} says, {found.reader} hears"),
        ("delivery", _DELIVERIES[found.delivery] + made),
        ("recorded", "yes" if found.recorded else "no"),
        ("message", f"{found.message}, as {found.encoding}"),
        *((f"  {field}", kind) for field, kind in found.fields.items()),
    ]


def _age(use: TopicUse) -> str:
    return f"{use.age_p50:.1f} / {use.age_p99:.1f} ms" if use.age_p50 >= 0.0 else ""


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
