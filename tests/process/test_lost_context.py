"""A render node whose driver loses the context: it says so once and ends, and its supervisor starts it again."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest

from elys.bus import topics
from elys.bus.messages.session import LogLine
from elys.bus.messages.views import ViewCamera, ViewFrame, ViewRequest
from elys.common.errors import DisplayError
from elys.render_node.gpu import offscreen_context
from tests.process.clients import client
from tests.process.conftest import Command

pytestmark = [pytest.mark.process, pytest.mark.gl]
PROGRAM = Path(__file__).parent / "programs" / "losing_render.py"
SUPERVISE = """
import sys
from pathlib import Path
from elys.launch import fill_in, read_launch_file, run_processes
sys.exit(run_processes(fill_in(read_launch_file(Path(sys.argv[1])), {})))
"""


@pytest.fixture(autouse=True)
def _drawable() -> None:
    try:
        offscreen_context().release()
    except DisplayError as error:
        pytest.skip(str(error))


def test_a_lost_context_is_said_once_and_the_next_render_node_draws(elys, environment, free_port, tmp_path) -> None:
    endpoint, mark = f"tcp/127.0.0.1:{free_port}", tmp_path / "lost"
    words = [sys.executable, str(PROGRAM), endpoint, str(mark)]
    (tmp_path / "it.toml").write_text(f'[[process]]\nname = "render"\ncommand = {words!r}\nrestart = "on-crash"\n')
    elys("run", "stack", "--headless", "--paused", "--listen", endpoint).wait_for("simulating")
    prefix = (sys.executable, "-c", SUPERVISE)
    supervisor = Command((str(tmp_path / "it.toml"),), environment, tmp_path, prefix=prefix)
    try:
        asyncio.run(drawn_again(endpoint))
    finally:
        supervisor.end()
    assert mark.exists()
    said = [line for line in supervisor.lines if "lost the context" in line and "│" in line]
    assert len(said) == 1, supervisor.output
    assert "drawing a picture failed: the driver has lost the context" in said[0]
    assert sum("ended with status 1" in line for line in supervisor.lines) == 1
    assert "Traceback" not in supervisor.output


async def drawn_again(endpoint: str) -> None:
    """Wants pictures of whoever draws, until one comes that was asked for after the context was lost."""
    camera = ViewCamera(position=(0.0, 2.0, 8.0), rotation=(0.0, 0.0, 0.0, 1.0))
    losses: list[LogLine] = []
    sequence, asked_after = 0, 1 << 30

    def heard(line: LogLine, _: str) -> None:
        nonlocal asked_after
        if "lost the context" in line.text:
            losses.append(line)
            asked_after = sequence

    async with client(endpoint) as viewer:
        session, frames = viewer.session, list[ViewFrame]()
        session.subscribe(topics.VIEW_FRAME, lambda frame, _: frames.append(frame))
        session.subscribe(topics.LOG, heard)
        async with asyncio.timeout(60):
            while not (frames and frames[-1].sequence > asked_after):
                await viewer.until(lambda: bool(session.nodes_of("render")))
                sequence += 1
                asked = ViewRequest(view="eye", sequence=sequence, camera=camera, width=48, height=32)
                session.publish(topics.VIEW_REQUEST, asked, key=session.nodes_of("render")[-1].id)
                for _ in range(100):
                    await asyncio.sleep(0.01)
                    if frames and frames[-1].sequence == sequence:
                        break
    assert len(losses) == 1
