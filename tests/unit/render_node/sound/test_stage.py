"""Which voices a scene and its events have: sources, single sounds, files, viewers without a device, and films."""

from __future__ import annotations

import io
import logging
import sys
import types
import wave
from collections import deque
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from elys.bus import topics
from elys.bus.messages.scene import ComponentSet, Despawned, EnabledSet, SceneDelta, Spawned
from elys.bus.messages.session import Event, EventBatch
from elys.bus.messages.sounds import Sound, event_of, sound_of
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.assets import AssetStore
from elys.common.components import Component, SoundSource, Transform, values_of
from elys.common.errors import AssetError
from elys.render_node.film import VideoWriter
from elys.render_node.render_world import RenderWorld
from elys.render_node.sound.built_in import built_in_sound
from elys.render_node.sound.film_sound import FilmSound
from elys.render_node.sound.hearing import Ears
from elys.render_node.sound.library import SoundLibrary, decode_sound
from elys.render_node.sound.loudspeaker import Loudspeaker, nowhere
from elys.render_node.sound.mixer import QUANTUM, RATE, Mixer
from elys.render_node.sound.output import SoundOutput
from elys.render_node.sound.stage import SoundStage

EARS = Ears((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
CAMERA = ViewCamera(position=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0, 1.0))


def no_file(reference: str) -> bytes:
    raise AssetError(f"there is no asset {reference}")


def tell(mirror: SceneMirror, *changes: Any) -> None:
    mirror.apply_delta(SceneDelta(epoch=0, sequence=mirror.sequence + 1, tick=0, changes=tuple(changes)))


def spawned(entity: int, *components: Component) -> Spawned:
    parts = {type(part).__name__: values_of(part) for part in components}
    return Spawned(entity=entity, name="", parent=0, enabled=True, components=parts)


def changed(entity: int, component: Component) -> ComponentSet:
    return ComponentSet(entity=entity, component=type(component).__name__, values=values_of(component))


class Hall:
    """A stage with a mixer, by hand."""

    def __init__(self) -> None:
        self.mirror, self.mixer = SceneMirror(), Mixer()
        self.stage = SoundStage(self.mixer, SoundLibrary(no_file).sound, mirror=self.mirror)

    def place(self, *, is_running: bool = True) -> None:
        self.stage.place(EARS, lambda entity: self.mirror.world_pose(entity).position, is_running=is_running)

    def gains(self) -> list[tuple[float, float]]:
        return [(round(voice.left, 4), round(voice.right, 4)) for voice in self.mixer.voices]


def test_sources_sound_as_long_as_they_are_there_and_switched_on() -> None:
    hall = Hall()
    assert not hall.stage.has_sounds
    source = SoundSource(sound="roll", reference_distance=1.0)
    tell(hall.mirror, spawned(1, Transform(position=(4.0, 0.0, 0.0)), source), spawned(2, Transform()))
    hall.place()
    assert hall.gains() == [(0.0, 0.25)]
    tell(hall.mirror, changed(1, Transform(position=(-2.0, 0.0, 0.0))))
    hall.place()
    assert hall.gains() == [(0.5, 0.0)]
    (voice,) = hall.mixer.voices
    tell(hall.mirror, changed(1, SoundSource(sound="roll", volume=0.5, pitch=2.0, spatial=False)))
    hall.place()
    assert hall.mixer.voices == [voice]  # goes on, as the new values say
    assert hall.gains() == [(0.3536, 0.3536)]
    assert voice.pitch == 2.0
    hall.place(is_running=False)
    assert hall.gains() == [(0.0, 0.0)]  # while time stands nothing sounds
    tell(hall.mirror, EnabledSet(entity=1, enabled=False))
    hall.place()
    hall.mixer.mix(2 * QUANTUM)
    assert hall.mixer.voices == []
    tell(hall.mirror, EnabledSet(entity=1, enabled=True))
    hall.place()
    assert len(hall.mixer.voices) == 1
    tell(hall.mirror, Despawned(entity=1))
    hall.place()
    hall.mixer.mix(2 * QUANTUM)
    assert hall.mixer.voices == []


def test_a_source_that_does_not_loop_sounds_once_each_time_it_is_switched_on() -> None:
    hall = Hall()
    once = SoundSource(sound="click", loop=False, spatial=False)
    tell(hall.mirror, spawned(1, once))
    for _ in range(2):
        hall.place()
        hall.mixer.mix(RATE)
        assert hall.mixer.voices == []
        hall.place()
        assert hall.mixer.voices == []
        tell(hall.mirror, changed(1, SoundSource(sound="click", loop=False, playing=False)))
        hall.place()
        tell(hall.mirror, changed(1, once))
        hall.place()
        assert len(hall.mixer.voices) == 1


def test_single_sounds_are_heard_from_where_they_were_told() -> None:
    hall = Hall()
    hall.stage.hear(event_of(Sound(sound="hit", position=(0.0, 0.0, -8.0), volume=2.0), entity=3))
    hall.stage.hear(event_of(Sound(sound="chime", pitch=0.5)))
    assert hall.gains() == [(0.3536, 0.3536), (0.7071, 0.7071)]
    hall.stage.place(Ears((0.0, 0.0, -8.0), (1.0, 0.0, 0.0)), lambda entity: (0.0, 0.0, 0.0))
    assert hall.gains()[0] == (1.4142, 1.4142)


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"sound": ""},
        {"sound": 5},
        {"sound": "hit", "volume": float("nan")},
        {"sound": "hit", "volume": 1e9},
        {"sound": "hit", "pitch": 0.0},
        {"sound": "hit", "position": [0.0, 1.0]},
        {"sound": "hit", "position": [0.0, 1.0, float("inf")]},
        {"sound": "hit", "reference_distance": -1.0},
        {"sound": "x" * 1000},
    ],
)
def test_what_is_no_sound_is_passed_over(values: dict[str, Any]) -> None:
    assert sound_of(Event(kind="sound", values=values)) is None
    hall = Hall()
    hall.stage.hear(Event(kind="sound", values=values))
    hall.stage.hear(Event(kind="door", values={"sound": "hit"}))
    assert hall.mixer.voices == []


def wav(hertz: float = 500.0, *, rate: int = 24_000, channels: int = 1) -> bytes:
    time = np.arange(rate) / rate
    samples = np.repeat((0.5 * 32767 * np.sin(2 * np.pi * hertz * time)).astype("<i2")[:, None], channels, axis=1)
    file = io.BytesIO()
    with wave.open(file, "wb") as writer:
        writer.setnchannels(channels)
        writer.setsampwidth(2)
        writer.setframerate(rate)
        writer.writeframes(samples.tobytes())
    return file.getvalue()


def encoded(codec: str, container: str) -> bytes:
    """A second of 500 Hz as another program writes it."""
    file = io.BytesIO()
    samples = (0.5 * 32767 * np.sin(2 * np.pi * 500.0 * np.arange(RATE) / RATE)).astype(np.int16)
    with av.open(file, "w", format=container) as output:
        stream = output.add_stream(codec, rate=RATE, layout="mono")
        frame = av.AudioFrame.from_ndarray(samples[None], format="s16", layout="mono")
        frame.sample_rate = RATE
        resampler = av.AudioResampler(
            format=stream.format.name, layout="mono", rate=RATE, frame_size=stream.frame_size or 4096
        )
        for piece in (*resampler.resample(frame), *resampler.resample(None)):
            output.mux(stream.encode(piece))
        output.mux(stream.encode(None))
    return file.getvalue()


@pytest.mark.parametrize(
    "data",
    [wav(), wav(channels=2), encoded("flac", "flac"), encoded("libmp3lame", "mp3"), encoded("libopus", "ogg")],
    ids=["wav", "stereo", "flac", "mp3", "ogg"],
)
def test_files_become_samples_of_the_mixers_rate(data: bytes) -> None:
    samples = decode_sound(data)
    assert len(samples) == pytest.approx(RATE, abs=0.05 * RATE)
    middle = samples[RATE // 4 : RATE // 4 + 9600, 0].astype(np.float64)
    assert np.abs(middle).max() == pytest.approx(0.5, abs=0.03)
    spectrum = np.abs(np.fft.rfft(middle * np.hanning(len(middle))))
    assert int(np.argmax(spectrum)) * RATE / len(middle) == pytest.approx(500.0, abs=5.0)


@pytest.mark.parametrize("data", [b"", b"RIFF", b"not a sound" * 100, wav()[:30], b"\xff\xfb\x90\x00" + bytes(50)])
def test_damaged_files_are_refused_with_a_sentence(data: bytes) -> None:
    with pytest.raises(AssetError, match="no sound that can be decoded"):
        decode_sound(data)
        raise AssetError("this is no sound that can be decoded: nothing is in it")  # of a header alone


def test_a_file_is_heard_when_it_has_come_and_what_cannot_be_had_is_said_once(caplog: Any) -> None:
    store = AssetStore()
    reference = store.put(wav(), kind="sound")
    library, mixer = SoundLibrary(store.get), Mixer()
    stage = SoundStage(mixer, library.sound, is_pending=library.is_pending)
    stage.hear(event_of(Sound(sound=reference)))
    library.settle(reference)
    stage.place(EARS, nowhere())
    assert len(mixer.voices) == 1
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            stage.hear(event_of(Sound(sound="missing.wav")))
            library.settle("missing.wav")
    (said,) = [record.message for record in caplog.records]
    assert said.startswith("missing.wav is not heard: there is no asset 'missing.wav'")
    library.close()


def test_without_miniaudio_or_a_device_all_is_silent_and_says_so_once(monkeypatch: Any, caplog: Any) -> None:
    class NoDevice(Exception):
        pass

    def refuse(**options: Any) -> None:
        raise NoDevice("failed to init device")

    with caplog.at_level(logging.WARNING):
        monkeypatch.setitem(sys.modules, "miniaudio", None)
        assert not SoundOutput(Mixer().mix).is_heard
        fake = types.SimpleNamespace(
            MiniaudioError=NoDevice, PlaybackDevice=refuse, SampleFormat=types.SimpleNamespace(FLOAT32=5)
        )
        monkeypatch.setitem(sys.modules, "miniaudio", fake)
        silent = SoundOutput(Mixer().mix)
        silent.close()
    said = [record.message for record in caplog.records]
    assert said[0] == "sounds are not heard: miniaudio is not installed (pip install 'elys[sound]')"
    assert said[1].startswith("sounds are not heard: this machine has no device that plays them")


def test_a_device_is_given_what_the_mixer_makes(monkeypatch: Any) -> None:
    class Device:
        def __init__(self, **options: Any) -> None:
            assert options["nchannels"] == 2
            assert options["sample_rate"] == RATE

        def start(self, stream: Any) -> None:
            self.stream = stream

        def close(self) -> None:
            self.stream.close()

    fake = types.SimpleNamespace(
        MiniaudioError=OSError, PlaybackDevice=Device, SampleFormat=types.SimpleNamespace(FLOAT32=5)
    )
    monkeypatch.setitem(sys.modules, "miniaudio", fake)
    mixer = Mixer()
    hall = SoundStage(mixer, SoundLibrary(no_file).sound)
    hall.hear(event_of(Sound(sound="click")))
    output = SoundOutput(mixer.mix)
    assert output.is_heard
    heard = np.frombuffer(output._device.stream.send(1000), np.float32).reshape(-1, 2)
    assert len(heard) == 1000
    expected = built_in_sound("click")[: 1000 - QUANTUM, 0] * 0.5**0.5
    np.testing.assert_allclose(heard[QUANTUM:, 1], expected, atol=1e-6)
    output.close()
    assert not output.is_heard


class Ear:
    """Takes the place of a session: hands a loudspeaker what is told."""

    def __init__(self) -> None:
        self.handler: Any = None

    def subscribe(self, topic: Any, handler: Any) -> None:
        assert topic is topics.EVENTS
        self.handler = handler


class Buffer:
    """Takes the place of a device."""

    def __init__(self, mix: Any, *, is_heard: bool = True) -> None:
        self.mix, self.is_heard = mix, is_heard

    def close(self) -> None:
        self.is_heard = False


def test_a_viewer_opens_a_device_with_the_first_sound_and_can_be_silenced() -> None:
    ear, opened = Ear(), []

    def open_output(mix: Any) -> Any:
        opened.append(Buffer(mix))
        return opened[-1]

    speaker = Loudspeaker(ear, no_file, open_output=open_output)  # type: ignore[arg-type]
    speaker.place(CAMERA, nowhere)
    assert opened == []
    ear.handler(EventBatch(epoch=1, tick=1, events=(event_of(Sound(sound="chime")), Event(kind="x"))), "")
    speaker.place(CAMERA, nowhere)
    assert np.abs(opened[0].mix(2000)).max() > 0.05
    speaker.is_muted = True
    speaker.place(CAMERA, nowhere)
    opened[0].mix(4 * QUANTUM)
    assert np.abs(opened[0].mix(2000)).max() == 0.0
    speaker.close()


def test_where_nobody_hears_them_voices_do_not_gather() -> None:
    ear = Ear()
    speaker = Loudspeaker(ear, no_file, open_output=lambda mix: Buffer(mix, is_heard=False))  # type: ignore[arg-type, return-value]
    batch = EventBatch(epoch=1, tick=1, events=(event_of(Sound(sound="chime")),))
    for _ in range(200):
        ear.handler(batch, "")
        speaker.place(CAMERA, nowhere)
    assert len(speaker._mixer.voices) <= 1


def film(path: Path) -> bytes:
    mirror = SceneMirror()
    tell(mirror, spawned(1, Transform(position=(2.0, 0.0, 0.0)), SoundSource(sound="roll", volume=0.2)))
    heard = deque([(0.5, event_of(Sound(sound="hit", position=(0.0, 0.0, -1.0)))), (9.0, event_of(Sound(sound="hit")))])
    sound = FilmSound(mirror, no_file, heard)
    picture = np.zeros((32, 32, 4), np.uint8)
    with VideoWriter(path, 32, 32, fps=10.0, sound=True) as video:
        for number in range(11):
            video.add(picture)
            video.add_sound(sound.until(number / 10, CAMERA, RenderWorld()))
    sound.close()
    assert len(heard) == 1
    return path.read_bytes()


def test_a_film_has_its_sound_at_the_time_of_its_pictures_and_the_same_each_time(tmp_path: Path) -> None:
    assert film(tmp_path / "a.mp4") == film(tmp_path / "b.mp4")
    with av.open(str(tmp_path / "a.mp4")) as container:
        frames = [frame.to_ndarray() for frame in container.decode(audio=0)]
        assert container.streams.audio[0].rate == RATE
    track = np.concatenate(frames, axis=1)
    loudness = np.abs(track).max(axis=0)
    assert track.shape[1] >= RATE
    before, after = loudness[int(0.2 * RATE) : int(0.47 * RATE)], loudness[int(0.5 * RATE) : int(0.6 * RATE)]
    assert 0.01 < before.max() < 0.3  # the rumble alone
    assert after.max() > 0.45  # and the blow
    with av.open(str(tmp_path / "a.mp4")) as container:
        assert len(list(container.decode(video=0))) == 11
