"""What could not run as it is written is refused as a script's file is loaded, with its line and what to write."""

from __future__ import annotations

import logging

import pytest

from elys.common.errors import ScriptError
from elys.sim_node.scripts import reloading
from elys.sim_node.scripts.library import ScriptLibrary
from elys.sim_node.scripts.reloading import ScriptFiles
from tests.unit.sim_node.scripts.conftest import Playground

HEAD = "from typing import Annotated, Literal\nfrom elys.script import *\n\nclass A(Behaviour):\n    "
# Each begins in line 5.
REFUSED = {
    # Hooks that would never run.
    "def start(self):\n        yield 1": (
        "a.py:5: start has a yield, and would never run: write async def start(self) and await what it waits for"
    ),
    "async def update(self, dt):\n        yield": "a.py:5: update has a yield, and would never run: write async def update(",
    "async def blink(self):\n        yield": (
        "a.py:5: blink has a yield, and nothing could await or begin it: await what it waits for"
    ),
    # Hooks that are called otherwise.
    "def update(self): pass": "a.py:5: update is called with dt: write def update(self, dt)",
    "def start(self, other): pass": "a.py:5: start is called with nothing: write def start(self)",
    "def on_event(): pass": "a.py:5: on_event is called with event: write def on_event(self, event)",
    "def on_trigger_exit(self): pass": "a.py:5: on_trigger_exit is called with other: write def on_trigger_exit(self, oth",
    "def on_contact(self, other): pass": (
        "a.py:5: on_contact is called with other and touch: write def on_contact(self, other, touch)"
    ),
    "async def on_input(self): pass": "a.py:5: on_input is called with player: write async def on_input(self, player)",
    "def update(self, *, dt): pass": "a.py:5: update is called with dt",
    "@staticmethod\n    def update(dt): pass": (
        "a.py:6: update is a staticmethod, and is called as a method: write def update(self, dt)"
    ),
    "@classmethod\n    def start(cls): pass": "a.py:6: start is a classmethod, and is called as a method: write def start(",
    "@property\n    def on_event(self): pass": "a.py:6: on_event is a property, and is called as a method: write def on_",
    "on_event = None": "a.py:5: on_event is no function: write def on_event(self, event)",
    # Defaults that no scene could say.
    'speed: float = "fast"': "a.py:5: the default of A.speed must be a number, not 'fast'",
    "x: int = 0\n    n: int = 1.5": "a.py:6: the default of A.n must be a whole number, not 1.5",
    "is_on: bool = 1": "a.py:5: the default of A.is_on must be true or false, not 1",
    "name: str = None": "a.py:5: the default of A.name must be a text, not None",
    "n: Annotated[float, about('', unit='m', maximum=1.0)] = 7.0": "a.py:5: the default of A.n must be at most 1 m, not 7",
    "mode: Literal['a', 'b'] = 'c'": "a.py:5: the default of A.mode must be one of a, b, not 'c'",
    "mode: Literal[1, 2] = 1": "a.py:5: A.mode has the choices 1, 2: choices are texts, as Literal[",
    "place: Vec3 = 3": "a.py:5: the default of A.place must be 3 numbers, not 3",
    "place: Vec3 = ('a', 1, 2)": "a.py:5: the default of A.place must be a number, not 'a'",
    "turn: Quat = (0, 0, 0, 0)": "a.py:5: the default of A.turn must be a rotation",
    "friend: Entity | None = 1.5": "a.py:5: the default of A.friend must be an entity id",
    "size: bytes = b''": "a.py:5: A.size has type <class 'bytes'>; use float",
    # Names that are taken.
    "world: str = ''": "a.py:5: A.world is what every behaviour has: give the field another name",
    "every: float = 1.0": "a.py:5: A.every is what every behaviour has",
    "start: float = 1.0": "a.py:5: A.start is what every behaviour has",
}


def load(play: Playground, text: str) -> ScriptLibrary:
    (play.folder / "a.py").write_text(text)
    library = ScriptLibrary(play.assets)
    library.load(play.source("a.py", "A"))
    return library


@pytest.mark.parametrize(("body", "said"), REFUSED.items())
def test_what_could_not_run_is_refused_with_its_line(play: Playground, body: str, said: str) -> None:
    with pytest.raises(ScriptError) as refused:
        load(play, HEAD + body + "\n")
    assert said in str(refused.value)


@pytest.mark.parametrize(
    "body",
    [
        "def update(self, *all): pass",
        "def update(self, seconds_of_step, more=1, **named): pass",
        "def on_contact(this, other, touch): pass",
        "async def on_event(self, event: object): pass",
        "def points(self):\n        yield 1",
        "speed: float = 3\n    place: Vec3 = [1, 2, 3]\n    way: Vec3 = Vector(1, 0, 0)\n    turn: Quat = Rotation()",
        "friend: Entity | None = None\n    door: Entity = 'Door'\n    rest: object\n    world: object",
        "mode: Literal['a', 'b'] = 'b'",
        "def _wrapped(function):\n        import functools\n        return functools.wraps(function)(lambda *all: function(*all))"
        "\n    @_wrapped\n    def update(self, dt): pass",
    ],
)
def test_what_can_run_is_loaded(play: Playground, body: str) -> None:
    load(play, HEAD + body + "\n")


def test_an_async_hook_that_could_not_be_kept_is_refused(play: Playground) -> None:
    text = "from elys.script import *\nif True:\n    class A(Behaviour):\n        async def start(self): pass\n"
    with pytest.raises(
        ScriptError, match=r"a\.py:4: start is async, and would never run: an async function of a script"
    ):
        load(play, text)


def test_what_a_base_in_another_file_has_wrong_is_said_of_that_file(play: Playground) -> None:
    base = "from elys.script import *\nclass Base(Behaviour):\n    speed: float = 'fast'\n"
    text = "from base import Base\nclass A(Base):\n    def update(self, dt): pass\n"
    (play.folder / "base.py").write_text(base)
    with pytest.raises(ScriptError, match=r"base\.py:3: the default of A\.speed"):
        load(play, text)
    (play.folder / "base.py").write_text(
        base.replace("'fast'", "1.0") + "    def update(self): pass\n    def start(): pass\n"
    )
    with pytest.raises(ScriptError, match=r"base\.py:5: start is called with nothing"):
        load(play, text)  # its update is never called


def test_a_version_that_is_refused_leaves_the_one_before(play: Playground, caplog: pytest.LogCaptureFixture) -> None:
    text = "class A(Behaviour):\n    n = 0\n    def update(self, dt): self.n += 1\n"
    source = play.write("a.py", text)
    thing = play.spawn(source)
    files = ScriptFiles(play.simulation)
    play.run(2)
    for wrong in (
        text.replace("self, dt", "self"),
        text.replace("n = 0", "n: Vec3 = (1, 'a', 2)"),
        text.replace("n = 0", "log: int = 0"),
    ):
        play.write("a.py", wrong)
        with caplog.at_level(logging.ERROR):
            assert files.reloaded(source, [thing]) is None
        assert "a.py was saved, and the version before goes on: " in caplog.messages[-1]
    play.run(2)
    assert play.on(thing).n == 4
    play.write("a.py", text.replace("+= 1", "+= 10"))
    assert files.reloaded(source, [thing]) is not None


def test_a_file_that_is_gone_is_said_once(
    play: Playground, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = play.write("a.py", "class A(Behaviour):\n    n = 0\n    def update(self, dt): self.n += 1\n")
    thing, files = play.spawn(source), ScriptFiles(play.simulation)
    path = play.folder / "a.py"
    now = [100.0]
    monkeypatch.setattr(reloading.time, "monotonic", lambda: now[0])
    assert not files._have_changed([path])
    path.rename(path.with_suffix(".old"))  # as editors save
    assert not files._have_changed([path])
    path.with_suffix(".old").rename(path)
    assert not files._have_changed([path]) and not caplog.messages
    path.unlink()
    for _ in range(20):
        now[0] += reloading.INTERVAL
        assert not files._have_changed([path, path.with_name("never_there.py")])
    assert [message for message in caplog.messages if "is gone" in message] == [
        f"{path} is gone: its scripts go on as they were loaded. Put it back, or the scene cannot be opened again"
    ]
    play.run(2)
    assert play.on(thing).n == 2
