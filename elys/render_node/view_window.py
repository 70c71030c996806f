"""`elys view`: a window that draws a running session or a replay by itself.

left drag orbit   middle drag pan   wheel zoom   F frame all   C the scene's camera   space play / pause   Esc quit
P lends keys, mouse and gamepads to the game, Esc gives them back; F1 shows which does what, and binds them anew
1 to 9, 0, G and D debug drawing, see DEBUG_KEYS   A tick, time, age and frame rate   M silence
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Collection, Mapping
from typing import Final

from elys.bus.host_clock import HostClock
from elys.bus.messages.streaming import StreamInterest
from elys.bus.messages.views import Debug, ViewCamera
from elys.bus.scene_controls import input_map_of
from elys.bus.session import Session
from elys.bus.state_source import stream_report, tell_interest
from elys.bus.streaming.measures import stream_text
from elys.common.components import InputMap
from elys.common.errors import DisplayError
from elys.render_node.game_input import GameInput, Seating, Seen
from elys.render_node.gpu import Framebuffer, window_context
from elys.render_node.marks import age_text, stamp_text
from elys.render_node.orbit import Orbit
from elys.render_node.play_control import SILENCE, PlayControl
from elys.render_node.quality import interactive_quality
from elys.render_node.renderer import Renderer
from elys.render_node.scene_following import SceneFollower
from elys.render_node.sound.film_sound import places_in
from elys.render_node.sound.loudspeaker import Loudspeaker
from elys.render_node.window import Dragged, Key, KeyPressed, Scrolled, Window, WindowEvent

FRAME_TIME: Final = 1.0 / 60.0  # [s]
IDLE_TIME: Final = 0.1  # [s] between two looks at the window when nothing moves
TITLE_TIME: Final = 0.25  # [s] between two titles
NOTE_TIME: Final = 0.25  # [s] after which what stands on the picture is told anew
RETRY_TIME: Final = 1.0  # [s] after which what could not be drawn is tried again
RATE_PICTURES: Final = 30  # over which the rate of pictures is taken
LOST: Final = "simulation lost - waiting"
NOT_DRAWN: Final = "cannot be drawn, the log says why"
_log = logging.getLogger(__name__)


# Kinds of debug drawing in the order in which they are looked for.
DEBUG_KEYS: Final[Mapping[Key, Debug]] = {
    "1": "aabb",
    "2": "obb",
    "3": "contacts",
    "4": "joints",
    "5": "trajectories",
    "6": "velocity",
    "7": "axes",
    "8": "labels",
    "9": "islands",
    "0": "sleeping",
    "n": "forces",
    "g": "grid",
    "d": "divergence",
}


def stream_notes(session: Session) -> tuple[str, ...]:
    """How the stream of states does, in a line; nothing where full states come."""
    report = stream_report(session)
    return () if report is None else (stream_text(report),)


async def run_view(
    session: Session,
    *,
    frames: int | None = None,
    debug: Collection[Debug] = (),
    age: bool = False,
    seating: Seating = Seating(),  # noqa: B008  frozen
) -> None:
    """Shows the session in a window until it is closed, or until `frames` pictures were shown; at first with this debug
    drawing, and with the age of what is seen or without. Who plays there is said by `seating`.

    Raises:
        DisplayError: no window can be opened here.
    """
    window = Window(f"ELYS  {session.name}")
    follower = SceneFollower(session)
    follower.world.player = seating.player
    scene = asyncio.ensure_future(follower.start())
    await asyncio.sleep(0)  # the scene is on its way while OpenGL starts
    viewer: _Viewer | None = None
    try:
        context = window_context()
        renderer = Renderer(context, quality=interactive_quality(context))
        viewer = _Viewer(session, window, follower, renderer, seating)
        viewer.show_debug(frozenset(debug))
        viewer.tells_age = age
        await scene
        await viewer.run(frames)
    finally:
        scene.cancel()
        if viewer is not None:
            viewer.loudspeaker.close()
        follower.close()
        window.close()


class _Viewer:
    """The window's state: from where it looks, and what it says in its title."""

    def __init__(
        self, session: Session, window: Window, follower: SceneFollower, renderer: Renderer, seating: Seating
    ) -> None:
        self._session = session
        self._window = window
        self._follower = follower
        self._renderer = renderer
        self._orbit: Orbit | None = None  # None: looks through the scene's camera
        self._play = PlayControl(session)
        self._debug: frozenset[Debug] = frozenset()
        self.tells_age = False
        self._player = seating.player
        self.loudspeaker = Loudspeaker(session, follower.fetch, mirror=follower.mirror)
        self._shown_at: deque[float] = deque(maxlen=RATE_PICTURES)  # [s] of the last pictures
        self._host_clock = HostClock(session)
        session.start(self._host_clock.run())
        self._game = GameInput(
            session,
            window,
            self._play,
            seen=self._seen,
            host_time=self._host_clock.host_time,
            seating=seating,
            declared=self._input_map,
        )
        self._is_dirty = True
        self._drawn: tuple[object, ...] | None = None
        self._trouble = ""  # why the last picture could not be drawn, which has been said
        window.on_event = self._on_event

    async def run(self, frame_limit: int | None) -> None:
        """Polls, draws when something has changed, and waits for the next frame or for news."""
        shown, titled_at = 0, 0.0
        while not self._window.is_closing and (frame_limit is None or shown < frame_limit):
            start = time.monotonic()
            self._window.poll()
            self._is_dirty |= self._game.update()
            if start - titled_at > TITLE_TIME:
                self._window.set_title(self.title())
                titled_at = start
            if self._draw_if_changed(start, always=frame_limit is not None):
                shown += 1
            self._listen()
            self._follower.changed.clear()
            await self._wait(start)

    def show_debug(self, kinds: frozenset[Debug]) -> None:
        """Draws these kinds from now on."""
        self._debug = kinds
        self._follower.want_debug(kinds)
        self._is_dirty = True

    def notes(self, now: float) -> tuple[str, ...]:
        """Tick and time of what is seen, how old it is and how many pictures a second there are, where that is asked for."""
        if not self.tells_age:
            return self._game.note
        world, mirror = self._follower.world, self._follower.mirror
        bodies = world.bodies()
        what = (
            stamp_text(bodies.tick, bodies.time)
            if bodies.tick >= 0
            else stamp_text(mirror.tick, mirror.simulation_time)
        )
        age = age_text(self._age(now), self._host_clock.round_trip) if bodies.tick >= 0 else "no state yet"
        shown = self._shown_at
        rate = (len(shown) - 1) / (shown[-1] - shown[0]) if len(shown) > 1 and shown[-1] > shown[0] else 0.0
        notes = (*stream_notes(self._session), *self._game.latency, *self._game.note)
        return what, f"{age}   {rate:.0f} pictures/s", *notes

    async def _input_map(self) -> InputMap:
        return input_map_of(self._follower.mirror)

    def _seen(self) -> Seen:
        world = self._follower.world
        if world.tick < 0:
            return Seen()
        fraction = world.standing.fraction
        return Seen(world.timeline.tick_at(fraction), world.timeline.time_at(fraction))

    def title(self) -> str:
        """Scene, tick, and how old what is shown is."""
        follower = self._follower
        name = follower.mirror.scene or self._session.name
        now = time.monotonic()
        if self._play.is_lost(SILENCE):
            return f"ELYS  {name}  ·  {LOST}"
        state, status = "playing" if self._play.is_playing else "paused", self._play.status
        tick = status.tick if status is not None else follower.mirror.tick
        is_aging = state == "playing" and follower.world.timeline.newest is not None
        age = f"  ·  {self._age(now) * 1e3:.0f} ms old" if is_aging else ""
        if self._trouble:
            age = f"  ·  {NOT_DRAWN}"
        return f"ELYS  {name}  ·  tick {tick}  ·  {state}{age}"

    def _age(self, now: float) -> float:
        """How long ago [s] it was as is seen, by the host's clock; before that is known, since it could have been here."""
        timeline = self._follower.world.timeline
        age = self._host_clock.age_of(timeline.seen_stamp(now), now)
        return age if age is not None else timeline.seen_age(now)

    def _draw_if_changed(self, now: float, *, always: bool) -> bool:
        width, height = self._window.framebuffer_size
        if not self._window.is_visible:
            return False
        self._follower.refresh(now)
        world = self._follower.world
        told = (
            int(now / NOTE_TIME) if self.tells_age else 0,
            self._follower.revision if self._debug else 0,
            self._follower.ghost_revision,
            self._follower.overlays.version,
            int(now / RETRY_TIME) if self._trouble else 0,
        )
        versions = (world.scene_version, world.pose_version, world.value_version)
        what = (*versions, self._follower.arrived_count, width, height, *told)
        if not (self._is_dirty or what != self._drawn or always):
            return False
        self._drawn, self._is_dirty = what, False
        try:
            self._draw(now, width, height)
        except DisplayError as error:
            if always:
                raise  # who wants so many pictures and no more is not to wait for them for ever
            if str(error) != self._trouble:
                _log.error("the window keeps its last picture: %s", error)
            self._trouble = str(error)
            return False
        self._trouble = ""
        self._window.swap()
        self._shown_at.append(time.monotonic())
        return True

    def _draw(self, now: float, width: int, height: int) -> None:
        world = self._follower.world
        target = Framebuffer.of_window(self._renderer.context, width, height)
        ghosts = self._follower.ghosts
        marks = self._follower.drawing.marks(world, self._debug, notes=self.notes(now), ghosts=ghosts)
        camera = self._camera(width / height)
        tell_interest(self._session, StreamInterest(cameras=(camera,), aspect=width / height))
        overlays = self._game.over(self._follower.overlays.shown(world, player=self._player))
        self._renderer.draw(world, camera, width, height, marks=marks, ghosts=ghosts, overlays=overlays, target=target)

    def _listen(self) -> None:
        """Sounds are heard from where the camera stands, also while no picture is drawn."""
        if not self.loudspeaker.is_needed:
            return
        width, height = self._window.framebuffer_size
        world, mirror = self._follower.world, self._follower.mirror
        camera = self._camera(width / max(height, 1))
        self.loudspeaker.place(camera, lambda: places_in(world, mirror), is_running=self._play.is_playing)

    async def _wait(self, start: float) -> None:
        await asyncio.sleep(max(0.0, start + FRAME_TIME - time.monotonic()))
        if self._is_dirty or self._game.is_busy or self._follower.world.timeline.is_moving(time.monotonic()):
            return
        try:  # idle: only input and news wake us
            async with asyncio.timeout(IDLE_TIME if not self._follower.changed.is_set() else 0.0):
                await self._follower.changed.wait()
        except TimeoutError:
            pass

    def _camera(self, aspect: float) -> ViewCamera:
        if self._orbit is None and not self._follower.world.has_camera:
            self._frame(aspect)
        return self._orbit.camera() if self._orbit is not None else self._follower.world.camera(aspect)

    def _on_event(self, event: WindowEvent) -> None:
        self._is_dirty = True
        match event:
            case Dragged(button="left", shift=False):
                self._led().turn(event.x, event.y)
            case Dragged():
                self._led().pan(event.x, event.y)
            case Scrolled():
                self._led().zoom(event.steps)
            case KeyPressed(key="f"):
                width, height = self._window.framebuffer_size
                self._frame(width / height)
            case KeyPressed(key="c"):
                self._orbit = None
            case KeyPressed(key="m"):
                self.loudspeaker.is_muted = not self.loudspeaker.is_muted
            case KeyPressed(key="a"):
                self.tells_age = not self.tells_age
            case KeyPressed(key=key) if key in DEBUG_KEYS:
                self.show_debug(self._debug ^ {DEBUG_KEYS[key]})
            case KeyPressed(key="p"):
                self._game.start()
            case KeyPressed(key="f1"):
                self._game.show_controls()
            case KeyPressed(key="space"):
                self._play.toggle()
            case KeyPressed(key="escape"):
                self._window.request_close()

    def _led(self) -> Orbit:
        """The hand's camera, which starts where the scene's stood."""
        if self._orbit is None:
            world = self._follower.world
            camera = world.camera()
            lower, upper = world.bounds()
            distance = 5.0
            if world.instance_count:
                middle = (lower + upper) / 2
                distance = float(sum((a - b) ** 2 for a, b in zip(middle, camera.position, strict=True)) ** 0.5)
            self._orbit = Orbit()
            self._orbit.take(camera, distance)
        return self._orbit

    def _frame(self, aspect: float) -> None:
        self._orbit = self._orbit or Orbit()
        self._orbit.frame(*self._follower.world.bounds(), aspect=aspect)
