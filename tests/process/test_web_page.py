"""`elys web` in a real browser: what a person sees, clicks and types, and what becomes of it in the session."""

from __future__ import annotations

import asyncio
import concurrent.futures
import http.server
import json
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.bus import topics
from elys.common.errors import DisplayError
from elys.render_node.gpu import offscreen_context
from tests.process.clients import client
from tests.process.web_pages import Page, Served, component_of, names_of, open_browser

pytestmark = [pytest.mark.process, pytest.mark.gl]
SIZE = {"width": 900, "height": 560}
MANY = 50_000


def thing(name: str, position: list[float], **components: Any) -> dict[str, Any]:
    return {"name": name, "components": {"Transform": {"position": position}, **components}}


def glowing(color: list[float]) -> dict[str, Any]:
    return {"MeshRenderer": {}, "Material": {"base_color": [0.0, 0.0, 0.0], "emissive": color}}


SCENE = {
    "elys_scene": 1,
    "name": "Two boxes",
    "settings": {"background": [0.0, 0.0, 0.2]},
    "entities": [
        thing("Eye", [0.0, 0.0, 5.0], Camera={}),
        thing("Red", [-1.2, 0.0, 0.0], **glowing([1.0, 0.0, 0.0])),
        thing("Green", [1.2, 0.0, 0.0], **glowing([0.0, 1.0, 0.0])),
        thing("Ball", [0.0, 40.0, -60.0], RigidBody={}, Collider={"shape": "sphere"}),
    ],
}


@pytest.fixture(scope="module", autouse=True)
def _drawable() -> None:
    try:
        offscreen_context().release()
    except DisplayError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser() as opened:
        yield opened


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    made = Served(tmp_path)
    yield made
    made.end()


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory, browser: Any) -> Iterator[Served]:
    """One session with two boxes, for all tests that leave it as it was."""
    made = Served(tmp_path_factory.mktemp("boxes"))
    try:
        (made.folder / "two.scene.json").write_text(json.dumps(SCENE))
        made.host("run", "two.scene.json", "--headless", "--realtime", "--paused")
        made.serve()
        yield made
    finally:
        made.end()


@pytest.fixture
def open_page(browser: Any) -> Iterator[Any]:
    contexts = []

    def open_(address: str, **options: Any) -> Page:
        context = browser.new_context(viewport=SIZE, locale="en-US", **options)
        contexts.append(context)
        page = Page(context)
        page.tab.goto(address)
        return page

    yield open_
    for context in contexts:
        context.close()


def test_a_picture_arrives_and_follows_the_hand(boxes, open_page):
    page = open_page(boxes.addresses["watch"])
    page.wait_for_picture()
    page.until(lambda: page.text("#scene") == "Two boxes")
    assert "secret" not in page.tab.url  # it is not left standing in the address
    page.until(lambda: page.canvas()[..., 0].max() > 150)
    before = page.canvas()
    height, width, _ = before.shape
    left, right = before[height // 2, width // 4], before[height // 2, 3 * width // 4]
    assert left[0] > 150 > left[1] and right[1] > 150 > right[0]  # red on the left, green on the right
    assert page.text("#inspector") == "Click on something in the view or in the tree."
    page.drag((0.5, 0.6), (0.5, 0.7))  # seen from farther above
    page.until(lambda: np.abs(page.canvas() - before).mean() > 2.0)
    turned = page.rest()
    page.tab.mouse.wheel(0, 400)
    page.until(lambda: (page.canvas()[..., 0] > 150).sum() < 0.7 * (turned[..., 0] > 150).sum())  # farther, so smaller
    page.tab.click("#camera")
    page.until(lambda: np.abs(page.canvas() - before).mean() < 2.0)
    assert page.said == []


def test_pictures_come_as_h264_where_they_can_be_decoded_and_as_jpeg_if_wanted(boxes, open_page):
    page = open_page(boxes.addresses["watch"])
    page.wait_for_picture()
    page.tab.click("#figures-switch")
    can = page.tab.evaluate(
        "async () => 'VideoDecoder' in self && (await VideoDecoder.isConfigSupported({codec: 'avc1.42c028'})).supported"
    )
    page.until(lambda: ("H.264" if can else "JPEG") in page.text("#figures"))
    video = page.canvas()
    page.tab.select_option("#quality", "jpeg")
    page.until(lambda: "JPEG" in page.text("#figures"))
    page.until(lambda: np.abs(page.canvas() - video).mean() < 4.0)  # the same colours, but for what coding loses


def test_a_click_chooses_what_is_seen_there(boxes, open_page):
    page = open_page(boxes.addresses["watch"])
    page.wait_for_picture()
    for share, name in ((0.25, "Red"), (0.75, "Green")):
        plain = page.canvas()
        page.tab.mouse.click(*page.point(share, 0.5))
        page.until(lambda name=name: page.text("#chosen") == f"{name} · MeshRenderer · Material")
        page.until(lambda name=name: page.text('#tree [aria-selected="true"] .name') == name)
        assert page.tab.input_value("#entity-name") == name
        assert "Material" in page.text("#inspector")
        page.until(lambda plain=plain: np.abs(page.canvas() - plain).max() > 60)  # outlined
    page.tab.mouse.click(*page.point(0.5, 0.9))
    page.until(lambda: page.text("#chosen") == "")


def test_time_is_led_from_the_page(boxes, open_page):
    page = open_page(boxes.addresses["edit"])
    page.until(lambda: page.tick >= 0)
    page.tab.click("#play")
    page.until(lambda: page.tick > 60 and page.text("#state") == "playing")
    page.tab.keyboard.press("Space")  # the button has the keyboard: it is pressed once, and not twice
    page.until(lambda: page.text("#state") == "paused")
    at = settled_tick(page, boxes)
    page.tab.click("#step")
    page.until(lambda: page.tick == at + 1)
    page.tab.click("#picture", position={"x": 5, "y": 5})
    page.tab.keyboard.press(".")
    page.until(lambda: page.tick == at + 2)
    page.tab.keyboard.press(",")
    page.until(lambda: page.tick == at + 1 and page.text("#state") == "the past, paused")
    box = page.tab.locator("#scrub").bounding_box()
    page.tab.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + box["height"] / 2)
    page.until(lambda: abs(page.tick - (at + 2) / 2) < 0.1 * at)
    assert settled_tick(page, boxes) == page.tick
    page.tab.click("#now")
    page.until(lambda: page.tick == at + 2 and page.text("#state") == "paused")


def settled_tick(page: Page, served: Served) -> int:
    """At which tick the session stands, as another node hears it; the page says the same."""

    async def listen(joined: Any) -> int:
        await joined.until(lambda: joined.status is not None and not joined.status.playing)
        return int(joined.status.tick)

    tick = served.ask(listen)
    page.until(lambda: page.tick == tick)
    return tick


def test_an_edit_arrives_in_the_simulation_and_is_undone(boxes, open_page):
    page = open_page(boxes.addresses["edit"])
    page.tab.click('#tree .line:has-text("Ball")')
    field = page.tab.locator("#field-RigidBody-mass")
    field.fill("7.5")
    field.press("Enter")
    page.until(lambda: component_of(boxes, "Ball", "RigidBody").mass == 7.5)
    field.fill("-1")
    field.press("Enter")
    page.until(lambda: "must be at least" in page.text("#refusal"))
    page.until(lambda: field.input_value() == "7.5")  # what holds is shown again
    field.fill("heavy")
    field.press("Enter")
    page.until(lambda: field.get_attribute("aria-invalid") == "true")
    page.tab.click("#undo")
    page.until(lambda: component_of(boxes, "Ball", "RigidBody").mass == 1.0)
    page.tab.select_option("#field-RigidBody-motion", "kinematic")
    page.until(lambda: component_of(boxes, "Ball", "RigidBody").motion == "kinematic")
    page.tab.click("#undo")
    page.until(lambda: component_of(boxes, "Ball", "RigidBody").motion == "dynamic")
    page.tab.fill("#entity-name", "Globe")
    page.tab.press("#entity-name", "Enter")
    page.until(lambda: "Globe" in names_of(boxes))
    page.tab.click("#undo")
    page.until(lambda: "Ball" in names_of(boxes))


SAY = """async (message) => {
    const socket = new WebSocket(`ws://${location.host}/ws`);
    await new Promise((open) => (socket.onopen = open));
    socket.send(message);
    return await new Promise((resolve) => {
        socket.onclose = ({ code, reason }) => resolve({ code, reason });
        socket.onmessage = ({ data }) => {
            const told = typeof data === "string" ? JSON.parse(data) : {};
            if (told.type === "answer") resolve(told);
        };
    });
}"""


def test_a_viewer_can_neither_edit_nor_lead_time_nor_play(boxes, open_page):
    page = open_page(boxes.addresses["watch"])
    page.tab.click('#tree .line:has-text("Red")')
    page.until(lambda: page.tab.locator("#inspector input").count() > 5)
    assert page.text("#role") == "viewer"
    assert page.tab.locator("#inspector :is(input, select):not(:disabled)").count() == 0
    for button in ("play", "step", "back", "scrub", "rate", "undo", "redo", "game"):
        assert page.tab.is_disabled(f"#{button}"), button
    entity = int(page.tab.locator('#tree [aria-selected="true"]').get_attribute("data-entity"))
    forged = {"type": "ask", "id": 1, "command": {"type": "rename", "entity": entity, "name": "Mine"}}
    answer = page.tab.evaluate(SAY, json.dumps(forged))
    assert (answer["accepted"], answer["reason"]) == (False, "this takes the role editor; yours is viewer")
    keys = page.tab.evaluate(SAY, json.dumps({"type": "keys", "changes": [["w", True]]}))
    assert keys["reason"] == "this takes the role player; yours is viewer"
    nonsense = page.tab.evaluate(SAY, '{"type": "look"}')
    assert nonsense["code"] == 1008 and nonsense["reason"].startswith("this is no request")
    assert "Red" in names_of(boxes)
    page.until(lambda: page.text("#link-text").endswith("ms"))  # its own connection goes on


def test_only_the_right_secret_lets_in(boxes, open_page):
    page = open_page(f"{boxes.url}#secret=wrong")
    page.until(lambda: page.tab.is_visible("#login"))
    page.tab.fill("#secret", "wrong again")
    page.tab.press("#secret", "Enter")
    page.until(lambda: page.text("#login-wrong") == "this is no secret of this session")
    assert page.text("#scene") == ""
    page.tab.fill("#secret", boxes.addresses["edit"].partition("=")[2])
    page.tab.press("#secret", "Enter")
    page.until(lambda: page.text("#role") == "editor")
    page.tab.reload()  # the cookie is enough from now on
    page.until(lambda: page.text("#scene") == "Two boxes")
    assert page.tab.evaluate("document.cookie") == ""


def test_another_page_in_the_same_browser_gets_nothing(boxes, open_page):
    page = open_page(boxes.addresses["edit"])
    page.until(lambda: page.text("#role") == "editor")
    with foreign_page() as address:
        page.tab.goto(address)
        got = page.tab.evaluate(
            """async (url) => {
                const socket = new WebSocket(url.replace("http", "ws") + "ws");
                const opened = await new Promise((resolve) => {
                    socket.onopen = () => resolve(true);
                    socket.onerror = () => resolve(false);
                });
                const read = await fetch(url + "me", { credentials: "include" }).then(() => true, () => false);
                const plain = { method: "POST", body: "{}", mode: "no-cors" };
                const login = await fetch(url + "login", plain).then(() => true, () => false);
                return [opened, read, login, await framed(url)];

                async function framed(url) {
                    const frame = Object.assign(document.createElement("iframe"), { src: url });
                    document.body.append(frame);
                    await new Promise((loaded) => (frame.onload = loaded));
                    try { return frame.contentDocument?.title ?? "blocked"; } catch { return "blocked"; }
                }
            }""",
            boxes.url,
        )
    assert got == [False, False, False, "blocked"]


class _Foreign(http.server.BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>Elsewhere</title>")

    def log_message(self, *_: Any) -> None:
        pass


class foreign_page:
    """A page at another port of this machine, to which the browser sends the same cookies."""

    def __enter__(self) -> str:
        self._server = http.server.HTTPServer(("127.0.0.1", 0), _Foreign)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        return f"http://127.0.0.1:{self._server.server_address[1]}/"

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()


def test_keys_reach_the_game_while_the_view_has_them(boxes, open_page):
    page = open_page(boxes.addresses["edit"])  # who may edit may play
    page.wait_for_picture()
    heard: list[Any] = []
    ready, done = threading.Event(), threading.Event()

    async def listen() -> None:
        async with client(boxes.endpoint) as joined:
            joined.session.subscribe(topics.COMMANDS, lambda record, _: heard.append(record.command))
            ready.set()
            while not done.is_set():
                await asyncio.sleep(0.01)

    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        listening = pool.submit(asyncio.run, listen())
        assert ready.wait(30)
        page.tab.click("#game")
        page.until(lambda: page.tab.is_visible("#game-note") and page.text("#state") == "playing")
        page.tab.keyboard.down("w")
        page.until(lambda: ("w", True) in [one for keys in inputs(heard) for one in keys.changes])
        page.tab.mouse.move(*page.point(0.4, 0.4))
        page.tab.mouse.move(*page.point(0.6, 0.4), steps=3)
        page.until(lambda: sum(keys.moved.get("pointer_x", 0.0) for keys in inputs(heard)) > 20.0)
        page.tab.keyboard.press("Escape")
        page.until(lambda: any(keys.lets_go for keys in inputs(heard)))
        assert not page.tab.is_visible("#game-note")
        done.set()
        listening.result(30)
    page.tab.keyboard.press("Space")
    page.until(lambda: page.text("#state") == "paused")


def inputs(commands: list[Any]) -> list[Any]:
    return [command for command in list(commands) if type(command).__name__ == "Input"]


def test_on_a_telephone_everything_is_there(boxes, open_page):
    page = open_page(boxes.addresses["edit"], has_touch=True)
    page.tab.set_viewport_size({"width": 400, "height": 780})
    page.wait_for_picture()
    assert page.tab.evaluate("document.documentElement.scrollWidth") <= 400
    for selector in ("#picture", "#play", "#step", "#scrub", "#clock", "#tree", "#search", "#age", "#link"):
        box = page.tab.locator(selector).bounding_box()
        assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= 400, selector
    page.tab.touchscreen.tap(*page.point(0.2, 0.5))
    page.until(lambda: page.text("#chosen").startswith("Red"))
    page.tab.click("#tab-inspector")
    assert page.tab.is_visible("#entity-name") and not page.tab.is_visible("#tree")
    page.tab.keyboard.press("ArrowLeft")
    page.until(lambda: page.tab.is_visible("#tree"))


def test_the_page_speaks_french_and_light(boxes, open_page):
    page = open_page(boxes.addresses["watch"], color_scheme="light")
    page.until(lambda: page.text("#role") == "viewer")
    light = page.picture_of("#tree-panel").mean()
    page.tab.select_option("#language", "fr")
    page.until(lambda: page.text("#role") == "spectateur")
    assert page.tab.get_attribute("#play", "title") == "Lecture ou pause (Espace)"
    assert page.tab.get_attribute("html", "lang") == "fr"
    page.tab.reload()
    page.until(lambda: page.text("#role") == "spectateur")  # it is remembered
    page.tab.emulate_media(color_scheme="dark")
    assert page.picture_of("#tree-panel").mean() < 80 < 180 < light


def test_fifty_thousand_entities_are_opened_searched_and_walked_through(served, open_page):
    groups = [
        {"name": f"Group {g}", "children": [{"name": f"Leaf {g * 1000 + n}"} for n in range(1000)]} for g in range(50)
    ]
    (served.folder / "many.scene.json").write_text(json.dumps({"elys_scene": 1, "name": "Many", "entities": groups}))
    served.host("run", "many.scene.json", "--headless", "--realtime", "--paused")
    served.serve()
    page = open_page(served.addresses["watch"])
    lines = page.tab.locator("#tree .line")
    page.until(lambda: page.text("#tree .name:text-is('Group 1')") == "Group 1")
    page.until(lambda: page.text("#entity-count").replace(",", "") == str(MANY + 50))
    page.tab.locator('#tree .line:has-text("Group 0") .arrow').click()
    page.until(lambda: page.tab.is_visible("#tree .name:text-is('Leaf 0')"))
    assert lines.count() < 100  # only what is in sight
    page.tab.locator("#tree").press("End")
    page.until(lambda: page.tab.is_visible("#tree .name:text-is('Group 49')"))
    assert page.tab.evaluate("document.getElementById('tree-lines').offsetHeight") == 26 * (50 + 1000)
    page.tab.fill("#search", "leaf 4999")
    page.until(lambda: page.text("#search-note") == "15 found")  # four that end so, and 49990 to 49999, and 4999 itself
    assert page.tab.is_visible("#tree .name:text-is('Leaf 49990')")
    page.tab.fill("#search", "q:x")
    page.until(lambda: "there is no filter q:" in page.text("#search-note"))
    page.tab.fill("#search", "")
    page.until(lambda: page.text("#search-note") == "")
    page.tab.locator("#tree").press("End")
    page.until(lambda: page.text('#tree [aria-selected="true"] .name') == "Group 49")
    page.tab.locator("#tree").press("ArrowRight")
    page.until(lambda: page.tab.is_visible("#tree .name:text-is('Leaf 49000')"))
    page.tab.locator("#tree").press("ArrowDown")
    page.until(lambda: page.text('#tree [aria-selected="true"] .name') == "Leaf 49000")
    page.tab.locator("#tree").press("ArrowLeft")
    page.until(lambda: page.text('#tree [aria-selected="true"] .name') == "Group 49")
    assert page.said == []


def test_the_page_outlives_the_simulation_and_the_web_node(served, open_page):
    (served.folder / "two.scene.json").write_text(json.dumps(SCENE))
    words = ("run", "two.scene.json", "--headless", "--realtime", "--paused")
    simulation = served.host(*words)
    served.serve()
    page = open_page(served.addresses["edit"])
    page.wait_for_picture()
    page.tab.click('#tree .line:has-text("Red")')
    simulation.kill()
    page.until(lambda: "The session has ended" in page.text("#banner"))
    assert page.text("#link-text") == "lost"
    assert page.canvas().max() > 0  # what was seen last stays
    SCENE_AFTER = json.loads(json.dumps(SCENE))
    SCENE_AFTER["entities"][2]["components"]["Material"]["emissive"] = [0.0, 0.0, 1.0]
    (served.folder / "two.scene.json").write_text(json.dumps(SCENE_AFTER))
    served.host(*words)
    page.until(lambda: page.text("#banner") == "" and page.text("#link-text") != "lost")
    height, width, _ = page.canvas().shape
    page.until(lambda: page.canvas()[height // 2, 3 * width // 4, 2] > 150)  # what was green is blue in this run
    page.tab.click("#play")
    page.until(lambda: page.tick > 5)


def test_when_the_web_node_goes_it_is_said(served, open_page):
    (served.folder / "two.scene.json").write_text(json.dumps(SCENE))
    served.host("run", "two.scene.json", "--headless", "--realtime", "--paused")
    web = served.serve("--insecure", "--role", "viewer")
    address = re.search(r"http://\S+", web.output)
    assert address
    page = open_page(address[0])
    page.wait_for_picture()
    assert page.text("#role") == "viewer"
    web.kill()
    page.until(lambda: "The web node does not answer" in page.text("#banner"))
    port = address[0].rstrip("/").rpartition(":")[2]
    served.start("web", "--connect", served.endpoint, "--port", port, "--insecure").wait_for("for everybody")
    page.until(lambda: page.text("#banner") == "" and page.text("#role") == "owner")


def test_a_recording_is_played_and_scrubbed_but_not_edited(served, open_page):
    (served.folder / "two.scene.json").write_text(json.dumps(SCENE))
    recording = served.start("run", "two.scene.json", "--headless", "--steps", "180", "--record", "run.mcap")
    assert recording.wait() == 0, recording.output
    served.host("play", "run.mcap", "--paused", says="playing|serving|paused|at tcp")
    served.serve()
    page = open_page(served.addresses["edit"])
    page.wait_for_picture()
    page.until(lambda: page.text("#state") == "recording, paused")
    page.tab.click('#tree .line:has-text("Ball")')
    page.until(lambda: page.tab.locator("#inspector input").count() > 5)
    assert page.tab.locator("#inspector :is(input, select):not(:disabled)").count() == 0
    page.tab.locator("#scrub").press("End")
    page.until(lambda: page.tick >= 179)
    page.tab.locator("#scrub").press("Home")
    page.until(lambda: 0 <= page.tick <= 1)
    first = page.tick
    page.tab.click("#step")
    page.until(lambda: page.tick == first + 1)
    page.tab.click("#loop")
    page.until(lambda: page.tab.get_attribute("#loop", "aria-pressed") == "true")
    page.tab.click("#play")
    page.until(lambda: page.tick > 20 and page.text("#state") == "recording, playing")
