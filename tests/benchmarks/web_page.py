"""`elys web`: what a browser's view costs the web node and the way, and how long a hand waits for its picture.

pictures drawn before ──30 a second──> elys web ──> a client that shows nothing (processor time of the web node, bytes)
yard, playing ──> render node ───────> elys web ──> Chromium, whose camera is dragged (from the hand to the picture)
"""

from __future__ import annotations

import asyncio
import os
import sys
import time
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import aiohttp
import msgspec
import numpy as np
import simplejpeg

from elys.bus import topics
from elys.bus.messages.views import Encoding, ViewCamera, ViewFrame, ViewRequest
from elys.render_node.view_desk import JPEG_QUALITY
from elys.render_node.view_encoder import CodedPicture, ViewEncoder
from elys.verbs.nodes import joined
from tests.benchmarks.figures import percentiles
from tests.benchmarks.processes import environment, running
from tests.benchmarks.view_streams import SIZE, drawn_pictures
from tests.process.web_pages import Page, open_browser, unused_port

RATE = 30.0  # pictures a second
PICTURES = 200  # that are counted
DRAGS = 12
LOOKS = 60
CAMERA = ViewCamera(position=(0.0, 0.0, 5.0), rotation=(0.0, 0.0, 0.0, 1.0))
Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    drawn = drawn_pictures()
    encoder = ViewEncoder(*SIZE)
    coded: dict[Encoding, Sequence[CodedPicture]] = {
        "jpeg": [
            CodedPicture(simplejpeg.encode_jpeg(pixels, JPEG_QUALITY, "RGBX", fastdct=True), 0, True)
            for pixels in drawn
        ],
        "h264": [encoder.encode(pixels, keyframe=False) for pixels in drawn],
    }
    endpoint, port = f"tcp/127.0.0.1:{unused_port()}", unused_port()
    elys = (sys.executable, "-m", "elys")
    simulation = (*elys, "run", "yard", "--headless", "--realtime", "--listen", endpoint)
    render = (*elys, "node", "render", "--connect", endpoint)
    web = (*elys, "web", "--connect", endpoint, "--port", str(port), "--insecure", "--fps", "60")
    rows = []
    with environment() as env, running(simulation, env=env, wait_for="simulating"):
        asyncio.run(shown(endpoint, env, web, coded, f"http://127.0.0.1:{port}/", rows))
        with (
            running(render, env=env, wait_for="drawing views"),
            running(web, env=env, wait_for="for everybody"),
        ):
            rows += led(f"http://127.0.0.1:{port}/")
    return rows


async def shown(
    endpoint: str,
    env: dict[str, str],
    web: Sequence[str],
    coded: dict[Encoding, Sequence[CodedPicture]],
    url: str,
    rows: list[Row],
) -> None:
    """The web node alone, at a render node that has its pictures ready 30 times a second."""
    async with joined(endpoint, kind="render", timeout=20.0) as session:
        requests: asyncio.Queue[ViewRequest] = asyncio.Queue()
        session.subscribe(topics.VIEW_REQUEST, lambda request, _: requests.put_nowait(request), key=session.node.id)

        async def draw() -> None:
            pictures = {encoding: cycle(enumerate(found, start=1)) for encoding, found in coded.items()}
            due, number = time.monotonic(), 0
            while True:
                request = await requests.get()
                due = max(due + 1.0 / RATE, time.monotonic() - 1.0 / RATE)
                if request.width == SIZE[0]:  # else it is asked how long the way is
                    await asyncio.sleep(due - time.monotonic())
                _, picture = next(pictures[request.encoding])
                number += 1
                frame = ViewFrame(
                    view=request.view,
                    sequence=request.sequence,
                    tick=number,
                    state_published_at=time.time_ns(),
                    camera=request.camera or CAMERA,
                    width=SIZE[0],
                    height=SIZE[1],
                    jpeg=picture.data if request.encoding == "jpeg" else b"",
                    h264=picture.data if request.encoding == "h264" else b"",
                    number=number,
                    keyframe=picture.is_keyframe,
                )
                session.publish(topics.VIEW_FRAME, frame, key=request.view)

        drawing = asyncio.ensure_future(draw())
        with running(web, env=env, wait_for="for everybody") as serving:
            for encoding, name in (("jpeg", "JPEG"), ("h264", "H.264")):
                rows += await watched(url, encoding, name, serving.pid)
            rows.append(("page: from a look to its picture, without drawing, p50 / p99", percentiles(await ways(url))))
        drawing.cancel()


async def watched(url: str, encoding: str, name: str, process: int) -> list[Row]:
    """A client that says at once of each picture that it was shown."""
    look = {"type": "look", "number": 1, "width": SIZE[0], "height": SIZE[1], "encoding": encoding}
    pictures = size = 0
    began = used = 0.0
    async with aiohttp.ClientSession() as client, client.ws_connect(f"{url}ws", headers={"Origin": url[:-1]}) as socket:
        await say(socket, look)
        async for message in socket:
            if message.type is not aiohttp.WSMsgType.BINARY:
                continue
            length = int.from_bytes(message.data[:4], "little")
            about = msgspec.json.decode(message.data[4 : 4 + length])
            await say(socket, {"type": "shown", "picture": about["picture"]})
            if not began:  # the first is a keyframe
                began, used = time.monotonic(), processor_time(process)
                continue
            pictures, size = pictures + 1, size + len(message.data)
            if pictures == PICTURES:
                break
    elapsed, used = time.monotonic() - began, processor_time(process) - used
    rate = pictures / elapsed
    what = f"page, {name}, {SIZE[0]}x{SIZE[1]}, {rate:.0f} pictures a second"
    return [
        (f"{what}: a picture, on the way", f"{size / pictures / 1e3:.0f} kB, {size * 8 / elapsed / 1e6:.1f} Mbit/s"),
        (
            f"{what}: processor of the web node, states of 200 bodies included",
            f"{used / elapsed * 100:.1f} % of a core",
        ),
    ]


async def ways(url: str) -> list[float]:
    """From saying what is to be seen to its picture, drawn before [ms]: browser, web node, bus, render node, and back."""
    found = []
    async with aiohttp.ClientSession() as client, client.ws_connect(f"{url}ws", headers={"Origin": url[:-1]}) as socket:
        for number in range(1, LOOKS + 1):
            began = time.monotonic()
            await say(socket, {"type": "look", "number": number, "width": 640, "height": 360})
            async for message in socket:
                if message.type is not aiohttp.WSMsgType.BINARY:
                    continue
                length = int.from_bytes(message.data[:4], "little")
                about = msgspec.json.decode(message.data[4 : 4 + length])
                await say(socket, {"type": "shown", "picture": about["picture"]})
                if about["look"] == number:
                    break
            found.append((time.monotonic() - began) * 1e3)
            await asyncio.sleep(0.05)  # longer than the node keeps between two pictures
    return found


async def say(socket: aiohttp.ClientWebSocketResponse, message: dict[str, Any]) -> None:
    await socket.send_str(msgspec.json.encode(message).decode())


def processor_time(process: int) -> float:
    """Of a process [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def led(url: str) -> list[Row]:
    """In a real browser: from the event of the hand to the picture that shows it, and what of that was drawing."""
    waits: list[float] = []
    drawing: list[float] = []
    with open_browser() as browser:
        page = Page(browser.new_context(viewport={"width": 1240, "height": 460}))
        page.tab.goto(url)
        page.wait_for_picture()
        page.tab.keyboard.press("a")
        for turn in range(DRAGS):
            page.drag((0.5, 0.5), (0.5 + 0.1 * (-1) ** turn, 0.5))
            page.tab.wait_for_timeout(400)
            told = dict(
                zip(
                    page.tab.locator("#figures dt").all_inner_texts(),
                    page.tab.locator("#figures dd").all_inner_texts(),
                    strict=True,
                )
            )
            waits.append(float(told["hand to picture"].split()[0]))
            drawing.append(float(told["drawing"].split()[0]))
    return [
        ("page: from the hand to the picture, p50 / p99", percentiles(waits)),
        ("page: of which drawing and encoding (software OpenGL), p50", f"{np.median(drawing):.0f} ms"),
    ]
