"""Single nodes, as launch files start them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from elys.cli.app import node_app
from elys.cli.options import (
    Address,
    At,
    Connect,
    DebugKinds,
    Discover,
    Frames,
    From,
    Ghost,
    Guard,
    Insecure,
    Keep,
    Listen,
    NoGuard,
    Recording,
    Router,
    Scene,
    SessionName,
    Threads,
    Tls,
    To,
    listening,
    place,
    shows_credentials,
)


@node_app.command("simulation")
def node_simulation(
    scene: Scene,
    listen: Listen = None,
    tls: Tls = False,
    insecure: Insecure = False,
    address: Address = [],  # noqa: B006
    router: Router = None,
    discover: Discover = False,
    steps: Annotated[int, typer.Option(min=0)] = 0,
    record: Annotated[Optional[Path], typer.Option()] = None,  # noqa: UP045
    recording_plan: Annotated[str, typer.Option()] = "{}",
    fast: Annotated[bool, typer.Option("--fast", help="as fast as it can instead of in real time")] = False,
    paused: Annotated[bool, typer.Option("--paused")] = False,
    name: Annotated[str, typer.Option()] = "",
    threads: Threads = 1,
    guard: Guard = "5s",
    no_guard: NoGuard = False,
    keep: Keep = 60.0,
    at: At = "",
) -> None:
    """The simulation."""
    from elys.bus.recording_plan import from_json
    from elys.verbs import nodes
    from elys.verbs.moments import guard_seconds

    nodes.simulation(
        scene,
        listen=listening(listen, tls=tls, insecure=insecure, addresses=address),
        router=router,
        discover=discover,
        step_limit=steps,
        record=record,
        realtime=not fast,
        paused=paused,
        name=name,
        threads=threads,
        guard=0.0 if no_guard else guard_seconds(guard),
        keep=keep,
        plan=from_json(recording_plan),
        at=at,
    )


@node_app.command("render")
@shows_credentials
def node_render(connect: Connect = None) -> None:
    """A render node that draws views for others."""
    from elys.verbs import nodes

    nodes.render(connect)


@node_app.command("editor")
@shows_credentials
def node_editor(
    connect: Connect = None,
    frames: Frames = 0,
    alone: Annotated[bool, typer.Option("--alone", help="begin with the start page")] = False,
) -> None:
    """The editor's window."""
    from elys.verbs import nodes

    nodes.editor(connect, starts_alone=alone, frame_limit=frames)


@node_app.command("player")
def node_player(
    recording: Recording,
    listen: Listen = None,
    tls: Tls = False,
    insecure: Insecure = False,
    address: Address = [],  # noqa: B006
    paused: Annotated[bool, typer.Option("--paused")] = False,
    rate: Annotated[float, typer.Option(min=0.01, max=100.0)] = 1.0,
    loop: Annotated[bool, typer.Option("--loop")] = False,
    start: From = "",
    end: To = "",
    ghost: Ghost = [],  # noqa: B006
) -> None:
    """A player that serves a recording."""
    from elys.verbs import nodes
    from elys.verbs.playback import Playback

    nodes.player(
        recording,
        Playback(paused, rate, loop, start, end, tuple(map(str, ghost))),
        listen=listening(listen, tls=tls, insecure=insecure, addresses=address),
    )


@node_app.command("ghost")
@shows_credentials
def node_ghost(
    recording: Recording,
    connect: Connect = None,
    color: Annotated[str, typer.Option(help="RRGGBB")] = "",
    now: Annotated[bool, typer.Option("--now", help="let it begin now, and not at the same simulation time")] = False,
) -> None:
    """A recording shown beside a session as a ghost."""
    from elys.verbs import ghosts

    ghosts.ghost(recording, connect=connect, color=color, starts_now=now)


@node_app.command("view")
@shows_credentials
def node_view(
    connect: Connect = None,
    session: SessionName = "",
    debug: DebugKinds = "",
    play: Annotated[bool, typer.Option("--play")] = False,
    frames: Frames = 0,
) -> None:
    """A viewer's window, which waits for its session."""
    from elys.verbs import nodes

    nodes.view(place(connect, session), debug=debug, frame_limit=frames, plays=play)
