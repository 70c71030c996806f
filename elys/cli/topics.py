"""What is said on the bus."""

from __future__ import annotations

from typing import Annotated

import typer

from elys.cli.app import topic_app
from elys.cli.options import Connect, Json, shows_credentials


@topic_app.command("list")
def topic_list(json: Json = False) -> None:
    """List the topics, their messages and how they are delivered."""
    from elys.verbs import topic

    topic.list_topics(json=json)


@topic_app.command("echo")
@shows_credentials
def topic_echo(
    topic: Annotated[str, typer.Argument(help="name of a topic (elys topic list)")],
    connect: Connect = None,
    count: Annotated[int, typer.Option("--count", "-n", help="end after so many messages (0: never)", min=0)] = 0,
) -> None:
    """Print the messages of a topic as they come."""
    from elys.verbs import topic as verb

    verb.echo(topic, connect, count=count)


@topic_app.command("hz")
@shows_credentials
def topic_hz(
    topic: Annotated[str, typer.Argument(help="name of a topic; default: all")] = "",
    connect: Connect = None,
    seconds: Annotated[float, typer.Option(help="how long to measure [s]", min=0.1, max=1e6)] = 2.0,
    json: Json = False,
) -> None:
    """Measure how often and how much a topic is published."""
    from elys.verbs import topic as verb

    verb.hz(topic, connect, seconds=seconds, json=json)
