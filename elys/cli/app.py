"""The program `elys` and its groups of verbs."""

from __future__ import annotations

from typing import Annotated

import typer

import elys

app = typer.Typer(
    name="elys",
    help="ELYS: a game engine of processes on a message bus; every session can be recorded and replayed.",
    epilog="Start with: elys demo   ·   elys run SCENE   ·   elys doctor",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
topic_app = typer.Typer(help="Look at what is said on the bus.", no_args_is_help=True)
keys_app = typer.Typer(help="Who may come into your sessions from elsewhere: secrets and certificates.")
input_app = typer.Typer(help="What players can do in a scene, and with which keys and sticks.", no_args_is_help=True)
cases_app = typer.Typer(help="The hard cases: what they are, and how wrong ELYS is in them.", no_args_is_help=True)
node_app = typer.Typer(help="Single nodes, as launch files start them.", no_args_is_help=True)
app.add_typer(topic_app, name="topic")
app.add_typer(keys_app, name="keys")
app.add_typer(input_app, name="input")
app.add_typer(cases_app, name="cases")
app.add_typer(node_app, name="node", hidden=True)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"ELYS {elys.__version__}")
        raise typer.Exit


@app.callback()
def about(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="print the version and end")
    ] = False,
) -> None:
    """ELYS: a game engine of processes on a message bus; every session can be recorded and replayed."""
