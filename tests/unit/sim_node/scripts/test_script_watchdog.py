"""Scripts that do not come back: ended where they stand, with their line; and what cannot be ended is said."""

from __future__ import annotations

import logging
import signal
import subprocess
import sys
import threading

import pytest

from elys.sim_node.scripts import runner
from tests.unit.sim_node.scripts.conftest import Playground

COUNTS = """
class B(Behaviour):
    n = 0
    def update(self, dt): self.n += 1
"""
# What a call does, after the line `def update(self, dt):`, which is the 8th of the file.
STUCK = {
    "a loop": "while True: pass",
    "a regular expression": 're.match(r"(a+)+$", "a" * 60 + "b")',
    "sleep": "time.sleep(1e6)",
    "a lock held twice": "lock.acquire(); lock.acquire()",
    "an event of a thread": "threading.Event().wait()",
    "a large number": "7 ** (7 ** 12)",
}


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="there are no signals to threads")
@pytest.mark.parametrize("text", STUCK.values(), ids=STUCK.keys())
def test_what_is_stuck_is_ended_with_its_line(play: Playground, text: str) -> None:
    play.simulation.scripts.watchdog._limit = 0.3
    source = play.write(
        "a.py",
        f"""
        import re, threading, time
        lock = threading.Lock()
        class A(Behaviour):
            def update(self, dt):
                {text}
        """,
    )
    thing, other = play.spawn(source), play.spawn(play.write("b.py", COUNTS), "Good")
    play.run(3)
    assert f"{play.folder / 'a.py'}:8: it did not come back within 0.3 s" in play.failure(thing)
    assert play.on(other).n == 3
    assert signal.getitimer(signal.ITIMER_VIRTUAL) == (0.0, 0.0)  # nothing comes after scripts are through


def test_an_error_that_a_script_swallows_is_raised_again(play: Playground) -> None:
    play.simulation.scripts.watchdog._limit = 0.2
    source = play.write(
        "a.py",
        """
        import time
        class A(Behaviour):
            caught = 0
            def update(self, dt):
                while self.caught < 3:
                    try:
                        time.sleep(1e6)
                    except BaseException:
                        self.caught += 1
                while True: pass
        """,
    )
    thing = play.spawn(source)
    play.run(2)
    assert "a.py:13: it did not come back within 0.2 s" in play.failure(thing)
    assert play.simulation.scripts._running[thing].itself.caught == 3  # type: ignore[union-attr]


CATCHES = {
    "a loop in a loop": """
        while True:
            try:
                while True: pass
            except BaseException: pass""",
    "a sleep": """
        while True:
            try: time.sleep(1e6)
            except BaseException: continue""",
    "what is done finally": """
        while True:
            try:
                try: time.sleep(1e6)
                finally:
                    try: time.sleep(1e6)
                    except BaseException: self.never_ending()
            except BaseException: pass""",
    "a question to the engine": """
        while True:
            try:
                while True: self.world.find("nobody")
            except BaseException: pass""",
}


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="there are no signals to threads")
@pytest.mark.parametrize("body", CATCHES.values(), ids=CATCHES.keys())
def test_what_catches_everything_is_ended_all_the_same(play: Playground, body: str) -> None:
    play.simulation.scripts.watchdog._limit = 0.2
    text = f"""import time
class A(Behaviour):
    def update(self, dt):{body}

    def never_ending(self):
        while True:
            try: time.sleep(1e6)
            except BaseException: pass
"""
    thing, other = play.spawn(play.write("a.py", text)), play.spawn(play.write("b.py", COUNTS), "Good")
    play.run(3)
    said = play.failure(thing)
    assert "a.py:" in said and "it did not come back within 0.2 s" in said
    assert play.on(other).n == 3
    assert signal.getitimer(signal.ITIMER_VIRTUAL) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("body", "line"),
    [
        ("while self.is_on:\n            if not self.is_on:\n                await ticks(1)", 7),  # cut into steps
        ("n = 0\n        while True:\n            n += 1", 8),  # one block
    ],
)
def test_an_async_function_that_loops_without_await_is_ended_with_its_line(
    play: Playground, body: str, line: int
) -> None:
    play.simulation.scripts.watchdog._limit = 0.3
    text = f"class A(Behaviour):\n    is_on = True\n    async def start(self):\n        {body}\n"
    thing, other = play.spawn(play.write("a.py", text)), play.spawn(play.write("b.py", COUNTS), "Good")
    play.run(3)
    said = play.failure(thing)
    assert "a.py:" in said and "it did not come back within 0.3 s" in said
    assert abs(int(said.partition("a.py:")[2].partition(":")[0]) - line) <= 1  # wherever in the loop it stood
    assert play.on(other).n == 3


def test_a_file_that_is_stuck_as_it_is_loaded_is_said_with_its_line(
    play: Playground, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "LOADING_LIMIT", 0.3)
    thing = play.spawn(play.write("a.py", "import time\ntime.sleep(1e6)\nclass A(Behaviour): pass"))
    play.run(2)
    assert "a.py:4: the file did not come back within 0.3 s as it was loaded" in play.failure(thing)


def test_what_cannot_be_interrupted_is_said_once_while_it_is_stuck(
    play: Playground, caplog: pytest.LogCaptureFixture
) -> None:
    """In another thread than the main one no signal comes: there a lock is waited for until somebody lets go of it."""
    said = threading.Event()

    class Listens(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.set()

    source = play.write(
        "a.py",
        """
        import threading
        gate = threading.Event()
        class A(Behaviour):
            calls = 0
            def update(self, dt):
                self.calls += 1
                if self.calls == 2: gate.wait()
        """,
    )
    play.simulation.scripts.watchdog._limit = 0.2
    thing = play.spawn(source, "Gate")
    play.run()  # here, where a signal would come
    listener = Listens()
    logger = logging.getLogger("elys.sim_node.scripts.watchdog")
    logger.addHandler(listener)
    try:
        running = threading.Thread(target=play.run)
        running.start()
        assert said.wait(60.0)
        script = play.simulation.scripts._running[thing].script
        assert script is not None
        next(vars(module)["gate"] for module in script.modules.loaded() if "gate" in vars(module)).set()
        running.join(60.0)
    finally:
        logger.removeHandler(listener)
    assert not running.is_alive()
    told = [record.getMessage() for record in caplog.records if "does not come back" in record.getMessage()]
    assert len(told) == 1
    assert "a.py:A of entity 1 'Gate'" in told[0]
    assert f"{play.folder / 'a.py'}:10" in told[0] and "The simulation stands until it ends" in told[0]
    assert "a.py:10: it did not come back" in play.failure(thing)


PROGRAM = """
import sys
from pathlib import Path
from elys.common import trust
from elys.common.assets.scripts import read_script
from elys.common.assets.store import AssetStore
from elys.common.components import Script, Transform
from elys.sim_node.scripts import watchdog
from elys.sim_node.simulation import Simulation

watchdog.NATIVE_LIMIT = 1.0
folder = Path(sys.argv[1])
trust.trust(folder)
assets = AssetStore()
simulation = Simulation(assets=assets)
simulation.world.spawn([Transform(), Script(source=read_script(folder / "a.py", "", assets))], name="Sum")
simulation.scripts.watchdog._limit = 1.0
with watchdog.native_calls_said():
    for _ in range(2):
        simulation.step()
(event,) = [event for event in simulation.take_events() if event.kind == "script"]
print(event.values["text"])
"""


def test_a_call_that_lets_no_python_run_is_said_on_stderr_and_ended_after_it(play: Playground) -> None:
    play.write(
        "a.py",
        """
        import time
        class A(Behaviour):
            n = 0
            def update(self, dt):
                self.n += 1
                time.sleep(0.5)
                if self.n == 2: sum(range(200_000_000))
        """,
    )
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(play.folder)], capture_output=True, text=True, timeout=200, check=True
    )
    assert 'a.py", line 10 in update' in ran.stderr  # by a thread of C's, while nothing else could run
    assert "a.py:10: it did not come back within 1 s" in ran.stdout
