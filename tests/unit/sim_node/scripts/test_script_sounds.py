"""Sounds that scripts play: told as events, with what names them everywhere, and nothing of the run depends on them."""

from __future__ import annotations

import wave
from pathlib import Path

import pytest

from elys.bus.messages.sounds import Sound, sound_of
from elys.common.assets.store import is_reference
from elys.common.components import Transform
from tests.unit.sim_node.scripts.conftest import Playground


def sounds(play: Playground) -> list[tuple[int, Sound]]:
    told = [(event.entity, sound_of(event)) for event in play.simulation.take_events() if event.kind == "sound"]
    return [(entity, sound) for entity, sound in told if sound is not None]


def silence(path: Path) -> None:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(48_000)
        file.writeframes(bytes(480))


def test_a_script_plays_sounds_from_where_it_is_and_from_everywhere(play: Playground) -> None:
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def start(self):
                self.entity.play_sound("hit", volume=0.5, pitch=2, max_distance=30)
                self.entity.play_sound("click", spatial=False)
                self.world.play_sound("chime")
        """,
    )
    thing = play.spawn(source, "Thing", Transform(position=(1.0, 2.0, 3.0)))
    play.run(2)
    assert sounds(play) == [
        (thing, Sound(sound="hit", volume=0.5, pitch=2.0, position=(1.0, 2.0, 3.0), max_distance=30.0)),
        (thing, Sound(sound="click")),
        (0, Sound(sound="chime")),
    ]


def test_a_file_beside_the_scene_is_named_by_its_content_and_kept(play: Playground) -> None:
    silence(play.folder / "beep.wav")
    play.simulation.path = str(play.folder / "level.scene.json")
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def update(self, dt):
                self.world.play_sound("beep.wav")
        """,
    )
    play.spawn(source)
    play.run(3)
    told = {sound.sound for _, sound in sounds(play)}
    assert len(told) == 1
    (reference,) = told
    assert is_reference(reference)
    assert play.simulation.assets.get(reference) == (play.folder / "beep.wav").read_bytes()


def test_a_file_that_is_not_there_is_said_once_and_ends_nothing(
    play: Playground, caplog: pytest.LogCaptureFixture
) -> None:
    """Where a recording is run again the files of who made it are not there: the run must be the same."""
    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            count = 0
            def update(self, dt):
                self.world.play_sound("nowhere.wav")
                self.count += 1
        """,
    )
    thing = play.spawn(source)
    play.run(3)
    assert play.on(thing).count == 3
    assert [sound.sound for _, sound in sounds(play)] == ["nowhere.wav"] * 3
    assert sum("which is not heard" in record.message for record in caplog.records) == 1


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        ('self.world.play_sound("hit", volume=99)', "the volume of a sound lies between 0 and 8, not at 99"),
        ('self.world.play_sound("hit", pitch=0)', "the pitch of a sound lies between 0.1 and 8, not at 0"),
        ("self.world.play_sound(5)", "a sound is named by a text, not by 5"),
        ('self.world.play_sound("hit", volume="loud")', "the sound 'hit' cannot be played"),
        ('[self.world.play_sound("hit") for _ in range(300)]', "more than 256 sounds were played in one tick"),
    ],
)
def test_what_no_sound_can_have_is_an_error_in_the_script(play: Playground, call: str, expected: str) -> None:
    source = play.write("a.py", f"class A(Behaviour):\n    def start(self):\n        {call}\n")
    thing = play.spawn(source)
    play.run()
    assert expected in play.failure(thing)


def test_going_back_in_time_is_silent_and_going_on_from_there_is_heard_again(play: Playground) -> None:
    from elys.sim_node.flight_recorder import FlightRecorder

    source = play.write(
        "a.py",
        """
        class A(Behaviour):
            def update(self, dt):
                if self.world.tick % 10 == 0:
                    self.world.play_sound("click")
        """,
    )
    play.spawn(source)
    flight = FlightRecorder(play.simulation)
    for _ in range(25):
        play.run()
        flight.note((), steps=True, is_told=False, seconds=0.0)
    assert len(sounds(play)) == 3
    flight.go_to(flight.instant_of_tick(15))
    assert sounds(play) == []
    while flight.is_rewound:
        flight.repeat()
    assert len(sounds(play)) == 1
