"""What is said on the bus."""

from __future__ import annotations

from typing import Annotated

import typer

from elys.cli.app import topic_app
from elys.cli.options import Connect, Json, SessionName, place, shows_credentials


@topic_app.command("list")
def topic_list(json: Json = False) -> None:
    """List the topics, their messages and how they are delivered."""
    from elys.verbs import topic

    topic.list_topics(json=json)


@topic_app.command("info")
@shows_credentials
def topic_info(
    topic: Annotated[str, typer.Argument(help="name of a topic; default: all")] = "",
    connect: Connect = None,
    session: SessionName = "",
    seconds: Annotated[float, typer.Option(help="how long to measure [s]", min=0.1, max=1e3)] = 1.0,
    json: Json = False,
) -> None:
    """Say who publishes and hears a topic, how much and how old, how it is delivered, and what its messages hold."""
    from elys.verbs import topic as verb

    verb.info(topic, place(connect, session), seconds=seconds, json=json)


@topic_app.command("echo")
@shows_credentials
def topic_echo(
    topic: Annotated[str, typer.Argument(help="name of a topic (elys topic list)")],
    connect: Connect = None,
    session: SessionName = "",
    count: Annotated[int, typer.Option("--count", "-n", help="end after so many messages (0: never)", min=0)] = 0,
) -> None:
    """Print the messages of a topic as they come."""
    from elys.verbs import topic as verb

    verb.echo(topic, place(connect, session), count=count)


@topic_app.command("hz")
@shows_credentials
def topic_hz(
    topic: Annotated[str, typer.Argument(help="name of a topic; default: all")] = "",
    connect: Connect = None,
    session: SessionName = "",
    seconds: Annotated[float, typer.Option(help="how long to measure [s]", min=0.1, max=1e6)] = 2.0,
    json: Json = False,
) -> None:
    """Measure how often and how much a topic is published."""
    from elys.verbs import topic as verb

    verb.hz(topic, place(connect, session), seconds=seconds, json=json)
