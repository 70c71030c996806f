"""What players can do in a scene, and with which keys and sticks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from elys.cli.app import input_app
from elys.cli.options import Json

Player = Annotated[
    Optional[int],  # noqa: UP045  typer reads the annotation
    typer.Option("--player", help="of this player alone; default: of whoever plays here", min=1, max=16),
]
File = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option("--file", help="file of bindings; default: the user's own"),
]
OfScene = Annotated[
    str, typer.Option("--scene", help="scene whose names they are; default: what scenes have that declare nothing")
]


@input_app.command("list")
def list_(scene: OfScene = "", player: Player = None, file: File = None, json: Json = False) -> None:
    """List what players can do, with which controls, and which of them do more than one thing."""
    from elys.verbs import input as verb

    verb.listed(scene, player=player, file=file, json=json)


@input_app.command("bind")
def bind(
    name: Annotated[str, typer.Argument(help="an action, an axis or a vector, as scenes call it: jump")],
    controls: Annotated[str, typer.Argument(help="what does it from now on: 'k, pad_b'; '' for nothing")],
    scene: OfScene = "",
    player: Player = None,
    file: File = None,
) -> None:
    """Bind something to other controls, in every scene that has it."""
    from elys.verbs import input as verb

    verb.bind(name, controls, scene, player=player, file=file)


@input_app.command("reset")
def reset(
    names: Annotated[
        list[str] | None, typer.Argument(help="what gets the scene's controls again; default: all")
    ] = None,
    player: Player = None,
    file: File = None,
) -> None:
    """Give the scene's own controls back."""
    from elys.verbs import input as verb

    verb.reset(names or [], player=player, file=file)
