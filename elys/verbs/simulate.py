"""A simulation in this process: hosted on the bus, recorded if asked, until its steps are done or it is told to end."""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import platformdirs

from elys.bus.access.listening import Listening
from elys.bus.last_seconds import SECONDS
from elys.bus.recording_plan import PLAIN, RecordingPlan
from elys.common.assets.store import AssetStore
from elys.verbs.host_facts import discoverable, facts_of
from elys.verbs.nodes import hosted, session_name
from elys.verbs.output import size_text
from elys.verbs.scenes import open_scene_or_sample

if TYPE_CHECKING:
    from elys.bus.session import Session
    from elys.sim_node.guard import Guard
    from elys.sim_node.node import SimulationNode
    from elys.sim_node.simulation import Simulation
    from elys.verbs.fork import Origin

_log = logging.getLogger(__name__)


class RunReport(msgspec.Struct, frozen=True, kw_only=True):
    """What a run did, for who started it."""

    scene: str
    ticks: int
    simulation_time: float  # [s]
    wall_time: float  # [s]
    realtime_factor: float
    entity_count: int
    body_count: int
    state_hash: str
    tick_p50: float  # [ms]
    tick_p99: float  # [ms]
    recording: str = ""
    recording_size: int = 0  # [bytes]


def describe(report: RunReport) -> str:
    """A report as a person reads it."""
    text = (
        f"{report.scene}: {report.ticks} ticks ({report.simulation_time:.2f} s) in {report.wall_time:.2f} s, "
        f"{report.realtime_factor:.1f} times real time; {report.body_count} bodies; state {report.state_hash}"
    )
    if report.recording:
        text += f"\n{report.recording}: {size_text(report.recording_size)}"
    return text


def prepare(
    scene: str, *, record: Path | None, plan: RecordingPlan = PLAIN, threads: int = 1, at: str = ""
) -> tuple[Simulation, Origin | None]:
    """Opens a scene, or a recording at a time, and loads or compiles the kernels; and which recording it is a fork of.

    Not on the loop: Ctrl-C ends it at once, and nothing is lost.

    Raises:
        SceneError, AssetError: the scene is missing or wrong. RecordingError: it cannot be recorded there, or gone on with.
    """
    from elys.sim_node.simulation import Simulation
    from elys.verbs.fork import opened_at, required_recording
    from elys.verbs.kernels import compile_with_progress
    from elys.verbs.moments import parse_moment
    from elys.verbs.recording_child import require_recordable
    from elys.verbs.trusting import ask_about_scripts

    if record is not None:
        require_recordable(record, overwrites=plan.overwrites)
    if at:
        return opened_at(required_recording(scene), parse_moment(at), goes_on=False, threads=threads)
    assets = AssetStore()
    opened = open_scene_or_sample(scene, assets)
    ask_about_scripts(opened.records, assets)
    compile_with_progress(opened, threads=threads)
    return Simulation.load(opened, assets, threads=threads), None


async def simulate(
    simulation: Simulation,
    *,
    listen: Listening,
    router: str | None = None,
    discover: bool = False,
    step_limit: int,
    record: Path | None,
    realtime: bool,
    paused: bool,
    name: str,
    guard: float = SECONDS,
    keep: float = 60.0,
    plan: RecordingPlan = PLAIN,
    origin: Origin | None = None,
    on_end: Callable[[RunReport], None] | None = None,
) -> None:
    """Runs a simulation in a session of its own, of which the last `keep` seconds can be gone back to.

    One that has an `origin` is the fork of a recording.

    Raises:
        BusError: the endpoint cannot be listened at. RecordingError: the recording cannot be written.
    """
    from elys.sim_node.node import SimulationNode
    from elys.sim_node.scripts.watchdog import native_calls_said
    from elys.verbs.recording_child import RecordingChild

    scene, epoch = simulation.name, time.time_ns()
    async with hosted(
        listen,
        name=name or scene,
        kind="simulation",
        scene=scene,
        epoch=epoch,
        router=router,
        is_chosen=bool(name),
    ) as (session, endpoint):
        _log.info("simulating %s at %s", scene, endpoint)
        node = SimulationNode(
            simulation, session, realtime=realtime, playing=not paused, step_limit=step_limit, keep=keep
        )
        if origin is not None:
            node.chronicle.lineage, node.repetition = origin.lineage, origin.repetition
        recorder = RecordingChild(record, plan) if record else None
        if recorder is not None:
            recorder.attach(session, node, simulation.assets, lossless=not realtime)
        if guard:
            # What is recorded is in the recording, and what runs without anybody's hands can be run again.
            node.guard = _guard_of(node, session, record, seconds=guard, survives=realtime and record is None)
        session.host_facts = facts_of(node)
        started = time.perf_counter()
        try:
            async with discoverable(session, endpoint, wanted=discover, needs_secret=not listen.insecure):
                with native_calls_said():
                    await node.run()
        except Exception:
            if node.guard is not None:
                node.guard.keep()  # what led to it
            raise
        finally:
            wall_time = time.perf_counter() - started
            if node.guard is not None:
                await asyncio.shield(asyncio.to_thread(node.guard.close))
            size = await asyncio.shield(recorder.finish()) if recorder is not None else 0
            if on_end is not None:
                on_end(_report(node, wall_time, recorder.path if recorder is not None else None, size))


def _guard_of(node: SimulationNode, session: Session, record: Path | None, *, seconds: float, survives: bool) -> Guard:
    from elys.bus.crash_box import CrashBox
    from elys.bus.last_seconds import LastSeconds, room_for
    from elys.sim_node.guard import Guard

    simulation = node.simulation
    folder = record.parent if record is not None else Path()
    if not os.access(folder, os.W_OK):
        folder = Path(platformdirs.user_data_dir("elys", ensure_exists=True))
    place = folder / f"elys-problem-{session_name(simulation.name)}"
    box = None
    if survives:
        try:
            box = CrashBox(place, seconds=seconds, room=room_for(seconds))
        except OSError as error:
            _log.info("the last seconds are not kept for a crash: %s", error)
    last = LastSeconds(
        session,
        take_snapshot=node.snapshot,
        assets=simulation.assets,
        exact=node.chronicle,
        seconds=seconds,
        box=box,
    )
    return Guard(simulation, last, lambda tick: place.with_name(f"{place.name}-{tick}.mcap"))


def _report(node: SimulationNode, wall_time: float, record: Path | None, size: int) -> RunReport:
    simulation, ticks = node.simulation, node.steps_done
    times = sorted(node.tick_times) or [0.0]
    return RunReport(
        scene=simulation.name,
        ticks=ticks,
        simulation_time=simulation.time,
        wall_time=wall_time,
        realtime_factor=ticks / simulation.settings.tick_rate / wall_time if wall_time else 0.0,
        entity_count=simulation.world.entity_count,
        body_count=len(simulation.moving_bodies().entity),
        state_hash=f"{simulation.state_hash():016x}",
        tick_p50=times[len(times) // 2],
        tick_p99=times[len(times) * 99 // 100],
        recording=str(record) if record else "",
        recording_size=size,
    )
