"""Processes as data: reads launch/*.toml, starts what it describes and keeps it together.

    title = "Editor"                       # what it is, for `elys launch --help` and the log
    [parameters]                           # names that stand in {braces} below, each with what it means
    scene = "the scene to simulate"
    [[process]]
    name = "simulation"                    # prefix of its lines
    command = ["elys", "node", "simulation", "{scene}"]
    main = true                            # when it ends, all end
    restart = "never"                      # or "on-crash"
    nice = 0                               # 10 leaves the processor to others first

The supervisor leaves no orphan: children die with it even when it is killed (PR_SET_PDEATHSIG), and it ends them when the
main one ends, at Ctrl-C, and when one that may not be restarted crashes.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import os
import signal
import string
import subprocess
import sys
import time
import tomllib
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec
from rich.console import Console
from rich.text import Text

from elys.common.errors import LaunchError

TERMINATE_PATIENCE: Final = 5.0  # [s] between asking a process to end and ending it
RESTART_LIMIT: Final = 5  # crashes within RESTART_WINDOW after which a process is given up
RESTART_WINDOW: Final = 30.0  # [s]
TAIL_LENGTH: Final = 20  # lines of a crashed process's log that are shown again
COLORS: Final = ("cyan", "magenta", "green", "yellow", "blue", "red")


class ProcessDescription(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One [[process]] of a launch file."""

    name: str
    command: tuple[str, ...]
    main: bool = False
    restart: Literal["never", "on-crash"] = "never"
    nice: Annotated[int, msgspec.Meta(ge=0, le=19)] = 0


class LaunchFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A launch file as written."""

    title: str = ""
    parameters: dict[str, str] = {}
    process: tuple[ProcessDescription, ...] = ()


def read_launch_file(path: Path) -> LaunchFile:
    """The launch file at `path`; raises LaunchError naming file, place and what was expected."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise LaunchError(f"there is no launch file {path}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise LaunchError(f"{path} cannot be read: {error}") from error
    try:
        described = msgspec.convert(tomllib.loads(text), LaunchFile)
    except (tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise LaunchError(f"{path}: {error}") from error
    if not described.process:
        raise LaunchError(f"{path} describes no [[process]]")
    names = [process.name for process in described.process]
    if len(set(names)) != len(names):
        raise LaunchError(f"{path} has two processes of one name: {', '.join(names)}")
    if sum(process.main for process in described.process) > 1:
        raise LaunchError(f"{path} has more than one main process")
    return described


def fill_in(described: LaunchFile, values: Mapping[str, str]) -> list[ProcessDescription]:
    """The processes with parameters filled in and "elys" replaced by this interpreter; LaunchError for one missing or unknown."""
    for name in values:
        if name not in described.parameters:
            known = ", ".join(described.parameters) or "none"
            raise LaunchError(f"there is no parameter '{name}'; this launch file has {known}")
    for name, meaning in described.parameters.items():
        if name not in values:
            raise LaunchError(f"parameter '{name}' is missing ({meaning}): add {name}=VALUE")
    return [msgspec.structs.replace(process, command=tuple(_command(process, values))) for process in described.process]


def _command(process: ProcessDescription, values: Mapping[str, str]) -> list[str]:
    if not process.command:
        raise LaunchError(f"process '{process.name}' has an empty command")
    words = []
    for word in process.command:
        try:
            places = [place[1:] for place in string.Formatter().parse(word) if place[1] is not None]
            if any(form or conversion for _, form, conversion in places):
                raise ValueError("a parameter stands as it is")
            needed = [name for name, _, _ in places]
            unknown = [name for name in needed if name not in values]
            if unknown:
                raise LaunchError(f"process '{process.name}' uses {{{unknown[0]}}}, which is no parameter")
            words.append(word.format_map(values))
        except (ValueError, IndexError, KeyError, OverflowError) as error:
            raise LaunchError(f"process '{process.name}' has a word that cannot be filled in: {word!r}") from error
    if words[0] == "elys":
        words[:1] = [sys.executable, "-m", "elys"]
    return words


def run_processes(processes: list[ProcessDescription], *, quiet: bool = False) -> int:
    """Starts the processes and stays until the main one (or all) ended; the exit status of the whole.

    Raises:
        LaunchError: a process could not be started.
    """
    return asyncio.run(_Supervisor(processes, quiet=quiet).run())


class _Supervisor:
    def __init__(self, processes: list[ProcessDescription], *, quiet: bool) -> None:
        self._processes = processes
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)
        self._quiet = quiet
        self._stop = asyncio.Event()
        self._running: dict[str, asyncio.subprocess.Process] = {}
        self._status = 0

    async def run(self) -> int:
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, self._stop.set)
        failures: list[LaunchError] = []
        try:
            async with asyncio.TaskGroup() as group:
                watchers = [group.create_task(self._keep(index)) for index in range(len(self._processes))]
                group.create_task(self._end_when_all(watchers))
                group.create_task(self._end_when_asked(watchers))
        except* LaunchError as errors:
            failures += [error for error in errors.exceptions if isinstance(error, LaunchError)]
        if failures:  # raised out here: Python 3.11 before .4 wraps what is raised in an except* into a group again
            raise failures[0]
        return self._status

    async def _end_when_all(self, watchers: list[asyncio.Task[None]]) -> None:
        await asyncio.wait(watchers)
        self._stop.set()

    async def _end_when_asked(self, watchers: list[asyncio.Task[None]]) -> None:
        await self._stop.wait()
        for process in self._running.values():
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
        _, late = await asyncio.wait(watchers, timeout=TERMINATE_PATIENCE)
        if late:
            for name, process in self._running.items():
                self._say(name, f"did not end within {TERMINATE_PATIENCE:g} s and is killed", "bold red")
                with contextlib.suppress(ProcessLookupError):
                    process.kill()

    async def _keep(self, index: int) -> None:
        """Runs one process, again where it may be restarted, until it ended for good."""
        described = self._processes[index]
        crashes: deque[float] = deque(maxlen=RESTART_LIMIT)
        while not self._stop.is_set():
            tail: deque[str] = deque(maxlen=TAIL_LENGTH)
            status = await self._run_once(index, tail)
            if self._stop.is_set():
                return
            if status == 0:
                if described.main:
                    self._stop.set()
                return
            self._report_crash(described, status, tail)
            crashes.append(time.monotonic())
            hopeless = len(crashes) == RESTART_LIMIT and crashes[-1] - crashes[0] < RESTART_WINDOW
            if described.restart == "never" or hopeless:
                self._status = status if status > 0 else 128 - status
                self._stop.set()
                return
            await asyncio.sleep(0.2)

    async def _run_once(self, index: int, tail: deque[str]) -> int:
        described = self._processes[index]
        try:
            process = await asyncio.create_subprocess_exec(
                *described.command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.STDOUT,
                preexec_fn=before_exec(described.nice),
                start_new_session=True,  # Ctrl-C reaches the supervisor alone, which ends the others in order
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
            )
        except (OSError, ValueError, subprocess.SubprocessError) as error:
            self._stop.set()
            raise LaunchError(f"process '{described.name}' cannot be started: {error}") from error
        self._running[described.name] = process
        if self._stop.is_set():  # all were asked to end while this one was being started
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
        try:
            assert process.stdout is not None
            async for raw in _lines(process.stdout):
                tail.append(raw)
                if not self._quiet:
                    self._say(described.name, raw, COLORS[index % len(COLORS)])
            return await process.wait()
        finally:
            del self._running[described.name]

    def _report_crash(self, described: ProcessDescription, status: int, tail: deque[str]) -> None:
        how = f"was ended by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
        self._say(described.name, f"{how}; its last lines were:", "bold red")
        for line in tail:
            self._console.print(Text(f"    {line}", style="red"))

    def _say(self, name: str, line: str, style: str) -> None:
        width = max(len(process.name) for process in self._processes)
        self._console.print(Text.assemble((f"{name:>{width}} │ ", style), line))


async def _lines(stream: asyncio.StreamReader) -> AsyncIterator[str]:
    """The lines of a stream; one that is too long comes in pieces instead of ending the reader."""
    while True:
        try:
            raw = await stream.readuntil(b"\n")
        except asyncio.IncompleteReadError as error:
            if error.partial:
                yield error.partial.decode(errors="replace").rstrip("\n")
            return
        except asyncio.LimitOverrunError as error:
            raw = await stream.read(error.consumed)
        yield raw.decode(errors="replace").rstrip("\n")


def before_exec(nice: int) -> Callable[[], None]:
    """Runs in the child before exec: it shall die with its parent, and be as nice as asked."""
    libc = ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else None
    parent = os.getpid()

    def prepare() -> None:
        if libc is not None:
            libc.prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG, prctl(2)
            if os.getppid() != parent:  # the parent died in between
                os._exit(1)
        if nice:
            os.nice(nice)

    return prepare
