"""The command line: one verb a function, no logic; what verbs do stands in `elys.verbs`, imported only when called."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Optional

import typer

import elys
from elys.common.errors import ElysError

UsageError: type[typer.BadParameter] = typer.BadParameter.__mro__[1]  # the parent of all of them, which typer hides
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
cases_app = typer.Typer(help="The hard cases: what they are, and how wrong ELYS is in them.", no_args_is_help=True)
node_app = typer.Typer(help="Single nodes, as launch files start them.", no_args_is_help=True)
app.add_typer(topic_app, name="topic")
app.add_typer(cases_app, name="cases")
app.add_typer(node_app, name="node", hidden=True)

# What the simulation alone can do without, by the extra of pyproject.toml that brings it.
_EXTRA_OF = {
    "PIL": "render",
    "distributed": "cluster",
    "pyarrow": "lab",
    "vl_convert": "lab",
    "av": "render",
    "glfw": "render",
    "imgui_bundle": "editor",
    "moderngl": "render",
    "simplejpeg": "render",
    "OpenEXR": "render",
}

Scene = Annotated[str, typer.Argument(help="a NAME.scene.json, .gltf or .glb; or the name of a sample (elys samples)")]
Compact = Annotated[
    bool, typer.Option("--compact", help="record states to 0.5 mm and 0.01 degrees: a tenth of the size")
]
Rotate = Annotated[str, typer.Option(help="record into one file after the other, each of 512MB, or of 10min")]
KeepFiles = Annotated[int, typer.Option(help="of those files keep the newest so many (0: all)", min=0)]
Limit = Annotated[str, typer.Option(help="end the recording at a size, for instance 2GB")]
Topics = Annotated[
    str, typer.Option(help="record these topics, with commas between, and states and scene; default: all")
]
Recording = Annotated[Path, typer.Argument(help="a recording (.mcap)")]
Connect = Annotated[
    Optional[str],  # noqa: UP045  typer reads the annotation
    typer.Option(help="endpoint of the session, tcp/HOST:PORT; default: the one running on this machine"),
]
Listen = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(help="endpoint to listen at, tcp/HOST:PORT; default: loopback, the first free port from 7447"),
]
From = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--from", help="from this simulation time on [s]"),
]
To = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--to", help="up to this simulation time [s]"),
]
Threads = Annotated[
    int, typer.Option("--threads", min=1, max=64, help="threads for large steps of physics; what comes out is the same")
]
Keep = Annotated[float, typer.Option(min=0.0, max=3600.0, help="simulated seconds that can be gone back to (0: none)")]
At = Annotated[str, typer.Option(help="go on with a recording (.mcap) from this simulation time, as 12.5s")]
NoGuard = Annotated[bool, typer.Option("--no-guard", help="do not keep the last 5 s for when something goes wrong")]
Json = Annotated[bool, typer.Option("--json", help="print facts as JSON")]
DebugKinds = Annotated[
    str,
    typer.Option(
        "--debug",
        help="draw over it: aabb, obb, contacts, joints, trajectories, velocity, axes, grid, labels, islands, sleeping; "
        "several with commas",
    ),
]
Frames = Annotated[int, typer.Option(help="end after so many frames (0: never)", min=0, hidden=True)]

Seconds = Annotated[float, typer.Option(min=0.1, max=36000.0, help="simulated seconds of each run")]
Budget = Annotated[
    float, typer.Option(help="largest error that is good enough, as a share of what is typical of the scene")
]
Only = Annotated[
    list[str], typer.Option("--only", help="an observable that counts, may be given several times; default: all")
]
Jobs = Annotated[int, typer.Option(min=0, max=512, help="runs side by side (0: one for each processor)")]
Cluster = Annotated[str, typer.Option(help="run on a Dask cluster: endpoint of its scheduler, tcp://HOST:PORT")]


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


@app.command()
def run(
    scene: Scene,
    headless: Annotated[bool, typer.Option("--headless", help="no window, no GL, no display library")] = False,
    steps: Annotated[int, typer.Option(help="end after so many ticks (0: run on)", min=0)] = 0,
    record: Annotated[Optional[Path], typer.Option(help="record the session to this .mcap")] = None,  # noqa: UP045
    realtime: Annotated[bool, typer.Option("--realtime", help="headless: keep to real time even with --steps")] = False,
    paused: Annotated[bool, typer.Option("--paused", help="start paused")] = False,
    listen: Listen = None,
    name: Annotated[str, typer.Option(help="name of the session; default: the scene's")] = "",
    threads: Threads = 1,
    no_guard: NoGuard = False,
    keep: Keep = 60.0,
    compact: Compact = False,
    rotate: Rotate = "",
    keep_files: KeepFiles = 0,
    limit: Limit = "",
    topics: Topics = "",
    at: At = "",
    json: Json = False,
) -> None:
    """Simulate a scene, with an editor attached; or --headless, for a server or a script."""
    from elys.bus.recording_plan import recording_plan
    from elys.verbs import run as verb

    plan = recording_plan(compact=compact, rotate=rotate, keep_files=keep_files, limit=limit, topic_names=topics)
    verb.run(
        scene,
        headless=headless,
        step_limit=steps,
        record=record,
        realtime=realtime,
        paused=paused,
        listen=listen,
        name=name,
        threads=threads,
        guarded=not no_guard,
        keep=keep,
        plan=plan,
        json=json,
        at=at,
    )


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
) -> None:
    """Speed against error: run a scene at a ladder of tick rates, substeps and strengths, and judge each."""
    from elys.verbs import pareto as verb

    verb.pareto(
        scenes, seconds=seconds, error=error, only=only, peers=peers, page=html, json=json, jobs=jobs, cluster=cluster
    )


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
) -> None:
    """What a scene makes the engine do, why the rest is switched off, and what that saves."""
    from elys.verbs import plan as verb

    verb.plan(scene, at=at, seconds=seconds if measure else 0.0, threads=threads, json=json)


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
) -> None:
    """Run a scene many times with other values, every combination a row of a table."""
    from elys.verbs import sweep as verb

    verb.sweep(scene, vary=vary, output=output, seconds=seconds, jitter=jitter, jobs=jobs, cluster=cluster)


@app.command()
def view(
    connect: Connect = None,
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
    frames: Frames = 0,
) -> None:
    """Watch a running session or a replay in a window."""
    from elys.verbs import attach

    attach.view(connect, frame_limit=frames, debug=debug, age=age, thin=thin, encoding=encoding, bit_rate=bit_rate)


@app.command()
def edit(connect: Connect = None) -> None:
    """Attach an editor to a running session or a replay; where none runs, choose in the editor what to open."""
    from elys.verbs import attach

    attach.edit(connect)


@app.command()
def play(
    recording: Recording,
    listen: Listen = None,
    paused: Annotated[bool, typer.Option("--paused", help="start paused")] = False,
    rate: Annotated[float, typer.Option(help="simulated seconds per second", min=0.01, max=100.0)] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="start again at the end")] = False,
    start: From = None,
    end: To = None,
    editor: Annotated[bool, typer.Option("--edit", help="open the editor on it as well")] = False,
) -> None:
    """Serve a recording as if it were running: attach with `elys view` or `elys edit`."""
    from elys.verbs import replay
    from elys.verbs.playback import Playback

    replay.play(recording, Playback(paused, rate, loop, start, end), listen=listen, editor=editor)


@app.command()
def record(
    output: Annotated[Path, typer.Option("--output", "-o", help="the .mcap to write")],
    connect: Connect = None,
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
    topics: Topics = "",
) -> None:
    """Record a running session from outside."""
    from elys.bus.recording_plan import recording_plan
    from elys.verbs import replay

    plan = recording_plan(compact=compact, rotate=rotate, keep_files=keep_files, limit=limit, topic_names=topics)
    replay.record(
        output, connect=connect, seconds=seconds, views=view, view_size=view_size, view_fps=view_fps, plan=plan
    )


@app.command()
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
        typer.Option(help="what is shown: shaded, normals, albedo, roughness, depth, entity, wireframe or overdraw"),
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
    debug: DebugKinds = "",
    debug_of: Annotated[
        list[str],
        typer.Option(help="entity that --debug is about, with all below it; may be given several times; default: all"),
    ] = [],  # noqa: B006
    stamp: Annotated[bool, typer.Option("--stamp", help="write tick and simulation time onto the pictures")] = False,
    environment: Annotated[
        bool,
        typer.Option(help="light from all around and a sky, as the scene has them; else lamps alone, before black"),
    ] = True,
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
        connect=connect,
        environment=environment,
        debug=debug,
        debug_of=debug_of,
        stamp=stamp,
    )


@app.command()
def info(recording: Recording, json: Json = False) -> None:
    """Tell what a recording holds."""
    from elys.verbs import replay

    replay.info(recording, json=json)


@app.command()
def verify(
    recording: Recording,
    first: Annotated[
        float, typer.Option("--from", min=0.0, help="simulation time from which on it is compared [s]")
    ] = 0.0,
    last: Annotated[float, typer.Option("--to", min=0.0, help="up to which it is [s]; 0: to the end")] = 0.0,
    threads: Threads = 1,
    json: Json = False,
) -> None:
    """Run a recorded session again and compare every tick, to the bit.

    Ends with 0: equal. 1: the recording was altered, or the machine that made it erred. 2: it cannot be read or run again.
    3: different, and here is another build or kind of machine. 4: not deterministic: run twice, it differs from itself.
    """
    from elys.verbs import verify as verb

    raise typer.Exit(verb.verify(recording, first=first, last=last, threads=threads, json=json))


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
    listen: Listen = None,
    threads: Threads = 1,
    json: Json = False,
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
        seconds=seconds,
        repeats=repeat,
        listen=listen,
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
    json: Json = False,
) -> None:
    """Tell when, where and by how much two recorded runs part.

    Ends with 0: equal. 1: they differ. 2: one cannot be read, or they have no instant in common.
    """
    from elys.verbs import diff as verb

    raise typer.Exit(verb.diff(a, b, plot=plot, json=json))


@app.command()
def export(
    recording: Recording,
    output: Annotated[Path, typer.Argument(help="out.npz: time, name, position, rotation, velocities as arrays")],
) -> None:
    """Write a recording's motion as numpy arrays."""
    from elys.verbs import replay

    replay.export(recording, output)


@app.command()
def doctor(json: Json = False) -> None:
    """Check what ELYS needs of this machine, and say how to mend it."""
    from elys.verbs import doctor as verb

    raise typer.Exit(verb.doctor(json=json))


@app.command()
def launch(
    file: Annotated[Path, typer.Argument(help="a launch file (launch/*.toml)")],
    values: Annotated[Optional[list[str]], typer.Argument(help="its parameters, NAME=VALUE")] = None,  # noqa: UP045
) -> None:
    """Start the processes that a launch file describes."""
    from elys.verbs import run as verb

    verb.launch(file, values or [])


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
def samples(
    name: Annotated[str, typer.Argument(help="write this one; default: list them")] = "",
    output: Annotated[Optional[Path], typer.Option("--output", "-o", help="where to; default: NAME.scene.json")] = None,  # noqa: UP045
    json: Json = False,
) -> None:
    """List the scenes ELYS comes with, or write one as a file to start from."""
    from elys.verbs import facts

    facts.samples(name, output, json=json)


@app.command()
def sessions(json: Json = False) -> None:
    """List the sessions that run on this machine."""
    from elys.verbs import facts

    facts.sessions(json=json)


@app.command()
def demo(
    directory: Annotated[Path, typer.Option(help="where demo.mcap, demo.png and demo.mp4 go")] = Path(),
    headless: Annotated[bool, typer.Option("--headless", help="write files even where there is a screen")] = False,
) -> None:
    """Show ELYS: the editor on a running simulation, or without a screen a recording, a picture and a video."""
    from elys.verbs import demo as verb

    verb.demo(directory, headless=headless)


@app.command()
def top(
    connect: Connect = None,
    once: Annotated[bool, typer.Option("--once", help="print the figures once and end")] = False,
    json: Json = False,
) -> None:
    """Watch energy, overlap, errors and times of a running session in the terminal."""
    from elys.verbs import top as verb

    verb.top(connect, once=once, json=json)


@topic_app.command("list")
def topic_list(json: Json = False) -> None:
    """List the topics, their messages and how they are delivered."""
    from elys.verbs import topic

    topic.list_topics(json=json)


@topic_app.command("echo")
def topic_echo(
    topic: Annotated[str, typer.Argument(help="name of a topic (elys topic list)")],
    connect: Connect = None,
    count: Annotated[int, typer.Option("--count", "-n", help="end after so many messages (0: never)", min=0)] = 0,
) -> None:
    """Print the messages of a topic as they come."""
    from elys.verbs import topic as verb

    verb.echo(topic, connect, count=count)


@topic_app.command("hz")
def topic_hz(
    topic: Annotated[str, typer.Argument(help="name of a topic; default: all")] = "",
    connect: Connect = None,
    seconds: Annotated[float, typer.Option(help="how long to measure [s]", min=0.1, max=1e6)] = 2.0,
    json: Json = False,
) -> None:
    """Measure how often and how much a topic is published."""
    from elys.verbs import topic as verb

    verb.hz(topic, connect, seconds=seconds, json=json)


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


@node_app.command("simulation")
def node_simulation(
    scene: Scene,
    listen: Listen = None,
    steps: Annotated[int, typer.Option(min=0)] = 0,
    record: Annotated[Optional[Path], typer.Option()] = None,  # noqa: UP045
    recording_plan: Annotated[str, typer.Option()] = "{}",
    fast: Annotated[bool, typer.Option("--fast", help="as fast as it can instead of in real time")] = False,
    paused: Annotated[bool, typer.Option("--paused")] = False,
    name: Annotated[str, typer.Option()] = "",
    threads: Threads = 1,
    no_guard: NoGuard = False,
    keep: Keep = 60.0,
    at: At = "",
) -> None:
    """The simulation."""
    from elys.bus.recording_plan import from_json
    from elys.verbs import nodes

    nodes.simulation(
        scene,
        listen=listen,
        step_limit=steps,
        record=record,
        realtime=not fast,
        paused=paused,
        name=name,
        threads=threads,
        guarded=not no_guard,
        keep=keep,
        plan=from_json(recording_plan),
        at=at,
    )


@node_app.command("render")
def node_render(connect: Connect = None) -> None:
    """A render node that draws views for others."""
    from elys.verbs import nodes

    nodes.render(connect)


@node_app.command("editor")
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
    paused: Annotated[bool, typer.Option("--paused")] = False,
    rate: Annotated[float, typer.Option(min=0.01, max=100.0)] = 1.0,
    loop: Annotated[bool, typer.Option("--loop")] = False,
    start: From = None,
    end: To = None,
) -> None:
    """A player that serves a recording."""
    from elys.verbs import nodes
    from elys.verbs.playback import Playback

    nodes.player(recording, Playback(paused, rate, loop, start, end), listen=listen)


def main() -> None:
    """The `elys` command: errors of ELYS become one line and exit status 1, wrong options one line and 2."""
    try:
        sys.exit(app(prog_name="elys", standalone_mode=False) or 0)
    except ElysError as error:
        print(f"elys: {error}", file=sys.stderr)
        sys.exit(1)
    except UsageError as error:
        print(_usage_sentence(error), file=sys.stderr)
        sys.exit(2)
    except ModuleNotFoundError as error:
        extra = _EXTRA_OF.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        print(f"elys: this needs {error.name}, which is not installed: pip install 'elys[{extra}]'", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:  # `elys topic echo | head`: the reader has had enough
        sys.stderr.close()
        sys.exit(0)


def _usage_sentence(error: typer.BadParameter) -> str:
    text = error.format_message().strip()
    if "\n" in text:
        return text  # the help itself: no command was given
    return f"elys: {text.rstrip('.')}: see {error.ctx.command_path if error.ctx else 'elys'} --help"


if __name__ == "__main__":
    main()
