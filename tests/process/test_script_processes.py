"""Scripts in real sessions: saved files that go on in their new version, events over the bus, and who is trusted."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.process.conftest import Command, Elys, wait_until
from tests.process.terminals import Terminal

pytestmark = [pytest.mark.process]
COUNTER = """
from elys.script import *

class Counter(Behaviour):
    def start(self):
        self.count = 0
        self.log("version 1 begins")

    def update(self, dt):
        self.count += 1

    def on_event(self, event):
        if event.kind == "asked":
            self.log(f"version 1 has {'counted' if self.count > 10 else 'begun'}, {event.values['why']}")
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "level").mkdir()
    (tmp_path / "level" / "counter.py").write_text(COUNTER)
    counter = {"name": "Counter", "components": {"Transform": {}, "Script": {"source": "counter.py#Counter"}}}
    path = tmp_path / "level" / "a.scene.json"
    path.write_text(json.dumps({"elys_scene": 1, "entities": [counter]}))
    return path


@pytest.fixture
def environment(environment: dict[str, str], tmp_path: Path) -> dict[str, str]:
    """With a list of trusted folders of the test's own, which is empty."""
    return {**environment, "ELYS_CONFIG_DIR": str(tmp_path / "config"), "ELYS_TRUST_SCRIPTS": ""}


def hosted(elys: Elys, scene: Path, port: int, *words: str) -> tuple[Command, str]:
    endpoint = f"tcp/127.0.0.1:{port}"
    run = elys("run", scene, "--headless", "--listen", endpoint, *words)
    run.wait_for("simulating")
    return run, endpoint


def test_a_file_that_is_saved_goes_on_in_its_new_version_with_what_it_remembers(
    elys: Elys, scene: Path, free_port: int
) -> None:
    run, endpoint = hosted(elys, scene, free_port, "--trust", "--record", "it.mcap")
    run.wait_for("version 1 begins")
    file = scene.parent / "counter.py"

    def ask() -> None:
        told = elys("tell", "asked", "why=because", "--to", "Counter", "--connect", endpoint)
        assert told.wait() == 0, told.output

    while not any("version 1 has counted, because" in line for line in run.lines):
        ask()
    file.write_text(COUNTER.replace("version 1", "version 2").replace("self.count += 1", "pass"))
    run.wait_for("counter.py was saved: 1 scripts go on in the new version")
    ask()
    run.wait_for("version 2 has counted, because")  # and does not count any more: what it remembers is of before
    assert not any("version 2 begins" in line for line in run.lines)
    file.write_text("this is no Python")
    run.wait_for("counter.py was saved, and the version before goes on: .*counter.py:1: ")
    ask()
    wait_until(lambda: sum("version 2 has counted" in line for line in run.lines) == 2)
    run.end()
    verified = elys("verify", "it.mcap", "--trust")
    assert verified.wait() == 0, verified.output


def test_an_event_that_is_told_by_hand_is_heard_or_refused_with_a_sentence(
    elys: Elys, scene: Path, free_port: int
) -> None:
    run, endpoint = hosted(elys, scene, free_port, "--trust")
    heard = elys("topic", "echo", "events", "--connect", endpoint)
    while not any('"kind":"opened"' in line for line in heard.lines):  # whoever listens late has missed some
        told = elys("tell", "opened", "speed=2.5", "far=true", "name=a b", "--connect", endpoint)
        assert told.wait() == 0, told.output
        assert "told at tick" in told.output
    line = next(line for line in heard.lines if '"kind":"opened"' in line)
    assert '"values":{"speed":2.5,"far":true,"name":"a b"}' in line
    for words, said in (
        (("paused",), "'paused' is told by the host alone"),
        (("opened", "speed"), "'speed' is no value of an event: write NAME=VALUE"),
        (("opened", "--to", "Nobody"), "there is no entity called 'Nobody'"),
        (("opened", 'a={"b": 1}'), "a of the event 'opened' must be a number"),
    ):
        refused = elys("tell", *words, "--connect", endpoint)
        assert refused.wait() == 1
        assert said in refused.output and "Traceback" not in refused.output
    assert "Traceback" not in run.output


# --- trust ---------------------------------------------------------------------------------------------------------------


@pytest.fixture
def terminal(environment: dict[str, str], tmp_path: Path) -> Iterator[list[Terminal]]:
    opened: list[Terminal] = []
    yield opened
    for each in opened:
        each.close()


def answered(opened: list[Terminal], scene: Path, environment: dict[str, str], answer: bytes) -> Terminal:
    words = ("run", str(scene), "--headless", "--steps", "3")
    opened.append(Terminal(words, environment, scene.parent))
    opened[-1].wait_for("This scene has scripts: .*counter.py")
    opened[-1].wait_for(r"\[y/N\]")
    opened[-1].press(answer)
    assert opened[-1].wait() == 0, opened[-1].text
    return opened[-1]


@pytest.mark.parametrize("answer", [b"n\r", b"\r"])
def test_scripts_of_a_scene_do_not_run_where_the_answer_is_no(
    terminal: list[Terminal], scene: Path, environment: dict[str, str], answer: bytes, elys: Elys
) -> None:
    run = answered(terminal, scene, environment, answer)
    assert "version 1 begins" not in run.text and "are not trusted" in run.text
    listed = elys("trust")
    assert listed.wait() == 0 and "no folder is trusted" in listed.output


def test_scripts_run_now_and_from_now_on_where_the_answer_is_yes(
    terminal: list[Terminal], scene: Path, environment: dict[str, str], elys: Elys
) -> None:
    run = answered(terminal, scene, environment, b"y\r")
    assert "version 1 begins" in run.text
    again = elys("run", scene, "--headless", "--steps", "3")
    assert again.wait() == 0 and "version 1 begins" in again.output and "This scene has scripts" not in again.output
    listed = elys("trust", "--json")
    assert listed.wait() == 0 and json.loads(listed.output) == [str(scene.parent)]


def test_nobody_is_asked_where_nobody_can_answer_and_folders_are_trusted_and_forgotten_by_hand(
    scene: Path, elys: Elys
) -> None:
    unasked = elys("run", scene, "--headless", "--steps", "3")  # its input is no terminal
    assert unasked.wait() == 0
    assert "the scene's scripts do not run, for nobody has trusted them" in unasked.output
    assert "version 1 begins" not in unasked.output and "[y/N]" not in unasked.output
    assert elys("trust", scene.parent).wait() == 0
    trusted = elys("run", scene, "--headless", "--steps", "3")
    assert trusted.wait() == 0 and "version 1 begins" in trusted.output
    assert elys("trust", scene.parent, "--forget").wait() == 0
    forgotten = elys("run", scene, "--headless", "--steps", "3")
    assert forgotten.wait() == 0 and "version 1 begins" not in forgotten.output
    for words, said in (
        ((scene.parent, "--forget"), "is not trusted anyhow"),
        ((scene.parent / "nowhere",), "there is no folder"),
    ):
        refused = elys("trust", *words)
        assert refused.wait() == 1 and said in refused.output and "Traceback" not in refused.output
