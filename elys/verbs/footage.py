"""Where pictures for `elys render` come from: a scene simulated in this process, or a recording, led through time."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

from elys.bus.messages.physics import ContactBatch, DebugLines
from elys.bus.messages.session import Event, EventBatch
from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import Debug
from elys.bus.mirror import SceneMirror
from elys.common.errors import ElysError
from elys.render_node.debug_drawing import ONLY_SIMULATED, PHYSICS_LINES, DebugDrawing
from elys.render_node.sound.film_sound import FilmSound
from elys.render_node.trails import TRAIL_SECONDS

if TYPE_CHECKING:
    from elys.bus.recording import Recording
    from elys.common.assets.store import AssetStore
    from elys.common.scene import OpenedScene
    from elys.sim_node.simulation import Simulation

SCENE_DURATION: Final = 5.0  # [s] of a video of a scene or a session when nobody says how long
Heard = deque[tuple[float, Event]]  # what happened, at simulation times [s]
MOST_HEARD: Final = 100_000  # events that wait to be taken
LinesByTick = dict[int, dict[str, DebugLines]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Footage:
    """What is to be drawn: a mirror that `frames` leads through time, and where assets come from."""

    mirror: SceneMirror
    frames: Iterator[StateFrame]
    fetch: Callable[[str], bytes]
    duration: float  # [s] from the first frame
    source_of: Callable[[str], str] = lambda _: ""  # the file of an asset, where that is known
    origin: float = 0.0  # [s] of simulation from which --time and camera paths count
    drawing: DebugDrawing | None = None  # fed with what `frames` passes
    recording: Recording | None = None  # that it comes from
    heard: Heard = field(default_factory=deque)  # what happened on the way of `frames`; who takes it takes it away


@contextlib.contextmanager
def film_sound(footage: Footage, *, wanted: bool) -> Iterator[FilmSound | None]:
    """What is heard of it, where a film is to have that."""
    if not wanted:
        yield None
        return
    sound = FilmSound(footage.mirror, footage.fetch, footage.heard)
    try:
        yield sound
    finally:
        sound.close()


@contextlib.contextmanager
def opened_footage(
    source: str, time: float, duration: float, debug: tuple[Debug, ...], *, hears: bool = False
) -> Iterator[Footage]:
    if Path(source).suffix == ".mcap":
        untold = ONLY_SIMULATED.intersection(debug)
        if untold:
            raise ElysError(
                f"a recording tells nothing of {sorted(untold)[0]}: draw them of a scene or a running session"
            )
        with recorded(Path(source), time, duration, debug, hears=hears) as footage:
            yield footage
    else:
        yield _simulated(source, time, duration or SCENE_DURATION, debug)


@contextlib.contextmanager
def recorded(
    path: Path,
    time: float,
    duration: float,
    debug: tuple[Debug, ...],
    told: LinesByTick | None = None,
    *,
    hears: bool = False,
) -> Iterator[Footage]:
    """`told` are lines of physics that were heard while it was recorded; with `hears` what happened is read as well."""
    from elys.bus.recording import Recording

    with Recording(path, checked=True) as recording:
        start, end = float(recording.time[0]), float(recording.time[-1])
        if not start <= time + start <= end + 1e-9:
            raise ElysError(f"{path} lasts {end - start:.2f} s: there is nothing at {time:g} s")
        position = recording.position_at(start + time)
        # Debug drawing remembers: of contacts all since the beginning, of ways the last seconds.
        earliest = recording.position_at(start + time - TRAIL_SECONDS) if "trajectories" in debug else position
        earliest = 0 if "contacts" in debug and told is None else earliest
        mirror = recording.mirror_at(earliest)
        drawing = DebugDrawing(mirror)
        heard: Heard = deque(maxlen=MOST_HEARD)

        def passed(places: range) -> Iterator[StateFrame]:
            for place in places:
                recording.advance(mirror, place)
                frame = recording.frame(place)
                if hears:
                    heard.extend((frame.simulation_time, event) for event in _events_of(recording, place))
                if debug:
                    mirror.keep_frame(frame)
                    _feed(drawing, debug, recording, place, frame, told)
                yield frame

        for _ in passed(range(earliest, position)):
            pass
        if earliest < position:
            recording.advance(mirror, position)

        def frames() -> Iterator[StateFrame]:
            yield from passed(range(position, len(recording)))

        yield Footage(
            mirror=mirror,
            frames=frames(),
            fetch=recording.asset,
            duration=min(duration, end - start - time) if duration else end - start - time,
            origin=start,
            drawing=drawing,
            recording=recording,
            heard=heard,
        )


def _events_of(recording: Recording, place: int) -> tuple[Event, ...]:
    """What was told to have happened with a frame."""
    from elys.bus import codec, topics

    messages = [message for message in recording.messages_of(place, place) if message.channel == topics.EVENTS.name]
    batches = [codec.decode_body(message.body, EventBatch, topics.EVENTS.encoding) for message in messages]
    return tuple(event for batch in batches for event in batch.events)


def _feed(
    drawing: DebugDrawing,
    debug: tuple[Debug, ...],
    recording: Recording,
    place: int,
    frame: StateFrame,
    told: LinesByTick | None,
) -> None:
    """Lets debug drawing know what was recorded with a frame at which the mirror stands."""
    from elys.bus import codec, topics

    drawing.take_state(frame)
    for key, lines in (told or {}).get(frame.tick, {}).items():
        drawing.take_lines(key, lines)
    if "contacts" in debug:
        for message in recording.messages_of(place, place):
            if message.channel == topics.CONTACTS.name:
                drawing.take_contacts(codec.decode_body(message.body, ContactBatch, topics.CONTACTS.encoding))


def _simulated(scene: str, time: float, duration: float, debug: tuple[Debug, ...]) -> Footage:
    from elys.common.assets.store import AssetStore
    from elys.verbs.kernels import compile_with_progress
    from elys.verbs.scenes import open_scene_or_sample

    assets = AssetStore()
    opened = open_scene_or_sample(scene, assets)
    compile_with_progress(opened)
    return simulated(opened, assets, time, duration, debug)


def simulated(
    scene: OpenedScene,
    assets: AssetStore,
    time: float,
    duration: float = SCENE_DURATION,
    debug: tuple[Debug, ...] = (),
) -> Footage:
    """A scene from `time` [s] on, simulated in this process as it is drawn, debug drawing kept up to date."""
    from elys.sim_node.simulation import Simulation
    from elys.sim_node.systems.publish_state import debug_lines, state_frame

    simulation = Simulation.load(scene, assets)
    mirror = SceneMirror()
    follow = _following(simulation, mirror)
    drawing = DebugDrawing(mirror)
    heard: Heard = deque(maxlen=MOST_HEARD)

    def frame_now() -> StateFrame:
        frame = state_frame(simulation, epoch=1, delta_sequence=follow(), playing=True)
        heard.extend((simulation.time, event) for event in simulation.take_events())
        if "trajectories" in debug:
            drawing.take_state(frame)
        return frame

    def frames() -> Iterator[StateFrame]:
        for _ in range(round(time * simulation.settings.tick_rate)):
            if time - simulation.time <= TRAIL_SECONDS and debug:
                frame_now()
            simulation.step()
        simulation.take_events()  # they were before
        while True:
            for kind in debug:
                if kind in PHYSICS_LINES:
                    key = PHYSICS_LINES[kind]
                    drawing.take_lines(key, debug_lines(simulation, key, epoch=1))
            yield frame_now()
            simulation.step()

    return Footage(
        mirror=mirror,
        frames=frames(),
        fetch=assets.get,
        source_of=assets.source,
        duration=duration,
        drawing=drawing,
        heard=heard,
    )


def _following(simulation: Simulation, mirror: SceneMirror) -> Callable[[], int]:
    """What brings a mirror to where the scene of a simulation is, scripts' spawning and ending too, and says by which delta."""
    from elys.sim_node.scene.snapshot import take_snapshot
    from elys.sim_node.systems.publish_state import scene_delta

    sequence, settings = 0, simulation.settings

    def look() -> None:
        mirror.apply_snapshot(
            take_snapshot(
                simulation.world,
                epoch=1,
                tick=simulation.tick,
                simulation_time=simulation.time,
                sequence=sequence,
                scene=simulation.name,
                settings=simulation.settings,
            )
        )

    def follow() -> int:
        nonlocal sequence, settings
        changes, told = simulation.take_changes(), settings
        settings = simulation.settings
        if changes or settings is not told:
            sequence += 1
            changed = settings is not told
            delta = scene_delta(simulation, changes, epoch=1, sequence=sequence, settings_changed=changed)
            look() if delta.resync else mirror.apply_delta(delta)
        return sequence

    look()
    return follow
