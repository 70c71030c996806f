"""Scripts that drive characters."""

from __future__ import annotations

import pytest

from elys.common.components import Character, Collider, Transform


def test_a_script_walks_jumps_and_hears_what_it_stands_on(play):
    source = play.write(
        "guard.py",
        """
        class Guard(Behaviour):
            highest: Annotated[float, about("highest place")] = 0.0

            def fixed_update(self, dt):
                legs = self.entity.legs
                legs.wish((0.6, 0, 0.8), run=True, jump=self.world.tick == 80)

            def update(self, dt):
                self.highest = max(self.highest, self.entity.position.y)
                legs = self.entity.legs
                if legs.is_grounded:
                    self.speed = legs.velocity
                    self.under = legs.ground.name
        """,
    )
    play.simulation.world.spawn([Transform(position=(0.0, -0.5, 0.0)), Collider(size=(200.0, 1.0, 200.0))], name="Yard")
    guard = play.spawn(source, "Guard", Transform(position=(0.0, 0.01, 0.0)), Character())
    play.run(160)
    assert play.failure(guard) == ""
    assert play.on(guard).highest == pytest.approx(1.21, abs=1e-5)
    assert list(play.on(guard).speed) == pytest.approx([3.6, 0.0, 4.8], abs=1e-6)
    assert play.on(guard).under == "Yard"
    play.simulation.take_changes()
    play.run(5)  # wishes are no edits of the scene
    assert not any(name == "Character" for change in play.simulation.take_changes() for _, name in change.set)


def test_a_script_puts_it_to_swim_and_throws_it(play):
    source = play.write(
        "pool.py",
        """
        class Swimmer(Behaviour):
            def fixed_update(self, dt):
                if self.world.tick == 5:
                    self.entity.legs.mode = "swim"
                if self.world.tick == 30:
                    self.entity.legs.mode = "walk"
                    self.entity.legs.launch((0, 12, 0))
        """,
    )
    one = play.spawn(source, "Swimmer", Transform(position=(0.0, 50.0, 0.0)), Character())
    play.run(28)
    world = play.simulation.world
    assert world.get(one, Character).velocity == (0.0, 0.0, 0.0)
    before = world.get(one, Transform).position[1]
    play.run(30)
    assert world.get(one, Transform).position[1] > before + 3.0
    assert play.failure(one) == ""


def test_who_has_no_legs_is_told(play):
    source = play.write(
        "stone.py", "class Stone(Behaviour):\n    def update(self, dt):\n        self.entity.legs.wish((1, 0, 0))\n"
    )
    stone = play.spawn(source)
    play.run(3)
    assert "has no Character" in play.failure(stone)
