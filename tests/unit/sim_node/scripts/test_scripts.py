"""Behaviours on entities: their hooks, their fields, what they await, what they remember, and what goes wrong in them."""

from __future__ import annotations

import logging
from dataclasses import replace

import msgspec
import pytest

from elys.bus.marker_log import markers_of_events
from elys.bus.messages.commands import Input
from elys.bus.messages.session import EventBatch
from elys.common.components import Collider, RigidBody, Script, Transform
from elys.common.errors import ScriptError
from elys.sim_node.scripts import runner
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.state import State
from tests.unit.sim_node.scripts.conftest import Playground


def test_hooks_are_called_in_their_order(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def __init__(self): self.calls = ["init"]
            def start(self): self.calls.append("start")
            def fixed_update(self, dt): self.calls.append(f"fixed {dt * 60:g}")
            def update(self, dt): self.calls.append("update")
            def on_destroy(self): print_out.append("destroyed")
        print_out = []
        """,
    )
    thing = play.spawn(source)
    play.run(2)
    one = play.on(thing)
    assert one.calls == ["init", "start", "fixed 1", "update", "fixed 1", "update"]
    one.entity.destroy()
    play.run()
    assert not play.simulation.world.is_alive(thing)
    assert type(one).on_destroy.__globals__["print_out"] == ["destroyed"]


def test_fields_take_what_the_component_says_and_refuse_the_rest(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            speed: Annotated[float, about("How fast.", unit="m/s", minimum=0.0, maximum=9.0)] = 2.0
            count: int = 3
            place: Vec3 = (1.0, 2.0, 3.0)
            friend: Entity | None = None
            own = 5
        """,
    )
    friend = play.simulation.world.spawn([Transform()], name="Friend")
    first = play.spawn(source, "First", speed=4, friend="Friend")
    second = play.spawn(source, "Second")
    for name, values, expected in (
        ("fast", {"speed": 10.0}, "a.py:A.speed must be at most 9 m/s, not 10"),
        ("worded", {"count": "many"}, "a.py:A.count must be a whole number, not 'many'"),
        ("unknown", {"sped": 1.0}, "a.py:A has no field 'sped'; it has speed, count, place, friend"),
        ("alone", {"friend": "Nobody"}, "Nobody"),
    ):
        wrong = play.spawn(source, name, **values)
        play.run()
        assert expected in play.failure(wrong)
    one, other = play.on(first), play.on(second)
    assert (one.speed, one.count, one.friend.id) == (4.0, 3, friend)
    assert (other.speed, other.place, other.friend) == (2.0, (1.0, 2.0, 3.0), None)
    play.simulation.world.set_fields(first, Script, {"values": {"speed": 1.0}})
    play.run()
    assert (one.speed, one.friend) == (1.0, None)


def test_awaiting_takes_simulation_time(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            async def start(self):
                self.seen = []
                await seconds(0.5)
                self.seen.append(("seconds", self.world.tick))
                told = await event("door", "window")
                self.seen.append((told.kind, told.values["open"], self.world.tick))
                await until(lambda: self.world.tick >= 50)
                self.seen.append(("until", self.world.tick))
                found = await all_of(self.later(3), self.later(1))
                self.seen.append(found)
                found = await first_of(self.later(5), event("never"), self.later(2))
                self.seen.append(found)
            async def later(self, count):
                await ticks(count)
                return count
        """,
    )
    thing = play.spawn(source)
    play.run(40)
    play.on(thing).world.emit("door", open=True)
    play.run(30)
    assert play.on(thing).seen == [("seconds", 30), ("door", True, 40), ("until", 50), [3, 1], (2, 2)]


def test_triggers_and_contacts_are_heard_on_both_sides(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self): self.heard, self.stayed = [], 0
            def on_trigger_enter(self, other): self.heard.append(("enter", other.name))
            def on_trigger_stay(self, other): self.stayed += 1
            def on_trigger_exit(self, other): self.heard.append(("exit", other.name))
            def on_contact(self, other, touch): self.heard.append((other.name, round(touch.normal.y), touch.speed > 1.0))
        """,
    )
    high = Transform(position=(0.0, 4.0, 0.0))
    ball = play.spawn(source, "Ball", high, RigidBody(), Collider(shape="sphere"))
    gate = play.spawn(source, "Gate", Transform(position=(0.0, 2.5, 0.0)), Collider(is_trigger=True))
    ground = play.spawn(source, "Ground", Transform(position=(0.0, -0.5, 0.0)), Collider(size=(9.0, 1.0, 9.0)))
    play.run(90)
    assert play.on(ball).heard[:3] == [("enter", "Gate"), ("exit", "Gate"), ("Ground", 1, True)]
    assert play.on(gate).heard == [("enter", "Ball"), ("exit", "Ball")]
    assert play.on(gate).stayed == play.on(ball).stayed > 3
    assert play.on(ground).heard[0] == ("Ball", -1, True)


def test_what_awaits_is_kept_rewound_and_goes_on_the_same(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        import dataclasses
        @dataclasses.dataclass
        class Step:
            number: int
            friend: object
        class A(Behaviour):
            async def start(self):
                self.steps, self.shared = [], {}
                mine = self.shared
                for number in range(100):
                    try:
                        await self.entity.move_to(Vector(self.random.random(), number, 0), duration=0.15)
                        self.steps.append(Step(number, self.entity))
                        mine["last"] = number
                    finally:
                        mine["tried"] = number
        """,
    )
    thing = play.spawn(source)

    def on() -> list[object]:
        found = []
        for _ in range(60):
            play.run()
            one = play.on(thing)
            found.append((one.entity.position, dict(one.shared), [(s.number, s.friend) for s in one.steps]))
        return found

    play.run(77)
    state = play.simulation.capture()
    first = on()
    play.simulation.restore(state)
    assert on() == first
    play.simulation.restore(State.from_bytes(state.to_bytes()))
    assert on() == first


def test_an_error_switches_off_its_script_and_nothing_else(play: Playground, caplog: pytest.LogCaptureFixture) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            wrong: bool = False
            n = 0
            def update(self, dt):
                if self.wrong and self.n == 2:
                    return 1 / 0
                self.n += 1
        """,
    )
    things = [play.spawn(source, f"T{number}", wrong=number == 1) for number in range(3)]
    with caplog.at_level(logging.ERROR):
        play.run(5)
    assert [play.on(thing).n for thing in things] == [5, 2, 5]
    assert "a.py:9: ZeroDivisionError: division by zero" in play.failure(things[1])
    assert "a.py:A of entity 2 'T1' is off" in caplog.text
    # Switched off and on again it runs, from where it stood.
    play.on(things[1]).n = 3
    play.simulation.world.set_fields(things[1], Script, {"enabled": False})
    play.run()
    play.simulation.world.set_fields(things[1], Script, {"enabled": True})
    play.run(4)
    assert play.on(things[1]).n == 7


WRONG = {
    "class A(Behaviour:\n    pass": "a.py:3: invalid syntax, at `class A(Behaviour:`",
    "import nothing_like_it": "a.py:3: there is no module 'nothing_like_it': put nothing_like_it.py beside",
    "x = 1": "a.py has no behaviour: derive a class from elys.script.Behaviour",
    "class A(Behaviour): pass\nclass B(Behaviour): pass": "a.py has the behaviours A, B: say which, as a.py#A",
    "class A(Behaviour):\n    size: bytes = b''": "A.size has type <class 'bytes'>; use float, int, bool",
    "import b\nclass A(Behaviour): pass": "import one another in a circle",
    "class A(Behaviour):\n    async def start(self):\n        x = 1 + await ticks(1)": (
        "a.py:5, in A.start: await stands alone"
    ),
    "class A(Behaviour):\n    async def start(self):\n        with open('x') as f:\n            await ticks(1)": (
        "await cannot stand inside `with`"
    ),
    "class A(Behaviour):\n    def start(self):\n        raise SystemExit": "a.py:5: SystemExit",
    "class A(Behaviour):\n    def start(self):\n        self.x = bytearray(1 << 50)": "a.py:5: MemoryError",
    "class A(Behaviour):\n    def start(self):\n        self.start()": "RecursionError",
    "class A(Behaviour):\n    async def start(self):\n        await 5": "cannot wait for a int",
    "raise SystemExit": "a.py:3: SystemExit",
    "class A(Behaviour):\n    def __init__(self): raise ValueError('no')": "a.py:4: ValueError: no",
    "class A(Behaviour):\n    def start(self): raise ValueError('\\ud800')": "ValueError: \\ud800",
    "class A(Behaviour):\n    def start(self): self.world.emit('x', a='\\ud800')": "surrogates not allowed",
    "class A(Behaviour):\n    def start(self): self.world.emit('x', a=(object(),))": "a of the event 'x' must be a number",
    "class A(Behaviour):\n    def start(self): self.entity.name = '\\ud800'": "surrogates not allowed",
    "class A(Behaviour):\n    def start(self): self.entity.name = 5": "a name is a text of at most 200 characters",
    "class A(Behaviour):\n    def start(self): self.entity.set('Script', source='\\ud800')": "which is no character",
}


@pytest.mark.parametrize(("text", "said"), WRONG.items())
def test_scripts_that_cannot_run_say_where_and_what_to_do(play: Playground, text: str, said: str) -> None:
    (play.folder / "b.py").write_text("from a import A\n")
    thing = play.spawn(play.write("a.py", text))
    other = play.spawn(
        play.write("good.py", "class G(Behaviour):\n    n: int = 0\n    def update(self, dt): self.n += 1")
    )
    play.run(3)
    events = play.simulation.take_events()
    msgspec.json.encode(events)  # as the bus does
    told = [event.values["text"] for event in events if event.kind == "script" and event.entity == thing]
    assert len(told) == 1 and said in told[0]
    markers = markers_of_events(EventBatch(epoch=1, tick=1, events=tuple(events)), 0.0)
    assert [marker.entity for marker in markers if marker.kind == "error"] == [thing]  # a timeline's filter of errors
    assert play.on(other).n == 3


def test_a_script_that_does_not_come_back_is_ended(play: Playground, monkeypatch: pytest.MonkeyPatch) -> None:
    play.simulation.scripts.watchdog._limit = 0.3
    thing = play.spawn(play.write("a.py", "class A(Behaviour):\n    def update(self, dt):\n        while True: pass"))
    other = play.spawn(
        play.write("good.py", "class G(Behaviour):\n    n: int = 0\n    def update(self, dt): self.n += 1")
    )
    play.run(3)
    assert "did not come back" in play.failure(thing)
    assert play.on(other).n == 3


def test_a_file_that_does_not_come_back_as_it_is_loaded_is_ended(
    play: Playground, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "LOADING_LIMIT", 0.3)
    thing = play.spawn(play.write("a.py", "while True: pass\nclass A(Behaviour): pass"))
    other = play.spawn(
        play.write("good.py", "class G(Behaviour):\n    n: int = 0\n    def update(self, dt): self.n += 1")
    )
    play.run(3)
    assert "did not come back within 0.3 s as it was loaded" in play.failure(thing)
    assert play.on(other).n == 3


def test_a_state_of_before_there_were_scripts_can_be_gone_back_to(play: Playground) -> None:
    state = play.simulation.capture()
    values = {path: value for path, value in state.values.items() if not path.startswith("scripts/")}
    assert len(values) == len(state.values) - 4  # who runs, what was told, who holds time, and pushes that wait
    play.simulation.restore(replace(state, values=values))
    play.run()


def test_what_waits_in_code_that_is_no_more_is_off_and_all_else_goes_on(play: Playground) -> None:
    thing = play.spawn(play.write("a.py", "class A(Behaviour):\n    async def start(self):\n        await seconds(9)"))
    other = play.spawn(
        play.write("good.py", "class G(Behaviour):\n    n: int = 0\n    def update(self, dt): self.n += 1")
    )
    play.run(3)
    state = play.simulation.capture()
    loaded = play.simulation.scripts.library.load(play.simulation.world.get(thing, Script).source)
    loaded.modules.programs.clear()
    play.simulation.restore(state)
    play.run(2)
    assert play.on(other).n == 5
    assert "was changed or taken away since it began" in play.simulation.scripts._running[thing].failure


def test_a_file_saved_anew_goes_on_with_what_it_remembers(play: Playground) -> None:
    from elys.sim_node.scripts.reloading import ScriptFiles

    text = """
    class A(Behaviour):
        async def start(self):
            self.n = 0
            while True:
                await ticks(1)
                self.n += 1
        def update(self, dt): self.version = "old"
    """
    source = play.write("a.py", text)
    thing = play.spawn(source)
    play.run(5)
    files = ScriptFiles(play.simulation)
    (play.folder / "a.py").write_text("class A(")
    assert files.reloaded(source, [thing]) is None  # said in the console; the old one goes on
    play.write("a.py", text.replace("old", "new"))
    command = files.reloaded(source, [thing])
    assert command is not None
    play.simulation.world.set_fields(thing, Script, command.values)
    one = play.on(thing)
    play.run(3)
    assert play.on(thing) is one
    assert (one.version, one.n) == ("new", 7)


def test_scripts_of_strangers_do_not_run(play: Playground, monkeypatch: pytest.MonkeyPatch) -> None:
    from elys.common import trust

    monkeypatch.setattr(trust, "_here", set())
    text = "from pathlib import Path\nPath(__file__).with_name('ran').touch()\nclass A(Behaviour): pass"
    thing = play.spawn(play.write("a.py", text))
    play.run()
    assert "are not trusted" in play.failure(thing)
    assert not (play.folder / "ran").exists()
    with pytest.raises(ScriptError, match="elys trust"):
        play.simulation.scripts.require_trust()
    trust.remember(play.folder)
    play.simulation.scripts.require_trust()


def test_what_cannot_be_kept_is_said_and_disturbs_nothing(play: Playground, caplog: pytest.LogCaptureFixture) -> None:
    thing = play.spawn(
        play.write(
            "a.py", "class A(Behaviour):\n    def start(self):\n        self.file = open(__file__)\n        self.n = 4"
        )
    )
    play.run()
    with caplog.at_level(logging.ERROR):
        state = play.simulation.capture()
        play.simulation.capture()
    assert caplog.text.count("self.file is a TextIOWrapper, which cannot be kept") == 1
    play.on(thing).file.close()
    play.simulation.restore(state)
    assert play.on(thing).n == 4 and not hasattr(play.on(thing), "file")


def test_a_class_that_a_script_imports_finds_those_that_run_as_it(play: Playground) -> None:
    door = play.write("door.py", "class Door(Behaviour):\n    def start(self): self.opened = 0\n")
    bell = play.write(
        "bell.py",
        """
        from door import Door

        class Bell(Behaviour):
            def update(self, dt):
                for door in self.world.behaviours(Door):
                    door.opened += 1
                self.own = self.world.find("Door").script(Door).opened
        """,
    )
    play.spawn(door, "Door"), play.spawn(bell, "Bell"), play.spawn(bell, "Other")
    play.run(3)
    assert play.on(play.simulation.scripts.behaviours_of(Behaviour)[0].entity.id).opened == 6
    assert [one.own for one in play.simulation.scripts.behaviours_of(Behaviour)[1:]] == [5, 6]


def test_scripts_read_actions_and_keep_what_they_read(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def __init__(self): self.jumps = 0
            def fixed_update(self, dt):
                player = self.world.input(2)
                self.jump, self.move = player.action("jump"), player.vector("move")
                if self.jump.was_pressed:
                    self.jumps += 1
            async def start(self):
                await until(lambda: self.world.input(2).action("use").is_down)
                self.world.input(2).axis("fly")
        """,
    )
    thing = play.spawn(source)
    play.run()
    play.simulation.inputs.take(Input(player=2, changes=(("space", True), ("d", True))))
    play.run(3)
    one = play.on(thing)
    assert (one.jumps, one.jump.is_down, one.move.x) == (1, True, 1.0)
    play.simulation.restore(State.from_bytes(play.simulation.capture().to_bytes()))
    one = play.on(thing)
    assert (one.jump.is_down, one.jump.was_pressed, tuple(one.move)) == (True, False, (1.0, 0.0))
    play.simulation.inputs.take(Input(player=2, changes=(("e", True),)))
    play.run(2)
    assert "there is no axis 'fly': the scene declares none" in play.failure(thing)
