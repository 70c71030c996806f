"""A script's declared fields in the inspector by hand: the real widgets, the real library of scripts behind the host."""

from __future__ import annotations

import pytest

from elys.bus import topics
from elys.common import trust
from elys.common.assets.scripts import read_script
from elys.common.components import Script, Transform
from elys.common.scene import EntityRecord
from elys.editor_node.keys import Key
from elys.sim_node.scripts.forms import form_of
from elys.sim_node.simulation import Simulation
from tests.unit.editor_node.hand import Hand
from tests.unit.editor_node.person import CTRL
from tests.unit.editor_node.person import at_the_editor as at_the_editor

pytestmark = pytest.mark.gl

TEXT = '''
from typing import Annotated, Literal
from elys.script import *

class Door(Behaviour):
    """Opens for whoever comes near."""
    rise: Annotated[float, about("How far it goes up.", unit="m", minimum=0.0, maximum=5.0)] = 2.0
    count: int = 3
    is_open: bool = False
    label: str = "door"
    mood: Literal["glad", "sad"] = "glad"
    travel: Annotated[Vec3, about("Its way.", unit="m")] = (0.0, 1.0, 0.0)
    keeper: Entity | None = None
'''


@pytest.fixture
def at_doors(at_the_editor, tmp_path, monkeypatch):
    """Runs `await scenario(hand)` with a door selected whose script is told of by a simulation."""
    monkeypatch.setattr(trust, "_here", {*trust._here, tmp_path.resolve()})
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))
    (tmp_path / "door.py").write_text(TEXT)
    (tmp_path / "bad.py").write_text("class Door(Behaviour): pass")
    simulation = Simulation()
    good, bad = (read_script(tmp_path / name, "Door", simulation.assets) for name in ("door.py", "bad.py"))
    for source in (good, bad):
        simulation.world.spawn([Transform(), Script(source=source)])

    def record(name: str, source: str, **values) -> EntityRecord:
        return EntityRecord(name=name, components={"Transform": {}, "Script": {"source": source, "values": values}})

    def play(scenario, select: str = "Front") -> None:
        async def with_person(person):
            async def answer(request, _):
                return form_of(simulation.scripts, request.source)

            person.stage.host.session.serve(topics.SCRIPT_FORM, answer)
            hand = Hand(person)
            await person.click(f"hierarchy/{select}")
            await person.frames(4)
            await scenario(hand)

        records = [
            record("Front", good),
            record("Back", good, rise=4.0),
            record("Broken", bad, rise=1.0),
            record("Nobody", ""),
        ]
        at_the_editor(with_person, records)

    return play


def test_each_kind_of_field_has_its_widget_and_undo_takes_it_back(at_doors):
    async def scenario(hand):
        person = hand.person
        await person.until(lambda: "inspector/Script/rise" in hand.landmarks.rectangles)

        def values():
            return hand.value("Front", "Script", "values")

        await hand.enter("Script/rise", "250 cm")
        assert values() == {"rise": 2.5}
        await hand.enter("Script/count", "2*4")
        assert values() == {"rise": 2.5, "count": 8}
        await person.click("inspector/Script/is_open")
        await hand.settle()
        assert values()["is_open"] is True
        await hand.enter("Script/travel/2", "-1")
        assert values()["travel"] == (0.0, 1.0, -1.0)
        await person.click("inspector/Script/mood")
        await person.frames(2)
        await person.click("inspector/Script/mood/sad")
        await hand.settle()
        assert values()["mood"] == "sad"
        for count in (4, 3, 2, 1, 0):
            await person.press(Key.Z, CTRL)
            await hand.settle()
            assert len(values()) == count

    at_doors(scenario)


def test_a_value_out_of_range_is_said_beside_the_field_and_the_default_comes_back(at_doors):
    async def scenario(hand):
        person = hand.person
        await person.until(lambda: "inspector/Script/rise" in hand.landmarks.rectangles)
        await hand.enter("Script/rise", "7")
        rows = person.editor.workspace.inspector.rows
        assert "at most 5 m" in rows._refused[1]
        assert hand.value("Front", "Script", "values") == {}
        await person.press(Key.ESCAPE)
        await hand.enter("Script/rise", "4")
        assert hand.value("Front", "Script", "values") == {"rise": 4.0}
        await person.click("inspector/Script/rise/reset")
        await hand.settle()
        assert hand.value("Front", "Script", "values") == {}

    at_doors(scenario)


def test_another_entity_is_picked_and_kept_by_its_path(at_doors):
    async def scenario(hand):
        person = hand.person
        await person.until(lambda: "inspector/Script/keeper/pick" in hand.landmarks.rectangles)
        await person.click("inspector/Script/keeper/pick")
        await person.frames(3)
        await person.click("inspector/Script/keeper/pick/Back")
        await hand.settle()
        assert hand.value("Front", "Script", "values") == {"keeper": "Back"}

    at_doors(scenario)


def test_several_are_edited_together(at_doors):
    async def scenario(hand):
        person = hand.person
        await person.click("hierarchy/Back", held=CTRL)
        await person.until(lambda: "inspector/Script/rise" in hand.landmarks.rectangles)
        await hand.enter("Script/rise", "+= 0.5")
        assert hand.value("Front", "Script", "values") == {"rise": 2.5}
        assert hand.value("Back", "Script", "values") == {"rise": 4.5}

    at_doors(scenario)


@pytest.mark.parametrize("name", ["Broken", "Nobody"])
def test_a_script_that_cannot_be_loaded_says_why_and_shows_its_values(at_doors, name):
    async def scenario(hand):
        await hand.person.until(lambda: "inspector/Script/values" in hand.landmarks.rectangles)
        await hand.person.frames(6)
        shown = await hand.shown()
        assert "inspector/Script/values" in shown and "inspector/Script/rise" not in shown
        assert ("inspector/Script/problem" in shown) == (name == "Broken")

    at_doors(scenario, select=name)


def test_only_scripts_of_the_scene_are_told_of(tmp_path, monkeypatch):
    simulation = Simulation()
    (tmp_path / "a.py").write_text("raise SystemExit")
    source = read_script(tmp_path / "a.py", "", simulation.assets)
    with pytest.raises(Exception, match="no entity of the scene carries that script"):
        form_of(simulation.scripts, source)
