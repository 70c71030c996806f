"""Sessions: run, watch, edit, look at."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Optional

import typer

from elys.cli.app import app
from elys.cli.options import (
    Address,
    At,
    Compact,
    Connect,
    DebugKinds,
    Discover,
    Frames,
    FullFrames,
    Ghost,
    Guard,
    Insecure,
    Json,
    Keep,
    KeepFiles,
    Limit,
    LimitRate,
    Listen,
    NoGuard,
    Overwrite,
    Rotate,
    Router,
    Scene,
    SessionName,
    Threads,
    Tls,
    Topics,
    Trust,
    listening,
    place,
    shows_credentials,
)

# Verbs that attach take no name; who gives one hears what to type instead.
_TAKES_NAMES: Final = {"allow_extra_args": True}


@app.command()
def run(
    scene: Scene,
    headless: Annotated[bool, typer.Option("--headless", help="no window, no GL, no display library")] = False,
    steps: Annotated[int, typer.Option(help="end after so many ticks (0: run on)", min=0)] = 0,
    record: Annotated[Optional[Path], typer.Option(help="record the session to this .mcap")] = None,  # noqa: UP045
    realtime: Annotated[bool, typer.Option("--realtime", help="headless: keep to real time even with --steps")] = False,
    paused: Annotated[bool, typer.Option("--paused", help="start paused")] = False,
    listen: Listen = None,
    tls: Tls = False,
    insecure: Insecure = False,
    address: Address = [],  # noqa: B006
    router: Router = None,
    discover: Discover = False,
    name: Annotated[str, typer.Option(help="name of the session; default: the scene's")] = "",
    threads: Threads = 1,
    guard: Guard = "5s",
    no_guard: NoGuard = False,
    keep: Keep = 60.0,
    compact: Compact = False,
    rotate: Rotate = "",
    keep_files: KeepFiles = 0,
    limit: Limit = "",
    limit_rate: LimitRate = "",
    topics: Topics = "",
    overwrite: Overwrite = False,
    at: At = "",
    foxglove: Annotated[
        int,
        typer.Option(
            help="serve the session to the Foxglove app at this port of loopback; 8765 is where it looks",
            min=0,
            max=65535,
        ),
    ] = 0,
    trust: Trust = False,
    json: Json = False,
) -> None:
    """Simulate a scene, with an editor attached; or --headless, for a server or a script."""
    from elys.bus.recording_plan import recording_plan
    from elys.verbs import run as verb
    from elys.verbs.moments import guard_seconds

    plan = recording_plan(
        compact=compact,
        rotate=rotate,
        keep_files=keep_files,
        limit=limit,
        limit_rate=limit_rate,
        topic_names=topics,
        overwrites=overwrite,
    )
    verb.run(
        scene,
        headless=headless,
        step_limit=steps,
        record=record,
        realtime=realtime,
        paused=paused,
        listen=listening(listen, tls=tls, insecure=insecure, addresses=address),
        router=router,
        discover=discover,
        name=name,
        threads=threads,
        guard=0.0 if no_guard else guard_seconds(guard),
        keep=keep,
        plan=plan,
        foxglove=foxglove,
        json=json,
        at=at,
    )


@app.command(context_settings=_TAKES_NAMES)
@shows_credentials
def edit(
    context: typer.Context,
    connect: Connect = None,
    session: SessionName = "",
    full_frames: FullFrames = False,
) -> None:
    """Attach an editor to a running session or a replay; where none runs, choose in the editor what to open."""
    from elys.verbs import attach

    attach.refuse_names("edit", context.args)
    attach.edit(place(connect, session), full_frames=full_frames)


@app.command(context_settings=_TAKES_NAMES)
@shows_credentials
def view(
    context: typer.Context,
    connect: Connect = None,
    session: SessionName = "",
    debug: DebugKinds = "",
    age: Annotated[
        bool, typer.Option("--age", help="show tick, time, age and frame rate of what is seen (key A)")
    ] = False,
    thin: Annotated[
        bool, typer.Option("--thin", help="draw nothing here: show what a render node of the session draws")
    ] = False,
    encoding: Annotated[
        str, typer.Option(help="of such pictures: jpeg, h264, or auto: by what the way between carries")
    ] = "auto",
    bit_rate: Annotated[
        float, typer.Option(help="[Mbit/s] that h264 may take; 0: as much as it needs", min=0.0, max=1000.0)
    ] = 0.0,
    full_frames: FullFrames = False,
    ghost: Ghost = [],  # noqa: B006
    ghost_now: Annotated[
        bool, typer.Option("--ghost-now", help="let ghosts begin now, and not at the same simulation time")
    ] = False,
    player: Annotated[
        int, typer.Option(help="number as which the person at this window plays (key P)", min=1, max=16)
    ] = 1,
    bindings: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="file of bindings (elys input); default: the user's own"),
    ] = None,
    play: Annotated[
        bool, typer.Option("--play", help="give the game keys and mouse at once; Esc gives them back")
    ] = False,
    frames: Frames = 0,
) -> None:
    """Watch a running session or a replay in a window."""
    from elys.verbs import attach

    attach.refuse_names("view", context.args)
    attach.view(
        place(connect, session),
        frame_limit=frames,
        debug=debug,
        age=age,
        thin=thin,
        encoding=encoding,
        bit_rate=bit_rate,
        full_frames=full_frames,
        ghosts=ghost,
        ghosts_start_now=ghost_now,
        player=player,
        plays=play,
        bindings=bindings,
    )


@app.command()
@shows_credentials
def tell(
    event: Annotated[str, typer.Argument(help="what it is called")],
    values: Annotated[Optional[list[str]], typer.Argument(help="its values, NAME=VALUE; as in JSON, or a text")] = None,  # noqa: UP045
    to: Annotated[str, typer.Option("--to", help="entity whose script hears it, by name or id; default: all")] = "",
    connect: Connect = None,
    session: SessionName = "",
) -> None:
    """Tell the scripts of a running session an event (see docs/scripts.md)."""
    from elys.verbs import tell as verb

    verb.tell(event, values or [], place(connect, session), to=to)


@app.command()
def demo(
    directory: Annotated[Path, typer.Option(help="where demo.mcap, demo.png and demo.mp4 go")] = Path(),
    headless: Annotated[bool, typer.Option("--headless", help="write files even where there is a screen")] = False,
) -> None:
    """Show ELYS: the editor on a running simulation, or without a screen a recording, a picture and a video."""
    from elys.verbs import demo as verb

    verb.demo(directory, headless=headless)


@app.command()
def launch(
    file: Annotated[Path, typer.Argument(help="a launch file (launch/*.toml)")],
    values: Annotated[Optional[list[str]], typer.Argument(help="its parameters, NAME=VALUE")] = None,  # noqa: UP045
) -> None:
    """Start the processes that a launch file describes."""
    from elys.verbs import run as verb

    verb.launch(file, values or [])


@app.command()
@shows_credentials
def foxglove(
    connect: Connect = None,
    session: SessionName = "",
    port: Annotated[int, typer.Option(help="port to listen at; 0: any that is free", min=0, max=65535)] = 8765,
    host: Annotated[str, typer.Option(help="address to listen at; default: this machine alone")] = "127.0.0.1",
    patience: Annotated[float, typer.Option(help="seconds to wait for the session", min=0.1, hidden=True)] = 5.0,
) -> None:
    """Serve a running session, or a replay, to the Foxglove app."""
    from elys.verbs import foxglove as verb

    verb.foxglove(place(connect, session), host=host, port=port, patience=patience)


@app.command()
@shows_credentials
def web(
    connect: Connect = None,
    session: SessionName = "",
    host: Annotated[
        str, typer.Option(help="address to listen at; default: this machine alone. 0.0.0.0: every network it is in")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="port to listen at; 0: the first free from 8090", min=0, max=65535)] = 0,
    role: Annotated[str, typer.Option(help="what anybody may at most: viewer, player, editor or owner")] = "owner",
    name: Annotated[
        list[str], typer.Option(help="name under which browsers reach this machine, if it does not know it itself")
    ] = [],  # noqa: B006
    cert: Annotated[Optional[Path], typer.Option(help="certificate (PEM): everything is encrypted")] = None,  # noqa: UP045
    cert_key: Annotated[Optional[Path], typer.Option(help="its private key (PEM), if not in the same file")] = None,  # noqa: UP045
    insecure: Annotated[
        bool, typer.Option("--insecure", help="ask nobody for a secret: whoever reaches the port is let in")
    ] = False,
    fps: Annotated[float, typer.Option(help="pictures a second for each browser at most", min=0.1, max=60.0)] = 30.0,
    bit_rate: Annotated[
        float,
        typer.Option(help="[Mbit/s] that a browser's H.264 may take; 0: as much as it needs", min=0.0, max=1000.0),
    ] = 0.0,
    browsers: Annotated[int, typer.Option(help="how many may look at once", min=1, max=64)] = 32,
) -> None:
    """Show a running session, or a replay, in a browser, and steer it from there.

    Prints an address for each role: open it in a browser of this machine. A render node draws; one is started if there is none.

    \b
    From elsewhere, through a tunnel, with the same address there:
      ssh -L 8090:localhost:8090 HOST
    Directly, encrypted:
      elys web --host 0.0.0.0 --cert cert.pem --cert-key key.pem
    A recording:
      elys play run.mcap      and beside it      elys web
    """
    from elys.verbs import web as verb

    verb.web(
        place(connect, session),
        host=host,
        port=port,
        names=tuple(name),
        cert=cert,
        cert_key=cert_key,
        insecure=insecure,
        role=role,
        fps=fps,
        bit_rate=bit_rate,
        browsers=browsers,
    )


@app.command()
def doctor(json: Json = False) -> None:
    """Check what ELYS needs of this machine, and say how to mend it."""
    from elys.verbs import doctor as verb

    raise typer.Exit(verb.doctor(json=json))
