"""Scripts that take too much memory, import in circles, name files that are not there, or have fields of the wrong type.

Each says where, who and what to do, and the rest goes on.
"""

from __future__ import annotations

import resource
import sys

import pytest

from elys.common.assets.scripts import read_script
from elys.common.components import Script
from elys.common.scene import EntityNode, SceneDocument, expand
from elys.sim_node.scene.loading import load_records
from elys.sim_node.scripts import memory_watch
from tests.unit.sim_node.scripts.conftest import Playground

COUNTS = """
class B(Behaviour):
    n = 0
    def update(self, dt): self.n += 1
"""


@pytest.mark.skipif(sys.platform != "linux", reason="what a process holds is told by Linux")
def test_a_script_that_hoards_from_tick_to_tick_is_found_and_switched_off(
    play: Playground, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory_watch, "LIMIT", 200 << 20)
    other = play.spawn(play.write("b.py", COUNTS), "Good")
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self): self.kept = []
            def update(self, dt): self.kept.append(bytearray(b"x") * (36 << 20))
        """,
    )
    # Blocks as large as that are always new to the process, whatever the tests before have let go of.
    hoarder = play.spawn(source, "Hoarder")
    play.run(40)
    said = play.failure(hoarder)
    assert "it remembers" in said and "all scripts together may grow by 200 MB: let go of what is not needed" in said
    assert play.on(other).n == 40
    # It can begin anew, and what it remembered is let go.
    play.simulation.world.set_fields(hoarder, Script, {"enabled": False})
    play.run()
    play.simulation.world.set_fields(hoarder, Script, {"enabled": True})
    play.run(3)
    assert len(play.on(hoarder).kept) == 3


@pytest.mark.skipif(sys.platform != "linux", reason="what a process holds is told by Linux")
def test_a_script_that_grows_without_coming_back_is_ended_where_it_stands(
    play: Playground, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory_watch, "LIMIT", 100 << 20)
    other = play.spawn(play.write("b.py", COUNTS), "Good")
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def update(self, dt):
                kept = []
                while True:
                    kept.append(bytearray(b"x" * 100_000))
        """,
    )
    grower = play.spawn(source, "Grower")
    play.run(3)
    said = play.failure(grower)
    assert "it took 100 MB of memory and went on: something in it grows without end" in said
    assert "a.py:7: " in said or "a.py:8: " in said
    assert play.on(other).n == 3


@pytest.mark.skipif(sys.platform != "linux", reason="the bound on one block is Linux's")
def test_a_block_beyond_any_use_is_refused_and_the_bound_is_taken_away_again(play: Playground) -> None:
    before = resource.getrlimit(resource.RLIMIT_AS)
    source = play.write("a.py", "class A(Behaviour):\n    def update(self, dt): self.much = [0] * (1 << 40)")
    greedy = play.spawn(source, "Greedy")
    other = play.spawn(play.write("b.py", COUNTS), "Good")
    play.run(3)
    assert "a.py:4: MemoryError: it asked for more memory than a script may have at once: take less" in play.failure(
        greedy
    )
    assert play.on(other).n == 3
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_what_a_script_remembers_is_counted_once(play: Playground) -> None:
    block = bytearray(1 << 20)
    shared = {"a": [block, block], "b": (block,)}
    shared["itself"] = shared  # type: ignore[assignment]
    assert (1 << 20) < memory_watch.size_of([shared, block]) < (1 << 20) + 5000


def test_imports_in_a_circle_name_the_files_and_the_remedy(play: Playground) -> None:
    (play.folder / "b.py").write_text("from c import x\ny = 1\n")
    (play.folder / "c.py").write_text("from b import y\nx = 1\n")
    thing = play.spawn(play.write("a.py", "import b\nclass A(Behaviour): pass"), "Thing")
    other = play.spawn(play.write("d.py", COUNTS.replace("class B", "class D")), "Good")
    play.run(2)
    said = play.failure(thing)
    assert "c.py:1" in said and "b.py and c.py import one another in a circle" in said
    assert "move what both need to a third file" in said
    assert play.on(other).n == 2


def test_a_script_that_is_not_there_is_said_with_its_name_and_place(play: Playground) -> None:
    node = EntityNode(name="Door", components={"Script": {"source": "doors/front.py#Door"}})
    load_records(
        play.simulation.world, expand(SceneDocument(entities=[node]), directory=play.folder, assets=play.assets)
    )
    play.run()
    thing = play.simulation.world.hierarchy.find("Door")
    assert play.failure(thing) == (
        "there is no script doors/front.py#Door that could be read: it is looked for beside the scene's file as that is opened"
    )


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (
            {"speed": "fast"},
            "a.py:A.speed must be a number, not 'fast'; set it in the inspector or in the scene's file",
        ),
        ({"speed": 50.0}, "a.py:A.speed must be at most 9 m/s, not 50"),
        ({"place": (1.0, 2.0)}, "a.py:A.place must be 3 numbers, not (1.0, 2.0)"),
        ({"mood": "angry"}, "a.py:A.mood must be one of glad, sad, not 'angry'"),
        ({"is_open": 1}, "a.py:A.is_open must be true or false, not 1"),
        ({"friend": "Nobody/There"}, "a.py:A.friend: "),
    ],
)
def test_a_field_of_the_wrong_type_says_what_was_expected(
    play: Playground, values: dict[str, object], said: str
) -> None:
    source = play.write(
        "a.py",
        """
        from typing import Literal
        class A(Behaviour):
            speed: Annotated[float, about("How fast.", unit="m/s", maximum=9.0)] = 1.0
            place: Vec3 = (0.0, 0.0, 0.0)
            mood: Literal["glad", "sad"] = "glad"
            is_open: bool = False
            friend: Entity | None = None
            n = 0
            def update(self, dt): self.n += 1
        """,
    )
    wrong, right = play.spawn(source, "Wrong", **values), play.spawn(source, "Right", speed=2.0)
    play.run(2)
    assert said in play.failure(wrong)
    assert play.on(right).n == 2
    play.simulation.world.set_fields(wrong, Script, {"values": {"speed": 3.0}})
    play.simulation.world.set_fields(wrong, Script, {"enabled": False})
    play.run()
    play.simulation.world.set_fields(wrong, Script, {"enabled": True})
    play.run(2)
    assert play.on(wrong).speed == 3.0 and play.on(wrong).n == 2


def test_pieces_that_came_with_a_recording_are_ours_only_word_for_word(
    play: Playground, monkeypatch: pytest.MonkeyPatch
) -> None:
    from elys.common.assets.store import AssetStore
    from elys.common.scene_files import PIECES_FOLDER

    monkeypatch.delenv("ELYS_TRUST_SCRIPTS", raising=False)
    ours = AssetStore()
    race = read_script(PIECES_FOLDER / "game" / "race.py", "Race", ours)  # with what it imports from beside it
    play.assets.put(ours.get(race), kind="script")
    assert play.simulation.scripts.library.load(race).behaviour.__name__ == "Race"
    source = read_script(PIECES_FOLDER / "door.py", "Door", ours)
    library = play.simulation.scripts.library
    play.assets.put(ours.get(source), kind="script")  # as a recording brings it: from no file
    assert library.load(source).behaviour.__name__ == "Door"
    changed = ours.get(source).replace(b"stays_open", b"stays_shut")
    with pytest.raises(Exception, match="the scripts that came with it are not trusted"):
        library.load(play.assets.put(changed, kind="script"))
