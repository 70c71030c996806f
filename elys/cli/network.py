"""The network: who is there, who passes it on, and how everybody does."""

from __future__ import annotations

from typing import Annotated

import typer

from elys.cli.app import app
from elys.cli.options import Address, Connect, Insecure, Json, SessionName, Tls, listening, place, shows_credentials


@app.command()
@shows_credentials
def sessions(
    connect: Connect = None,
    discover: Annotated[
        bool,
        typer.Option("--discover", help="look around in the local network too, for sessions that were told to answer"),
    ] = False,
    seconds: Annotated[float, typer.Option(help="how long to look around [s]", min=0.1, max=60.0)] = 1.0,
    json: Json = False,
) -> None:
    """List the sessions that run on this machine; or those behind an endpoint, or on the local network."""
    from elys.verbs import session_list

    session_list.sessions(connect, discover=discover, seconds=seconds, json=json)


@app.command()
@shows_credentials
def top(
    connect: Connect = None,
    session: SessionName = "",
    network: Annotated[
        bool,
        typer.Option("--network", "-n", help="the nodes of the session: round trip, rates, drops, age of the data"),
    ] = False,
    once: Annotated[bool, typer.Option("--once", help="print the figures once and end")] = False,
    json: Json = False,
) -> None:
    """Watch a running session in the terminal: energy, overlap, errors and times; or its network."""
    from elys.verbs import network_top
    from elys.verbs import top as verb

    if network:
        network_top.top(place(connect, session), once=once, json=json)
    else:
        verb.top(place(connect, session), once=once, json=json)


@app.command()
@shows_credentials
def router(
    connect: Annotated[
        list[str],
        typer.Option(
            help="endpoint of the host or router above; several times: whichever is there. Default: none is above"
        ),
    ] = [],  # noqa: B006
    listen: Annotated[str, typer.Option(help="endpoint at which viewers, sessions and routers connect")] = (
        "tcp/127.0.0.1:7447"
    ),
    tls: Tls = False,
    insecure: Insecure = False,
    address: Address = [],  # noqa: B006
    discover: Annotated[
        bool,
        typer.Option("--discover", help="answer those who look around in the local network with what is behind it"),
    ] = False,
) -> None:
    """Pass sessions on to many: what is above sends once, however many connect here. Routers make a tree."""
    from elys.verbs import router as verb

    verb.router(listening(listen, tls=tls, insecure=insecure, addresses=address), connect, discover=discover)
