"""Arguments and options that several verbs have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from elys.common.trust import trust_everything


def _trusting(is_trusting: bool) -> bool:
    if is_trusting:
        trust_everything()
    return is_trusting


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
From = Annotated[str, typer.Option("--from", help="simulation time at which it begins: 2, 2s, 500ms, 1m30s")]
To = Annotated[str, typer.Option("--to", help="simulation time at which it ends")]
Connect = Annotated[
    Optional[str],  # noqa: UP045  typer reads the annotation
    typer.Option(
        help="endpoint of the session, tcp/HOST:PORT, or several with commas, of which the first that answers counts; "
        "default: the one running on this machine"
    ),
]
Listen = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(help="endpoint to listen at, tcp/HOST:PORT; default: loopback, the first free port from 7447"),
]
Threads = Annotated[
    int, typer.Option("--threads", min=1, max=64, help="threads for large steps of physics; what comes out is the same")
]
Keep = Annotated[float, typer.Option(min=0.0, max=3600.0, help="simulated seconds that can be gone back to (0: none)")]
At = Annotated[str, typer.Option(help="go on with a recording (.mcap) from this simulation time, as 12.5s")]
Trust = Annotated[
    bool,
    typer.Option("--trust", help="run the scene's scripts: programs that may do whatever you may", callback=_trusting),
]
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
