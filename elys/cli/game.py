"""The game."""

from __future__ import annotations

from typing import Annotated

import typer

from elys.cli.app import app, node_app
from elys.cli.options import Address, Insecure, Json, Listen, Tls, Trust, listening

LevelName = Annotated[str, typer.Argument(help="meadow, quarry, skyline, or the scene file of one that you made")]
Players = Annotated[int, typer.Option(min=1, max=4, help="balls at the start, one for each player")]
Name = Annotated[str, typer.Option(help="who races; default: your user name")]
Bot = Annotated[bool, typer.Option("--bot", help="let it be driven; no window")]
Races = Annotated[int, typer.Option(min=0, help="end after so many finished races (0: go on)")]
NoGhosts = Annotated[bool, typer.Option("--no-ghosts", help="race alone")]


@app.command()
def game(
    level: LevelName = "",
    players: Players = 1,
    name: Name = "",
    no_ghosts: NoGhosts = False,
    headless: Annotated[
        bool, typer.Option("--headless", help="host it for others: elys view --connect ... --player N")
    ] = False,
    bot: Bot = False,
    races: Races = 0,
    fast: Annotated[bool, typer.Option("--fast", help="with --bot: as fast as it can instead of in real time")] = False,
    times: Annotated[bool, typer.Option("--times", help="list the best times, and end")] = False,
    listen: Listen = None,
    tls: Tls = False,
    insecure: Insecure = False,
    address: Address = [],  # noqa: B006
    trust: Trust = False,
    json: Json = False,
) -> None:
    """Roll a ball through gates against the clock, and against your best run and others'."""
    from elys.common.errors import ElysError
    from elys.verbs import game as verb

    if times:
        verb.times(level, players=players, json=json)
        return
    if fast and not bot:
        raise ElysError("--fast leaves no time to play: give --bot as well")
    where = listening(listen, tls=tls, insecure=insecure, addresses=address)
    chosen = level or verb.FIRST
    if not (headless or bot):
        verb.play(chosen, players=players, person=name, ghosts=not no_ghosts, listen=where)
        return
    verb.host(
        chosen,
        players=players,
        person=name,
        ghosts=not no_ghosts,
        listen=where,
        bot=bot,
        races=races or int(bot),
        realtime=not fast,
        json=json,
    )


@node_app.command("race")
def node_race(
    level: LevelName,
    players: Players = 1,
    name: Name = "",
    no_ghosts: NoGhosts = False,
    listen: Listen = None,
    tls: Tls = False,
    insecure: Insecure = False,
    address: Address = [],  # noqa: B006
) -> None:
    """Hosts races, one after the other."""
    from elys.verbs import game as verb

    verb.host(
        level,
        players=players,
        person=name,
        ghosts=not no_ghosts,
        listen=listening(listen, tls=tls, insecure=insecure, addresses=address),
        bot=False,
        races=0,
        realtime=True,
        has_menu=True,
    )
