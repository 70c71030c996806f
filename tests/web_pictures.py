"""The pictures of docs/web.md: the page on the yard in its fall, as a desk and as a telephone show it."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from tests.benchmarks.processes import environment, running
from tests.process.web_pages import Page, open_browser, unused_port

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
TICKS = 110  # much lies, much still falls


def draw_web_pictures(folder: Path) -> None:
    """Draws web.png and web-telephone.png."""
    endpoint = f"tcp/127.0.0.1:{unused_port()}"
    elys = (sys.executable, "-m", "elys")
    simulation = (*elys, "run", "yard", "--headless", "--paused", "--listen", endpoint)
    render = (*elys, "node", "render", "--connect", endpoint)
    web = (*elys, "web", "--connect", endpoint, "--port", str(unused_port()))
    with (
        environment() as env,
        running(simulation, env=env, wait_for="simulating"),
        running(render, env=env, wait_for="drawing views"),
        running(web, env=env, wait_for="to play") as serving,
        open_browser() as browser,
    ):
        assert serving.stdout is not None
        found = re.search(r"http\S+", serving.stdout.readline())
        assert found, "the line after it is for editors"
        draw_desk(browser, found[0], folder / "web.png")
        draw_telephone(browser, found[0], folder / "web-telephone.png")


def draw_desk(browser: object, address: str, path: Path) -> None:
    """Wide and dark: a box is chosen, the figures are shown, time has been led to where much still falls."""
    page = open_on(browser, address, width=1440, height=810, color_scheme="dark")
    page.tab.evaluate(
        """async (count) => {
            const socket = new WebSocket(`ws://${location.host}/ws`);
            await new Promise((open) => (socket.onopen = open));
            socket.send(JSON.stringify({ type: "ask", id: 1, command: { type: "step_ticks", count } }));
        }""",
        TICKS,
    )
    page.until(lambda: page.tick >= TICKS)
    page.tab.fill("#search", "box 8")
    page.tab.click("#tree .name:text-is('Box 8')")
    page.until(lambda: "RigidBody" in page.text("#chosen"))
    page.tab.fill("#search", "")
    page.tab.click('summary:has-text("Collider")')
    page.drag((0.5, 0.8), (0.56, 0.78))
    page.rest()
    page.tab.screenshot(path=str(path))
    print(path)


def draw_telephone(browser: object, address: str, path: Path) -> None:
    """Narrow and light."""
    page = open_on(
        browser, address, width=400, height=780, color_scheme="light", has_touch=True, device_scale_factor=1.5
    )
    page.tab.touchscreen.tap(*page.point(0.5, 0.6))
    page.until(lambda: page.text("#chosen") != "")
    page.rest()
    page.tab.screenshot(path=str(path))
    print(path)


def open_on(browser: object, address: str, *, width: int, height: int, **options: object) -> Page:
    context = browser.new_context(viewport={"width": width, "height": height}, locale="en-US", **options)  # type: ignore[attr-defined]
    page = Page(context)
    page.tab.goto(address)
    page.wait_for_picture()
    return page


if __name__ == "__main__":
    draw_web_pictures(PICTURES)
