"""`elys view --thin`: a window that shows what a render node elsewhere draws. Keys and mouse are those of `view_window.py`."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Collection
from dataclasses import replace
from statistics import median
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus import topics
from elys.bus.asset_service import AssetClient
from elys.bus.host_clock import HostClock
from elys.bus.messages.views import FRAMED, Debug, PickRequest, ViewCamera
from elys.bus.session import Session
from elys.common.assets import AssetStore
from elys.common.errors import BusError
from elys.render_node.camera import View
from elys.render_node.game_input import GameInput, Seating, Seen
from elys.render_node.gpu import TEXTURE_UNITS, Context, Framebuffer, Texture, window_context
from elys.render_node.lettering import write_on
from elys.render_node.marks import LETTERS, age_text, stamp_text
from elys.render_node.orbit import Orbit
from elys.render_node.overlays import NO_OVERLAYS, Overlays
from elys.render_node.passes.backdrop import ScreenShader
from elys.render_node.passes.overlay import OverlayPass
from elys.render_node.play_control import PlayControl
from elys.render_node.remote_view import Choice, RemotePicture, RemoteView, Wanted
from elys.render_node.resources import Resources
from elys.render_node.sound.loudspeaker import Loudspeaker, nowhere
from elys.render_node.view_window import DEBUG_KEYS, LOST
from elys.render_node.window import Clicked, Dragged, KeyPressed, Scrolled, Window, WindowEvent

LOOK_TIME: Final = 1.0 / 60.0  # [s] between two looks at the window
TITLE_TIME: Final = 0.25  # [s] between two titles
MEASURED: Final = 60  # pictures over which rates are taken
HAND_MEASURED: Final = 20  # movements of the camera whose median is told
RENDERER_PATIENCE: Final = 2.0  # [s] without a render node after which it is told how to start one
DARK: Final = (30, 32, 36, 255)  # where there is no picture yet
_log = logging.getLogger(__name__)
PICK_TIMEOUT: Final = 2.0  # [s]
USUAL_DISTANCE: Final = 8.0  # [m] around which one circles where nothing is seen in the middle


async def run_thin_view(
    session: Session,
    *,
    choice: Choice = "auto",
    bit_rate: float = 0.0,
    frames: int | None = None,
    debug: Collection[Debug] = (),
    age: bool = False,
    endpoint: str = "",
    seating: Seating = Seating(),  # noqa: B008  frozen
) -> None:
    """Shows the session as a render node draws it until the window is closed, or until `frames` pictures were shown. Where
    there is no render node it tells how to start one that comes to `endpoint`.

    Raises:
        DisplayError: no window can be opened here.
    """
    window = Window(f"ELYS  {session.name}")
    viewer: _ThinViewer | None = None
    try:
        viewer = _ThinViewer(
            session, window, window_context(), choice=choice, bit_rate=bit_rate, endpoint=endpoint, seating=seating
        )
        viewer.debug, viewer.tells_age = frozenset(debug), age
        await viewer.run(frames)
    finally:
        if viewer is not None:
            viewer.loudspeaker.close()
        window.close()


class _ThinViewer:
    """The window's state: from where it looks, and the pictures that came last."""

    def __init__(
        self,
        session: Session,
        window: Window,
        context: Context,
        *,
        choice: Choice,
        bit_rate: float,
        endpoint: str,
        seating: Seating,
    ) -> None:
        self._session = session
        self._window = window
        self._screen = _Screen(context)
        self._play = PlayControl(session)
        self._host_clock = HostClock(session)
        session.start(self._host_clock.run())
        self._game = GameInput(
            session, window, self._play, seen=self._seen, host_time=self._host_clock.host_time, seating=seating
        )
        self._remote = RemoteView(
            session,
            choice=choice,
            bit_rate=bit_rate,
            adapts=True,
            round_trip=lambda: self._host_clock.round_trip,
            on_picture=self._arrived,
        )
        self._lack = Lack(endpoint)
        self._news = asyncio.Event()  # a picture came
        self._player = seating.player
        # Without a scene nobody knows its sources: what events tell is heard.
        self._assets, self._loop = AssetClient(session, AssetStore()), asyncio.get_running_loop()
        self.loudspeaker = Loudspeaker(session, self._fetch)
        self._selection: tuple[int, ...] = ()
        self._picked = ""  # what was clicked at, in words
        self._hand: deque[float] = deque(maxlen=HAND_MEASURED)  # [s] from a movement to the picture that shows it
        self._orbit: Orbit | None = None  # None: looks as `_through` says
        self._through = 0
        self._distance = USUAL_DISTANCE  # [m] of what is seen in the middle
        self._picture: RemotePicture | None = None
        self._is_fresh = False
        self._came: deque[tuple[float, int]] = deque(maxlen=MEASURED)  # [s] and [bytes] of the last pictures
        self.latency = 0.0  # [s] from the state's publishing to its picture here, by the clocks of both machines
        self.debug: frozenset[Debug] = frozenset()
        self.tells_age = False
        window.on_event = self._on_event

    async def run(self, frame_limit: int | None) -> None:
        """Asks for pictures, and shows those that come."""
        shown, titled_at = 0, 0.0
        while not self._window.is_closing and (frame_limit is None or shown < frame_limit):
            now = time.monotonic()
            self._window.poll()
            self._is_fresh |= self._game.update()
            lacks = self._lack.told(now, is_lacking=self._remote.renderer is None)
            if now - titled_at > TITLE_TIME:
                self._window.set_title(self.title())
                titled_at = now
                if lacks:
                    self._show_lack()
            if self._window.is_visible:
                self._remote.want(self._wanted())
            if self._is_fresh and self._picture is not None and not lacks:
                self._show(self._picture)
                shown += 1
            if self._picture is not None:
                self.loudspeaker.place(self._picture.frame.camera, nowhere, is_running=self._play.is_playing)
            await self._wait()

    def title(self) -> str:
        """Scene, tick, and by which way pictures come."""
        status = self._play.status
        name = status.scene if status is not None else self._session.name
        if self._play.is_lost():
            return f"ELYS  {name}  ·  {LOST}"
        if self._remote.renderer is None:
            return f"ELYS  {name}  ·  no render node in this session: start one with `{self._lack.command}`"
        if self._picture is None:
            return f"ELYS  {name}  ·  waiting for a picture"
        state = "playing" if self._play.is_playing else "paused"
        return f"ELYS  {name}  ·  tick {self._picture.frame.tick}  ·  {state}  ·  {self._way()}"

    def notes(self) -> tuple[str, ...]:
        """What is told on the picture, where that is asked for."""
        picture = self._picture
        picked = (self._picked,) if self._picked else ()
        if not self.tells_age or picture is None:
            return *picked, *self._game.note
        frame = picture.frame
        age = age_text(self.latency, self._host_clock.round_trip) if frame.state_published_at else "no state yet"
        return (
            stamp_text(frame.tick, frame.simulation_time),
            f"{age}   {self.rate:.0f} pictures/s",
            self._way(),
            *((f"camera seen after {median(self._hand) * 1e3:.0f} ms",) if self._hand else ()),
            *self._game.latency,
            *picked,
            *self._game.note,
        )

    @property
    def rate(self) -> float:
        """Pictures a second."""
        came = self._came
        return (len(came) - 1) / (came[-1][0] - came[0][0]) if len(came) > 1 and came[-1][0] > came[0][0] else 0.0

    def _way(self) -> str:
        sizes = [size for _, size in self._came]
        mean = sum(sizes) / max(len(sizes), 1)
        scale = f" of {self._remote.scale * 100:.0f} % size" if self._remote.scale < 1.0 else ""
        return f"{self._remote.encoding}{scale}, {mean / 1e3:.0f} kB a picture, {mean * 8 * self.rate / 1e6:.1f} Mbit/s"

    def _seen(self) -> Seen:
        picture = self._picture
        return Seen(picture.frame.tick, picture.frame.simulation_time) if picture is not None else Seen()

    def _wanted(self) -> Wanted:
        width, height = self._window.framebuffer_size
        camera = self._orbit.camera() if self._orbit is not None else None
        kinds = tuple(sorted(self.debug))
        return Wanted(
            camera=camera,
            through=self._through,
            width=width,
            height=height,
            debug=kinds,
            selection=self._selection,
            player=self._player,
        )

    def _arrived(self, picture: RemotePicture) -> None:
        is_first = self._picture is None
        is_newer = is_first or picture.frame.tick != self._picture.frame.tick  # type: ignore[union-attr]
        self._picture, self._is_fresh = picture, True
        self._news.set()
        self._came.append((time.monotonic(), picture.size))
        if is_newer and picture.frame.state_published_at:
            published = picture.frame.state_published_at * 1e-9
            age = self._host_clock.age_of(published)
            self.latency = age if age is not None else max(0.0, time.time() - published)
        if is_first:
            self._session.start(self._find_distance(picture.frame.camera, picture.frame.width, picture.frame.height))

    def _show(self, picture: RemotePicture) -> None:
        pixels, notes = picture.pixels, self.notes()
        if notes:
            pixels = pixels.copy()
            write_on(pixels, notes, LETTERS)
        self._screen.show(pixels, *self._window.framebuffer_size)
        if card := self._game.over(NO_OVERLAYS):
            self._screen.show_over(card, View.of(picture.frame.camera, *self._window.framebuffer_size))
        self._window.swap()
        self._is_fresh = False
        if picture.asked_at is not None and self._orbit is not None:
            self._hand.append(time.monotonic() - picture.asked_at)
            self._picture = replace(picture, asked_at=None)  # shown again it tells nothing

    def _show_lack(self) -> None:
        width, height = self._window.framebuffer_size
        pixels = np.full((height, width, 4), DARK, np.uint8)
        write_on(pixels, self._lack.lines, LETTERS)
        self._screen.show(pixels, width, height)
        self._window.swap()

    def _fetch(self, reference: str) -> bytes:
        """On another thread."""
        return asyncio.run_coroutine_threadsafe(self._assets.fetch(reference), self._loop).result(timeout=60.0)

    async def _wait(self) -> None:
        """For the next look at the window, or for a picture: it is not to wait for that."""
        self._news.clear()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(LOOK_TIME):
                await self._news.wait()

    async def _pick(self, x: float, y: float) -> None:
        """Asks what is seen at a place of the window (0 to 1), and shows it from now on."""
        picture, renderer = self._picture, self._remote.renderer
        if picture is None or renderer is None:
            return
        width, height = self._window.framebuffer_size
        at = min(int(x * width), width - 1), min(int(y * height), height - 1)
        camera = picture.frame.camera
        request = PickRequest(camera=camera, width=width, height=height, x=at[0], y=at[1])
        try:
            reply = await self._session.request(topics.PICK, request, key=renderer.id, timeout=PICK_TIMEOUT)
        except BusError as error:
            self._picked = f"what is there cannot be told: {error}"
        else:
            self._selection = (reply.entity,) if reply.entity else ()
            place = ", ".join(f"{number:.2f}" for number in reply.position)
            self._picked = f"{reply.name or f'entity {reply.entity}'}   {place} m" if reply.entity else ""
        self._is_fresh = True

    async def _find_distance(self, camera: ViewCamera, width: int, height: int) -> None:
        """Asks how far away that is which is seen in the middle: a hand's camera circles around it."""
        if self._remote.renderer is None:
            return
        request = PickRequest(camera=camera, width=width, height=height, x=width // 2, y=height // 2)
        try:
            reply = await self._session.request(
                topics.PICK, request, key=self._remote.renderer.id, timeout=PICK_TIMEOUT
            )
        except BusError:
            return
        if reply.entity:
            self._distance = float(np.linalg.norm(np.subtract(reply.position, camera.position)))

    def _on_event(self, event: WindowEvent) -> None:
        match event:
            case Dragged(button="left", shift=False) if (orbit := self._led()) is not None:
                orbit.turn(event.x, event.y)
            case Dragged() if (orbit := self._led()) is not None:
                orbit.pan(event.x, event.y)
            case Clicked(x=x, y=y):
                self._session.start(self._pick(x, y))
            case Scrolled() if (orbit := self._led()) is not None:
                orbit.zoom(event.steps)
            case KeyPressed(key="f" | "c" as key):
                self._orbit, self._through = None, FRAMED if key == "f" else 0
            case KeyPressed(key="m"):
                self.loudspeaker.is_muted = not self.loudspeaker.is_muted
            case KeyPressed(key="a"):
                self.tells_age = not self.tells_age
                self._is_fresh = True
            case KeyPressed(key=key) if key in DEBUG_KEYS:
                self.debug = self.debug ^ {DEBUG_KEYS[key]}
            case KeyPressed(key="p"):
                self._game.start()
                self._is_fresh = True
            case KeyPressed(key="f1"):
                self._game.show_controls()
            case KeyPressed(key="space"):
                self._play.toggle()
            case KeyPressed(key="escape"):
                self._window.request_close()

    def _led(self) -> Orbit | None:
        """The hand's camera, which starts where that of the last picture stood; None before there is any."""
        if self._orbit is None and self._picture is not None:
            self._orbit = Orbit()
            self._orbit.take(self._picture.frame.camera, self._distance)
        return self._orbit


class Lack:
    """That a session has no render node: told once at the terminal, and in the window as long as it is so."""

    def __init__(self, endpoint: str) -> None:
        self.command: Final = f"elys node render --connect {endpoint}" if endpoint else "elys node render"
        self.lines: Final = (
            "no render node in this session: start one near it, where there is a graphics card",
            self.command,
        )
        self._since: float | None = None  # [s]
        self._is_told = False

    def told(self, now: float, *, is_lacking: bool) -> bool:
        """Whether it has to be seen at `now` [s]."""
        if not is_lacking:
            self._since, self._is_told = None, False
            return False
        self._since = now if self._since is None else self._since
        if now - self._since < RENDERER_PATIENCE:
            return False
        if not self._is_told:
            self._is_told = True
            _log.warning("%s:\n    %s", *self.lines)
        return True


class _Screen:
    """Puts pixels into the window."""

    def __init__(self, context: Context) -> None:
        self._context = context
        resources = Resources(context)
        self._shader = ScreenShader(resources, "picture.frag")
        self._overlays = OverlayPass(resources)
        self._texture: Texture | None = None

    def show(self, pixels: NDArray[np.uint8], width: int, height: int) -> None:
        """RGBA pixels (H, W, 4), the upper row first, all over a window of that size."""
        size = (pixels.shape[1], pixels.shape[0])
        if self._texture is None or self._texture.size != size:
            self._texture = Texture(self._context, size, "rgba8", data=pixels)
        else:
            self._texture.write(pixels)
        Framebuffer.of_window(self._context, width, height).use(depth_write=False)
        self._context.set_state()
        self._texture.use(TEXTURE_UNITS["picture"])
        self._shader.compiled()[1].draw()
        self._context.collect()

    def show_over(self, overlays: Overlays, view: View) -> None:
        """Overlays of the window's own, which show no images, over that."""
        self._overlays.draw_over(overlays, view, None, Framebuffer.of_window(self._context, view.width, view.height))
        self._context.collect()
