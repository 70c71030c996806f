"""Recordings: made, shown, proved, gone on with, compared, cut, mended, and given to other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from elys.cli.app import app
from elys.cli.options import (
    Address,
    Compact,
    Connect,
    From,
    Ghost,
    Insecure,
    Json,
    KeepFiles,
    Limit,
    LimitRate,
    Listen,
    Overwrite,
    Recording,
    Rotate,
    SessionName,
    Threads,
    Tls,
    To,
    Topics,
    Trust,
    listening,
    place,
    shows_credentials,
)


@app.command()
@shows_credentials
def record(
    output: Annotated[Path, typer.Option("--output", "-o", help="the .mcap to write")],
    connect: Connect = None,
    session: SessionName = "",
    seconds: Annotated[
        float, typer.Option(help="stop after so many seconds (0: at Ctrl-C or the session's end)", min=0.0)
    ] = 0.0,
    view: Annotated[
        list[str], typer.Option(help="name of a camera whose pictures are recorded too; may be given several times")
    ] = [],  # noqa: B006
    view_size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of such pictures")] = "1280x720",
    view_fps: Annotated[float, typer.Option(help="how many a second at most", min=0.1, max=60.0)] = 30.0,
    compact: Compact = False,
    rotate: Rotate = "",
    keep_files: KeepFiles = 0,
    limit: Limit = "",
    limit_rate: LimitRate = "",
    topics: Topics = "",
    overwrite: Overwrite = False,
    patience: Annotated[
        float, typer.Option(help="seconds to wait for a session that is not there yet, or is gone", min=0.1)
    ] = 5.0,
) -> None:
    """Record a running session from outside."""
    from elys.bus.recording_plan import recording_plan
    from elys.verbs import replay

    plan = recording_plan(
        compact=compact,
        rotate=rotate,
        keep_files=keep_files,
        limit=limit,
        limit_rate=limit_rate,
        topic_names=topics,
        overwrites=overwrite,
    )
    replay.record(
        output,
        connect=place(connect, session),
        seconds=seconds,
        views=view,
        view_size=view_size,
        view_fps=view_fps,
        plan=plan,
        patience=patience,
    )


@app.command()
def play(
    recording: Recording,
    listen: Listen = None,
    tls: Tls = False,
    insecure: Insecure = False,
    address: Address = [],  # noqa: B006
    paused: Annotated[bool, typer.Option("--paused", help="start paused")] = False,
    rate: Annotated[float, typer.Option(help="simulated seconds per second", min=0.01, max=100.0)] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="start again at the end")] = False,
    start: From = "",
    end: To = "",
    ghost: Ghost = [],  # noqa: B006
    editor: Annotated[bool, typer.Option("--edit", help="open the editor on it as well")] = False,
) -> None:
    """Serve a recording as if it were running: attach with `elys view` or `elys edit`."""
    from elys.verbs import replay
    from elys.verbs.playback import Playback

    replay.play(
        recording,
        Playback(paused, rate, loop, start, end, tuple(map(str, ghost))),
        listen=listening(listen, tls=tls, insecure=insecure, addresses=address),
        editor=editor,
    )


@app.command()
def info(recording: Recording, json: Json = False) -> None:
    """Tell what a recording holds."""
    from elys.verbs import replay

    replay.info(recording, json=json)


@app.command()
def verify(
    recording: Recording,
    start: From = "",
    end: To = "",
    threads: Threads = 1,
    json: Json = False,
    trust: Trust = False,
) -> None:
    """Run a recorded session again and compare every tick, to the bit.

    Ends with 0: equal. 1: the recording was altered, or the machine that made it erred. 2: it cannot be read or run again.
    3: different, and here is another build or kind of machine. 4: not deterministic: run twice, it differs from itself.
    5: equal as far as it can be compared, but ticks are missing or a part is damaged.
    """
    from elys.verbs import verify as verb

    raise typer.Exit(verb.verify(recording, start=start, end=end, threads=threads, json=json))


@app.command()
def fork(
    recording: Recording,
    output: Annotated[Path, typer.Option("--output", "-o", help="the .mcap to write")],
    at: Annotated[str, typer.Option(help="simulation time from which on it becomes another, as 12.5s")],
    edit: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="JSON list of commands to begin with (elys schema edits); entities may be called by name"),
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=0.0, max=360000.0, help="simulated seconds to run on; 0: to the end of the recording")
    ] = 0.0,
    repeat: Annotated[
        bool, typer.Option("--repeat/--no-repeat", help="do again what was done in the recording from there on")
    ] = True,
    overwrite: Overwrite = False,
    listen: Listen = None,
    tls: Tls = False,
    insecure: Insecure = False,
    address: Address = [],  # noqa: B006
    threads: Threads = 1,
    json: Json = False,
    trust: Trust = False,
) -> None:
    """Go on from any instant of a recording with another future, as fast as it can. With no edit it comes out the same.

    To go on from there by hand, with the editor: elys run RECORDING.mcap --at TIME
    """
    from elys.verbs import fork as verb

    verb.fork(
        recording,
        at=at,
        edits=edit,
        output=output,
        overwrites=overwrite,
        seconds=seconds,
        repeats=repeat,
        listen=listening(listen, tls=tls, insecure=insecure, addresses=address),
        threads=threads,
        json=json,
    )


@app.command()
def diff(
    a: Annotated[Path, typer.Argument(help="a recording (.mcap)")],
    b: Annotated[Path, typer.Argument(help="another, as a fork of it")],
    plot: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="out.png or out.html: how far bodies are from one another over time (extra 'lab')"),
    ] = None,
    view: Annotated[
        bool, typer.Option("--view", help="watch both afterwards, the second as ghost of the first")
    ] = False,
    json: Json = False,
) -> None:
    """Tell when, where and by how much two recorded runs part.

    Ends with 0: equal. 1: they differ. 2: one cannot be read, or they have no instant in common.
    """
    from elys.verbs import diff as verb

    raise typer.Exit(verb.diff(a, b, plot=plot, view=view, json=json))


@app.command()
def cut(
    recording: Recording,
    output: Annotated[Path, typer.Option("--output", "-o", help="the .mcap to write")],
    start: From = "",
    end: To = "",
    overwrite: Overwrite = False,
) -> None:
    """Write a part of a recording as a recording of its own."""
    from elys.verbs import recordings as verb

    verb.cut(recording, output, start=start, end=end, overwrites=overwrite)


@app.command()
def merge(
    recordings: Annotated[list[Path], typer.Argument(help="recordings of one session", show_default=False)],
    output: Annotated[Path, typer.Option("--output", "-o", help="the .mcap to write")],
    overwrite: Overwrite = False,
) -> None:
    """Put the parts of a session together, or what several recorders have of it."""
    from elys.verbs import recordings as verb

    verb.merge(recordings, output, overwrites=overwrite)


@app.command()
def recover(
    recording: Recording,
    output: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--output", "-o", help="the .mcap to write; default: NAME.recovered.mcap", show_default=False),
    ] = None,
    in_place: Annotated[
        bool, typer.Option("--in-place", help="put the whole file in its place and keep the damaged one as .bak")
    ] = False,
) -> None:
    """Make a whole file of a recording that was cut off or is damaged."""
    from elys.verbs import recordings as verb

    verb.recover(recording, output, in_place=in_place)


@app.command()
def export(
    recording: Recording,
    output: Annotated[
        Path,
        typer.Argument(
            help="OUT.npz (arrays), OUT.csv or OUT.parquet (tables), OUT.glb (a model that moves), "
            "OUT.foxglove.mcap (for Foxglove and Rerun)"
        ),
    ],
    start: From = "",
    end: To = "",
    rate: Annotated[
        float, typer.Option(help="samples per simulated second; 0: every tick", min=0.0, max=1e6, show_default=False)
    ] = 0.0,
    entities: Annotated[
        list[str],
        typer.Option(help="only entities of this name, with all below them; * stands for anything; several times"),
    ] = [],  # noqa: B006
    foxglove: Annotated[
        bool, typer.Option("--foxglove", help="for Foxglove and Rerun, whatever the .mcap is called")
    ] = False,
) -> None:
    """Write a recording's motion for other programs: numpy, tables, Blender and three.js."""
    from elys.verbs import export as verb

    verb.export(recording, output, start=start, end=end, rate=rate, entities=entities, foxglove=foxglove)
