"""JPEG against H.264 for views of 1280x720: what encoding and decoding cost a processor, how large and how old pictures are.

yard, drawn once ──> encoders and decoders as a render node and a thin window use them: processor time, bytes, error
a render node ─────> RemoteView: age of the state in a picture when its pixels are there
"""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from elys.bus.messages.views import Encoding, ViewCamera
from elys.common.assets import AssetStore
from elys.common.math.matrix import look_rotation
from elys.render_node.offline import OfflineRenderer
from elys.render_node.remote_view import RemotePicture, RemoteView, Wanted
from elys.render_node.view_desk import JPEG_QUALITY
from elys.render_node.view_encoder import ViewDecoder, ViewEncoder
from elys.verbs.footage import simulated
from elys.verbs.nodes import joined
from elys.verbs.scenes import open_scene_or_sample
from tests.benchmarks.figures import percentiles
from tests.benchmarks.processes import environment, running

SIZE = (1280, 720)
PICTURES = 40  # encoded and decoded, one a tick
WARM_UP = 4
ROUNDS, ASKED = 2, 20  # of the render node: encodings take turns, for the machine may be busy with other things
ENDPOINT = "tcp/127.0.0.1:17552"
Row = tuple[str, str]
T = TypeVar("T")
Pixels = NDArray[np.uint8]


def measure() -> list[Row]:
    """Rows of the table."""
    pictures = drawn_pictures()
    rows = [
        *coding_rows("JPEG", through_jpeg(pictures), pictures),
        *coding_rows("H.264", through_h264(pictures), pictures),
    ]
    return [*rows, *age_rows()]


def drawn_pictures() -> list[Pixels]:
    """The sample "yard" while its bodies fall, seen as a viewer does: RGBA (H, W, 4)."""
    assets = AssetStore()
    footage = simulated(open_scene_or_sample("yard", assets), assets, 0.5)
    found = []
    with OfflineRenderer(footage.mirror, footage.fetch, width=SIZE[0], height=SIZE[1]) as renderer:
        for frame in footage.frames:
            footage.mirror.keep_frame(frame)
            found.append(renderer.picture())
            if len(found) == PICTURES:
                return found
    raise AssertionError("a scene goes on for ever")


Coded = tuple[float, float, int, Pixels]  # [ms] of processor time to encode and to decode, [bytes], what is seen


def through_jpeg(pictures: Sequence[Pixels]) -> list[Coded]:
    """As a render node and a thin window do it."""
    found = []
    for pixels in pictures:
        data, encoding = timed(lambda pixels=pixels: simplejpeg.encode_jpeg(pixels, JPEG_QUALITY, "RGBX", fastdct=True))
        seen, decoding = timed(lambda data=data: simplejpeg.decode_jpeg(data, colorspace="RGBA"))
        found.append((encoding, decoding, len(data), seen))
    return found


def through_h264(pictures: Sequence[Pixels]) -> list[Coded]:
    """The same; the first picture is the keyframe."""
    encoder, decoder = ViewEncoder(*SIZE), ViewDecoder()
    found = []
    for pixels in pictures:
        coded, encoding = timed(lambda pixels=pixels: encoder.encode(pixels, keyframe=False))
        seen, decoding = timed(lambda coded=coded: decoder.decode(coded, *SIZE))
        assert seen is not None
        found.append((encoding, decoding, len(coded.data), seen))
    return found


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """What comes of it, and the processor time of all threads [ms]."""
    start = time.process_time()
    result = work()
    return result, (time.process_time() - start) * 1e3


def coding_rows(name: str, coded: list[Coded], pictures: Sequence[Pixels]) -> list[Row]:
    """What a coding costs, and what is lost by it."""
    settled = coded[WARM_UP:]
    encoding, decoding, sizes = ([row[column] for row in settled] for column in range(3))
    errors = [
        np.square(row[3][..., :3].astype(float) - pixels[..., :3]).mean()
        for row, pixels in zip(settled, pictures[WARM_UP:], strict=True)
    ]
    noise = 10.0 * np.log10(255.0**2 / np.mean(errors))
    first = f", the first {coded[0][2] / 1e3:.0f} kB" if name == "H.264" else ""
    return [
        (f"{name}, 1280x720: processor time to encode, p50 / p99", percentiles(encoding)),
        (f"{name}, 1280x720: processor time to decode, p50 / p99", percentiles(decoding)),
        (f"{name}, 1280x720: a picture, signal to noise", f"{np.median(sizes) / 1e3:.0f} kB{first}, {noise:.1f} dB"),
    ]


def age_rows() -> list[Row]:
    """Over real processes of one machine: what the way carries is no bound here."""
    simulation = (sys.executable, "-m", "elys", "run", "yard", "--headless", "--realtime", "--listen", ENDPOINT)
    render = (sys.executable, "-m", "elys", "node", "render", "--connect", ENDPOINT)
    ages: dict[Encoding, list[float]] = {"jpeg": [], "h264": []}
    ways: dict[Encoding, list[float]] = {"jpeg": [], "h264": []}
    with (
        environment() as env,
        running(simulation, env=env, wait_for="simulating"),
        running(render, env=env, wait_for="drawing views"),
    ):
        for _ in range(ROUNDS):
            for encoding in ages:
                found, drawing = asyncio.run(ages_of(encoding))
                ages[encoding] += found
                ways[encoding] += [age - time for age, time in zip(found, drawing, strict=True)]
    rows = []
    for encoding, name in (("jpeg", "JPEG"), ("h264", "H.264")):
        rows.append(
            (f"{name}, 1280x720: age of a decoded picture (software OpenGL), p50 / p99", percentiles(ages[encoding]))
        )
        rows.append((f"{name}: of which not drawing and encoding, p50 / p99", percentiles(ways[encoding])))
    return rows


async def ages_of(encoding: Encoding) -> tuple[list[float], list[float]]:
    """Ages [ms] of the states in pictures when their pixels were there, and what drawing and encoding took [ms]."""
    eye = (9.0, 6.0, 11.0)
    rotation = look_rotation([-x for x in eye]).tolist()
    camera = ViewCamera(position=eye, rotation=(rotation[0], rotation[1], rotation[2], rotation[3]))
    wanted = Wanted(camera=camera, width=SIZE[0], height=SIZE[1])
    ages: list[float] = []
    drawing: list[float] = []
    enough = asyncio.Event()

    def came(picture: RemotePicture) -> None:
        ages.append((time.time_ns() - picture.frame.state_published_at) / 1e6)
        drawing.append(picture.frame.render_time)
        if len(ages) == ASKED:
            enough.set()

    async with joined(ENDPOINT, kind="tool") as session:
        view = RemoteView(session, choice=encoding, name=f"bench-{encoding}", on_picture=came)
        async with asyncio.timeout(120):
            while not enough.is_set():
                view.want(wanted)
                await asyncio.sleep(0.002)  # as the frames of a window
    return ages[WARM_UP:], drawing[WARM_UP:]
