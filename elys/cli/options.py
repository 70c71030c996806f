"""Arguments and options that several verbs have."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Optional, TypeVar, cast

import typer


def _trusting(is_trusting: bool) -> bool:
    if is_trusting:
        from elys.common.trust import trust_everything

        trust_everything()
    return is_trusting


if TYPE_CHECKING:
    from elys.bus.access.listening import Listening as Listening_

Scene = Annotated[str, typer.Argument(help="a NAME.scene.json, .gltf or .glb; or the name of a sample (elys samples)")]
Compact = Annotated[
    bool, typer.Option("--compact", help="record states to 0.5 mm and 0.01 degrees: a tenth of the size")
]
Rotate = Annotated[str, typer.Option(help="record into one file after the other, each of 512MB, or of 10min")]
KeepFiles = Annotated[int, typer.Option(help="of those files keep the newest so many (0: all)", min=0)]
Limit = Annotated[str, typer.Option(help="end the recording at a size, for instance 2GB")]
LimitRate = Annotated[
    str,
    typer.Option(help="stay below a rate, for instance 5MB/s: of profiles, diagnostics and states fewer are recorded"),
]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="write over a recording of that name; else it is kept, see the docs")
]
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
SessionName = Annotated[
    str, typer.Option("--session", help="name of the session, where several are behind one endpoint (elys sessions)")
]
Router = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        help="listen nowhere: be reached through the router (elys router) at this endpoint, as other sessions"
    ),
]
Discover = Annotated[
    bool,
    typer.Option("--discover", help="answer those of the local network who look around (elys sessions --discover)"),
]
Secret = Annotated[
    str,
    typer.Option(
        help="who this is to the host: USER:SECRET, or better @FILE or the variable ELYS_SECRET", show_default=False
    ),
]
KeyFile = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--key", help="who this is to the host: an .elyskey file (elys keys export), or the variable ELYS_KEY"
    ),
]
Listen = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(help="endpoint to listen at, tcp/HOST:PORT; default: loopback, the first free port from 7447"),
]
Tls = Annotated[
    bool, typer.Option("--tls", help="encrypt, and ask for certificates (elys keys export) instead of secrets")
]
Insecure = Annotated[bool, typer.Option("--insecure", help="ask nobody who he is: all who reach the port may do all")]
Address = Annotated[
    list[str],
    typer.Option("--address", help="name or address under which others reach this machine, if it does not know it"),
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
Guard = Annotated[
    str, typer.Option("--guard", help="how much is kept for when something goes wrong: simulated time, as 30s")
]
NoGuard = Annotated[bool, typer.Option("--no-guard", help="keep nothing for when something goes wrong")]
Json = Annotated[bool, typer.Option("--json", help="print facts as JSON")]
DebugKinds = Annotated[
    str,
    typer.Option(
        "--debug",
        help="draw over it: aabb, obb, contacts, forces, joints, trajectories, velocity, axes, grid, labels, islands, sleeping, "
        "divergence; several with commas",
    ),
]
Ghost = Annotated[
    list[Path],
    typer.Option(
        "--ghost",
        help="recording (.mcap) of another run, shown see-through at the same instants; may be given several times",
    ),
]
FullFrames = Annotated[
    bool, typer.Option("--full-frames", help="every bit of every state, also over a network that may not carry them")
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


def place(connect: str | None, session: str) -> str | None:
    """What `--connect` and `--session` say together, as verbs take it."""
    from elys.bus.discovery import place_of

    return place_of(connect, session)


def listening(listen: str | None, *, tls: bool, insecure: bool, addresses: list[str]) -> Listening_:
    """What the options of a verb that hosts say, together. Raises BusError for what is no endpoint."""
    from elys.bus.access.listening import Listening as Where
    from elys.bus.discovery import complete_endpoint

    endpoint = complete_endpoint(listen, tls=tls) if listen or tls else None
    return Where(endpoint=endpoint, insecure=insecure, addresses=tuple(addresses))


V = TypeVar("V", bound=Callable[..., Any])


def shows_credentials(verb: V) -> V:
    """Gives a verb that connects the options --secret and --key.

    They go into the environment, where `discovery.join_session` and the processes that the verb starts find them.
    """
    own = inspect.signature(verb, eval_str=True)
    added = (
        inspect.Parameter("secret", inspect.Parameter.KEYWORD_ONLY, default="", annotation=Secret),
        inspect.Parameter("key", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=KeyFile),
    )

    @functools.wraps(verb)
    def with_credentials(*arguments: Any, secret: str = "", key: Path | None = None, **options: Any) -> Any:
        from elys.bus.access.credentials import remember

        remember(secret=secret, key_file=key)
        return verb(*arguments, **options)

    parameters = [*own.parameters.values(), *added]
    setattr(with_credentials, "__signature__", own.replace(parameters=parameters))  # noqa: B010
    with_credentials.__annotations__ = {p.name: p.annotation for p in parameters}
    del with_credentials.__wrapped__  # typer would look there for annotations
    return cast(V, with_credentials)
