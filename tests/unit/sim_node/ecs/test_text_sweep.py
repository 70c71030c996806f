"""Texts that nobody has any more are let go of, and nothing but memory tells the difference."""

from __future__ import annotations

from elys.common.components import Kind, MeshRenderer, OverlayText, Script, Transform, declaration_of
from elys.sim_node.ecs import text_sweep
from elys.sim_node.ecs.text_sweep import EVERY, FEW, sweep_texts
from elys.sim_node.scene.edited_values import MOVED
from elys.sim_node.simulation import Simulation


def test_only_what_no_component_names_goes_and_all_others_read_the_same() -> None:
    simulation = Simulation()
    world = simulation.world
    clock = world.spawn([Transform(), OverlayText(text="0")])
    script = world.spawn([Script(source="nowhere.py", values={"a": "b"}), MeshRenderer(mesh="sphere")])
    for number in range(FEW + 1):
        world.set_fields(clock, OverlayText, {"text": f"{number}"})
    bare = world.spawn([OverlayText(text="")])
    before = {entity: world.components_of(entity) for entity in (clock, script, bare)}
    assert len(world.strings) > FEW
    assert sweep_texts(world)
    assert {entity: world.components_of(entity) for entity in before} == before
    assert set(world.strings.texts) == {"", f"{FEW}", "nowhere.py", '{"a":"b"}', "sphere"}
    assert not sweep_texts(world)
    assert world.strings.lookup(world.strings.intern("new")) == "new"


def test_where_most_are_in_use_all_stay() -> None:
    world = Simulation().world
    for number in range(FEW + 10):
        world.spawn([OverlayText(text=f"{number}")])
    assert not sweep_texts(world)
    assert len(world.strings) == FEW + 11


def test_a_clock_that_is_written_each_tick_does_not_fill_the_memory_and_time_can_be_wound_back(monkeypatch) -> None:
    monkeypatch.setattr(text_sweep, "FEW", 100)

    def run() -> Simulation:
        simulation = Simulation()
        clock = simulation.world.spawn([OverlayText()])

        def tell(world) -> None:
            world.set_fields(clock, OverlayText, {"text": f"tick {simulation.tick}"})

        simulation.systems = (tell, *simulation.systems)
        return simulation

    simulation = run()
    for _ in range(EVERY - 10):
        simulation.step()
    state, longest = simulation.capture(), 0
    for _ in range(2 * EVERY):
        simulation.step()
        longest = max(longest, len(simulation.world.strings))
    assert longest <= EVERY + 2
    strings = simulation.world.strings.texts
    simulation.restore(state)
    for _ in range(2 * EVERY):
        simulation.step()
    assert simulation.world.strings.texts == strings


def test_what_steps_have_written_is_remembered_without_texts() -> None:
    """Columns that are kept aside name rows too, and are not swept."""
    kinds = {declaration_of(name).field(field).kind for name, fields in MOVED.items() for field in fields}
    assert kinds.isdisjoint({Kind.TEXT, Kind.ASSET, Kind.VALUES})
