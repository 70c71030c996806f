"""What scripts of people in a hurry do: it works, or one sentence says what was wrong, and nothing else is harmed."""

from __future__ import annotations

import logging
import signal
from pathlib import Path

import numpy as np
import pytest

from elys.bus.log import LONGEST, readable
from elys.common import garbage, trust
from elys.common.components import Collider, RigidBody, Transform
from elys.common.scene import open_scene
from elys.sim_node.scripts import runner
from elys.sim_node.simulation import Simulation
from elys.sim_node.state import State

from .conftest import Playground

COUNTS = """
class Counts(Behaviour):
    n = 0
    def update(self, dt):
        self.n += 1
"""


@pytest.mark.parametrize("kind", ["Exception", "BaseException"])
@pytest.mark.parametrize("how", ["def start(self):", "async def start(self):\n        await ticks(1)"])
def test_an_error_whose_own_text_fails_ends_its_script_alone(play: Playground, how: str, kind: str) -> None:
    text = f"""
class Worse({kind}):
    pass
class Bad(Exception):
    def __str__(self):
        raise Worse()
    __repr__ = __str__
class A(Behaviour):
    {how}
        raise Bad()
"""
    thing, other = play.spawn(play.write("a.py", text)), play.spawn(play.write("b.py", COUNTS), "Good")
    play.run(4)
    said = play.failure(thing)
    assert "a.py:" in said and "Bad: its own text cannot be had (Worse)" in said
    assert play.on(other).n == 4


@pytest.mark.parametrize("error", ["KeyboardInterrupt", "GeneratorExit", "asyncio.CancelledError", "SystemExit", "Own"])
@pytest.mark.parametrize(
    "where",
    [
        "    raise {}()",
        "    def start(self):\n        raise {}()",
        "    def update(self, dt):\n        raise {}('now')",
        "    async def start(self):\n        await ticks(1)\n        raise {}()",
    ],
)
def test_no_kind_of_error_ends_more_than_its_script(play: Playground, where: str, error: str) -> None:
    text = f"import asyncio\nclass Own(BaseException): pass\nclass A(Behaviour):\n{where.format(error)}\n"
    thing, other = play.spawn(play.write("a.py", text)), play.spawn(play.write("b.py", COUNTS), "Good")
    play.run(4)
    said = play.failure(thing)
    assert error.rpartition(".")[2] in said and "a.py:" in said
    assert play.on(other).n == 4


@pytest.mark.parametrize("handler", ["default", "of elys"])
def test_who_presses_ctrl_c_while_a_script_runs_ends_the_session(play: Playground, handler: str) -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler if handler == "default" else garbage._interrupt)
    thing = play.spawn(
        play.write(
            "a.py",
            """
            import signal
            class A(Behaviour):
                def update(self, dt):
                    signal.raise_signal(signal.SIGINT)
            """,
        )
    )
    try:
        with pytest.raises(KeyboardInterrupt):
            play.run(2)
    finally:
        signal.signal(signal.SIGINT, before)
    assert not play.failure(thing)


def test_an_error_whose_text_never_comes_is_ended(play: Playground) -> None:
    play.simulation.scripts.watchdog._limit = 0.2
    text = """
    class Bad(Exception):
        def __str__(self):
            while True: pass
    class A(Behaviour):
        def start(self):
            raise Bad()
    """
    thing = play.spawn(play.write("a.py", text))
    play.run(2)
    assert "a.py:9: Bad: its own text cannot be had (ScriptTimeout)" in play.failure(thing)


BULLETS = """
class Gun(Behaviour):
    def {hook}:
        if self.world.tick == 2:
            bullet = self.world.spawn(
                components.Transform(position=(0, 5, 0)),
                components.RigidBody(mass=2.0, gravity_scale=0.0, linear_damping=0.0),
                components.Collider(shape="sphere", radius=0.5),
                name="Bullet",
            )
            bullet.apply_impulse((3, 0, 0))
            bullet.apply_impulse((0, 1, 0), at=(0, 5, 0))
"""


@pytest.mark.parametrize("hook", ["fixed_update(self, dt)", "update(self, dt)"])
def test_what_was_spawned_in_this_tick_can_be_struck(play: Playground, hook: str) -> None:
    play.spawn(play.write("gun.py", BULLETS.replace("{hook}", hook)))
    play.run(3)
    state = play.simulation.capture()
    play.run(3)
    world = play.simulation.world
    bullet = next(entity for entity in play.simulation.scripts.named("Bullet"))
    assert np.allclose(world.get(bullet, RigidBody).linear_velocity, (1.5, 0.5, 0.0), atol=1e-6)
    place = world.get(bullet, Transform).position
    play.simulation.restore(State.from_bytes(state.to_bytes()))  # the strike may still wait then
    play.run(3)
    assert world.get(bullet, Transform).position == place


def test_what_has_no_body_at_all_says_so(play: Playground, caplog: pytest.LogCaptureFixture) -> None:
    thing = play.spawn(
        play.write("a.py", "class A(Behaviour):\n    def start(self): self.entity.apply_force((1, 0, 0))")
    )
    play.run()
    assert "a.py:4: entity 1 'Thing' has no RigidBody, so nothing can push it: give it one" in play.failure(thing)
    off = play.spawn(play.source("a.py"), "Nowhere", RigidBody(), Collider())
    play.simulation.world.remove(off, Transform)
    play.run()
    assert "was pushed, and has no body" in caplog.text


@pytest.mark.parametrize("wrong", ["float('nan')", "float('inf')"])
def test_a_push_that_is_no_number_is_refused_at_once(play: Playground, wrong: str) -> None:
    text = f"""
    class A(Behaviour):
        def start(self):
            ball = self.world.spawn(components.RigidBody(), components.Collider(), position=(0, 0, 0))
            ball.apply_impulse(({wrong}, 0, 0))
    """
    thing = play.spawn(play.write("a.py", text))
    play.run()
    assert "a.py:7: PhysicsError" in play.failure(thing)


def test_what_spawns_itself_without_end_is_stopped_and_said_in_few_lines(
    play: Playground, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(runner, "MOST_THERE", 500)
    text = """
    class Doubles(Behaviour):
        def start(self):
            for _ in range(2):
                self.world.spawn(components.Script(source="doubles.py"))
    """
    play.spawn(play.write("doubles.py", text))
    other = play.spawn(play.write("b.py", COUNTS), "Good")
    play.run(14)
    assert 400 < play.simulation.world.entity_count <= 500
    assert play.on(other).n == 14
    off = [record.getMessage() for record in caplog.records if "off" in record.getMessage()]
    assert any("something spawns without end, or destroys too little" in line for line in off)
    assert any("more are off for the same reason" in line for line in off)
    assert len(off) <= 3 * (runner.MOST_SAID + 1)


def test_more_than_anybody_needs_in_a_tick_is_refused(play: Playground, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "MOST_SPAWNED", 20)
    text = """
    class A(Behaviour):
        def fixed_update(self, dt):
            for _ in range(15 if self.world.tick < 3 else 21):
                self.world.spawn()
    """
    thing = play.spawn(play.write("a.py", text))
    play.run(3)
    assert not play.failure(thing)
    play.run()
    assert "a.py:7: more than 20 entities were spawned in one tick: spread it over several" in play.failure(thing)


def test_a_script_of_the_scene_is_spawned_by_its_name(play: Playground) -> None:
    play.spawn(play.write("counts.py", COUNTS))
    text = """
    class A(Behaviour):
        def start(self):
            self.world.spawn(components.Script(source="counts.py#Counts"), name="again")
            self.world.spawn(components.Script(source="other.py"))
    """
    thing = play.spawn(play.write("a.py", text))
    play.run(3)
    (again,) = play.simulation.scripts.named("again")
    assert play.on(again).n == 2
    assert "nothing here has the script other.py" in play.failure(thing)


def test_nothing_is_begun_in_what_is_being_taken_away(play: Playground) -> None:
    text = """
    class A(Behaviour):
        async def never(self):
            await ticks(1)
        def on_destroy(self):
            self.begin(self.never())
    """
    thing = play.spawn(play.write("a.py", text))
    play.run()
    play.simulation.world.despawn(thing)
    play.run()
    assert "A is being taken away: nothing more can be begun in it" in play.failure(thing)


def test_what_a_script_logs_is_readable_whoever_shows_it() -> None:
    assert readable("door: \x1b[31mred\x07\r\n\ttext é") == "door: \\x1b[31mred\\x07\\r\n\ttext é"
    assert readable("half \udc80 letter") == "half \\udc80 letter"
    long = readable("x" * (LONGEST + 5))
    assert long == "x" * LONGEST + " ... and 5 characters more"


def test_a_scene_draws_nothing_into_recordings_but_scripts_from_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.delenv(trust.EVERYTHING, raising=False)
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))
    project = tmp_path / "home" / "project" / "scenes"
    project.mkdir(parents=True)
    (tmp_path / "secret.py").write_text("PASSWORD = 'swordfish'")
    (project / "notes").write_text("swordfish")
    (project.parent / "shared.py").write_text("from elys.script import *\nclass Shared(Behaviour): pass")
    (project / "link.py").symlink_to(tmp_path / "secret.py")
    sources = ["../../../secret.py", str(tmp_path / "secret.py"), "notes", "link.py", "../shared.py"]
    entities = ", ".join(
        f'{{"name": "{n}", "components": {{"Script": {{"source": "{s}"}}}}}}' for n, s in enumerate(sources)
    )
    path = project / "a.scene.json"
    path.write_text(f'{{"elys_scene": 1, "name": "a", "entities": [{entities}]}}')
    from elys.common.assets.store import AssetStore

    assets = AssetStore()
    with caplog.at_level(logging.WARNING):
        opened = open_scene(path, assets)
    texts = b"".join(assets.get(reference) for reference in assets.references())
    assert b"swordfish" not in texts and b"class Shared" in texts
    assert [record.components["Script"]["source"] for record in opened.records[:4]] == sources[:4]
    assert caplog.text.count("lies neither in the scene's folder nor beside that") == 3
    assert "notes is not read as a script: scripts are files that end with .py" in caplog.text
    trust.remember(tmp_path)
    assert open_scene(path, assets).records[0].components["Script"]["source"] != sources[0]
    Simulation.load(opened, assets).step()
