"""Experiments: speed against error, the cheapest settings, many runs, hard cases."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from elys.cli.app import app, cases_app
from elys.cli.options import Budget, Cluster, Jobs, Json, Only, Scene, Seconds, Trust


@app.command()
def pareto(
    scenes: Annotated[list[str], typer.Argument(help="scenes, or samples by name", show_default=False)],
    seconds: Seconds = 5.0,
    error: Budget = 1e-3,
    only: Only = [],  # noqa: B006  typer copies it
    peers: Annotated[bool, typer.Option("--peers", help="put rapier3d and mujoco beside it (extra 'peers')")] = False,
    html: Annotated[Optional[Path], typer.Option(help="also write a page with curves and pictures")] = None,  # noqa: UP045
    json: Json = False,
    jobs: Jobs = 0,
    cluster: Cluster = "",
    trust: Trust = False,
) -> None:
    """Speed against error: run a scene at a ladder of tick rates, substeps and strengths, and judge each."""
    from elys.verbs import pareto as verb

    verb.pareto(
        scenes, seconds=seconds, error=error, only=only, peers=peers, page=html, json=json, jobs=jobs, cluster=cluster
    )


@app.command()
def calibrate(
    scene: Scene,
    output: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--output", "-o", help="write the calibrated scene there; default: into the scene's file"),
    ] = None,
    seconds: Seconds = 5.0,
    error: Budget = 1e-3,
    only: Only = [],  # noqa: B006  typer copies it
    keep_tick_rate: Annotated[
        bool, typer.Option("--keep-tick-rate", help="choose substeps and strength alone")
    ] = False,
    json: Json = False,
    jobs: Jobs = 0,
    cluster: Cluster = "",
    trust: Trust = False,
) -> None:
    """Find the cheapest settings within an error budget and write them into the scene, with the evidence."""
    from elys.verbs import calibrate as verb

    verb.calibrate(
        scene,
        output=output,
        seconds=seconds,
        error=error,
        only=only,
        keep_tick_rate=keep_tick_rate,
        json=json,
        jobs=jobs,
        cluster=cluster,
    )


@app.command()
def sweep(
    scene: Scene,
    output: Annotated[Path, typer.Option("--output", "-o", help="the table: .parquet, .csv or .json")],
    vary: Annotated[
        list[str],
        typer.Option(
            help="NAME=A,B,C or NAME=A..B or NAME=A..B:N of seed, gravity, tick_rate, ... or ENTITY.COMPONENT.FIELD"
        ),
    ] = [],  # noqa: B006
    seconds: Seconds = 5.0,
    jitter: Annotated[float, typer.Option(min=0.0, help="[m] by which a seed moves each body at most")] = 1e-3,
    jobs: Jobs = 0,
    cluster: Cluster = "",
    trust: Trust = False,
) -> None:
    """Run a scene many times with other values, every combination a row of a table."""
    from elys.verbs import sweep as verb

    verb.sweep(scene, vary=vary, output=output, seconds=seconds, jitter=jitter, jobs=jobs, cluster=cluster)


@cases_app.command("list")
def cases_list(json: Json = False) -> None:
    """List the hard cases and what makes each hard."""
    from elys.verbs import cases

    cases.list_cases(json=json)


@cases_app.command("run")
def cases_run(
    names: Annotated[Optional[list[str]], typer.Argument(help="names of cases (elys cases list)")] = None,  # noqa: UP045
    every: Annotated[bool, typer.Option("--all", help="run all of them")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="long ones shorter, large ones smaller")] = False,
    jobs: Annotated[int, typer.Option("--jobs", min=0, help="so many at a time (0: one a processor)")] = 0,
    json: Json = False,
) -> None:
    """Run hard cases and print their errors; ends with 1 where one is above its bound."""
    from elys.verbs import cases

    raise typer.Exit(cases.run_cases(names or [], every=every, quick=quick, jobs=jobs, json=json))
