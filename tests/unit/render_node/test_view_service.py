"""The render node over a session in one process: views, rings, picks, and all that may be asked wrongly."""

from __future__ import annotations

import asyncio
import contextlib
import io
import itertools
import mmap
import os
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import simplejpeg
from PIL import Image

from elys.bus import topics
from elys.bus.asset_service import serve_assets
from elys.bus.codec import encode
from elys.bus.messages.physics import DebugLines
from elys.bus.messages.plan import RenderProfile
from elys.bus.messages.scene import ComponentSet, SceneDelta, SettingsSet, Snapshot, SnapshotRequest, Spawned
from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import PickRequest, SharedRing, ThumbnailRequest, ViewCamera, ViewFrame, ViewRequest
from elys.bus.mirror import SceneMirror
from elys.bus.picture_ring import boot_id
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets import AssetStore
from elys.common.components import Light, Material, MeshRenderer, Overlay, OverlayPanel, Transform, values_of
from elys.common.errors import BusError, ContextLost, DisplayError, RequestError
from elys.render_node.node import serve_views
from elys.render_node.quality import FAST
from elys.render_node.renderer import Renderer
from elys.render_node.scene_classes import SceneClasses
from elys.render_node.view_desk import SILENCE, ViewDesk, sane_camera, sane_size

PATIENCE = 20.0  # [s] far beyond what anything here takes; a failure, not a measure
CAMERA = ViewCamera(position=(0.0, 0.0, 5.0), rotation=(0.0, 0.0, 0.0, 1.0))
RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
BOX = 7


def box(color: tuple[float, float, float]) -> dict[str, dict[str, Any]]:
    """A glowing cube."""
    components = (
        Transform(scale=(2.0, 2.0, 2.0)),
        MeshRenderer(),
        Material(base_color=(0.0, 0.0, 0.0), emissive=color),
        Light(intensity=0.0),
    )
    return {type(value).__name__: values_of(value) for value in components}


class Play:
    """A host with a scene of one box, and somebody who looks at it through a render node."""

    def __init__(self, host: Session, viewer: Session, mirror: SceneMirror, node: str) -> None:
        self.host, self.viewer, self.mirror, self.node = host, viewer, mirror, node
        self.frames: asyncio.Queue[ViewFrame] = asyncio.Queue()
        self.pictures_sent: list[ViewFrame] = []
        self.task: asyncio.Task[None]
        self._sequence = 0
        viewer.subscribe(topics.VIEW_FRAME, lambda frame, _: self.frames.put_nowait(frame))

    def ask(self, **changes: Any) -> int:
        """Publishes a request for a view; returns its sequence."""
        self._sequence += 1
        values = {"view": "eye", "sequence": self._sequence, "camera": CAMERA, "width": 40, "height": 30, "grid": False}
        self.viewer.publish(topics.VIEW_REQUEST, ViewRequest(**(values | changes)), key=self.node)
        return self._sequence

    async def next(self) -> ViewFrame:
        """The next picture that arrives."""
        async with asyncio.timeout(PATIENCE):
            return await self.frames.get()

    async def picture(self, **changes: Any) -> ViewFrame:
        """Asks, and waits for the answer to that question."""
        sequence = self.ask(**changes)
        while True:
            frame = await self.next()
            if frame.sequence == sequence:
                return frame

    def change(self, *changes: Any) -> None:
        """Tells of a change of the scene."""
        delta = SceneDelta(epoch=1, sequence=self.mirror.sequence + 1, tick=self.mirror.tick, changes=changes)
        self.mirror.apply_delta(delta)
        self.host.publish(topics.DELTA, delta)

    def move(self, frame: StateFrame) -> None:
        """Tells of a state."""
        self.host.publish(topics.STATE, frame)


@asynccontextmanager
async def play(context: Any) -> AsyncIterator[Play]:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="play", kind="simulation", epoch=1)
    mirror = SceneMirror()
    mirror.epoch = 1
    spawned = Spawned(entity=BOX, name="Box", parent=0, enabled=True, components=box(RED))
    mirror.apply_delta(SceneDelta(epoch=1, sequence=0, tick=3, changes=(spawned,)))

    async def answer(_: SnapshotRequest, __: str) -> Snapshot:
        return mirror.to_snapshot()

    host.serve(topics.SNAPSHOT, answer)
    render = await Session.join(broker.connect(), kind="render")
    viewer = await Session.join(broker.connect(), kind="editor")
    made = Play(host, viewer, mirror, render.node.id)
    task = asyncio.create_task(serve_views(render, context=context, quality=FAST, measure=made.pictures_sent.append))
    made.task = task
    try:
        await asyncio.sleep(0)  # the task subscribes in its first step
        yield made
        if task.done():
            task.result()
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        for session in (viewer, render, host):
            await session.close()


def run(context: Any, act: Callable[[Play], Coroutine[Any, Any, None]]) -> None:
    async def whole() -> None:
        async with play(context) as made:
            await act(made)

    asyncio.run(whole())


def middle(frame: ViewFrame) -> tuple[int, int, int]:
    """The colour in the middle of a JPEG."""
    pixels = simplejpeg.decode_jpeg(frame.jpeg, colorspace="RGB")
    assert pixels.shape == (frame.height, frame.width, 3)
    return tuple(pixels[frame.height // 2, frame.width // 2].tolist())


@pytest.mark.gl
def test_a_view_is_drawn_and_stamped(context) -> None:
    async def act(made: Play) -> None:
        frame = await made.picture()
        assert (frame.width, frame.height, frame.camera, frame.tick) == (40, 30, CAMERA, 3)
        assert middle(frame)[0] > 180 > 60 > middle(frame)[1]
        assert frame.render_time > 0.0
        assert made.pictures_sent[-1].sequence == frame.sequence

    run(context, act)


@pytest.mark.gl
def test_what_a_picture_cost_is_told_to_who_listens(context) -> None:
    async def act(made: Play) -> None:
        profiles: asyncio.Queue[RenderProfile] = asyncio.Queue()
        await made.picture()
        assert not made.host.has_listener(topics.RENDER_PROFILE, key="eye")
        stop = made.viewer.subscribe(topics.RENDER_PROFILE, lambda profile, _: profiles.put_nowait(profile))
        frame = await made.picture(width=60)
        async with asyncio.timeout(PATIENCE):
            profile = await profiles.get()
        assert (profile.view, profile.sequence, profile.node) == ("eye", frame.sequence, made.node)
        assert (profile.width, profile.height, profile.total) == (60, 30, frame.render_time)
        assert 0.0 < sum(profile.stages.values()) <= profile.total
        passes = {told.name: told for told in profile.passes}
        assert passes["opaque"].is_on
        assert passes["opaque"].why == "1 solid thing seen, in 1 draw call"
        assert not passes["transparent"].is_on
        assert passes["grid"].why == "nobody edits"
        await made.picture(shows="depth")
        async with asyncio.timeout(PATIENCE):
            profile = await profiles.get()
        assert (profile.stages, profile.passes) == ({}, ())  # data comes of no passes that could be left out
        stop()

    run(context, act)


@pytest.mark.gl
def test_an_edit_and_a_state_change_the_picture(context, make_frame) -> None:
    async def act(made: Play) -> None:
        await made.picture()
        sequence = made.ask(newer_than_tick=3)
        made.change(ComponentSet(entity=BOX, component="Material", values=box(GREEN)["Material"]))
        frame = await made.next()
        assert frame.sequence == sequence
        assert middle(frame)[1] > 180
        made.ask(newer_than_tick=3)
        made.move(make_frame({BOX: (50.0, 0.0, 0.0)}, tick=4, delta_sequence=1, published_at=77))
        frame = await made.next()
        assert (frame.tick, frame.state_published_at) == (4, 77)
        assert middle(frame)[2] > 100  # the sky, where the box was

    run(context, act)


@pytest.mark.gl
def test_a_view_that_waits_costs_nothing_until_something_changes(context, make_frame) -> None:
    async def act(made: Play) -> None:
        await made.picture()
        drawn = len(made.pictures_sent)
        made.ask(newer_than_tick=3)
        reply = await made.viewer.request(
            topics.PICK, PickRequest(camera=CAMERA, width=40, height=30, x=20, y=15), key=made.node
        )
        assert reply.entity == BOX
        assert len(made.pictures_sent) == drawn
        made.ask(newer_than_tick=3, selection=(BOX,))
        assert (await made.next()).sequence == made._sequence
        made.ask(newer_than_tick=3, selection=(BOX,), hidden=(BOX,))
        assert (await made.next()).sequence == made._sequence

    run(context, act)


@pytest.mark.gl
def test_the_newest_request_wins(context) -> None:
    async def act(made: Play) -> None:
        await made.picture()
        drawn = len(made.pictures_sent)
        for x in range(200):
            made.ask(camera=ViewCamera(position=(x * 0.001, 0.0, 5.0), rotation=(0.0, 0.0, 0.0, 1.0)))
        while (await made.next()).sequence != made._sequence:
            pass
        assert len(made.pictures_sent) - drawn < 50

    run(context, act)


@pytest.mark.gl
def test_picking_answers_with_place_and_tick(context) -> None:
    async def act(made: Play) -> None:
        await made.picture()
        request = PickRequest(camera=CAMERA, width=41, height=31, x=20, y=15)
        reply = await made.viewer.request(topics.PICK, request, key=made.node)
        assert reply.entity == BOX
        assert reply.position == pytest.approx((0.0, 0.0, 1.0), abs=1e-5)
        assert reply.tick == 3
        beside = PickRequest(camera=CAMERA, width=41, height=31, x=0, y=0)
        assert (await made.viewer.request(topics.PICK, beside, key=made.node)).entity == 0

    run(context, act)


@pytest.mark.gl
def test_what_cannot_be_drawn_is_said_once_and_then_drawn_again(context, monkeypatch, caplog) -> None:
    reason = "making a framebuffer failed: the graphics card has no memory left"
    tried: list[bool] = []

    def fail(*_: Any, **__: Any) -> None:
        tried.append(True)
        raise DisplayError(reason)

    async def act(made: Play) -> None:
        await made.picture()
        with monkeypatch.context() as patch:
            patch.setattr(Renderer, "draw", fail)
            for _ in range(3):
                count = len(tried)
                made.ask()
                async with asyncio.timeout(PATIENCE):
                    while len(tried) == count:
                        await asyncio.sleep(0)
        await made.picture()
        said = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
        assert said == [f"view eye cannot be drawn: {reason}"]

    run(context, act)


class LostDriver:
    """moderngl's context, as it is after a card was reset."""

    def __init__(self, gl: Any) -> None:
        self._gl, self.error = gl, "GL_UNKNOWN_ERROR"

    def __getattr__(self, name: str) -> Any:
        return getattr(self._gl, name)


@pytest.mark.gl
@pytest.mark.parametrize("asked", ["a picture", "data", "a pick", "a thumbnail"])
def test_a_node_ends_when_the_context_is_lost_whoever_meets_it(context, monkeypatch, caplog, asked: str) -> None:
    questions: dict[str, tuple[Any, Any]] = {
        "a pick": (topics.PICK, PickRequest(camera=CAMERA, width=40, height=30, x=20, y=15)),
        "a thumbnail": (topics.THUMBNAIL, ThumbnailRequest(records=())),
    }

    async def act(made: Play) -> None:
        await made.picture()
        monkeypatch.setattr(context, "gl", LostDriver(context.gl))
        if asked in questions:
            query, request = questions[asked]
            with pytest.raises(RequestError, match="lost the context"):
                await made.viewer.request(query, request, key=made.node, timeout=PATIENCE)
        else:
            made.ask(shows="shaded" if asked == "a picture" else "depth")
        with pytest.raises(ContextLost, match="the process that draws has to start again"):
            await asyncio.wait_for(asyncio.shield(made.task), PATIENCE)
        assert not [record for record in caplog.records if record.levelname == "ERROR"]  # who runs it says it

    with contextlib.suppress(ContextLost):
        run(context, act)


@pytest.mark.gl
def test_a_view_shows_data_when_asked(context) -> None:
    slot_size = 40 * 30 * 4
    descriptor = os.memfd_create("elys-test")
    os.ftruncate(descriptor, 3 * slot_size)

    async def act(made: Play) -> None:
        assert middle(await made.picture())[0] > 180
        normal = middle(await made.picture(shows="normals"))  # of the box' front, which looks at the camera
        np.testing.assert_allclose(normal, (128, 128, 255), atol=6)
        assert max(middle(await made.picture(shows="albedo"))) < 8  # it only glows
        ring = SharedRing(
            machine=boot_id(), process=os.getpid(), descriptor=descriptor, slot_count=3, slot_size=slot_size
        )
        (box_class,) = SceneClasses(made.mirror).legend()
        np.testing.assert_allclose(middle(await made.picture(shows="segmentation")), box_class.color, atol=6)
        frame = await made.picture(ring=ring, shows="normals")
        with mmap.mmap(descriptor, 3 * slot_size) as memory:
            pixels = np.frombuffer(memory[frame.slot * slot_size :][:slot_size], np.uint8).reshape(30, 40, 4)
        np.testing.assert_array_equal(pixels[15, 20], (128, 128, 255, 255))
        assert not pixels[0, 0, :3].any()
        assert middle(await made.picture())[0] > 180

    try:
        run(context, act)
    finally:
        os.close(descriptor)


@pytest.mark.gl
def test_pictures_go_into_a_ring_and_never_where_the_last_one_is(context) -> None:
    slot_size = 40 * 30 * 4
    descriptor = os.memfd_create("elys-test")
    os.ftruncate(descriptor, 3 * slot_size)

    async def act(made: Play) -> None:
        ring = SharedRing(
            machine=boot_id(), process=os.getpid(), descriptor=descriptor, slot_count=3, slot_size=slot_size
        )
        memory = mmap.mmap(descriptor, 3 * slot_size)
        slots = []
        for _ in range(7):
            frame = await made.picture(ring=ring)
            assert frame.jpeg == b""
            pixels = np.frombuffer(memory, np.uint8, slot_size, frame.slot * slot_size).reshape(30, 40, 4)
            assert pixels[15, 20, 0] > 180
            slots.append(frame.slot)
            del pixels
        assert all(before != after for before, after in itertools.pairwise(slots))
        large = await made.picture(ring=ring, width=80)
        assert large.slot == -1
        assert large.jpeg

    try:
        run(context, act)
    finally:
        os.close(descriptor)


@pytest.mark.gl
def test_absurd_requests_are_answered_or_refused_and_nothing_dies(context) -> None:
    async def act(made: Play) -> None:
        for size in ((0, 0), (-5, 30), (10**9, 2)):
            frame = await made.picture(width=size[0], height=size[1])
            assert 1 <= frame.width <= 8192
            assert 1 <= frame.height <= 8192
        lost = ViewCamera(
            position=(1e300, 0.0, 0.0), rotation=(0.0, 0.0, 0.0, 0.0), field_of_view=9.0, near=-1.0, far=-2.0
        )
        assert (await made.picture(camera=lost)).camera == sane_camera(lost)
        made.ask(view="no/such name")
        made.ask(selection=(12345678,), newer_than_tick=10**12)
        key = topics.key_of("play", topics.VIEW_REQUEST, made.node)
        request = ViewRequest(view="eye", sequence=1, camera=CAMERA, width=4, height=4)
        whole = encode(request, topics.VIEW_REQUEST.encoding)
        for garbage in (
            b"",
            b"\xff" * 40,
            whole[:20],
            whole[:8] + b"[1,2",
            whole.replace(b'"width":4', b'"width":"x"'),
        ):
            made.viewer.transport.publish(key, garbage, topics.VIEW_REQUEST.delivery)
        with pytest.raises(BusError):
            await made.viewer._ask(topics.key_of("play", topics.PICK, made.node), b"junk", 5.0)
        assert middle(await made.picture())[0] > 180

    run(context, act)


@pytest.mark.gl
def test_the_last_picture_stays_when_the_host_goes(context) -> None:
    async def act(made: Play) -> None:
        await made.picture()
        await made.host.close()
        assert middle(await made.picture())[0] > 180

    run(context, act)


def test_who_asks_no_more_is_forgotten() -> None:
    desk = ViewDesk()
    request = ViewRequest(view="eye", sequence=1, camera=CAMERA, width=4, height=4)
    assert desk.take(request, 100.0)
    assert len(desk.due(100.0, 0, gliding=False)) == 1
    desk.forget_silent(100.0 + SILENCE + 0.1)
    assert desk.due(200.0, 0, gliding=False) == []


def test_an_older_request_does_not_overtake_a_newer_one() -> None:
    desk = ViewDesk()
    newer = ViewRequest(view="eye", sequence=5, camera=CAMERA, width=4, height=4)
    older = ViewRequest(view="eye", sequence=4, camera=CAMERA, width=8, height=8)
    assert desk.take(newer, 1.0)
    assert not desk.take(older, 1.1)
    assert desk.take(older, 1.0 + SILENCE)  # the asker was started anew and counts from the beginning


@pytest.mark.parametrize(
    ("asked", "drawn"),
    [((640, 360), (640, 360)), ((0, -3), (1, 1)), ((10**9, 10), (8192, 10)), ((8192, 8192), (4096, 4096))],
)
def test_sizes_are_kept_or_brought_to_what_can_be_drawn(asked: tuple[int, int], drawn: tuple[int, int]) -> None:
    width, height, reason = sane_size(*asked)
    assert (width, height) == drawn
    assert bool(reason) == (asked != drawn)


def test_each_view_has_its_own_debug_drawing_and_lines_are_made_only_while_one_is_shown(context: Any) -> None:
    lines = np.array([[(-2.0, 1.3, 0.0), (2.0, 1.3, 0.0)]], "<f4")

    async def act(made: Play) -> None:
        def listened() -> bool:
            return made.host.has_listener(topics.DEBUG_LINES, key="boxes")

        plain = await made.picture()
        assert not listened()
        drawn = await made.picture(debug=("aabb",))
        assert drawn.jpeg != plain.jpeg  # without physics, the boxes of what is drawn
        assert listened()
        told = DebugLines(epoch=1, tick=3, positions=lines.tobytes(), colors=b"\0")
        made.host.publish(topics.DEBUG_LINES, told, key="boxes")
        waiting = made.ask(debug=("aabb",), newer_than_tick=3)  # time stands: lines alone bring a picture
        frame = await made.next()
        assert frame.sequence == waiting
        assert frame.jpeg != drawn.jpeg
        other = await made.picture(view="other")
        assert other.jpeg == plain.jpeg
        await made.picture()
        while listened():
            await made.picture()
        assert (await made.picture(debug=("labels",), debug_entities=(99,))).jpeg == plain.jpeg
        nothing = await made.picture(hidden=(BOX,))
        assert (await made.picture(hidden=(BOX,), debug=("obb", "labels"))).jpeg == nothing.jpeg

    run(context, act)


def test_content_that_the_host_has_not_yet_is_shown_when_it_comes(
    context: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a new connection; a checker stands for it meanwhile."""
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path))
    buffer = io.BytesIO()
    Image.fromarray(np.full((8, 8, 3), (10, 20, 220), np.uint8)).save(buffer, "PNG")
    image = AssetStore().put(buffer.getvalue(), kind="image")

    async def act(made: Play) -> None:
        served = AssetStore()  # which holds nothing yet
        serve_assets(made.host, served)
        light = msgspec.structs.replace(made.mirror.settings, background=(0.0, 0.0, 0.0), ambient=(1.0, 1.0, 1.0))
        textured = values_of(Material(base_color_texture=image, roughness=1.0))
        made.change(ComponentSet(entity=BOX, component="Material", values=textured), SettingsSet(settings=light))

        async def shown(is_it: Callable[[int, int, int], bool]) -> None:
            """Asks for pictures, as an editor does, until one is so."""
            async with asyncio.timeout(PATIENCE):
                while not is_it(*middle(await made.picture())):
                    pass

        await shown(lambda red, green, blue: green < 40 and red >= green)
        served.put(buffer.getvalue(), kind="image")
        await shown(lambda red, green, blue: blue > 150 and red < 60)

    run(context, act)


@pytest.mark.gl
def test_an_overlay_that_is_written_is_a_new_picture_and_each_view_has_its_players(context: Any) -> None:
    async def act(made: Play) -> None:
        panel = {"OverlayPanel": {"color": (0.0, 1.0, 0.0), "opacity": 1.0, "radius": 0.0}}
        where = {"Overlay": values_of(Overlay(anchor="center", width=0.5, height=0.5, player=2))}
        await made.picture()
        made.change(Spawned(entity=8, name="", parent=0, enabled=True, components={**panel, **where}))
        assert middle(await made.picture())[0] > 180  # not for the first player
        shown = await made.picture(player=2)
        assert middle(shown)[1] > 200 > 60 > middle(shown)[0]
        sequence = made.ask(player=2, newer_than_tick=3)
        blue = values_of(OverlayPanel(color=(0.0, 0.0, 1.0), opacity=1.0))
        made.change(ComponentSet(entity=8, component="OverlayPanel", values=blue))
        frame = await made.next()
        assert frame.sequence == sequence
        assert middle(frame)[2] > 200 > 60 > middle(frame)[1]

    run(context, act)
