"""Scenes: those that come with ELYS, their form, and what they make the engine do."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from elys.cli.app import app
from elys.cli.options import Json, Scene, Threads, Trust


@app.command()
def samples(
    name: Annotated[str, typer.Argument(help="write this one; default: list them")] = "",
    output: Annotated[Optional[Path], typer.Option("--output", "-o", help="where to; default: NAME.scene.json")] = None,  # noqa: UP045
    json: Json = False,
) -> None:
    """List the scenes ELYS comes with, or write one as a file to start from."""
    from elys.verbs import facts

    facts.samples(name, output, json=json)


@app.command()
def trust(
    folder: Annotated[Optional[Path], typer.Argument(help="trust the scripts in it; default: list the folders")] = None,  # noqa: UP045
    forget: Annotated[bool, typer.Option("--forget", help="trust it no longer")] = False,
    json: Json = False,
) -> None:
    """Let the scripts in a folder run whenever a scene has them. Scripts are programs: they may do whatever you may."""
    from elys.verbs import trusting

    trusting.trust(folder, forget=forget, json=json)


@app.command()
def schema(
    component: Annotated[
        str, typer.Argument(help="a component, or edits (see elys fork); default: the scene file")
    ] = "",
) -> None:
    """Print the JSON Schema of the scene file (or of one component), for editors that check while you type."""
    from elys.verbs import facts

    facts.schema(component)


@app.command()
def plan(
    scene: Scene,
    at: Annotated[
        float, typer.Option(min=0.0, max=36000.0, help="simulated seconds after which the plan is told")
    ] = 0.0,
    measure: Annotated[
        bool, typer.Option("--measure/--no-measure", help="measure what stages take, and what is saved")
    ] = True,
    seconds: Annotated[float, typer.Option(min=0.05, max=600.0, help="simulated seconds that are measured")] = 1.0,
    threads: Threads = 1,
    json: Json = False,
    trust: Trust = False,
) -> None:
    """What a scene makes the engine do, why the rest is switched off, and what that saves."""
    from elys.verbs import plan as verb

    verb.plan(scene, at=at, seconds=seconds if measure else 0.0, threads=threads, json=json)
