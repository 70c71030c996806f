"""fork: goes on from any instant of a recording, with another future."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from elys.bus.messages.commands import CommandRequest
from elys.common.errors import RecordingError, SceneError
from elys.verbs.moments import parse_moment
from elys.verbs.output import print_json

if TYPE_CHECKING:
    from elys.bus.access.listening import Listening
    from elys.common.scene import OpenedScene
    from elys.sim_node.repetition import Repetition
    from elys.sim_node.simulation import Simulation
    from elys.verbs.simulate import RunReport


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a simulation comes from that goes on with a recorded session."""

    lineage: dict[str, str]
    repetition: Repetition | None = None


def fork(
    recording: Path,
    *,
    at: str,
    edits: Path | None,
    output: Path,
    overwrites: bool,
    seconds: float,
    repeats: bool,
    listen: Listening,
    threads: int,
    json: bool,
) -> None:
    """Runs on from an instant as fast as it can, and records.

    Raises:
        RecordingError, StateError, SceneError: there is no such instant, or an edit cannot be made there.
    """
    from elys.bus.log import start_logging
    from elys.bus.recording_names import require_free
    from elys.bus.recording_plan import RecordingPlan
    from elys.verbs.nodes import run_until_asked
    from elys.verbs.recording_child import require_recordable
    from elys.verbs.simulate import describe, simulate

    start_logging()
    if output.exists() and recording.exists() and output.samefile(recording):
        raise RecordingError(f"a fork of {recording} cannot be recorded over it: choose another name with -o")
    if not overwrites:
        require_free(output)
    require_recordable(output, overwrites=overwrites)
    simulation, origin = opened_at(
        recording, parse_moment(at), edits=edits, seconds=seconds, repeats=repeats, threads=threads
    )
    reports: list[RunReport] = []
    run_until_asked(
        simulate(
            simulation,
            listen=listen,
            step_limit=0,
            record=output,
            plan=RecordingPlan(overwrites=overwrites),
            realtime=False,
            paused=False,
            name="",
            keep=0.0,
            origin=origin,
            on_end=reports.append,
        )
    )
    for report in reports:
        print_json(report) if json else print(describe(report))


def opened_at(
    recording: Path,
    at: float,
    *,
    edits: Path | None = None,
    seconds: float = 0.0,
    repeats: bool = True,
    threads: int = 1,
    goes_on: bool = True,
) -> tuple[Simulation, Origin]:
    """The simulation of a recording at a time [s]; unless it `goes_on` by itself, without what happened there afterwards.

    Raises:
        RecordingError, StateError, SceneError: see `fork`.
    """
    from elys.bus.lineage import lineage_from
    from elys.bus.recording import Recording
    from elys.sim_node.fork_point import fork_point
    from elys.sim_node.repetition import ORIGIN, Repetition
    from elys.verbs.edit_file import read_edits
    from elys.verbs.verify import load_kernels, progress_bar

    load_kernels(recording, threads=threads)
    with Recording(recording, checked=True) as opened:
        with progress_bar("Going there") as progress:
            point = fork_point(opened, at, threads=threads, progress=progress)
        simulation = point.simulation
        changes = read_edits(edits, simulation) if edits is not None else ()
        lineage = lineage_from(
            opened,
            instant=point.instant,
            tick=simulation.tick,
            time=simulation.time,
            repeats=repeats and goes_on,
            edits=msgspec.json.encode(changes).decode(),
        )
    if not goes_on:
        return simulation, Origin(lineage.facts())
    repetition = Repetition(
        point.course,
        point.instant,
        last_instant=point.last_instant,
        first=tuple(CommandRequest(origin=ORIGIN, command=change) for change in changes),
        step_limit=round(seconds * simulation.settings.tick_rate),
        repeats=repeats,
    )
    return simulation, Origin(lineage.facts(), repetition)


def required_recording(name: str) -> Path:
    """The recording of that name; SceneError if it is the name of a scene."""
    if Path(name).suffix != ".mcap":
        raise SceneError(f"{name} is no recording: leave --at away, it says from when on a recording goes on")
    return Path(name)


def recorded_scene(name: str, at: str) -> OpenedScene:
    """What a recording shows at a time; RecordingError if it cannot be gone on with from there."""
    from elys.bus.course import read_course
    from elys.bus.recording import opened_to_show
    from elys.sim_node.fork_point import require_within
    from elys.verbs.verify import scene_of

    time = parse_moment(at)
    with opened_to_show(required_recording(name), time) as recording:
        require_within(recording, read_course(recording), time)
        return scene_of(recording.mirror_at(recording.position_at(time)), recording.path)
