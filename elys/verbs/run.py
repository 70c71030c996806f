"""run and launch: a simulation alone in this process, or several nodes under the supervisor."""

from __future__ import annotations

import sys
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from elys.bus.access.listening import Listening
from elys.bus.recording_plan import PLAIN, RecordingPlan, to_json
from elys.common.errors import LaunchError

if TYPE_CHECKING:
    from elys.common.scene import OpenedScene

_PACKAGE: Final = Path(__file__).parents[1]
LAUNCH_DIRECTORIES: Final = (_PACKAGE.parent / "launch", _PACKAGE / "_launch")  # of a checkout, of an installed wheel


def run(scene: str, *, listen: Listening, foxglove: int = 0, **options: Any) -> None:
    """Simulates a scene: with an editor, or headless; with a port, also for the Foxglove app."""
    from elys.verbs.host_facts import require_announceable

    if options.get("router") and (options.get("discover") or foxglove):
        raise LaunchError(
            "a session behind a router is announced by `elys router --discover`, and served by `elys foxglove --session NAME`"
        )
    if options.get("discover"):
        require_announceable(listen.endpoint)
    if not foxglove:
        _run(scene, listen=listen, **options)
        return
    from elys.verbs.foxglove import foxglove_beside

    endpoint = listen.endpoint or free_endpoint()
    with foxglove_beside(endpoint, foxglove):
        _run(scene, listen=replace(listen, endpoint=endpoint), **options)


def _run(
    scene: str,
    *,
    headless: bool,
    step_limit: int,
    record: Path | None,
    realtime: bool,
    paused: bool,
    listen: Listening,
    router: str | None = None,
    discover: bool = False,
    name: str,
    threads: int,
    guard: float,
    keep: float,
    json: bool,
    plan: RecordingPlan = PLAIN,
    at: str = "",
) -> None:
    """Simulates a scene: with an editor, or headless; headless with a step limit runs as fast as it can."""
    if headless:
        _run_headless(
            scene,
            step_limit=step_limit,
            record=record,
            realtime=realtime or not step_limit,
            paused=paused,
            listen=listen,
            router=router,
            discover=discover,
            name=name,
            threads=threads,
            guard=guard,
            keep=keep,
            json=json,
            plan=plan,
            at=at,
        )
        return
    if router:
        raise LaunchError(
            "a session behind a router runs by itself: add --headless, and attach with `elys edit --session NAME`"
        )
    from elys.render_node.window import probe_display
    from elys.sim_node.kernel_cache import kernels_are_warm
    from elys.sim_node.kernel_needs import needed_kernels
    from elys.verbs.kernels import compile_with_progress
    from elys.verbs.recording_child import require_recordable

    opened = require_scene(scene, at=at)
    if record is not None:
        require_recordable(record, overwrites=plan.overwrites)
    probe_display()
    if not kernels_are_warm(needed_kernels(opened, threads=threads)):
        compile_with_progress(opened, threads=threads)  # the bar needs this terminal; a node's own lines are prefixed
    options = ["--steps", str(step_limit)] if step_limit else []
    options += ["--record", str(record), "--recording-plan", to_json(plan)] if record else []
    options += ["--paused"] if paused else []
    options += ["--discover"] if discover else []
    options += ["--name", name] if name else []
    options += ["--guard", f"{guard}s"] if guard else ["--no-guard"]
    options += ["--keep", str(keep)]
    options += ["--threads", str(threads)] if threads > 1 else []
    options += ["--at", at] if at else []
    options += listen.words()
    sys.exit(start("editor", {"scene": scene}, endpoint=listen.endpoint, extra={"simulation": options}))


def launch(file: Path, values: list[str]) -> None:
    """Starts what a launch file describes; parameters named endpoint or NAME_endpoint that nobody set are chosen here."""
    from elys.launch import fill_in, read_launch_file, run_processes

    described = read_launch_file(file)
    parameters: dict[str, str] = {}
    for value in values:
        name, equals, text = value.partition("=")
        if not equals:
            raise LaunchError(f"'{value}' is no parameter: write NAME=VALUE")
        parameters[name] = text
    for name in described.parameters:
        if name not in parameters and (name == "endpoint" or name.endswith("_endpoint")):
            parameters[name] = free_endpoint(taken=tuple(parameters.values()))
    sys.exit(run_processes(fill_in(described, parameters)))


def start(
    launch_name: str,
    parameters: dict[str, str],
    *,
    endpoint: str | None,
    extra: dict[str, list[str]] | None = None,
) -> int:
    """Starts one of ELYS's own launch files; `extra` adds words to the commands of processes by name.

    Raises LaunchError for an endpoint at which nobody can listen: the others would wait for a host that never comes.
    """
    if endpoint is not None:
        require_listenable(endpoint)
    from msgspec import structs

    from elys.launch import fill_in, read_launch_file, run_processes

    directory = next((folder for folder in LAUNCH_DIRECTORIES if folder.is_dir()), LAUNCH_DIRECTORIES[0])
    described = read_launch_file(directory / f"{launch_name}.toml")
    processes = fill_in(described, {**parameters, "endpoint": endpoint or free_endpoint()})
    words = extra or {}
    return run_processes([structs.replace(p, command=(*p.command, *words.get(p.name, ()))) for p in processes])


def require_listenable(endpoint: str) -> None:
    """Raises LaunchError where no address of this machine is meant, or somebody listens there."""
    import errno
    import socket

    host, _, port = endpoint.partition("/")[2].rpartition(":")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host.strip("[]"), int(port), type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            probe.listen()
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise LaunchError(
                f"{endpoint} is in use, perhaps by another session: stop that one, or choose another port"
            ) from error
        raise LaunchError(f"cannot listen on '{endpoint}' ({error.strerror}): give tcp/ADDRESS:PORT") from error


def free_endpoint(*, taken: Collection[str] = ()) -> str:
    """The first endpoint of loopback, from the default port on, at which nobody listens and that is not `taken`."""
    import socket

    from elys.bus.transports.zenoh import DEFAULT_PORT

    for port in range(DEFAULT_PORT, DEFAULT_PORT + 100):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        if (endpoint := f"tcp/127.0.0.1:{port}") not in taken:
            return endpoint
    raise LaunchError(f"the ports {DEFAULT_PORT} to {DEFAULT_PORT + 99} are all in use: name one with --listen")


def require_scene(scene: str, *, at: str = "") -> OpenedScene:
    """Reads the scene once in this process, so that a mistake in it is one line and not a crash of a node."""
    from elys.verbs.scenes import open_scene_or_sample

    if at:
        from elys.verbs.fork import recorded_scene

        return recorded_scene(scene, at)
    return open_scene_or_sample(scene)


def _run_headless(
    scene: str,
    *,
    step_limit: int,
    record: Path | None,
    realtime: bool,
    paused: bool,
    listen: Listening,
    router: str | None,
    discover: bool,
    name: str,
    threads: int,
    guard: float,
    keep: float,
    json: bool,
    at: str,
    plan: RecordingPlan = PLAIN,
) -> None:
    from elys.bus.log import start_logging
    from elys.verbs.nodes import run_until_asked
    from elys.verbs.output import print_json
    from elys.verbs.simulate import RunReport, describe, prepare, simulate

    start_logging()
    reports: list[RunReport] = []
    simulation, origin = prepare(scene, record=record, plan=plan, threads=threads, at=at)

    async def work() -> None:
        await simulate(
            simulation,
            listen=listen,
            router=router,
            discover=discover,
            step_limit=step_limit,
            record=record,
            realtime=realtime,
            paused=paused,
            name=name,
            guard=guard,
            keep=keep,
            plan=plan,
            origin=origin,
            on_end=reports.append,
        )

    run_until_asked(work())
    for report in reports:
        if json:
            print_json(report)
        else:
            print(describe(report))
