"""The viewer's window on GLFW's null platform, each in a process of its own: a window's context stays current on its thread."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

PRELUDE = """
import asyncio, sys, time
from elys.bus import topics
from elys.bus.messages.commands import CommandReply
from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.mirror import SceneMirror
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.components import MeshRenderer, Transform, values_of
from elys.common.errors import DisplayError
from elys.render_node import view_window
from elys.render_node.window import Dragged, KeyPressed, Scrolled, Window, probe_display

BROKERS = []

async def open_session():
    broker = LoopbackBroker()
    BROKERS.append(broker)
    host = await Session.host(broker.listen(), name="play", kind="simulation", epoch=1)
    mirror = SceneMirror()
    mirror.epoch = 1
    components = {type(c).__name__: values_of(c) for c in (Transform(), MeshRenderer())}
    box = Spawned(entity=1, name="Box", parent=0, enabled=True, components=components)
    mirror.apply_delta(SceneDelta(epoch=1, sequence=0, tick=3, changes=(box,)))
    async def snapshot(request, key):
        return mirror.to_snapshot()
    host.serve(topics.SNAPSHOT, snapshot)
    return host, await Session.join(broker.connect(), kind="tool")
"""


def in_process(script: str, **environment: str) -> str:
    """What a script prints; fails with what it said if it fails."""
    done = subprocess.run(
        [sys.executable, "-c", PRELUDE + script],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={**os.environ, "ELYS_NULL_PLATFORM": "1", **environment},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()


@pytest.mark.gl
def test_a_window_shows_frames_and_ends() -> None:
    script = """
async def main():
    host, session = await open_session()
    await view_window.run_view(session, frames=5, debug=("aabb", "labels"), age=True)
    await session.close(); await host.close()
    print("done")
asyncio.run(main())
"""
    assert in_process(script) == "done"


@pytest.mark.gl
def test_hand_keys_and_title() -> None:
    script = """
view_window.SILENCE = 60.0  # this host says nothing, and a first picture takes its time on a busy machine
made = []
class Watched(view_window._Viewer):
    def __init__(self, *arguments):
        super().__init__(*arguments)
        made.append(self)
view_window._Viewer = Watched

async def main():
    host, session = await open_session()
    asked = []
    async def command(request, key):
        asked.append(request.command.playing)
        return CommandReply(accepted=True, tick=1)
    host.serve(topics.COMMAND, command)
    task = asyncio.create_task(view_window.run_view(session))
    while not made or made[0]._drawn is None:
        await asyncio.sleep(0)
    viewer = made[0]
    before = viewer._camera(1.5)
    viewer._window.on_event(Dragged("left", 0.1, 0.0))
    turned = viewer._camera(1.5)
    assert turned.position != before.position
    viewer._window.on_event(Scrolled(3.0))
    assert viewer._camera(1.5).position != turned.position
    assert viewer.notes(0.0) == ()
    for key in ("1", "3", "g", "a"):
        viewer._window.on_event(KeyPressed(key))
    assert viewer._debug == {"aabb", "contacts", "grid"}
    viewer._window.on_event(KeyPressed("3"))
    assert viewer._debug == {"aabb", "grid"}
    told, rate = viewer.notes(0.0)
    assert told.startswith("tick 3"), told
    assert "pictures/s" in rate
    shown = len(viewer._shown_at)
    while len(viewer._shown_at) == shown:
        await asyncio.sleep(0)
    viewer._window.on_event(KeyPressed("space"))
    while not asked:
        await asyncio.sleep(0)
    assert asked == [False]
    assert "tick 3" in viewer.title(), viewer.title()
    await host.close()
    while session.connected:
        await asyncio.sleep(0)
    assert view_window.LOST in viewer.title(), viewer.title()
    viewer._window.on_event(KeyPressed("escape"))
    await asyncio.wait_for(task, 20)
    await session.close()
    print("done")
asyncio.run(main())
"""
    assert in_process(script) == "done"


@pytest.mark.gl
def test_a_window_whose_pictures_fail_lives_on_and_says_it_once() -> None:
    script = """
import logging
said = []
class Said(logging.Handler):
    def emit(self, record):
        said.append(record.getMessage())
logging.getLogger().addHandler(Said(logging.ERROR))
made, drawn, tried = [], [], []
class Watched(view_window._Viewer):
    def __init__(self, *arguments):
        super().__init__(*arguments)
        made.append(self)
view_window._Viewer = Watched
reason = "making a picture of 8 x 8 pixels failed: the graphics card has no memory left"
fails = True
class Failing(view_window.Renderer):
    def draw(self, *arguments, **options):
        tried.append(fails)
        if fails:
            raise DisplayError(reason)
        return super().draw(*arguments, **options)
view_window.Renderer = Failing
view_window.RETRY_TIME = 0.01

async def tries(count):
    tried.clear()
    while len(tried) < count:
        await asyncio.sleep(0.001)

async def main():
    global fails, reason
    host, session = await open_session()
    task = asyncio.create_task(view_window.run_view(session))
    await tries(3)  # again by itself, though nothing changes
    viewer = made[0]
    for _ in range(3):
        viewer._window.on_event(Dragged("left", 0.1, 0.0))
        await tries(1)
    assert view_window.NOT_DRAWN in viewer.title(), viewer.title()
    assert said == ["the window keeps its last picture: " + reason], said
    assert not viewer._shown_at
    reason = "another"
    await tries(2)
    assert len(said) == 2, said
    fails = False
    while not viewer._shown_at:
        await asyncio.sleep(0.001)
    assert view_window.NOT_DRAWN not in viewer.title(), viewer.title()
    fails = True
    viewer._window.on_event(Dragged("left", 0.1, 0.0))
    await tries(1)
    assert len(said) == 3, said  # it had gone well in between
    viewer._window.on_event(KeyPressed("escape"))
    await asyncio.wait_for(task, 20)
    try:
        await view_window.run_view(session, frames=2)
    except DisplayError:
        print("refused")
    await session.close(); await host.close()
asyncio.run(main())
"""
    assert in_process(script) == "refused"


@pytest.mark.gl
def test_a_thin_window_shows_what_a_render_node_draws() -> None:
    script = """
import numpy as np
from elys.render_node import thin_window
from elys.render_node.gpu import offscreen_context
from elys.render_node.node import serve_views
from elys.render_node.quality import FAST
made = []
class Watched(thin_window._ThinViewer):
    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        made.append(self)
thin_window._ThinViewer = Watched
thin_window.USUAL_DISTANCE = 77.0
import glfw
from elys.render_node.window import Clicked

async def main():
    host, session = await open_session()
    asked = []
    async def command(request, key):
        asked.append(request.command.playing)
        return CommandReply(accepted=True, tick=1)
    host.serve(topics.COMMAND, command)
    render = await Session.join(BROKERS[0].connect(), kind="render")
    viewing = asyncio.create_task(thin_window.run_thin_view(session, choice="h264", age=True, debug=("labels",)))
    while not made:
        await asyncio.sleep(0)
    viewer = made[0]
    assert "start one with" not in viewer.title()
    viewer._picture = None
    serving = asyncio.create_task(serve_views(render, quality=FAST))
    while viewer._picture is None or viewer._is_fresh:
        assert not serving.done(), serving.result()
        await asyncio.sleep(0)
    frame = viewer._picture.frame
    assert frame.h264 and frame.tick == 3
    assert viewer._picture.pixels.std() > 5
    assert viewer.notes()[0].startswith("tick 3")
    while viewer._distance == 77.0:
        await asyncio.sleep(0)
    for event in (Dragged("left", 0.1, 0.0), Scrolled(1.0), KeyPressed("1"), KeyPressed("space")):
        viewer._window.on_event(event)
    assert viewer.debug == {"aabb", "labels"}
    turned = viewer._orbit.camera()
    while viewer._picture.frame.camera.position != turned.position or not asked:
        await asyncio.sleep(0)
    while not viewer._hand:  # how long the camera took
        await asyncio.sleep(0)
    assert 0.0 < viewer._hand[0] < 60.0
    viewer._window.on_event(KeyPressed("f"))
    while viewer._picture.frame.camera.position == turned.position:
        await asyncio.sleep(0)
    viewer._window.on_event(Clicked(0.5, 0.5))
    while not viewer._picked:
        await asyncio.sleep(0)
    assert viewer._picked.startswith("Box   ") and viewer._selection == (1,), viewer._picked
    assert any(line.startswith("Box") for line in viewer.notes())
    viewer._window.on_event(Clicked(0.0, 0.0))  # the sky
    while viewer._picked:
        await asyncio.sleep(0)
    assert viewer._selection == ()
    # Another size of the window is another size of pictures.
    glfw.set_window_size(viewer._window._window, 640, 480)
    while viewer._picture.pixels.shape[:2] != (480, 640):
        await asyncio.sleep(0)
    assert viewer._picture.frame.keyframe
    viewer._window.on_event(KeyPressed("escape"))
    await asyncio.wait_for(viewing, 20)
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)
    for one in (render, session, host):
        await one.close()
    print("done")
asyncio.run(main())
"""
    assert in_process(script) == "done"


@pytest.mark.gl
def test_a_thin_window_tells_how_to_start_what_is_lacking() -> None:
    script = """
import logging
from elys.render_node import thin_window
from elys.render_node.lettering import write_on
thin_window.RENDERER_PATIENCE = 0.0
written, said = [], []
thin_window.write_on = lambda pixels, lines, letters: (written.append(tuple(lines)), write_on(pixels, lines, letters))
class Ear(logging.Handler):
    def emit(self, record):
        said.append(record.getMessage())
logging.getLogger("elys.render_node.thin_window").addHandler(Ear())

async def main():
    host, session = await open_session()
    viewing = asyncio.create_task(thin_window.run_thin_view(session, endpoint="tcp/server:7447"))
    while len(written) < 2:
        await asyncio.sleep(0.01)
    assert written[0][1] == "elys node render --connect tcp/server:7447", written
    assert said == ["no render node in this session: start one near it, where there is a graphics card:\\n"
                    "    elys node render --connect tcp/server:7447"], said
    viewing.cancel()
    await asyncio.gather(viewing, return_exceptions=True)
    await session.close(); await host.close()
    print("done")
asyncio.run(main())
"""
    assert in_process(script) == "done"


@pytest.mark.gl
def test_a_click_is_a_button_that_goes_down_and_up_at_one_place() -> None:
    script = """
import glfw
from elys.render_node.window import Clicked
heard, at = [], [(10.0, 20.0)]
window = Window("test", (100, 50))
window.on_event = heard.append
glfw.get_cursor_pos = lambda _: at[0]
def button(action, which=glfw.MOUSE_BUTTON_LEFT):
    window._button(None, which, action, 0)
button(glfw.PRESS); at[0] = (12.0, 20.0); button(glfw.RELEASE)
assert heard == [Clicked(0.12, 0.4)], heard
button(glfw.PRESS); at[0] = (22.0, 20.0); button(glfw.RELEASE)  # dragged
button(glfw.RELEASE)
button(glfw.PRESS, glfw.MOUSE_BUTTON_RIGHT); button(glfw.RELEASE, glfw.MOUSE_BUTTON_RIGHT)
assert len(heard) == 1
window.close()
print("done")
"""
    assert in_process(script) == "done"


@pytest.mark.gl
def test_the_window_shows_the_same_picture_as_a_framebuffer() -> None:
    script = """
import numpy as np
from elys.bus.messages.views import ViewCamera
from elys.render_node.gpu import Framebuffer, window_context
from elys.render_node.quality import FAST, FULL
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import tables_of
window = Window("test", (96, 64))
context = window_context()
world = RenderWorld()
world.set_scene(tables_of([1], [0], [{"MeshRenderer": MeshRenderer()}]))
camera = ViewCamera(position=(0.5, 0.7, 3.0), rotation=(0.0, 0.0, 0.0, 1.0))
for quality in (FAST, FULL):
    renderer = Renderer(context, quality=quality)
    apart = renderer.read_pixels(renderer.draw(world, camera, 96, 64))
    shown = Framebuffer.of_window(context, 96, 64)
    renderer.draw(world, camera, 96, 64, target=shown)
    assert (renderer.read_pixels(shown)[..., :3] == apart[..., :3]).all()
    assert apart[..., :3].std() > 10
window.close()
print("done")
"""
    assert in_process(script) == "done"


def test_without_a_display_the_remedy_is_named() -> None:
    script = """
try:
    probe_display()
except DisplayError as error:
    print(error)
"""
    said = in_process(script, DISPLAY="", WAYLAND_DISPLAY="", ELYS_NULL_PLATFORM="")
    assert "no display" in said
    assert "elys render" in said


def test_the_null_platform_is_a_display_by_request() -> None:
    assert "null platform" in in_process("print(probe_display())")


@pytest.mark.gl
def test_a_window_draws_overlays_as_they_are_written_and_plays_what_is_told() -> None:
    script = """
from elys.bus.messages.session import EventBatch
from elys.bus.messages.sounds import Sound, event_of
from elys.common.components import Overlay, OverlayPanel
from elys.render_node.sound import loudspeaker
made, opened = [], []
class Watched(view_window._Viewer):
    def __init__(self, *arguments):
        super().__init__(*arguments)
        made.append(self)
view_window._Viewer = Watched
class Buffer:
    is_heard = True
    def __init__(self, mix):
        self.mix = mix
        opened.append(self)
    def close(self):
        self.is_heard = False
loudspeaker.Loudspeaker.__init__.__kwdefaults__["open_output"] = Buffer

async def until(met):
    async with asyncio.timeout(60.0):
        while not met():
            await asyncio.sleep(0)

async def main():
    host, session = await open_session()
    task = asyncio.create_task(view_window.run_view(session))
    await until(lambda: made and made[0]._drawn is not None)
    viewer = made[0]
    assert not opened
    shown = len(viewer._shown_at)
    parts = {type(c).__name__: values_of(c) for c in (Overlay(width=0.5, height=0.5), OverlayPanel())}
    spawned = Spawned(entity=2, name="Panel", parent=0, enabled=True, components=parts)
    host.publish(topics.DELTA, SceneDelta(epoch=1, sequence=1, tick=4, changes=(spawned,)))
    await until(lambda: len(viewer._shown_at) > shown and viewer._renderer.planned.overlays)
    host.publish(topics.EVENTS, EventBatch(epoch=1, tick=5, events=(event_of(Sound(sound="chime")),)))
    await until(lambda: opened)
    assert abs(opened[0].mix(4000)).max() > 0.05
    viewer._window.on_event(KeyPressed("m"))
    await until(lambda: viewer.loudspeaker._mixer.volume == 0.0)
    opened[0].mix(1024)
    assert abs(opened[0].mix(4000)).max() == 0.0
    viewer._window.request_close()
    await task
    assert not opened[0].is_heard
    await session.close(); await host.close()
    print("done")
asyncio.run(main())
"""
    assert in_process(script) == "done"
