"""The recorder of a run: a process of its own that outlives the simulation, fed through a pipe."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import logging
import os
import subprocess
import sys
from pathlib import Path
from typing import Final

from elys.bus.recording_names import claimed, free_name, is_device
from elys.bus.recording_plan import PLAIN, RecordingPlan, files_of, to_json
from elys.bus.session import Session
from elys.bus.tap import RecordingTap
from elys.bus.transports.mcap import open_alone
from elys.common.assets.store import AssetStore
from elys.common.errors import RecordingError
from elys.sim_node.node import SimulationNode

# What stands in the pipe outlives the simulation, what waits in front of it does not: while the recorder starts, or waits for
# its turn or a disk, a kill would lose it. Linux gives this much to everybody, 64 KiB if not asked.
PIPE_SIZE: Final = 1 << 20  # [bytes]
_log = logging.getLogger(__name__)


def require_recordable(path: Path, *, overwrites: bool = False) -> None:
    """Raises RecordingError unless a recording can be written there, under a number if need be; makes directories that lack."""
    if path.suffix != ".mcap":
        # What has another suffix may be the very scene that is to be run.
        raise RecordingError(f"{path} cannot be recorded to: recordings have the suffix .mcap, for instance run.mcap")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{path} cannot be written ({error.strerror}): choose another place") from error
    place = path if overwrites or is_device(path) else free_name(path)
    was_there = place.exists()
    os.close(open_alone(place))
    if not was_there:
        place.unlink()  # the run may yet fail, and would leave an empty file


def claimed_file(path: Path, plan: RecordingPlan) -> Path:
    """The file that is recorded to, and says so where it is not the one that was named; RecordingError if there can be none."""
    require_recordable(path, overwrites=plan.overwrites)
    if plan.rotates:
        return path  # numbers go on after those that are there
    place = claimed(path, overwrites=plan.overwrites)
    if place != path:
        _log.warning("%s is there already: recording to %s (--overwrite writes over it)", path, place)
    return place


class RecordingChild:
    """A recorder process, started before the simulation is there, so that both start at the same time."""

    def __init__(self, path: Path, plan: RecordingPlan = PLAIN) -> None:
        """Raises RecordingError if the file cannot be written."""
        self.path = path = claimed_file(path, plan)
        self._earlier = set(files_of(path)) if plan.rotates else set()
        self._plan = plan
        reading, self._writing = os.pipe()
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            with contextlib.suppress(OSError):  # this user has as many as the system lets him: a short one will do
                fcntl.fcntl(self._writing, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        self._tap: RecordingTap | None = None
        command = [sys.executable, "-m", "elys.bus.recorder_process", "--fd", str(reading), "--output", str(path)]
        self._process = subprocess.Popen(
            [*command, "--plan", to_json(plan)],
            pass_fds=[reading],
            stdin=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C ends the simulation; the recorder ends when the pipe does
        )
        os.close(reading)

    def attach(self, session: Session, node: SimulationNode, assets: AssetStore, *, lossless: bool) -> None:
        """From now on everything that the session publishes is recorded, and a lossless run keeps step with the recorder."""
        self._tap = RecordingTap(
            session,
            self._writing,
            take_snapshot=node.snapshot,
            assets=assets,
            lossless=lossless,
            exact=node.chronicle,
        )
        node.recorder = self._tap

    async def finish(self) -> int:
        """Ends the recording and waits until its files are whole; returns their size [bytes]."""
        if self._tap is not None:
            await asyncio.to_thread(self._tap.close)
        else:
            os.close(self._writing)
        status = await asyncio.to_thread(self._process.wait)
        if status:
            raise RecordingError(f"the recorder ended with status {status}: what it said stands above")
        files = set(files_of(self.path)) - self._earlier if self._plan.rotates else {self.path}
        return sum(file.stat().st_size for file in files)
