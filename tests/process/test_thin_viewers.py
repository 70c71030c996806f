"""`elys view --thin` with a game, a render node and a way between that becomes slow, each a process of its own."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from elys.common.errors import DisplayError
from elys.render_node.gpu import offscreen_context

pytestmark = [pytest.mark.process, pytest.mark.gl]
PROGRAMS = Path(__file__).parent / "programs"
PATIENCE = 60.0  # [s]


@pytest.fixture(scope="module", autouse=True)
def _drawable() -> None:
    try:
        offscreen_context().release()
    except DisplayError as error:
        pytest.skip(str(error))


class Program:
    """One that is told by lines what to do, and says by lines what came of it."""

    def __init__(self, words: tuple[str, ...], environment: dict[str, str]) -> None:
        self.lines: list[str] = []
        self._news = threading.Condition()
        self.process = subprocess.Popen(
            [sys.executable, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**environment, "ELYS_NULL_PLATFORM": "1"},
            cwd=Path(__file__).parents[2],
        )
        threading.Thread(target=self._read, daemon=True).start()

    def say(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def wait_for(self, pattern: str, *, after: int = 0) -> re.Match[str]:
        """The first line that matches of those after so many."""
        deadline = time.monotonic() + PATIENCE
        with self._news:
            while True:
                for line in self.lines[after:]:
                    if found := re.search(pattern, line):
                        return found
                if time.monotonic() > deadline or self.process.poll() is not None:
                    pytest.fail(f"it never said {pattern!r}; it said:\n" + "\n".join(self.lines))
                self._news.wait(0.2)

    def ask(self, line: str, pattern: str) -> re.Match[str]:
        count = len(self.lines)
        self.say(line)
        return self.wait_for(pattern, after=count)

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._news:
                self.lines.append(line.rstrip())
                self._news.notify_all()


@pytest.fixture
def start(environment: dict[str, str]) -> Iterator[Callable[..., Program]]:
    started: list[Program] = []

    def begin(program: str, *words: str) -> Program:
        started.append(Program((str(PROGRAMS / program), *words), environment))
        return started[-1]

    yield begin
    for program in reversed(started):
        program.process.kill()
        program.process.wait()


@pytest.fixture
def ports() -> tuple[int, int]:
    import socket

    with socket.socket() as one, socket.socket() as other:
        one.bind(("127.0.0.1", 0))
        other.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1]), int(other.getsockname()[1])


def test_a_game_is_seen_turned_picked_and_played_from_a_machine_that_draws_nothing(
    start, elys, ports, tmp_path
) -> None:
    port, _ = ports
    endpoint = f"tcp/127.0.0.1:{port}"
    start("game.py", endpoint, str(tmp_path / "game.mcap"))
    player = start("thin_player.py", endpoint)
    player.wait_for("no render node in this session")
    player.wait_for(rf"^ +elys node render --connect {re.escape(endpoint)}$")
    render = elys("node", "render", "--connect", endpoint)
    player.wait_for(r"^picture \d+ \d+ 4")
    assert float(player.ask("turn 10", r"^turned ([\d.]+)$")[1]) > 0.0
    assert player.ask("pick", r"^picked (\w+)   (-?[\d.]+), ")[1] in ("Ball", "Ground")
    applied, seen = player.ask("play d", r"^played ([\d.]+) ([\d.]+)$").groups()
    assert 0.0 < float(applied) <= float(seen)
    player.ask("resize 320 200", "^pictures of 320 200")
    # A render node that dies is told again, and the next goes on where it was.
    count = len(player.lines)
    render.process.send_signal(signal.SIGKILL)
    player.wait_for("no render node in this session", after=count)
    elys("node", "render", "--connect", endpoint)
    player.ask("turn 3", r"^turned")


def test_pictures_become_smaller_while_the_way_carries_little(start, elys, ports, tmp_path, soak: bool) -> None:
    if not soak:
        pytest.skip("judges by the clock what a slow way carries: make soak")
    port, slow = ports
    endpoint = f"tcp/127.0.0.1:{port}"
    start("game.py", endpoint, str(tmp_path / "game.mcap"))
    elys("node", "render", "--connect", endpoint).wait_for("drawing views")
    relay = start("slow_relay.py", str(slow), str(port))
    relay.wait_for("relaying")
    player = start("thin_player.py", f"tcp/127.0.0.1:{slow}")
    player.wait_for("^picture")
    player.ask("turn 30", "^turned")
    relay.ask("150000", "^rate 150000$")
    deadline = time.monotonic() + PATIENCE
    while float(player.ask("encoding", r"^encoding h?\w+ ([\d.]+)$")[1]) == 1.0:
        assert time.monotonic() < deadline, player.lines
        player.ask("turn 5", "^turned")
    assert player.ask("encoding", r"^encoding (\w+) ")[1] == "h264"
    player.ask("resize 500 300", "^pictures of 500 300")  # at rest it becomes as large as the window all the same
