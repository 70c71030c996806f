"""The carillon rings as its bars are struck, its board says so, and whoever draws it hears and sees that."""

from __future__ import annotations

from itertools import islice

import pytest

from elys.bus.messages.sounds import sound_of
from elys.common.assets import AssetStore
from elys.common.components import Overlay, OverlayPanel, OverlayText
from elys.samples.carillon import NAMES, STEPS
from elys.sim_node.simulation import Simulation
from elys.verbs.footage import simulated
from elys.verbs.scenes import open_scene_or_sample

SECONDS = 6


def played() -> tuple[Simulation, list[tuple[int, str, float, float]]]:
    """What is left after some seconds, and what was heard: tick, sound, pitch and volume."""
    store = AssetStore()
    simulation = Simulation.load(open_scene_or_sample("carillon", store), store)
    heard = []
    for _ in range(60 * SECONDS):
        simulation.step()
        for event in simulation.take_events():
            assert event.kind != "script", event.values
            if (sound := sound_of(event)) is not None:
                heard.append((simulation.tick, sound.sound, sound.pitch, sound.volume))
    return simulation, heard


def test_bars_ring_at_their_pitch_and_the_board_says_which() -> None:
    simulation, heard = played()
    rung = [one for one in heard if one[1] == "chime"]
    assert len(rung) > 5
    scale = [0.5 * 2.0 ** (step / 12.0) for step in STEPS]
    for _, _, pitch, volume in rung:
        assert min(abs(pitch - tone) for tone in scale) < 1e-4
        assert 0.0 < volume <= 1.0
    assert sum(one[1] == "whoosh" for one in heard) == 10  # at 0.5 s, and each 0.6 s from then on
    world = simulation.world
    find = world.hierarchy.find
    told = sum(tick < simulation.tick for tick, *_ in rung)  # an event is heard in the next tick
    assert world.get(find("Count"), OverlayText).value == told
    assert world.get(find("Clock"), OverlayText).value == pytest.approx(SECONDS, abs=0.05)
    assert world.get(find("Label"), Overlay).visible
    rows = [child for child in world.hierarchy.children_of(find("Board")) if world.hierarchy.name_of(child) != "Title"]
    assert len(rows) == len(NAMES)
    assert max(world.get(row, OverlayPanel).opacity for row in rows) > 0.3


def test_it_is_heard_the_same_each_time() -> None:
    assert played()[1] == played()[1]


def test_who_draws_it_sees_what_scripts_wrote_and_hears_what_they_played() -> None:
    store = AssetStore()
    footage = simulated(open_scene_or_sample("carillon", store), store, 2.0)
    frames = list(islice(footage.frames, 60))
    mirror = footage.mirror
    (clock,) = [entity for entity in mirror.entities.values() if entity.name == "Clock"]
    text = clock.components["OverlayText"]
    assert isinstance(text, OverlayText)
    assert text.value == pytest.approx(frames[-1].simulation_time, abs=0.03)
    balls = [entity for entity in mirror.entities.values() if entity.name == "Ball"]
    assert len(balls) == 5
    assert {entity.id for entity in balls} <= set(frames[-1].entity.tolist())
    assert footage.heard
    assert all(2.0 < time <= frames[-1].simulation_time for time, _ in footage.heard)
