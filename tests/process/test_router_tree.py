"""`launch/tree.toml` as it stands, for a user who has never run anything: a simulation, routers, viewers below them."""

from __future__ import annotations

import asyncio
import os
import signal
from pathlib import Path

import pytest

from elys.common.errors import DisplayError
from elys.render_node.gpu import offscreen_context
from tests.process.clients import Client, client
from tests.process.test_many_processes import LAUNCH, endpoints, fresh_frames

pytestmark = [pytest.mark.process, pytest.mark.gl]
START = 150.0  # [s] that five processes may take on a machine that has other things to do


@pytest.fixture(autouse=True)
def _drawable() -> None:
    try:
        offscreen_context().release()
    except DisplayError as error:
        pytest.skip(str(error))


def children(process: int) -> dict[int, str]:
    """Its children and their command lines."""
    found = {}
    for number in Path(f"/proc/{process}/task/{process}/children").read_text().split():
        found[int(number)] = Path(f"/proc/{number}/cmdline").read_text().replace("\0", " ")
    return found


@pytest.mark.timeout(600)
def test_a_tree_is_launched_without_keys_and_its_routers_come_back(elys, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))  # of this process, which watches
    top, left, right = endpoints(3)
    parameters = ("scene=stack", f"endpoint={top}", f"left_endpoint={left}", f"right_endpoint={right}")
    options = {"ELYS_NULL_PLATFORM": "1", "ELYS_CONFIG_DIR": str(tmp_path / "config")}
    tree = elys("launch", LAUNCH / "tree.toml", *parameters, **options)
    for side in ("left", "right"):
        tree.wait_for(f"{side} router.*session Stack-of-10 .*is here", seconds=START)
    assert "ended with status" not in tree.output  # none had to be started again

    def is_whole(watcher: Client) -> bool:
        nodes = watcher.session.nodes_of
        return watcher.session.connected and len(nodes("router")) == len(nodes("viewer")) == 2

    async def main() -> None:
        async with client(right) as watcher:
            await watcher.until(lambda: is_whole(watcher), seconds=START)
            await fresh_frames(watcher)
            before = {node.id for kind in ("router", "viewer") for node in watcher.session.nodes_of(kind)}
            (router,) = [pid for pid, line in children(tree.process.pid).items() if f"router --listen {right}" in line]
            os.kill(router, signal.SIGKILL)
            await watcher.until(lambda: not watcher.session.connected)
            await watcher.until(lambda: is_whole(watcher), seconds=START)
            watcher.frames.clear()
            await fresh_frames(watcher)
            after = {node.id for kind in ("router", "viewer") for node in watcher.session.nodes_of(kind)}
            assert len(before - after) == 1  # one router is another; the viewers are those that they were

    asyncio.run(main())
    started = children(tree.process.pid)
    assert len(started) == 5
    tree.process.send_signal(signal.SIGINT)
    tree.wait(seconds=START)
    assert "Traceback" not in tree.output and "cannot" not in tree.output
    assert not [pid for pid in started if Path(f"/proc/{pid}").exists()]
