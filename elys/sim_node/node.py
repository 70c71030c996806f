"""The simulation's node: the tick, as a table of contents, on a clock, with the bus on one side and the world on the other."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import deque
from dataclasses import dataclass
from typing import Final, Protocol

from elys.bus import topics
from elys.bus.asset_service import serve_assets
from elys.bus.messages.commands import (
    Command,
    CommandRecord,
    CommandReply,
    CommandRequest,
    SetPlaying,
    SetRate,
    StepTicks,
)
from elys.bus.messages.plan import PhysicsPlan, PlanRequest
from elys.bus.messages.scene import Snapshot, SnapshotRequest
from elys.bus.messages.session import Event, EventBatch, SessionStatus
from elys.bus.session import Session
from elys.common.clock import FixedStepClock
from elys.common.errors import ElysError, RequestError
from elys.sim_node.guard import Guard
from elys.sim_node.scene.snapshot import take_snapshot
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_commands import apply_command
from elys.sim_node.systems.publish_state import (
    contact_batch,
    is_heard,
    physics_plan,
    publish_debug_lines,
    publish_diagnostics,
    publish_profile,
    scene_delta,
    state_frame,
)
from elys.sim_node.timing import StageTimes, process_age

STATUS_INTERVAL: Final = 0.25  # [s]
COMMANDS_PER_TICK: Final = 1000  # what comes beyond waits for the next tick, so that a flood cannot stop time
TICK_TIMES_KEPT: Final = 36_000
COMMAND_LIMIT: Final = 20_000  # waiting; beyond it commands are refused
STEP_LIMIT: Final = 1_000_000  # ticks asked for at once
REASON_LENGTH: Final = 500  # characters of a refusal, which may quote what was sent

_log = logging.getLogger(__name__)


class BackPressure(Protocol):
    """Somebody who must get every tick (a recorder) and can ask a run at full speed to wait."""

    async def ready(self) -> None:
        """Returns when there is room for another tick."""


@dataclass(slots=True)
class _Waiting:
    request: CommandRequest
    reply: asyncio.Future[CommandReply]


class SimulationNode:
    """Runs a Simulation in a session. `run` returns after `step_limit` ticks, or never by itself if that is 0."""

    def __init__(
        self,
        simulation: Simulation,
        session: Session,
        *,
        realtime: bool = True,
        playing: bool = True,
        step_limit: int = 0,
    ) -> None:
        self.simulation = simulation
        self.session = session
        self.steps_done = 0
        self.recorder: BackPressure | None = None
        self.guard: Guard | None = None
        self.tick_times: deque[float] = deque(maxlen=TICK_TIMES_KEPT)  # [ms] of the last ticks, for the report
        self._step_limit = step_limit
        self._clock = FixedStepClock(simulation.settings.tick_rate, playing=playing, rate=1.0 if realtime else 0.0)
        self._waiting: deque[_Waiting] = deque()
        self._steps_asked = 0
        self._sequence = 0
        self._events: list[Event] = []
        self._settings_told = simulation.settings
        self._wake = asyncio.Event()

    @property
    def playing(self) -> bool:
        """Whether time goes on by itself."""
        return self._clock.playing

    @property
    def rate(self) -> float:
        """Simulated seconds in one second; 0: as fast as it can."""
        return self._clock.rate

    async def run(self) -> None:
        """Serves the session and ticks until the step limit or cancellation."""
        session = self.session
        session.serve(topics.COMMAND, self._take_command)
        session.serve(topics.SNAPSHOT, self._give_snapshot)
        session.serve(topics.PLAN, self._give_plan)
        serve_assets(session, self.simulation.assets)
        self._publish_status()
        self._publish_frame()  # who subscribes before the first tick sees the scene as it was loaded
        async with asyncio.TaskGroup() as group:
            heartbeat = group.create_task(self._heartbeat())
            await self._tick_until_done()
            heartbeat.cancel()
        self._publish_status()

    async def _tick_until_done(self) -> None:
        while not self._is_done():
            if self.recorder is not None:
                await self.recorder.ready()
            await self._until_due()
            for _ in range(self._clock.take_due() if self.playing else 1):
                if not self._is_done():
                    self.tick()

    async def _until_due(self) -> None:
        """Waits until the next tick; while paused, until somebody asks for something."""
        if self._steps_asked or (self.playing and self.rate == 0.0):
            await asyncio.sleep(0)  # lets the bus speak; a run at full speed waits for nothing else
        elif self.playing:
            await asyncio.sleep(self._clock.seconds_until_due())
        else:
            await self._wake.wait()
        self._wake.clear()

    def _is_done(self) -> bool:
        return bool(self._step_limit) and self.steps_done >= self._step_limit

    def tick(self) -> None:
        """One tick: commands, then if time goes on the world's step, then all that others shall know of it."""
        stages = StageTimes()
        late = self._clock.lateness() * 1000.0
        replies = self._apply_commands()
        stages.done("apply_commands")
        stepping = self.playing or self._steps_asked > 0
        if stepping:
            self._step(stages)
        else:
            self.simulation.settle()
            stages.done("follow_changes")
        self._publish_changes()
        if replies or (stepping and is_heard(self.session, topics.STATE)):
            self._publish_frame()
        if stepping and (found := publish_diagnostics(self.session, self.simulation)) and self.guard is not None:
            self._events += self.guard.look(found)
        events = self._publish_events()
        if stepping:
            self._publish_contacts()
        publish_debug_lines(self.session, self.simulation)
        stages.done("publish_state")
        for waiting, reply in replies:
            if not waiting.reply.done():
                waiting.reply.set_result(reply)
        if self.steps_done == 1 and stepping:
            _log.info("first tick published %.2f s after the process started", process_age())
        if stepping:
            self.tick_times.append(stages.total)
            publish_profile(self.session, self.simulation, stages.times, total=stages.total, late=late)
        if self.guard is not None:
            self.guard.end_tick(events)

    def _step(self, stages: StageTimes) -> None:
        self.simulation.step()
        stages.include(self.simulation.stage_times)
        self._clock.advance()
        self.steps_done += 1
        self._steps_asked = max(self._steps_asked - 1, 0)
        if self.simulation.take_stop():
            self._clock.pause()
            self._steps_asked = 0
            self._events.append(Event(kind="paused"))
            self._publish_status()

    # --- commands --------------------------------------------------------------------------------------------------

    async def _take_command(self, request: CommandRequest, key: str) -> CommandReply:
        if len(self._waiting) >= COMMAND_LIMIT:
            raise RequestError(f"{COMMAND_LIMIT} commands are waiting already: send fewer, or wait for their answers")
        waiting = _Waiting(request, asyncio.get_running_loop().create_future())
        self._waiting.append(waiting)
        self._wake.set()
        return await waiting.reply

    def _apply_commands(self) -> list[tuple[_Waiting, CommandReply]]:
        replies = []
        for _ in range(min(len(self._waiting), COMMANDS_PER_TICK)):
            waiting = self._waiting.popleft()
            reply = self._apply(waiting.request)
            replies.append((waiting, reply))
            self.session.publish(
                topics.COMMANDS,
                CommandRecord(
                    tick=reply.tick,
                    origin=waiting.request.origin,
                    command=waiting.request.command,
                    accepted=reply.accepted,
                    reason=reply.reason,
                ),
            )
        if self._waiting:
            self._wake.set()
        return replies

    def _apply(self, request: CommandRequest) -> CommandReply:
        tick = self.simulation.tick
        try:
            entities = self._apply_to_time(request.command)
            if entities is None:
                entities = apply_command(self.simulation, request.command)
        except ElysError as error:
            return CommandReply(accepted=False, tick=tick, reason=str(error)[:REASON_LENGTH])
        except Exception as error:  # a fault of ELYS's own: it is told in full, and does not end everybody's session
            _log.exception("command %s failed", type(request.command).__name__)
            return CommandReply(accepted=False, tick=tick, reason=f"ELYS failed: {error!r}"[:REASON_LENGTH])
        return CommandReply(accepted=True, tick=tick, entities=entities)

    def _apply_to_time(self, command: Command) -> tuple[int, ...] | None:
        """Commands to the clock rather than the world; None for all others."""
        match command:
            case SetPlaying(playing=playing):
                self._clock.play() if playing else self._clock.pause()
                self._steps_asked = 0
                self._events.append(Event(kind="playing" if playing else "paused"))
            case StepTicks(count=count):
                if count < 1:
                    raise RequestError("a simulation cannot step backwards: record it, and step in the replay")
                if self.playing:
                    raise RequestError("pause before stepping")
                if self._steps_asked + count > STEP_LIMIT:
                    raise RequestError(f"at most {STEP_LIMIT} ticks can be asked for at once: play instead")
                self._steps_asked += count
            case SetRate(rate=rate):
                if not 0.0 <= rate <= 100.0:
                    raise RequestError(f"the rate must lie between 0 (as fast as it can) and 100, not {rate:g}")
                self._clock.set_rate(rate)
            case _:
                return None
        self._publish_status()
        return ()

    # --- publishing ------------------------------------------------------------------------------------------------

    async def _give_snapshot(self, request: SnapshotRequest, key: str) -> Snapshot:
        return self.snapshot()

    async def _give_plan(self, request: PlanRequest, key: str) -> PhysicsPlan:
        return physics_plan(self.simulation)

    def snapshot(self) -> Snapshot:
        """The whole scene as it is between two ticks."""
        simulation = self.simulation
        return take_snapshot(
            simulation.world,
            epoch=self.session.epoch,
            tick=simulation.tick,
            simulation_time=simulation.time,
            sequence=self._sequence,
            scene=simulation.name,
            settings=simulation.settings,
        )

    def _publish_changes(self) -> None:
        changes = self.simulation.take_changes()
        settings_changed = self.simulation.settings is not self._settings_told
        if not changes and not settings_changed:
            return
        if settings_changed:
            self._settings_told = self.simulation.settings
            self._clock.set_tick_rate(self.simulation.settings.tick_rate, tick=self.simulation.tick)
        self._sequence += 1
        delta = scene_delta(
            self.simulation,
            changes,
            epoch=self.session.epoch,
            sequence=self._sequence,
            settings_changed=settings_changed,
        )
        self.session.publish(topics.DELTA, delta)

    def _publish_frame(self) -> None:
        frame = state_frame(
            self.simulation,
            epoch=self.session.epoch,
            delta_sequence=self._sequence,
            playing=self.playing,
        )
        self.session.publish(topics.STATE, frame)

    def _publish_events(self) -> tuple[Event, ...]:
        events = (*self._events, *self.simulation.take_events())
        self._events.clear()
        if events:
            batch = EventBatch(epoch=self.session.epoch, tick=self.simulation.tick, events=events)
            self.session.publish(topics.EVENTS, batch)
        return events

    def _publish_contacts(self) -> None:
        batch = contact_batch(self.simulation, epoch=self.session.epoch)
        if batch is not None:
            self.session.publish(topics.CONTACTS, batch)

    def _publish_status(self) -> None:
        simulation = self.simulation
        status = SessionStatus(
            epoch=self.session.epoch,
            kind="simulation",
            scene=simulation.name,
            tick=simulation.tick,
            simulation_time=simulation.time,
            playing=self.playing,
            tick_rate=simulation.settings.tick_rate,
            rate=self.rate,
            realtime_factor=self._clock.realtime_factor,
            entity_count=simulation.world.entity_count,
            body_count=len(simulation.moving_bodies().entity),
        )
        self.session.publish(topics.STATUS, status)

    async def _heartbeat(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            while True:
                await asyncio.sleep(STATUS_INTERVAL)
                self._publish_status()
