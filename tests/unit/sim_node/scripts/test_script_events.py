"""Events of scripts: typed by classes, told over the bus by a command, and refused with a sentence where they do not fit."""

from __future__ import annotations

import logging
import re
from typing import Any

import pytest

from elys.bus.messages.commands import Tell
from elys.bus.messages.session import Event
from elys.common.errors import RequestError
from elys.common.ids import Entity
from elys.sim_node.state import State
from elys.sim_node.systems.apply_commands import apply_command
from tests.unit.sim_node.scripts.conftest import Playground

EVENTS = """
from typing import NamedTuple
import msgspec
from elys.script import *

class DoorOpened(NamedTuple):
    door: Entity
    speed: float = 1.0
    place: Vec3 = (0.0, 0.0, 0.0)

class Scored(msgspec.Struct):
    points: int
    by: "Entity | None" = None
"""
HEARS = """
from events import DoorOpened, Scored
class Hears(Behaviour):
    def start(self): self.heard = []
    def on_event(self, event: DoorOpened | Scored): self.heard.append(event)
"""
WAITS = """
from events import DoorOpened
class Waits(Behaviour):
    async def start(self):
        self.heard = []
        while True:
            told = await event(DoorOpened, "stop")
            self.heard.append(told)
"""


CHECKS = """
from elys.script import *
import msgspec

class Score(msgspec.Struct):
    points: int

    def __post_init__(self):
        if self.points < 0:
            raise ValueError("nobody has less than nothing")
        while self.points == 13:
            pass
"""
HEARS_SCORES = """
from scores import Score
class HearsScores(Behaviour):
    def start(self): self.heard = []
    def on_event(self, event: Score): self.heard.append(event.points)
"""


def nested(depth: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(depth - 1):
        value = [value]
    return value


def teller(play: Playground, text: str) -> int:
    (play.folder / "events.py").write_text(EVENTS)
    lines = f"        if self.world.tick == 1: {text}"
    return play.spawn(
        play.write(
            "teller.py",
            f"from events import DoorOpened, Scored\nclass T(Behaviour):\n    def fixed_update(self, dt):\n{lines}",
        ),
        "Teller",
    )


def test_a_class_is_told_and_heard_as_what_it_is_by_hooks_and_who_waits(play: Playground) -> None:
    told = teller(play, "self.world.emit(DoorOpened(self.entity, 2, Vector(1, 2, 3)))")
    hears, waits = play.spawn(play.write("h.py", HEARS)), play.spawn(play.write("w.py", WAITS))
    play.run(3)
    for listener in (hears, waits):
        (heard,) = play.on(listener).heard
        assert type(heard).__name__ == "DoorOpened" and type(heard.speed) is float
        assert heard.door.id == told and heard.speed == 2.0 and heard.place.y == 2.0
    events = [event for event in play.simulation.take_events() if event.kind == "door_opened"]
    assert events == [
        Event(kind="door_opened", values={"door": told, "speed": 2.0, "place": (1.0, 2.0, 3.0)})
    ]  # plain on the bus


def test_a_struct_is_an_event_too_and_its_defaults_need_not_be_told(play: Playground) -> None:
    teller(play, "self.world.emit('scored', points=3)")
    hears = play.spawn(play.write("h.py", HEARS))
    play.run(3)
    (heard,) = play.on(hears).heard
    assert (type(heard).__name__, heard.points, heard.by) == ("Scored", 3, None)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("self.world.emit(DoorOpened('here'))", "DoorOpened.door (event 'door_opened'): expected int, got str"),
        (
            "self.world.emit(DoorOpened(self.entity, speed='fast'))",
            "DoorOpened.speed (event 'door_opened'): expected fl",
        ),
        ("self.world.emit(DoorOpened())", "missing 1 required positional argument: 'door'"),
        ("self.world.emit(DoorOpened(self.entity), speed=3.0)", "emit() takes the values of a DoorOpened from itself"),
        ("self.world.emit('door_opened', dor=1)", "DoorOpened (event 'door_opened'): it"),
        ("self.world.emit('scored')", "Scored (event 'scored'): it lacks points"),
        ("self.world.emit('scored', points=1, name='x')", "Scored (event 'scored'): it has no name"),
        ("self.world.emit(5)", "emit() takes the name of an event, or a named tuple or Struct, not a int"),
    ],
)
def test_wrong_fields_and_types_are_refused_where_they_are_told(play: Playground, text: str, said: str) -> None:
    told = teller(play, text)
    hears = play.spawn(play.write("h.py", HEARS))
    play.run(3)
    failure = play.failure(told)
    assert "teller.py:6: TypeError: " in failure and said in failure
    assert play.on(hears).heard == []


def test_what_a_listener_that_comes_later_cannot_take_is_said_and_not_heard(
    play: Playground, caplog: pytest.LogCaptureFixture
) -> None:
    told = teller(play, "self.world.emit('door_opened', speed='fast')")
    waits = play.spawn(play.write("w.py", WAITS), "Waiter")
    play.run(3)
    assert play.on(told) and play.on(waits).heard == []  # both go on
    assert "DoorOpened" in caplog.text and "is not heard" in caplog.text


def test_a_wait_for_a_class_is_part_of_a_state(play: Playground) -> None:
    told = teller(play, "self.world.emit(DoorOpened(self.entity))")
    waits = play.spawn(play.write("w.py", WAITS))
    play.run(1)
    state = State.from_bytes(play.simulation.capture().to_bytes())
    play.run(3)
    assert len(play.on(waits).heard) == 1
    later = play.simulation.state_hash()
    play.simulation.restore(state)
    play.run(3)
    (heard,) = play.on(waits).heard
    assert type(heard).__name__ == "DoorOpened" and heard.door.id == told
    assert play.simulation.state_hash() == later


def test_who_waits_hears_what_is_told_to_him_behind_what_is_told_to_others(play: Playground) -> None:
    source = play.write(
        "w.py",
        """
        class Waits(Behaviour):
            async def start(self):
                self.heard = []
                while True:
                    told = await event("hit")
                    self.heard.append(told.values["by"])
        """,
    )
    first, second, third = (play.spawn(source) for _ in range(3))
    play.run()
    for entity, by in ((first, "a"), (first, "b"), (second, "c"), (0, "d"), (third, "e")):
        apply_command(play.simulation, Tell(kind="hit", entity=entity, values={"by": by}))
    play.run()
    assert [play.on(entity).heard for entity in (first, second, third)] == [["a"], ["c"], ["d"]]


def test_a_command_tells_scripts_an_event(play: Playground) -> None:
    teller(play, "pass")
    hears, waits = play.spawn(play.write("h.py", HEARS)), play.spawn(play.write("w.py", WAITS))
    plain = play.spawn(
        play.write(
            "p.py",
            """
            class P(Behaviour):
                def start(self): self.heard = []
                def on_event(self, event): self.heard.append((event.kind, dict(event.values)))
            """,
        )
    )
    play.run(2)
    apply_command(play.simulation, Tell(kind="door_opened", values={"door": hears, "place": [1, 2, 3]}))
    apply_command(play.simulation, Tell(kind="stop", entity=waits, values={"why": [1, "x", None]}))
    state = play.simulation.capture()  # told and not heard yet
    play.run()
    assert play.on(hears).heard[0].place.z == 3.0
    assert [getattr(told, "kind", "door_opened") for told in play.on(waits).heard] == ["door_opened"]
    assert play.on(plain).heard == [("door_opened", {"door": hears, "place": (1, 2, 3)})]  # the other was not for it
    after = play.simulation.state_hash()
    play.simulation.restore(state)
    play.run()
    assert play.simulation.state_hash() == after


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (Tell(kind=""), "1 to 200 characters"),
        (Tell(kind="x" * 201), "1 to 200 characters"),
        (Tell(kind="script"), "told by the host alone"),
        (Tell(kind="sound"), "told by the host alone"),
        (Tell(kind="x", entity=999), "there is no entity 999"),
        (Tell(kind="x", values={"a": {"b": 1}}), "a of the event 'x' must be a number, a text or a tuple of such"),
        (Tell(kind="x", values={"a": [float("nan")]}), "must be finite"),
        (Tell(kind="x", values={"a": 10**30}), "must be finite"),
        (Tell(kind="x", values={"a": "x" * 70_000}), "may take 64 KB"),
        (Tell(kind="x", values={"a": nested(9)}), "may lie 8 deep"),
        (Tell(kind="x", values={"a": nested(800)}), "may lie 8 deep"),
        (Tell(kind="door_opened", values={"door": "here"}), "DoorOpened.door (event 'door_opened'): expected int"),
        (Tell(kind="scored", values={}), "it lacks points"),
    ],
)
def test_what_nobody_may_tell_is_refused_with_a_sentence(play: Playground, told: Tell, said: str) -> None:
    teller(play, "pass")
    hears, waits = play.spawn(play.write("h.py", HEARS)), play.spawn(play.write("w.py", WAITS))
    play.run(2)
    before = play.simulation.state_hash()
    with pytest.raises(RequestError, match=re.escape(said)):
        apply_command(play.simulation, told)
    assert play.simulation.state_hash() == before
    play.run()
    assert play.on(hears).heard == play.on(waits).heard == []


@pytest.fixture
def hears_scores(play: Playground, monkeypatch: pytest.MonkeyPatch) -> Entity:
    """A listener to a class that has code of its own."""
    monkeypatch.setattr(play.simulation.scripts.watchdog, "_allowed", 0.3)
    monkeypatch.setattr(play.simulation.scripts.watchdog, "_limit", 0.3)
    (play.folder / "scores.py").write_text(CHECKS)
    hears = play.spawn(play.write("h.py", HEARS_SCORES))
    play.run(2)
    return hears


@pytest.mark.parametrize(
    ("points", "said"), [(-1, "ValueError: nobody has less than nothing"), (13, "did not come back within 0.3 s")]
)
def test_a_class_whose_own_code_fails_is_told_nothing(
    play: Playground, hears_scores: Entity, points: int, said: str
) -> None:
    with pytest.raises(RequestError, match=said):
        apply_command(play.simulation, Tell(kind="score", values={"points": points}))
    apply_command(play.simulation, Tell(kind="score", values={"points": 4}))
    play.run()
    assert play.on(hears_scores).heard == [4]


def test_a_class_whose_own_code_fails_where_it_is_heard_ends_its_listener_at_most(
    play: Playground, hears_scores: Entity, caplog: pytest.LogCaptureFixture
) -> None:
    def happens(points: int) -> None:
        play.simulation.scripts.hear([Event(kind="score", values={"points": points})])
        play.run()

    with caplog.at_level(logging.ERROR):
        happens(-1)
    assert "does not hear an event: Score (event 'score') is not made of that" in caplog.text
    happens(4)
    assert play.on(hears_scores).heard == [4]
    happens(13)
    assert "did not come back" in play.failure(hears_scores)
    play.run()


def test_classes_and_structs_are_remembered_and_no_other_objects(
    play: Playground, caplog: pytest.LogCaptureFixture
) -> None:
    (play.folder / "events.py").write_text(EVENTS)
    source = play.write(
        "a.py",
        """
        from events import DoorOpened, Scored
        class Own: pass
        class A(Behaviour):
            def start(self): self.kind, self.score, self.own = DoorOpened, Scored(4, self.entity), Own()
        """,
    )
    thing = play.spawn(source)
    play.run()
    with caplog.at_level(logging.ERROR):
        state = play.simulation.capture()
    assert "self.own is a Own, which cannot be kept" in caplog.text
    one: Any = play.on(thing)
    one.score.points = 9
    play.simulation.restore(state)
    again = play.on(thing)
    assert again.kind.__name__ == "DoorOpened" and again.score.points == 4 and again.score.by.id == thing
