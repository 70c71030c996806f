"""The simulation's node: the tick, as a table of contents, on a clock, with the bus on one side and the world on the other."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import socket
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, Protocol

import msgspec

from elys.bus import topics
from elys.bus.asset_service import lacking_assets, serve_assets
from elys.bus.edit_parts import edits_of
from elys.bus.marker_log import MarkerLog, markers_of_command, markers_of_contacts, markers_of_events
from elys.bus.messages.commands import (
    Batch,
    Command,
    CommandRecord,
    CommandReply,
    CommandRequest,
    Edit,
    Grab,
    Input,
    KeepLast,
    LoadScene,
    NoteSaved,
    Redo,
    Release,
    Resume,
    Rewind,
    Seek,
    SetPlaying,
    SetRate,
    StepTicks,
    Tell,
    Time,
    Undo,
)
from elys.bus.messages.history import HistoryReply, HistoryRequest
from elys.bus.messages.physics import Touching, TouchingRequest
from elys.bus.messages.plan import PhysicsPlan, PlanRequest
from elys.bus.messages.scene import Snapshot, SnapshotRequest
from elys.bus.messages.scripts import ScriptForm, ScriptFormRequest
from elys.bus.messages.session import Event, EventBatch, SessionStatus
from elys.bus.messages.state_frame import INSTANTS
from elys.bus.messages.timeline import Markers, MarkersRequest
from elys.bus.prefab_service import serve_prefabs
from elys.bus.session import Session
from elys.common.clock import FixedStepClock
from elys.common.errors import EditConflict, ElysError, RequestError
from elys.sim_node.chronicle import Chronicle
from elys.sim_node.collection import without_collection
from elys.sim_node.edit_history import Done, EditHistory
from elys.sim_node.flight_recorder import SECONDS, FlightRecorder
from elys.sim_node.guard import Guard
from elys.sim_node.input_intake import InputIntake
from elys.sim_node.paused_physics import PausedPhysics
from elys.sim_node.repetition import Cue, Repetition
from elys.sim_node.scene_telling import SceneTelling
from elys.sim_node.scripts.forms import form_of
from elys.sim_node.scripts.reloading import SCRIPT_FILES, ScriptFiles
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_commands import apply_command
from elys.sim_node.systems.apply_edits import EditableSimulation, load_scene
from elys.sim_node.systems.publish_state import (
    contact_batch,
    is_heard,
    physics_plan,
    publish_debug_lines,
    publish_diagnostics,
    publish_profile,
    state_frame,
    touching,
)
from elys.sim_node.timing import StageTimes, process_age

STATUS_INTERVAL: Final = 0.25  # [s]
COMMANDS_PER_TICK: Final = 1000  # what comes beyond waits for the next tick, so that a flood cannot stop time
TICK_TIMES_KEPT: Final = 36_000
COMMAND_LIMIT: Final = 20_000  # waiting; beyond it commands are refused
STEP_LIMIT: Final = 1_000_000  # ticks asked for at once
REASON_LENGTH: Final = 500  # characters of a refusal, which may quote what was sent
PERSON_LENGTH: Final = 100  # characters of what a person is called

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
        keep: float = SECONDS,
    ) -> None:
        """`keep` seconds of simulation can be gone back to; with 0 none."""
        self.simulation = simulation
        self.session = session
        self.history = EditHistory(EditableSimulation(simulation))
        self.steps_done = 0
        self.recorder: BackPressure | None = None
        self.guard: Guard | None = None
        self.repetition: Repetition | None = None  # of a recorded session, which this one goes on like
        self.players: list[Callable[[], Iterable[CommandRequest]]] = []  # of this process: asked before each step
        self.untold: set[str] = (
            set()
        )  # events that scripts alone tell: somebody believes them, so nobody else may say so
        self.tick_times: deque[float] = deque(maxlen=TICK_TIMES_KEPT)  # [ms] of the last ticks, for the report
        self._step_limit = step_limit
        self._clock = FixedStepClock(simulation.settings.tick_rate, playing=playing, rate=1.0 if realtime else 0.0)
        self._clock.seek(simulation.tick)
        self._waiting: deque[_Waiting] = deque()
        self._steps_asked = 0
        self._scene = SceneTelling(simulation, session, self.history, self._clock)
        self._events: list[Event] = []
        self._paused_physics = PausedPhysics(simulation)
        self._wake = asyncio.Event()
        self._edited = asyncio.Event()  # an edit waits
        self._has_edited_between = False  # since the last step
        self._intake = InputIntake(
            simulation,
            session,
            put=self.put,
            wake=self._wake.set,
            is_rewound=lambda: self._is_rewound,
        )
        self.flight = FlightRecorder(simulation, seconds=keep) if keep > 0.0 else None
        self.chronicle = Chronicle(simulation, self.flight, epoch=session.epoch, tell=self._publish_command)
        self._script_files = ScriptFiles(simulation)
        self._markers = MarkerLog()
        self._repeated = False  # what the tick did was kept already
        self._is_whole = True  # its commands and its step are all that happened in it
        self._is_fork_told = True  # by a frame of its first beat, which says from where on what was told before is void

    @property
    def playing(self) -> bool:
        """Whether time goes on by itself."""
        return self._clock.playing

    @property
    def rate(self) -> float:
        """Simulated seconds in one second; 0: as fast as it can."""
        return self._clock.rate

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds per second, measured."""
        return self._clock.realtime_factor

    async def run(self) -> None:
        """Serves the session and ticks until the step limit or cancellation."""
        session = self.session
        session.serve(topics.COMMAND, self._take_command)
        self._intake.listen()
        session.serve(topics.SNAPSHOT, self._give_snapshot)
        session.serve(topics.EXACT, self.chronicle.give_exact)
        session.serve(topics.HISTORY, self._give_history)
        session.serve(topics.MARKERS, self._give_markers)
        session.serve(topics.PLAN, self._give_plan)
        session.serve(topics.TOUCHING, self._give_touching)
        serve_assets(session, self.simulation.assets)
        serve_prefabs(session, self.simulation.world.hierarchy.has_instance_of)
        session.serve(topics.SCRIPT_FORM, self._give_script_form)
        self._publish_status()
        self._publish_frame()  # who subscribes before the first tick sees the scene as it was loaded
        async with asyncio.TaskGroup() as group:
            beside = [
                group.create_task(self._heartbeat()),
                group.create_task(self._script_files.follow(self._put_edit)),
            ]
            await self._tick_until_done()
            for task in beside:
                task.cancel()
        self._publish_status()

    async def _tick_until_done(self) -> None:
        while not self._is_done():
            if self.recorder is not None:
                await self.recorder.ready()
            await self._until_due()
            due = self._clock.take_due() if self.playing else 1
            if not due and self._edited.is_set():
                self._edit_between()
            for _ in range(due):
                if not self._is_done():
                    self.tick()

    async def _until_due(self) -> None:
        """Waits until the next tick; while paused, until somebody asks for something."""
        if self._steps_asked or (self.playing and self.rate == 0.0):
            await asyncio.sleep(0)  # lets the bus speak; a run at full speed waits for nothing else
        elif self.playing:
            await self._until_time_or_edit(self._clock.seconds_until_due())
        else:
            await self._wake.wait()
        self._wake.clear()

    async def _until_time_or_edit(self, seconds: float) -> None:
        """Between two ticks the first edit is made at once: who made it sees it a tick earlier."""
        if self._has_edited_between or self.repetition is not None or seconds <= 0.0:
            await asyncio.sleep(seconds)
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._edited.wait()

    def _is_done(self) -> bool:
        is_repeated = self.repetition is not None and self.repetition.is_done
        return is_repeated or (bool(self._step_limit) and self.steps_done >= self._step_limit)

    def tick(self) -> None:
        """One tick: commands, then if time goes on the world's step, then all that others shall know of it."""
        with without_collection() if self._waiting else contextlib.nullcontext():
            self._tick()

    def _edit_between(self) -> None:
        """What waits is done now, before the next step is due: a beat without a step, as while time stands still."""
        self._has_edited_between = True
        with without_collection():
            self._tick(is_between=True)

    def _tick(self, *, is_between: bool = False) -> None:
        stages = StageTimes()
        late = self._clock.lateness() * 1000.0
        self._intake.begin_tick()
        for request in [request for player in self.players for request in player()] if self.playing else ():
            self.put(request)
        cue = self._take_cue()
        self._edited.clear()
        stands = is_between or not self.playing if cue is None else not cue.steps
        if stands and any(edits_of(waiting.request.command) for waiting in self._waiting):
            self._paused_physics.keep(self.history.content, self.chronicle.instant)
        replies = self._apply_commands()
        stages.done("apply_commands")
        self._repeated, self._is_whole = False, True
        goes_on = not is_between and (self.playing or self._steps_asked > 0)
        stepping = goes_on if cue is None else cue.steps
        if stepping:
            self._step(stages)
        else:
            self.simulation.settle()
            puts_back = cue is not None and cue.puts_physics_back
            self._is_whole = not self._paused_physics.follow(self.history.content, puts_back=puts_back)
            stages.done("follow_changes")
        self.chronicle.tell(steps=stepping, physics_of=-1 if self._is_whole else self._paused_physics.instant)
        is_told = self._scene.publish()
        # Between two steps nothing has moved but what the delta tells.
        is_due = (replies and not is_between) or not self._is_fork_told
        if is_due or (stepping and is_heard(self.session, topics.STATE)):
            self._publish_frame(steps=stepping and not self._repeated)
        if stepping and (found := publish_diagnostics(self.session, self.simulation)) and self.guard is not None:
            self._events += self.guard.look(found)
        events = self._publish_events()
        if stepping and not self.simulation.is_held:
            self._publish_contacts()
        publish_debug_lines(self.session, self.simulation)
        stages.done("publish_state")
        self._keep_instant(stages, stepping=stepping, is_told=is_told)
        for waiting, reply in replies:
            if not waiting.reply.done():
                waiting.reply.set_result(msgspec.structs.replace(reply, sequence=self._scene.sequence))
        if self.steps_done == 1 and stepping:
            _log.info("first tick published %.2f s after the process started", process_age())
        if stepping:
            self.tick_times.append(stages.total)
            publish_profile(self.session, self.simulation, stages.times, total=stages.total, late=late)
        if self.guard is not None:
            self.guard.end_tick(events)

    def _take_cue(self) -> Cue | None:
        """What a session that is repeated did in this tick: its commands come after those that wait."""
        cue = self.repetition.cue() if self.repetition is not None else None
        if cue is not None:
            if cue.keeps_physics:
                self._paused_physics.forget()
            for request in cue.requests:
                self.put(request)
        return cue

    def _step(self, stages: StageTimes) -> None:
        self._paused_physics.forget()
        self._has_edited_between = False
        self._repeated = self._is_rewound
        if self.flight is not None and self._repeated:
            self._scene.is_elsewhere |= self.flight.repeat()
        else:
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

    # --- other times -----------------------------------------------------------------------------------------------

    @property
    def _is_rewound(self) -> bool:
        return self.flight is not None and self.flight.is_rewound

    def _keep_instant(self, stages: StageTimes, *, stepping: bool, is_told: bool) -> None:
        """What happened at the newest instant becomes part of what can be gone back to."""
        if (self.chronicle.is_broken or not self._repeated) and self.chronicle.note(
            steps=stepping, is_told=is_told, seconds=stages.total * 1e-3, is_whole=self._is_whole
        ):
            assert self.flight is not None  # it has taken a keyframe
            self._markers.forget_before(self.flight.ticks[0])
        stages.done("keep_instant")

    def _go_to(self, instant: int) -> None:
        """Shows another instant, and waits there."""
        self._clock.pause()
        self._steps_asked = 0
        self._scene.is_elsewhere |= self._require_flight().go_to(instant)
        self._paused_physics.forget()
        self._clock.seek(self.simulation.tick)

    def _fork(self) -> None:
        """From here on it is another run: what came after is forgotten."""
        if self.flight is not None and self.flight.is_rewound:
            tick = self.simulation.tick
            self._is_fork_told = False
            self.chronicle.forked()
            dropped = self.flight.fork()
            self.history.forget_older()
            self._markers.forget_after(tick)
            self._events.append(Event(kind="forked", values={"from_tick": tick, "dropped_ticks": dropped}))
            self._publish_status()

    def _require_flight(self) -> FlightRecorder:
        """The flight recorder, with all in it that was done so far."""
        if self.flight is None:
            raise RequestError("nothing is kept to go back to: start the simulation with --keep SECONDS above 0")
        has_changes = self.chronicle.has_changes  # just before, in the same tick
        if has_changes:
            self.simulation.settle()
            self.chronicle.tell(steps=False)
        if not self._is_fork_told:
            self._scene.publish()
            self._publish_frame()
        if has_changes:
            self.chronicle.note(steps=False, is_told=True, seconds=0.0)
            self._events += self.simulation.take_events()
            self._scene.is_elsewhere = True  # nobody was told of it yet
        return self.flight

    # --- commands --------------------------------------------------------------------------------------------------

    async def _take_command(self, request: CommandRequest, key: str) -> CommandReply:
        if len(self._waiting) >= COMMAND_LIMIT:
            raise RequestError(f"{COMMAND_LIMIT} commands are waiting already: send fewer, or wait for their answers")
        return await self.put(request)

    def _put_edit(self, command: Command) -> None:
        self.put(CommandRequest(origin=SCRIPT_FILES, command=command))

    def put(self, request: CommandRequest) -> asyncio.Future[CommandReply]:
        """Puts a command before the next tick; what becomes of it."""
        waiting = _Waiting(request, asyncio.get_running_loop().create_future())
        self._waiting.append(waiting)
        self._wake.set()
        if isinstance(request.command, Edit | Batch | Undo | Redo):
            self._edited.set()
        return waiting.reply

    def _apply_commands(self) -> list[tuple[_Waiting, CommandReply]]:
        replies = []
        for _ in range(min(len(self._waiting), COMMANDS_PER_TICK)):
            waiting = self._waiting.popleft()
            command, reply = self._apply(waiting.request)
            replies.append((waiting, reply))
            record = CommandRecord(
                tick=reply.tick,
                origin=waiting.request.origin,
                command=command,
                accepted=reply.accepted,
                reason=reply.reason,
            )
            self.chronicle.add(record, is_change=reply.accepted and not isinstance(command, Time | NoteSaved))
            self._markers.add(markers_of_command(record, self.simulation.time))
        if self._waiting:
            self._wake.set()
        return replies

    def _apply(self, request: CommandRequest) -> tuple[Command, CommandReply]:
        """What became of a command, and the command as it can be repeated: of an undo, what it did."""
        tick = self.simulation.tick
        try:
            done = self._apply_to_time(request.command)
            if done is None:
                done = self._apply_to_scene(request)
                if not isinstance(done.command, NoteSaved):
                    self._fork()
        except ElysError as error:
            is_conflict = isinstance(error, EditConflict)
            reason = str(error)[:REASON_LENGTH]
            return request.command, CommandReply(accepted=False, tick=tick, reason=reason, is_conflict=is_conflict)
        except Exception as error:  # a fault of ELYS's own: it is told in full, and does not end everybody's session
            _log.exception("command %s failed", type(request.command).__name__)
            self.chronicle.breaks()
            reason = f"ELYS failed: {error!r}"[:REASON_LENGTH]
            return request.command, CommandReply(accepted=False, tick=tick, reason=reason)
        reply = CommandReply(
            accepted=True, tick=tick, entities=done.entities, content=self.history.content, new_ids=done.new_ids
        )
        return done.command, reply

    def _apply_to_scene(self, request: CommandRequest) -> Done:
        command, history = request.command, self.history
        match command:
            case Undo() | Redo() if self._is_rewound:
                raise RequestError("this is the past: go on from here, or return to now, before undoing or redoing")
            case Undo(force=force):
                return history.undo(request.author, force=force)
            case Redo(force=force):
                return history.redo(request.author, force=force)
            case NoteSaved(path=path, content=content):
                self.simulation.path, history.saved = path, content
                return Done((), command, {})
            case LoadScene():
                return self._load(command)
            case Grab() | Release() if self._is_rewound:
                raise RequestError("this is the past: go on from here, or return to now, before taking hold of a body")
            case Input() if self._is_rewound:
                raise RequestError("this is the past: go on from here, or return to now, before playing")
            case Tell() if self._is_rewound:
                raise RequestError(
                    "this is the past: go on from here, or return to now, before telling scripts anything"
                )
            case Tell(kind=kind) if kind in self.untold:
                raise RequestError(f"{kind!r} is told by scripts of this session alone: call the event otherwise")
            case Tell():
                apply_command(self.simulation, command)
                return Done((), command, {})
            case Input():
                played = msgspec.structs.replace(command, source=request.origin)
                apply_command(self.simulation, played)
                return Done((), played, {})
            case Grab() | Release():
                held = msgspec.structs.replace(command, holder=request.origin)
                apply_command(self.simulation, held)
                return Done((), held, {})
        if not edits_of(command):
            raise RequestError(f"a running simulation cannot {type(command).__name__}: that is for replays")
        return history.perform(
            command,
            author=request.author,
            writer=request.author or request.origin,
            label=request.label,
            stroke=request.stroke,
            made_from=request.made_from,
        )

    def _load(self, command: LoadScene) -> Done:
        lacking = lacking_assets(self.simulation.assets, command.records)
        if lacking:
            raise RequestError(f"the scene names {len(lacking)} assets that the host has not got: offer them first")
        entities = load_scene(self.simulation, command)
        self.history.forget()
        self._paused_physics.forget()
        self._scene.is_another_scene = True
        self._events.append(Event(kind="scene_loaded", values={"scene": command.name}))
        self._publish_status()
        return Done(entities, command, {})

    def _apply_to_time(self, command: Command) -> Done | None:
        """Commands to the clock rather than the world; None for all others."""
        match command:
            case SetPlaying(playing=playing):
                self._clock.play() if playing else self._clock.pause()
                self._steps_asked = 0
                self._events.append(Event(kind="playing" if playing else "paused"))
            case StepTicks(count=count):
                if self.playing:
                    raise RequestError("pause before stepping")
                if count == 0:
                    raise RequestError("step by at least one tick, on or back, not 0")
                if count < 0:
                    self._go_to(self._require_flight().instant_back(-count))
                elif self._steps_asked + count > STEP_LIMIT:
                    raise RequestError(f"at most {STEP_LIMIT} ticks can be asked for at once: play instead")
                else:
                    self._steps_asked += count
            case Seek(time=seconds):
                if not math.isfinite(seconds):
                    raise RequestError(f"{seconds} is no time to go to")
                self._go_to(self._require_flight().instant_at(seconds))
            case Rewind(tick=tick):
                self._go_to(self._require_flight().instant_of_tick(tick))
            case Resume():
                self._fork()
                self._clock.play()
                self._steps_asked = 0
            case SetRate(rate=rate):
                if not 0.0 <= rate <= 100.0:
                    raise RequestError(f"the rate must lie between 0 (as fast as it can) and 100, not {rate:g}")
                self._clock.set_rate(rate)
            case KeepLast():
                if self.guard is None:
                    raise RequestError("the last seconds are not kept: start the simulation without --no-guard")
                if self.guard.is_writing:  # who asks without end gets one file after the other
                    raise RequestError("the last seconds are being written already: ask again when they are")
                self._events.append(Event(kind="kept", values={"path": str(self.guard.keep())}))
            case _:
                return None
        self._publish_status()
        return Done((), command, {})

    async def _give_history(self, request: HistoryRequest, key: str) -> HistoryReply:
        if len(request.person) > PERSON_LENGTH or not request.person.strip():
            raise RequestError(f"a person is called by 1 to {PERSON_LENGTH} characters")
        author = self.history.attach(request.person.strip(), request.node, alive=self.session.nodes)
        told = self.history.told_to(author)
        return msgspec.structs.replace(told, path=self.simulation.path, machine=socket.gethostname())

    # --- publishing ------------------------------------------------------------------------------------------------

    async def _give_markers(self, request: MarkersRequest, key: str) -> Markers:
        return self._markers.reply(request)

    async def _give_script_form(self, request: ScriptFormRequest, _: str) -> ScriptForm:
        return form_of(self.simulation.scripts, request.source)

    async def _give_plan(self, request: PlanRequest, key: str) -> PhysicsPlan:
        return physics_plan(self.simulation)

    async def _give_touching(self, request: TouchingRequest, key: str) -> Touching:
        if not self.simulation.physics.settings.events:
            raise RequestError("contacts are not told: events are switched off by the scene's settings")
        return touching(self.simulation, epoch=self.session.epoch)

    async def _give_snapshot(self, request: SnapshotRequest, key: str) -> Snapshot:
        return self._scene.snapshot(as_edited=request.as_edited)

    def snapshot(self) -> Snapshot:
        """The whole scene as it is between two ticks."""
        return self._scene.snapshot()

    def _publish_command(self, record: CommandRecord) -> None:
        self.session.publish(topics.COMMANDS, record)

    def _publish_frame(self, *, steps: bool = False) -> None:
        instant = self.chronicle.leads_to(steps=steps)
        frame = state_frame(
            self.simulation,
            epoch=self.session.epoch,
            delta_sequence=self._scene.sequence,
            playing=self.playing,
            is_told_again=self._is_rewound,
            is_forked=self.chronicle.had_another(instant),
            instant=instant % INSTANTS,
        )
        self.session.publish_large(topics.STATE, frame)
        self._is_fork_told |= not self._is_rewound

    def _publish_events(self) -> tuple[Event, ...]:
        events = (*self._events, *self.simulation.take_events())
        self._events.clear()
        if events:
            batch = EventBatch(epoch=self.session.epoch, tick=self.simulation.tick, events=events)
            self.session.publish(topics.EVENTS, batch)
            self._markers.add(markers_of_events(batch, self.simulation.time))
        return events

    def _publish_contacts(self) -> None:
        batch = contact_batch(self.simulation, epoch=self.session.epoch)
        if batch is not None:
            self.session.publish(topics.CONTACTS, batch)
            self._markers.add(markers_of_contacts(batch, self.simulation.time))

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
            start_time=self.flight.start_time if self.flight is not None else simulation.time,
            end_time=self.flight.end_time if self.flight is not None else simulation.time,
            is_rewound=self._is_rewound,
            changes=self.chronicle.changes,
        )
        self.session.publish(topics.STATUS, status)

    async def _heartbeat(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            while True:
                await asyncio.sleep(STATUS_INTERVAL)
                self._publish_status()
                if not self.playing:
                    publish_debug_lines(self.session, self.simulation)  # for who began to listen while time stands
