"""topic list | echo | hz: looking at the bus."""

from __future__ import annotations

import asyncio

from elys.bus import topics
from elys.verbs.output import print_json, print_table, size_text


def list_topics(*, json: bool) -> None:
    """Prints the one list of topics."""
    rows = [
        {
            "name": topic.name,
            "message": topic.message.__name__,
            "delivery": topic.delivery.value,
            "encoding": topic.encoding.value,
            "text": topic.text,
        }
        for topic in topics.TOPICS
    ]
    rows += [
        {
            "name": query.name,
            "message": f"{query.request.__name__} -> {query.reply.__name__}",
            "delivery": "answered",
            "encoding": query.reply_encoding.value,
            "text": query.text,
        }
        for query in topics.QUERIES
    ]
    if json:
        print_json(rows)
    else:
        print_table(("topic", "message", "delivery", "encoding", "what"), (row.values() for row in rows))


def echo(name: str, connect: str | None, *, count: int) -> None:
    """Prints messages of one topic, a JSON line each."""
    from elys.bus.topic_tools import echo_lines
    from elys.verbs.nodes import joined

    topic = topics.topic_named(name)

    async def work() -> None:
        async with joined(connect, kind="tool") as session:
            printed = 0
            async for line in echo_lines(session, topic):
                print(line, flush=True)
                printed += 1
                if printed == count:
                    return

    asyncio.run(work())


def hz(name: str, connect: str | None, *, seconds: float, json: bool) -> None:
    """Measures rates and sizes for a while."""
    from elys.bus.topic_tools import measure_rates
    from elys.verbs.nodes import joined

    chosen = (topics.topic_named(name),) if name else topics.TOPICS

    async def work() -> None:
        async with joined(connect, kind="tool") as session:
            rates = await measure_rates(session, chosen, seconds=seconds)
        if json:
            print_json(rates)
        else:
            rows = [(r.topic, f"{r.rate:.1f}", size_text(r.mean_size), size_text(r.bandwidth) + "/s") for r in rates]
            print_table(("topic", "messages/s", "mean size", "bandwidth"), rows)

    asyncio.run(work())
