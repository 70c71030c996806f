"""`elys render` as somebody uses it: what comes out, the same each time, from where it was asked for."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import av
import numpy as np
import pytest

from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.mirror import SceneMirror
from elys.bus.recording import Recording
from elys.common.components import Camera, Transform, values_of
from elys.common.errors import DisplayError, ElysError
from elys.render_node.gpu import offscreen_context
from elys.render_node.offline import load_picture
from elys.verbs.viewpoint import Viewpoint, camera_entity

SIZE = ("--size", "96x64")


@pytest.fixture(scope="module", autouse=True)
def _drawable() -> None:
    try:
        offscreen_context().release()
    except DisplayError as error:
        pytest.skip(str(error))


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A box that falls on a floor, seen by two cameras."""

    def looking(name: str, x: float, priority: int) -> dict[str, object]:
        return {"name": name, "components": {"Transform": {"position": [x, 1, 6]}, "Camera": {"priority": priority}}}

    floor = {"Transform": {"position": [0, -0.5, 0], "scale": [30, 1, 30]}, "MeshRenderer": {}, "Collider": {}}
    box = {"Transform": {"position": [0, 2, 0]}, "MeshRenderer": {}, "Collider": {}, "RigidBody": {}}
    sun = {"Transform": {"rotation": [-0.5, 0, 0, 0.8660254]}, "Light": {}}
    path = tmp_path / "fall.scene.json"
    path.write_text(
        json.dumps(
            {
                "elys_scene": 1,
                "entities": [
                    {"name": "Floor", "components": floor},
                    {"name": "Box", "components": box},
                    {"name": "Sun", "components": sun},
                    looking("Main", 0.0, 5),
                    {"name": "Car", "children": [looking("Side", 1.5, 0)]},
                ],
            }
        )
    )
    return path


def works(outcome) -> str:
    """What a command printed that went well."""
    assert outcome.status == 0, outcome.err
    return outcome.out


@pytest.mark.gl
def test_the_same_command_gives_the_same_bytes(elys, scene: Path) -> None:
    for name in ("a", "b"):
        said = works(elys("render", scene, "-o", f"{name}.mp4", *SIZE, "--duration", "0.5", "--orbit", "2"))
        assert "15 pictures of 96x64" in said
        for suffix in ("png", "exr", "npy"):
            works(elys("render", scene, "-o", f"{name}.{suffix}", *SIZE, "--time", "0.3"))
    for suffix in ("mp4", "png", "exr", "npy"):
        assert Path(f"a.{suffix}").read_bytes() == Path(f"b.{suffix}").read_bytes(), suffix


@pytest.mark.gl
def test_numbers_are_the_light_behind_the_picture(elys, scene: Path) -> None:
    works(elys("render", scene, "-o", "light.npy", *SIZE))
    works(elys("render", scene, "-o", "ids.npy", *SIZE, "--view", "entity"))
    works(elys("render", scene, "-o", "depth.npy", *SIZE, "--view", "depth"))
    works(elys("render", scene, "-o", "depth.png", *SIZE, "--view", "depth"))
    light, ids, depth = np.load("light.npy"), np.load("ids.npy"), np.load("depth.npy")
    assert (light.shape, light.dtype) == ((64, 96, 3), np.float32)
    assert (ids.shape, ids.dtype, depth.dtype) == ((64, 96), np.uint32, np.float32)
    assert len(np.unique(ids)) == 3  # the sky, the floor and the box
    assert depth[ids == np.unique(ids)[2]].min() == pytest.approx(5.5, abs=1e-3)  # the front of the box
    assert load_picture(Path("depth.png")).shape == (64, 96, 3)
    assert "classes in kinds.classes.json" in works(
        elys("render", scene, "-o", "kinds.npy", *SIZE, "--view", "segmentation")
    )
    kinds = np.load("kinds.npy")
    legend = {
        0: None,
        **{one["id"]: one["name"] for one in json.loads(Path("kinds.classes.json").read_text())["classes"]},
    }
    assert kinds.dtype == np.uint32
    assert [legend[int(kinds[ids == entity].max())] for entity in np.unique(ids)] == [None, "Floor", "Box"]


@pytest.mark.gl
def test_cameras_are_chosen_by_name_and_paths_followed(elys, scene: Path) -> None:
    def drawn(view: str, *words: str) -> np.ndarray:
        works(elys("render", scene, "-o", "it.npy", *SIZE, "--view", view, *words))
        return np.load("it.npy")

    main = drawn("entity")
    np.testing.assert_array_equal(main, drawn("entity", "--camera", "Main"))
    side = drawn("entity", "--camera", "Side")
    np.testing.assert_array_equal(side, drawn("entity", "--camera", "Car/Side"))
    # A metre and a half to the right: the box is seen farther left.
    box = main.max()
    assert np.nonzero(side == box)[1].mean() < np.nonzero(main == box)[1].mean() - 10
    keys = [
        {"time": 0.0, "eye": [0, 1, 6], "target": [0, 1, 0]},
        {"time": 1.0, "eye": [0, 1, 4], "target": [0, 1, 0]},
    ]
    Path("path.json").write_text(json.dumps({"keyframes": keys}))
    for time, nearest in ((0.0, 5.5), (0.5, 4.5), (1.0, 3.5)):
        words = ("--path", "path.json", "--time", str(time))
        depth, ids = drawn("depth", *words), drawn("entity", *words)
        assert depth[ids == box].min() == pytest.approx(nearest, abs=0.05), time


@pytest.mark.gl
def test_a_recording_is_drawn_at_a_time_and_over_a_range(elys, scene: Path) -> None:
    works(elys("run", scene, "--headless", "--steps", "60", "--record", "run.mcap"))
    works(elys("render", "run.mcap", "-o", "at.npy", *SIZE, "--view", "depth", "--time", "0.5", "--camera", "Side"))
    works(elys("render", scene, "-o", "same.npy", *SIZE, "--view", "depth", "--time", "0.5", "--camera", "Side"))
    recorded, simulated = np.load("at.npy"), np.load("same.npy")
    np.testing.assert_array_equal(np.isinf(recorded), np.isinf(simulated))
    there = np.isfinite(recorded)
    assert np.quantile(np.abs(recorded[there] - simulated[there]), 0.98) < 0.05  # a tick's fall at the most
    said = works(
        elys("render", "run.mcap", "-o", "range.mp4", *SIZE, "--time", "0.2", "--duration", "0.3", "--fps", "20")
    )
    assert "6 pictures" in said
    assert "there is nothing at 3 s" in elys("render", "run.mcap", "-o", "late.png", "--time", "3").sentence
    assert "cameras are Car/Side, Main" in elys("render", "run.mcap", "-o", "late.png", "--camera", "Top").sentence
    assert not Path("late.png").exists()


@pytest.mark.gl
def test_debug_drawing_and_a_stamp_lie_over_scenes_and_recordings(elys, scene: Path) -> None:
    def drawn(source: object, *words: str) -> np.ndarray:
        works(elys("render", source, "-o", "it.png", *SIZE, "--time", "0.8", *words))
        return load_picture(Path("it.png")).astype(int)

    works(elys("run", scene, "--headless", "--steps", "60", "--record", "run.mcap"))
    for source in (scene, "run.mcap"):
        plain = drawn(source)
        for kind in ("aabb", "obb", "contacts", "trajectories", "axes", "grid", "labels"):
            assert (np.abs(drawn(source, "--debug", kind) - plain).max(axis=-1) > 30).sum() > 15, (source, kind)
        stamped = np.abs(drawn(source, "--stamp") - plain).max(axis=-1) > 30
        assert stamped[:30].any()
        assert not stamped[30:].any()
        some = np.abs(drawn(source, "--debug", "obb", "--debug-of", "Box") - plain).max(axis=-1) > 30
        assert some[:, :30].sum() == 0  # the floor's box reaches there
    joints = drawn("run.mcap", "--debug", "joints")
    np.testing.assert_array_equal(joints, drawn("run.mcap"))  # there are none


@pytest.mark.gl
def test_a_recording_gets_pictures_and_keeps_all_it_had(elys, scene: Path) -> None:
    works(elys("run", scene, "--headless", "--steps", "61", "--record", "run.mcap"))
    said = works(
        elys("render", "run.mcap", "-o", "with.mcap", "--size", "97x64", "--fps", "20", "--camera", "Car/Side")
    )
    assert "21 pictures of 97x64" in said
    with Recording(Path("run.mcap")) as before, Recording(Path("with.mcap")) as after:
        kept = [(m.channel, m.body, m.log_time) for m in after.reader.messages() if not m.channel.startswith("video/")]
        assert kept == [(m.channel, m.body, m.log_time) for m in before.reader.messages()]
        assert after.asset_references() == before.asset_references()
        state = np.array([message.log_time for message in after.reader.messages(("state",))])
        pictures = list(after.reader.messages(("video/Car-Side",)))
    decoder, seen = av.CodecContext.create("h264", "r"), []
    for message in pictures:
        content = json.loads(message.body)
        frames = decoder.decode(av.Packet(base64.b64decode(content["data"])))
        assert len(frames) == 1
        seen.append(frames[0].to_ndarray(format="rgb24")[:64, :97])
        assert message.log_time in state
    works(elys("render", "run.mcap", "-o", "same.png", "--size", "97x64", "--time", "0.5", "--camera", "Car/Side"))
    assert np.abs(seen[10].astype(int) - load_picture(Path("same.png"))).mean() < 4
    assert np.abs(seen[20].astype(int) - seen[0]).mean() > 1
    works(elys("render", "with.mcap", "-o", "again.mcap", *SIZE, "--fps", "5"))  # another view beside the first
    with Recording(Path("again.mcap")) as again:
        counts = again.reader.message_counts()
    assert (counts["video/Car-Side"], counts["video/view"]) == (21, 6)
    for words, sentence in (
        (("with.mcap", "-o", "with.mcap"), "is the recording itself"),
        (("with.mcap", "-o", "new.mcap", "--camera", "Car/Side"), "holds pictures of 'Car/Side' already"),
        ((str(scene), "-o", "new.mcap"), "name the recording it is made of"),
    ):
        assert sentence in elys("render", *words, *SIZE).sentence
    assert not Path("new.mcap").exists()


def test_what_cannot_be_drawn_over_pictures_is_one_sentence(elys, scene: Path) -> None:
    for words, said in (
        (("-o", "a.png", "--debug", "bones"), "there is no debug drawing 'bones': there are aabb, obb, contacts"),
        (("-o", "a.npy", "--debug", "aabb"), "a.npy is to hold numbers: write a .png or .mp4"),
        (("-o", "a.exr", "--stamp"), "--stamp draws over pictures"),
        (("-o", "a.png", "--view", "depth", "--debug", "aabb"), "leave --view depth out"),
        (("-o", "a.png", "--debug-of", "Box"), "give --debug as well"),
        (("-o", "a.png", "--debug", "aabb", "--debug-of", "Bax"), "there is no entity 'Bax'; near it are Box"),
    ):
        assert said in elys("render", scene, *words).sentence
        assert not Path(words[1]).exists()


@pytest.fixture
def mirror() -> SceneMirror:
    """Two cars with a camera each, and one camera that is off."""
    made = SceneMirror()
    looks = {"Transform": values_of(Transform()), "Camera": values_of(Camera())}
    changes = (
        Spawned(entity=1, name="Car", parent=0, enabled=True, components={}),
        Spawned(entity=2, name="Front", parent=1, enabled=True, components=looks),
        Spawned(entity=3, name="Truck", parent=0, enabled=True, components={}),
        Spawned(entity=4, name="Front", parent=3, enabled=True, components=looks),
        Spawned(entity=5, name="Sky", parent=0, enabled=False, components=looks),
    )
    made.apply_delta(SceneDelta(epoch=0, sequence=0, tick=0, changes=changes))
    return made


def test_a_camera_that_is_not_to_be_had_is_said_with_those_that_are(mirror: SceneMirror) -> None:
    assert camera_entity(mirror, "Car/Front") == 2
    assert camera_entity(mirror, "Truck/Front") == 4
    for name, said in (
        ("Front", "several cameras are called 'Front': say which of Car/Front, Truck/Front"),
        ("Car", "cameras are Car/Front, Sky, Truck/Front"),
        ("Sky", "is switched off"),
    ):
        with pytest.raises(ElysError, match=said):
            camera_entity(mirror, name)
    with pytest.raises(ElysError, match="the scene has none; --path and --orbit bring their own"):
        Viewpoint(camera="Front").entity_in(SceneMirror())
