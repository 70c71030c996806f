"""Pictures and videos."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from elys.cli.app import app
from elys.cli.options import Connect, DebugKinds, Ghost, SessionName, Trust, place, shows_credentials


@app.command()
@shows_credentials
def render(
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="out.png; out.exr or out.npy for linear numbers; out.mp4 for a video"),
    ],
    source: Annotated[
        Optional[str],  # noqa: UP045
        typer.Argument(help="a scene or a recording (.mcap); default: the running session", show_default=False),
    ] = None,
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT in pixels")] = "1280x720",
    time: Annotated[
        float, typer.Option(help="simulation time of a picture, start of a video [s]", min=0.0, max=1e6)
    ] = 0.0,
    duration: Annotated[
        float, typer.Option(help="length of a video [s]; 0: a recording's, or 5 s of a scene", min=0.0, max=1e6)
    ] = 0.0,
    fps: Annotated[float, typer.Option(help="pictures a second of a video", min=1.0, max=240.0)] = 30.0,
    view: Annotated[
        str,
        typer.Option(
            help="what is shown: shaded, normals, albedo, roughness, depth, entity, segmentation, wireframe or overdraw"
        ),
    ] = "shaded",
    camera: Annotated[str, typer.Option(help="entity whose camera looks; default: the one of highest priority")] = "",
    path: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="file of a camera path: keyframes of time, eye, target, field_of_view"),
    ] = None,
    orbit: Annotated[
        float, typer.Option(help="circle around the scene, once in so many seconds (0: do not)", min=0.0, max=1e6)
    ] = 0.0,
    connect: Connect = None,
    session: SessionName = "",
    debug: DebugKinds = "",
    debug_of: Annotated[
        list[str],
        typer.Option(help="entity that --debug is about, with all below it; may be given several times; default: all"),
    ] = [],  # noqa: B006
    ghost: Ghost = [],  # noqa: B006
    stamp: Annotated[bool, typer.Option("--stamp", help="write tick and simulation time onto the pictures")] = False,
    sound: Annotated[bool, typer.Option("--sound", help="give a film its sound")] = False,
    environment: Annotated[
        bool,
        typer.Option(help="light from all around and a sky, as the scene has them; else lamps alone, before black"),
    ] = True,
    sampled_light: Annotated[
        bool,
        typer.Option(
            "--sampled-light",
            help="sample light from all around for each pixel: within 2 % from every side, for hundreds of times the time",
        ),
    ] = False,
    trust: Trust = False,
) -> None:
    """Draw a scene, a recording or a running session offscreen, to a picture or a video."""
    from elys.verbs import render as verb

    verb.render(
        source,
        output,
        size=size,
        time=time,
        duration=duration,
        fps=fps,
        view=view,
        camera=camera,
        path=path,
        orbit=orbit,
        connect=place(connect, session),
        environment=environment,
        sampled=sampled_light,
        debug=debug,
        debug_of=debug_of,
        stamp=stamp,
        ghosts=ghost,
        sound=sound,
    )
