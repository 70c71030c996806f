"""Views for thin clients: streams of H.264, what happens when part of one is lost, and how the encoding is chosen."""

from __future__ import annotations

import asyncio
import base64
import json
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from mcap.reader import make_reader

from elys.bus import topics
from elys.bus.messages.scene import SceneDelta, Snapshot, SnapshotRequest, Spawned
from elys.bus.messages.views import FRAMED, ViewCamera, ViewFrame, ViewRequest
from elys.bus.mirror import SceneMirror
from elys.bus.recorder import record_session
from elys.bus.recording import Recording
from elys.bus.recording_info import recording_info
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.bus.view_recording import RecordedView
from elys.common.components import Camera, Light, Material, MeshRenderer, Transform, values_of
from elys.render_node.node import serve_views
from elys.render_node.quality import FAST
from elys.render_node.remote_view import SLOW_LINK, LinkMeasure, RemotePicture, RemoteView, Wanted
from elys.render_node.view_desk import sane_bit_rate
from elys.render_node.view_encoder import CodedPicture, ViewDecoder, ViewEncoder

PATIENCE = 20.0  # [s]
CAMERA = ViewCamera(position=(0.0, 0.0, 5.0), rotation=(0.0, 0.0, 0.0, 1.0))
SIDE = 9  # the entity with a camera


def moving(number: int, height: int = 90, width: int = 120) -> np.ndarray:
    """RGBA pixels of a smooth picture with a block that moves."""
    y, x = np.mgrid[:height, :width]
    pixels = np.stack([x * 2, y * 2, (x + y), np.full_like(x, 255)], axis=-1).clip(0, 255).astype(np.uint8)
    pixels[30:50, 4 * number : 4 * number + 20, :3] = (230, 40, 40)
    return pixels


def difference(a: Any, b: Any) -> float:
    """Mean of 255, colours only."""
    return float(np.abs(a[..., :3].astype(int) - b[..., :3].astype(int)).mean())


@pytest.mark.parametrize("size", [(90, 120), (89, 121)])
def test_a_stream_is_read_by_others_one_picture_a_message(size: tuple[int, int]) -> None:
    encoder, stranger = ViewEncoder(size[1], size[0]), av.CodecContext.create("h264", "r")
    decoder = ViewDecoder()
    for number in range(8):
        pixels = moving(number, *size)
        coded = encoder.encode(pixels, keyframe=number == 5)
        assert coded.is_keyframe == (number in (0, 5))
        assert coded.data.startswith(b"\x00\x00\x00\x01")  # Annex B
        seen = decoder.decode(coded, size[1], size[0])
        assert seen is not None
        assert seen.shape == pixels.shape
        assert difference(seen, pixels) < 6
        stranger.parse(coded.data)
        for frame in stranger.decode(av.Packet(coded.data)):
            assert frame.pict_type in (av.video.frame.PictureType.I, av.video.frame.PictureType.P)
    assert len(coded.data) < len(encoder.encode(moving(0, *size), keyframe=True).data) / 3


def test_after_a_loss_only_a_keyframe_helps_and_nonsense_is_refused() -> None:
    encoder, decoder = ViewEncoder(120, 90), ViewDecoder()
    coded = [encoder.encode(moving(number), keyframe=number == 4) for number in range(6)]
    assert decoder.decode(coded[1], 120, 90) is None  # what came before was never here
    assert decoder.decode(coded[0], 120, 90) is not None
    assert decoder.decode(coded[2], 120, 90) is None  # one is missing
    assert decoder.decode(coded[3], 120, 90) is None
    recovered = decoder.decode(coded[4], 120, 90)
    assert recovered is not None
    assert difference(recovered, moving(4)) < 6
    with pytest.raises(ValueError, match=r"no picture of 64 x 64|no H\.264"):
        decoder.decode(coded[5], 64, 64)
    assert decoder.decode(coded[5], 120, 90) is None
    for data in (b"", b"nonsense", coded[0].data[:40]):
        with pytest.raises(ValueError, match="it "):
            ViewDecoder().decode(CodedPicture(data, 1, True), 120, 90)


def test_a_bit_rate_is_kept() -> None:
    rng = np.random.default_rng(1)
    noise = [rng.integers(0, 255, (180, 320, 4), np.uint8) for _ in range(30)]
    sizes = {}
    for bit_rate in (0.0, 400e3):
        encoder = ViewEncoder(320, 180, bit_rate=bit_rate)
        sizes[bit_rate] = sum(len(encoder.encode(pixels, keyframe=False).data) for pixels in noise)
    assert (
        sizes[400e3] < 2 * 400e3 / 8
    )  # of one second at 30 pictures; what is noise cannot be made smaller without end
    assert sizes[0.0] > 4 * sizes[400e3]
    assert [sane_bit_rate(rate) for rate in (0.0, -1.0, float("nan"), float("inf"), 1.0, 1e12)] == [
        0,
        0,
        0,
        0,
        50e3,
        1e9,
    ]


def test_the_link_is_measured_by_what_large_pictures_take_longer_than_small_ones() -> None:
    for rate, is_slow in ((10e6, True), (100e6, False)):
        link, noise = LinkMeasure(), iter((0.004, 0.02, 0.0, 0.0, 0.011, 0.003))
        while not link.is_done:
            assert not link.is_slow
            size = 600 if link.wants_small else 130_000
            link.note(link.wants_small, 0.002 + size * 8 / rate + next(noise), size)
        assert link.rate == pytest.approx(rate, rel=0.3)
        assert link.is_slow == is_slow == (link.rate < SLOW_LINK)
    quick = LinkMeasure()
    for _ in range(3):
        quick.note(True, 0.003, 600)
        quick.note(False, 0.005, 2_000)  # a difference that anything may have made
    assert not quick.is_slow


# --- with a render node --------------------------------------------------------------------------------------------


def test_pictures_that_never_come_are_asked_for_smaller() -> None:
    """A way so narrow that one picture fills it for longer than silence is waited for: it is lost with the line, each time."""

    async def act() -> None:
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
        render = await Session.join(broker.connect(), kind="render")
        client = await Session.join(broker.connect(), kind="tool")
        asked: list[ViewRequest] = []
        render.subscribe(topics.VIEW_REQUEST, lambda request, _: asked.append(request), key=render.node.id)

        async def until_asked(count: int) -> None:
            async with asyncio.timeout(PATIENCE):
                while len(asked) < count:
                    await asyncio.sleep(0.005)

        async with asyncio.timeout(PATIENCE):
            while not client.nodes_of("render"):
                await asyncio.sleep(0.005)
        view = RemoteView(client, adapts=True)
        view.want(Wanted(camera=CAMERA, width=1280, height=720))
        await until_asked(1)
        key = topics.node_key(client.name, "render", render.node.id)
        ways = [(view.scale, view.encoding)]
        for count in range(2, 7):
            client._node_changed(key, False)  # another line is taken: who is there is told anew
            client._node_changed(key, True)
            await until_asked(count)
            ways.append((view.scale, view.encoding))
        assert ways == [*[(1.0, "jpeg")] * 2, *[(0.75, "h264")] * 2, *[(0.5, "h264")] * 2]
        assert asked[-1].bit_rate > 0.0 and asked[-1].keyframe
        client._node_changed(key, False)
        other = await Session.join(broker.connect(), kind="render")
        async with asyncio.timeout(PATIENCE):
            while view.renderer != other.node:
                await asyncio.sleep(0.005)
        assert view.scale == 0.5  # it was the render node that went, and not the way
        await other.close()
        for session in (client, render, host):
            await session.close()

    asyncio.run(act())


class Play:
    """A host with a glowing box and a camera at its side, a render node, and a client."""

    def __init__(self, broker: LoopbackBroker, host: Session, render: Session, client: Session) -> None:
        self.broker, self.host, self.render, self.client = broker, host, render, client
        self.pictures: asyncio.Queue[RemotePicture] = asyncio.Queue()
        self.remote: RemoteView

    def look(self, **options: Any) -> None:
        self.remote = RemoteView(self.client, on_picture=self.pictures.put_nowait, **options)

    async def picture(self, **wanted: Any) -> RemotePicture:
        """Wants it, and waits for a picture of that size."""
        values = Wanted(**({"camera": CAMERA, "width": 96, "height": 64} | wanted))
        async with asyncio.timeout(PATIENCE):
            while True:
                self.remote.want(values)
                try:
                    picture = await asyncio.wait_for(self.pictures.get(), 0.05)
                except TimeoutError:
                    continue
                if picture.pixels.shape[:2] == (values.height, values.width):
                    return picture


@asynccontextmanager
async def play(context: Any) -> AsyncIterator[Play]:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="play", kind="simulation", epoch=1)
    mirror = SceneMirror()
    mirror.epoch = 1
    box = (Transform(scale=(2.0,) * 3), MeshRenderer(), Material(emissive=(1.0, 0.1, 0.1)), Light(intensity=0.0))
    side = (Transform(position=(0.0, 0.0, 12.0)), Camera(priority=-1))
    front = (Transform(position=(0.0, 0.0, 6.0)), Camera())
    changes = tuple(
        Spawned(
            entity=entity, name=name, parent=0, enabled=True, components={type(c).__name__: values_of(c) for c in parts}
        )
        for entity, name, parts in ((7, "Box", box), (8, "Front", front), (SIDE, "Side", side))
    )
    mirror.apply_delta(SceneDelta(epoch=1, sequence=0, tick=3, changes=changes))

    async def answer(_: SnapshotRequest, __: str) -> Snapshot:
        return mirror.to_snapshot()

    host.serve(topics.SNAPSHOT, answer)
    render = await Session.join(broker.connect(), kind="render")
    client = await Session.join(broker.connect(), kind="tool")
    task = asyncio.create_task(serve_views(render, context=context, quality=FAST))
    try:
        await asyncio.sleep(0)
        yield Play(broker, host, render, client)
        if task.done():
            task.result()
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        for session in (client, render, host):
            await session.close()


def run(context: Any, act: Callable[[Play], Coroutine[Any, Any, None]]) -> None:
    async def whole() -> None:
        async with play(context) as made:
            await act(made)

    asyncio.run(whole())


@pytest.mark.gl
def test_pictures_come_as_they_are_chosen_and_show_the_same(context: Any) -> None:
    async def act(made: Play) -> None:
        made.look(choice="jpeg")
        jpeg = await made.picture()
        assert jpeg.frame.jpeg
        assert not jpeg.frame.h264
        made.look(choice="h264", name="other")
        coded = await made.picture(width=97, height=63)
        assert coded.frame.h264
        assert coded.frame.keyframe
        coded = await made.picture()
        assert difference(coded.pixels, jpeg.pixels) < 4
        assert jpeg.pixels.std() > 20
        made.look(name="third")  # by what the way carries: here, anything
        await made.picture()
        while made.remote.link_rate == 0.0:
            await made.picture(camera=CAMERA, width=128, height=64)
        assert made.remote.encoding == "jpeg"

    run(context, act)


@pytest.mark.gl
def test_a_lost_picture_is_followed_by_a_keyframe(context: Any) -> None:
    async def act(made: Play) -> None:
        made.look(choice="h264")
        first = await made.picture()
        assert first.frame.number == 1
        # Somebody else's request for the same view takes a picture out of the stream.
        stolen = ViewRequest(
            view=made.client.node.id, sequence=10_000, camera=CAMERA, width=96, height=64, encoding="h264"
        )
        lost: asyncio.Queue[ViewFrame] = asyncio.Queue()
        made.host.subscribe(topics.VIEW_FRAME, lambda frame, _: lost.put_nowait(frame))
        made.remote._decoder._last = -5  # as if what came before had never arrived
        made.host.publish(topics.VIEW_REQUEST, stolen, key=made.render.node.id)
        while (await asyncio.wait_for(lost.get(), PATIENCE)).sequence != 10_000:
            pass
        made.remote._sequence = 10_000
        turned = ViewCamera(position=(0.5, 0.0, 5.0), rotation=(0.0, 0.0, 0.0, 1.0))
        again = await made.picture(camera=turned)
        assert again.frame.keyframe
        assert again.frame.number > 2

    run(context, act)


@pytest.mark.gl
def test_who_has_no_camera_looks_through_the_scenes_or_sees_everything(context: Any) -> None:
    async def act(made: Play) -> None:
        made.look(choice="jpeg")
        assert (await made.picture(camera=None)).frame.camera.position == (0.0, 0.0, 6.0)
        assert (await made.picture(camera=None, through=SIDE, width=80)).frame.camera.position == (0.0, 0.0, 12.0)
        framed = (await made.picture(camera=None, through=FRAMED, width=72)).frame.camera
        assert framed.position not in ((0.0, 0.0, 6.0), (0.0, 0.0, 12.0))
        assert (await made.picture(camera=None, through=12345, width=64)).frame.camera.position == (0.0, 0.0, 6.0)

    run(context, act)


@pytest.mark.gl
def test_another_render_node_takes_over_with_a_stream_of_its_own(context: Any) -> None:
    async def act(made: Play) -> None:
        made.look(choice="h264")
        assert made.remote.renderer is not None
        await made.picture()
        made.remote._nodes_changed(made.remote.renderer, True)  # nothing new: the stream goes on
        assert not made.remote._needs_keyframe
        made.remote.renderer = None
        made.remote._choose_renderer()
        assert (await made.picture()).frame.keyframe

    run(context, act)


# --- in recordings -------------------------------------------------------------------------------------------------


@pytest.mark.gl
def test_a_recording_holds_views_that_others_can_read(context: Any, tmp_path: Path, make_frame: Any) -> None:
    path = tmp_path / "run.mcap"

    async def act(made: Play) -> None:
        recorder, stop = await Session.join(made.broker.connect(), kind="recorder"), asyncio.Event()
        views = [RecordedView(name="Side view!", entity=SIDE, width=97, height=64, fps=60.0)]
        recording = asyncio.create_task(record_session(recorder, path, stop, views))
        shown: list[ViewFrame] = []
        made.host.subscribe(topics.VIEW_FRAME, lambda frame, _: shown.append(frame))
        async with asyncio.timeout(PATIENCE):
            for tick in range(4, 12):
                count = len(shown)
                frame = make_frame(
                    {7: (0.25 * (tick - 4), 0.0, 0.0)}, tick=tick, simulation_time=tick / 60, published_at=10**18 + tick
                )
                while len(shown) == count:  # until it is drawn
                    made.host.publish(topics.STATE, frame)
                    assert not recording.done(), recording.result()
                    await asyncio.sleep(0.01)
        stop.set()
        await recording
        await recorder.close()

    run(context, act)
    with path.open("rb") as file:
        found = list(make_reader(file).iter_messages(topics=["video/Side-view"]))
    assert len(found) >= 7
    schema, channel, _ = found[0]
    assert (schema.name, schema.encoding, channel.message_encoding) == (
        "foxglove.CompressedVideo",
        "jsonschema",
        "json",
    )
    assert json.loads(schema.data)["properties"]["data"]["contentEncoding"] == "base64"
    decoder, pictures = av.CodecContext.create("h264", "r"), []
    for _, _, message in found:
        picture = json.loads(message.data)
        assert (picture["format"], picture["frame_id"]) == ("h264", "Side view!")
        frames = decoder.decode(av.Packet(base64.b64decode(picture["data"])))
        assert len(frames) == 1  # one a message, and no B frames
        pictures.append(frames[0].to_ndarray(format="rgb24")[:64, :97])
    assert picture["timestamp"] == {"sec": 10**9, "nsec": 11}  # the state that the last one shows
    columns = [np.nonzero(pixels[..., 0] > 60.0 + pixels[..., 2])[1].mean() for pixels in (pictures[0], pictures[-1])]
    assert columns[1] > columns[0] + 5  # the box goes to the right
    with Recording(path) as opened:
        assert len(opened) >= 8
        channels = {message.channel for message in opened.messages_of(0, len(opened) - 1)}
        assert "video/Side-view" in channels
    assert "video/Side-view" in {channel.name for channel in recording_info(path).channels}
