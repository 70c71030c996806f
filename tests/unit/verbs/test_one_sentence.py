"""Every mistake on the command line is one sentence that says what was wrong and what to do, and changes nothing."""

from __future__ import annotations

import json
import socket
import struct
from pathlib import Path
from typing import Any

import pytest

from elys.common.assets.primitives import PRIMITIVES
from elys.samples.registry import write_sample

HEADLESS = ("--headless", "--steps", "1")


def scene(**changes: Any) -> str:
    """A scene file with something wrong at its top."""
    return json.dumps({"elys_scene": 1, "entities": [], **changes})


def entity(**components: Any) -> str:
    """A scene file of one entity."""
    return scene(entities=[{"name": "Box", "components": components}])


WRONG_SCENES = {
    "syntax": ('{"elys_scene": 1, "entities": [}', ":1:32: not JSON"),
    "empty": ("", "the file is empty"),
    "binary": (b"\xff\xfe" * 50, "scene files are JSON in UTF-8"),
    "nan": ('{"elys_scene": 1, "entities": NaN}', "NaN is not a number that JSON knows"),
    "a list": ("[]", "must be an object"),
    "no version": ('{"entities": []}', 'it has no "elys_scene": 1'),
    "version": (scene(elys_scene=99), "newer than this ELYS reads (1); update ELYS"),
    "version text": (scene(elys_scene="1"), "elys_scene"),
    "unknown field": (scene(colour="red"), "colour: a scene has no such field"),
    "wrong type": (scene(entities={}), "entities: must be a list"),
    "component": (entity(Lihgt={}), "did you mean 'Light'?"),
    "field": (entity(Light={"intensty": 1}), "did you mean 'intensity'?"),
    "value": (entity(Light={"intensity": "bright"}), "entities[0].components.Light.intensity: must be a number"),
    "range": (entity(RigidBody={"mass": -1}), "RigidBody.mass: must be at least 1e-06 kg"),
    "setting": (scene(settings={"tick_rate": 0}), "settings.tick_rate"),
    "prefab": (scene(entities=[{"prefab": "gone.glb"}]), "gone.glb does not exist"),
    "mesh": (entity(MeshRenderer={"mesh": "dodecahedron"}), f"built in are {', '.join(PRIMITIVES)}"),
}


@pytest.mark.parametrize("name", WRONG_SCENES)
def test_a_wrong_scene_names_the_file_the_place_and_what_was_expected(elys, tmp_path: Path, name: str) -> None:
    content, expected = WRONG_SCENES[name]
    path = tmp_path / "it.scene.json"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    for words in (("run", path, *HEADLESS, "--record", "it.mcap"), ("run", path), ("render", path, "-o", "it.png")):
        sentence = elys(*words).sentence
        assert "it.scene.json" in sentence
        assert expected in sentence
    assert not Path("it.mcap").exists()
    assert not Path("it.png").exists()


def test_a_scene_that_is_not_there(elys, tmp_path: Path) -> None:
    assert "there is no scene file gone.scene.json" in elys("run", "gone.scene.json", *HEADLESS).sentence
    assert "did you mean 'yard'?" in elys("run", "yrad", *HEADLESS).sentence
    assert "did you mean 'stiff-spring'?" in elys("run", "stif-sprig", *HEADLESS).sentence
    assert "samples are yard, stack" in elys("run", "qq", *HEADLESS).sentence
    assert "is a directory" in elys("run", tmp_path, *HEADLESS).sentence
    assert "did you mean 'yard'?" in elys("samples", "yrad").sentence
    assert "did you mean 'quarry'?" in elys("samples", "qarry").sentence
    (tmp_path / "notes.txt").write_text("hello")
    assert "ELYS opens .scene.json" in elys("run", "notes.txt", *HEADLESS).sentence


def glb(*, length: int | None = None) -> bytes:
    text = b'{"asset":{"version":"2.0"}}     '
    whole = 20 + len(text)
    return struct.pack("<4sIIII", b"glTF", 2, length or whole, len(text), 0x4E4F534A) + text


TRIANGLE = {
    "asset": {"version": "2.0"},
    "buffers": [{"uri": "it.bin", "byteLength": 100}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "nodes": [{"mesh": 0}],
    "scenes": [{"nodes": [0]}],
}
WRONG_MODELS: dict[str, tuple[bytes, str]] = {
    "cut.glb": (glb(length=5000), "cut off"),
    "head.glb": (glb()[:10], "cut off in its header"),
    "empty.glb": (b"", "not a glTF model"),
    "garbage.glb": (b"hello" * 50, "not a glTF model"),
    "empty.gltf": (b"", "not a glTF model"),
    "syntax.gltf": (b'{"asset"', "not a glTF model"),
    "buffer.gltf": (json.dumps(TRIANGLE).encode(), "it.bin does not exist"),
}


@pytest.mark.parametrize("name", WRONG_MODELS)
def test_a_wrong_model_is_named(elys, tmp_path: Path, name: str) -> None:
    content, expected = WRONG_MODELS[name]
    (tmp_path / name).write_bytes(content)
    for words in (("run", name, *HEADLESS), ("render", name, "-o", "it.png")):
        sentence = elys(*words).sentence
        assert name in sentence
        assert expected in sentence


def test_a_models_file_that_is_too_short(elys, tmp_path: Path) -> None:
    (tmp_path / "it.gltf").write_text(json.dumps(TRIANGLE))
    (tmp_path / "it.bin").write_bytes(b"\0" * 50)
    assert "buffers[0] has 50 bytes, 100 were promised" in elys("run", "it.gltf", *HEADLESS).sentence
    assert "the model file" in elys("run", "gone.glb", *HEADLESS).sentence


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("run", "stack", "--steps", "-1"), "--steps"),
        (("run", "stack", "--steps", "many"), "--steps"),
        (("run",), "Missing argument 'scene': see elys run --help"),
        (("run", "stack", "--headless=3"), "does not take a value"),
        (("view", "x.mcap"), "type `elys play x.mcap --edit`, or `elys play x.mcap` and beside it `elys view`"),
        (("edit", "x.mcap"), "or `elys play x.mcap` and beside it `elys edit`"),
        (("view", "stack"), "`elys run stack` runs a scene"),
        (("rnu",), "No such command 'rnu'"),
        (("play", "x.mcap", "--rate", "0"), "--rate"),
        (("play", "x.mcap", "--rate", "nan"), "--rate"),
        (("record", "-o", "x.mcap", "--seconds", "-4"), "--seconds"),
        (("topic", "hz", "--seconds", "0"), "--seconds"),
        (("topic", "hz", "--seconds", "nan"), "--seconds"),
        (("topic", "echo", "state", "-n", "-1"), "--count"),
        (("topic", "echo", "sate"), "there is no topic 'sate'; there are state, delta"),
        (("topic", "hz", "sate"), "there is no topic 'sate'; there are state, delta"),
        (("schema", "Boddy"), "there is no component 'Boddy'; known are Transform"),
        (("render", "stack"), "Missing option '--output'"),
        (("render", "stack", "-o", "x.png", "--size", "64"), "write WIDTHxHEIGHT"),
        (("render", "stack", "-o", "x.png", "--size", "-1x5"), "write WIDTHxHEIGHT"),
        (("render", "stack", "-o", "x.png", "--size", "999999999999x1"), "write WIDTHxHEIGHT"),
        (("render", "stack", "-o", "x.png", "--time", "-1"), "--time"),
        (("render", "stack", "-o", "x.png", "--time", "nan"), "--time"),
        (("render", "stack", "-o", "x.png", "--time", "inf"), "--time"),
        (("render", "stack", "-o", "x.mp4", "--duration", "-1"), "--duration"),
        (("render", "stack", "-o", "x.mp4", "--duration", "nan"), "--duration"),
        (("render", "stack", "-o", "x.mp4", "--fps", "0"), "--fps"),
        (("render", "stack", "-o", "x.gif"), "pictures and videos that can be written are .png, .exr, .npy, .mp4"),
        (("render", "stack", "-o", "."), "pictures and videos that can be written are .png, .exr, .npy, .mp4"),
        (("render", "stack", "-o", "gone/x.png"), "there is no directory gone"),
        (("render", "stack", "-o", "x.png", "--size", "0x5"), "edges go from 1 to 32768"),
        (("render", "stack", "-o", "x.png", "--size", "32000x32000"), "it may have 128 Mi pixels"),
        (("render", "stack", "-o", "x.mp4", "--size", "9000x5"), "edges go to 8192"),
        (("render", "stack", "-o", "x.png", "--view", "depht"), "views are shaded, normals, albedo, roughness, depth"),
        (("render", "stack", "-o", "x.png", "--camera", "Nope"), "there is no camera 'Nope': cameras are "),
        (("render", "empty", "-o", "x.png", "--camera", "Nope"), "there is no camera 'Nope'"),
        (("render", "stack", "-o", "x.png", "--path", "gone.json"), "gone.json cannot be read: No such file"),
        (("render", "stack", "-o", "x.png", "--orbit", "-1"), "--orbit"),
        (("render", "stack", "-o", "x.png", "--orbit", "0.01"), "takes at least 0.05 s"),
        (("render", "stack", "-o", "x.png", "--orbit", "3", "--camera", "C"), "give one of them"),
        (("render", "stack", "-o", "x.png", "--connect", "tcp/127.0.0.1:9"), "give one of them"),
        (("render", "-o", "x.png", "--time", "3"), "a running session is drawn as it is now"),
        (("render", "-o", "x.png"), "no session is running on this machine"),
        (("demo", "--headless", "--directory", "/proc/x"), "choose another with --directory"),
    ],
)
def test_a_wrong_option_is_one_sentence(elys, words: tuple[str, ...], expected: str) -> None:
    assert expected in elys(*words).sentence
    assert not any(Path(name).exists() for name in ("x.png", "x.mp4", "x.mcap"))


@pytest.mark.parametrize("verb", ["run", "topic", "view", "record"])
@pytest.mark.parametrize(
    "endpoint", ["tcp/127.0.0.1:99999", "tcp/127.0.0.1:-1", "tcp/127.0.0.1:port", "a b", "///", ":"]
)
def test_what_is_no_endpoint_is_said_at_once(elys, verb: str, endpoint: str) -> None:
    words = {
        "run": ("run", "stack", *HEADLESS, "--listen"),
        "topic": ("topic", "hz", "--connect"),
        "view": ("view", "--connect"),
        "record": ("record", "-o", "x.mcap", "--connect"),
    }[verb]
    sentence = elys(*words, endpoint).sentence
    assert f"'{endpoint}' is no endpoint: give tcp/HOST:PORT" in sentence


@pytest.mark.parametrize("words", [("view",), ("topic", "hz"), ("topic", "echo", "log"), ("record", "-o", "x.mcap")])
def test_without_a_session_there_is_nothing_to_attach_to(elys, words: tuple[str, ...]) -> None:
    assert "no session is running on this machine: start one with `elys run SCENE`" in elys(*words).sentence
    assert not Path("x.mcap").exists()


@pytest.mark.parametrize(
    "words",
    [("run", "stack"), ("edit",), ("view", "--connect", "tcp/127.0.0.1:9"), ("edit", "--connect", "tcp/127.0.0.1:9")],
)
def test_without_a_display_a_window_is_not_tried(elys, words: tuple[str, ...]) -> None:
    sentence = elys(*words).sentence
    assert "there is no display to open a window on" in sentence
    assert "elys render" in sentence


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("it.scene.json", "recordings have the suffix .mcap"),
        ("it", "recordings have the suffix .mcap"),
        ("/proc/it.mcap", "cannot be written"),
        ("taken/it.mcap", "cannot be written"),
        ("folder.mcap", "cannot be written"),
    ],
)
def test_where_nothing_can_be_recorded_nothing_is_started(elys, tmp_path: Path, path: str, expected: str) -> None:
    """Above all not over the very scene that is to be run."""
    write_sample("empty", "it.scene.json")
    before = (tmp_path / "it.scene.json").read_bytes()
    (tmp_path / "taken").write_text("a file, no directory")
    (tmp_path / "folder.mcap").mkdir()
    for words in (
        ("run", "it.scene.json", *HEADLESS, "--record"),
        ("run", "it.scene.json", "--record"),
        ("record", "-o"),
    ):
        assert expected in elys(*words, path).sentence
    assert (tmp_path / "it.scene.json").read_bytes() == before


def test_a_sample_is_not_written_over_a_scene_somebody_has_edited(elys, tmp_path: Path) -> None:
    assert elys("samples", "empty").status == 0
    (tmp_path / "empty.scene.json").write_text("edited")
    assert "is there already: choose another name with -o" in elys("samples", "empty").sentence
    assert (tmp_path / "empty.scene.json").read_text() == "edited"
    for name in ("empty", "meadow"):
        assert "cannot be written" in elys("samples", name, "-o", "gone/x.scene.json").sentence
    assert not (tmp_path / "gone").exists()


def test_what_is_no_file_is_not_replaced_by_one(elys, tmp_path: Path) -> None:
    path = tmp_path / "it.scene.json"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        assert "cannot be written" in elys("samples", "empty", "-o", path).sentence
        assert path.is_socket()


@pytest.mark.parametrize(
    ("content", "words", "expected"),
    [
        (None, (), "there is no launch file it.toml"),
        (b"", (), "describes no [[process]]"),
        (b"title = ", (), "it.toml"),
        (b"\xff\xfe", (), "cannot be read"),
        (b'[[process]]\nname = "a"', (), "missing required field `command`"),
        (b'[[process]]\nname = "a"\ncommand = ["/gone/x"]', (), "process 'a' cannot be started"),
        (b'[[process]]\nname = "a"\ncommand = ["a\\u0000b"]', (), "process 'a' cannot be started"),
        (b'[[process]]\nname = "a"\ncommand = ["true"]\nnice = -20', (), "nice"),
        (b'[[process]]\nname = "a"\ncommand = ["true"]\nnice = 99999999999999999999', (), "nice"),
        (b'[parameters]\nx = "what"\n[[process]]\nname = "a"\ncommand = ["true"]', (), "add x=VALUE"),
        (b'[parameters]\nx = "what"\n[[process]]\nname = "a"\ncommand = ["true"]', ("x",), "write NAME=VALUE"),
        (b'[parameters]\nx = "what"\n[[process]]\nname = "a"\ncommand = ["true"]', ("x=1", "y=2"), "no parameter 'y'"),
        (
            b'[parameters]\nx = "what"\n[[process]]\nname = "a"\ncommand = ["{x:>9999999}"]',
            ("x=1",),
            "cannot be filled in",
        ),
        (b'[parameters]\nx = "what"\n[[process]]\nname = "a"\ncommand = ["{x.__class__}"]', ("x=1",), "no parameter"),
    ],
)
def test_a_wrong_launch_file(
    elys, tmp_path: Path, content: bytes | None, words: tuple[str, ...], expected: str
) -> None:
    if content is not None:
        (tmp_path / "it.toml").write_bytes(content)
    assert expected in elys("launch", "it.toml", *words).sentence


def test_no_command_at_all_is_the_help(elys) -> None:
    outcome = elys()
    assert outcome.status == 2
    assert "elys demo" in outcome.err + outcome.out
