"""What the editor's start page opens takes other nodes: they are started here, and end with the editor."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sys
from collections import deque
from pathlib import Path
from typing import Final

from elys.bus.access.credentials import Credentials
from elys.bus.discovery import find_sessions
from elys.bus.messages.ghosts import Color
from elys.common.errors import LaunchError, RecordingError
from elys.launch import RESTART_LIMIT, TERMINATE_PATIENCE, before_exec
from elys.verbs.run import free_endpoint

HOST_PATIENCE: Final = 300.0  # [s] for a host to listen: kernels may have to be compiled first
LOOK_INTERVAL: Final = 0.1  # [s]
TAIL_LENGTH: Final = 5  # lines of a process that ended, to find its sentence in
_log = logging.getLogger(__name__)


class ChildProcesses:
    """Hosts and render nodes as children of this process, which die with it. An async context manager."""

    def __init__(self) -> None:
        self._children: list[asyncio.subprocess.Process] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._shown: dict[str, Credentials] = {}  # by endpoint
        self._is_closing = False

    @property
    def samples(self) -> tuple[tuple[str, str], ...]:
        """The sample scenes: name and title."""
        from elys.samples.registry import SAMPLES

        return tuple((sample.name, sample.title) for sample in SAMPLES.values())

    async def simulate(self, scene: str) -> str:
        """Starts a simulation of a scene file or a sample, paused; returns its endpoint when it listens.

        Raises:
            SceneError: there is no such scene, or it is wrong. LaunchError: the simulation ended before it listened.
        """
        from elys.verbs.scenes import open_scene_or_sample

        await asyncio.to_thread(open_scene_or_sample, scene)  # a mistake in it is a sentence, and not a crash of a node
        return await self._host("simulation", scene, "--paused")

    async def play(self, recording: str) -> str:
        """Starts a player of a recording; returns its endpoint when it listens.

        Raises:
            RecordingError: it is none. LaunchError: the player ended before it listened.
        """
        from elys.bus.recording_info import recording_info

        await asyncio.to_thread(recording_info, Path(recording))
        return await self._host("player", recording, "--paused")

    async def fork(self, recording: str, time: float, record: str) -> str:
        """Starts a simulation that goes on from a time [s] of a recording, paused; returns its endpoint when it listens.

        Raises:
            RecordingError, StateError: there is no such instant, or it cannot be gone on with from there.
            LaunchError: the simulation ended before it listened.
        """
        from elys.verbs.fork import recorded_scene
        from elys.verbs.recording_child import require_recordable

        await asyncio.to_thread(recorded_scene, recording, f"{time:.9f}")
        words = ["--at", f"{time:.9f}", "--paused"]
        if record:
            if Path(record).exists() and Path(record).samefile(recording):
                raise RecordingError(f"a fork of {recording} cannot be recorded over it: choose another name")
            require_recordable(Path(record))
            words += ["--record", record]
        return await self._host("simulation", recording, *words)

    async def show_ghost(self, recording: str, endpoint: str, color: Color, starts_now: bool) -> None:
        """Starts a process that shows a recording as ghost in the session at an endpoint, until it is taken away there.

        Raises:
            RecordingError: it is none.
        """
        from elys.verbs.ghosts import require_recordings

        await asyncio.to_thread(require_recordings, [Path(recording)])
        now = ("--now",) if starts_now else ()
        await self._start("ghost", recording, "--connect", endpoint, "--color", bytes(color).hex(), *now, nice=10)

    async def draw(self, endpoint: str) -> None:
        """Starts a render node for the session at an endpoint; one that crashes is started again, but not for ever."""
        child, _ = await self._start("render", "--connect", endpoint, nice=10)
        keeper = asyncio.ensure_future(self._keep_drawing(child, endpoint))
        self._tasks.add(keeper)
        keeper.add_done_callback(self._tasks.discard)

    def show(self, endpoint: str, credentials: Credentials | None) -> None:
        """What is started for the session at an endpoint shows these from now on; None: what this process would."""
        self._shown.pop(endpoint, None)
        if credentials is not None:
            self._shown[endpoint] = credentials

    async def close(self) -> None:
        """Ends all that was started here."""
        self._is_closing = True
        for child in self._children:
            with contextlib.suppress(ProcessLookupError):
                child.terminate()
        for child in self._children:
            try:
                await asyncio.wait_for(child.wait(), TERMINATE_PATIENCE)
            except TimeoutError:
                with contextlib.suppress(ProcessLookupError):
                    child.kill()
                await child.wait()
        await asyncio.gather(*self._tasks)

    async def _keep_drawing(self, child: asyncio.subprocess.Process, endpoint: str) -> None:
        for _ in range(RESTART_LIMIT):
            if await child.wait() == 0 or self._is_closing:
                return
            _log.warning("the render node at %s ended with status %s and is started again", endpoint, child.returncode)
            child, _tail = await self._start("render", "--connect", endpoint, nice=10)

    async def _host(self, kind: str, *words: str) -> str:
        endpoint = await asyncio.to_thread(free_endpoint)
        child, tail = await self._start(kind, *words, "--listen", endpoint)
        async with asyncio.timeout(HOST_PATIENCE):
            while not any(record.endpoint == endpoint for record in await asyncio.to_thread(find_sessions)):
                if child.returncode is not None:
                    said = tail[-1] if tail else f"it ended with status {child.returncode}"
                    raise LaunchError(f"{words[0]} could not be opened: {said.removeprefix('error: ')}")
                await asyncio.sleep(LOOK_INTERVAL)
        return endpoint

    def _environment(self, words: tuple[str, ...]) -> dict[str, str]:
        """Of a process with these words: other users cannot see what stands there."""
        shown = next((self._shown[word] for word in words if word in self._shown), None)
        return dict(os.environ) if shown is None else shown.in_environment(os.environ)

    async def _start(self, kind: str, *words: str, nice: int = 0) -> tuple[asyncio.subprocess.Process, deque[str]]:
        try:
            child = await asyncio.create_subprocess_exec(
                sys.executable,
                *("-m", "elys", "node", kind, *words),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.STDOUT,
                preexec_fn=before_exec(nice),
                start_new_session=True,
                env={**self._environment(words), "PYTHONUNBUFFERED": "1"},
            )
        except OSError as error:
            raise LaunchError(f"a {kind} node cannot be started: {error}") from error
        self._children.append(child)
        tail: deque[str] = deque(maxlen=TAIL_LENGTH)
        reader = asyncio.ensure_future(_read(child, kind, tail))
        self._tasks.add(reader)
        reader.add_done_callback(self._tasks.discard)
        return child, tail


async def _read(child: asyncio.subprocess.Process, kind: str, tail: deque[str]) -> None:
    """Passes on what a child says, and waits for its end."""
    assert child.stdout is not None
    async for raw in child.stdout:
        line = raw.decode(errors="replace").rstrip()
        if line:
            tail.append(line)
            sys.stderr.write(f"{kind} | {line}\n")
    await child.wait()
