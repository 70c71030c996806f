"""The view "segmentation" beside what rays meet and beside a list of classes made by hand."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from elys.bus.messages.scene import ComponentSet, Despawned, Renamed, SceneChange, SceneDelta, Spawned
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.components import Component, MeshRenderer, Transform, values_of
from elys.common.errors import ElysError
from elys.render_node.offline import OfflineRenderer
from elys.render_node.picture_files import legend_path, save_legend
from elys.render_node.scene_classes import SceneClasses

WIDTH, HEIGHT = 120, 80
METRES = 8.0  # that are seen from below to above
CAMERA = ViewCamera(position=(0.0, 0.0, 10.0), rotation=(0.0, 0.0, 0.0, 1.0), ortho_height=METRES)
CAR, WHEEL, ROCK = "/scenes/car.prefab.json", "parts/wheel.glb", "elys:game/rock.prefab.json"
GROUP, SCRIPTED = 1, 2  # parents that are nothing to be seen
# Boxes of a metre: id, name, parent, prefab, where their middle is seen, how near; and what they are.
BOXES = (
    (10, "First", GROUP, CAR, (-4.0, 2.0), 0.0, "car"),
    (11, "Wheel", 10, WHEEL, (-3.6, 1.4), 2.0, "wheel"),
    (12, "Hub 3", 11, "", (-3.2, 1.2), 4.0, "wheel"),
    (13, "Body", 10, "", (-2.5, 2.2), 0.0, "car"),
    (20, "Second", 0, CAR, (0.0, 2.0), 0.0, "car"),
    (21, "Spare wheel", 20, WHEEL, (0.4, 1.4), 2.0, "wheel"),
    (3_000_000_000, "Stone", 0, ROCK, (3.0, 2.0), 0.0, "rock"),
    (31, "Crate 1", 0, "", (-4.0, -2.0), 0.0, "Crate"),
    (32, "Crate_02", 0, "", (-3.4, -1.6), -2.0, "Crate"),
    (33, "Crate", SCRIPTED, "", (-1.5, -2.0), 0.0, "Crate"),
    (34, "Crate.003", SCRIPTED, "", (0.0, -2.0), 0.0, "Crate"),
    (35, "Step 0.05 m", 0, "", (1.5, -2.0), 0.0, "Step 0.05 m"),
    (36, "", 0, "", (3.0, -2.0), 0.0, "box"),
    (37, "42", 0, "", (4.5, -2.0), 0.0, "42"),
)


def spawned(entity: int, name: str, parent: int, prefab: str, *components: Component) -> Spawned:
    """As the bus tells of it."""
    values = {type(value).__name__: values_of(value) for value in components}
    return Spawned(entity=entity, name=name, parent=parent, enabled=True, prefab=prefab, components=values)


def box(entity: int, name: str, parent: int, prefab: str, middle: tuple[float, float], z: float) -> Spawned:
    """A box at a place in the world, whatever its parent is."""
    above = next(((x, y, depth) for number, *_, (x, y), depth, _ in BOXES if number == parent), (0.0, 0.0, 0.0))
    place = (middle[0] - above[0], middle[1] - above[1], z - above[2])
    return spawned(entity, name, parent, prefab, Transform(position=place), MeshRenderer())


def change(mirror: SceneMirror, *changes: SceneChange) -> None:
    mirror.apply_delta(SceneDelta(epoch=0, sequence=mirror.sequence + 1, tick=0, changes=changes))


@pytest.fixture
def mirror() -> SceneMirror:
    made = SceneMirror()
    change(made, spawned(GROUP, "Traffic", 0, "", Transform()), spawned(SCRIPTED, "Crates", 0, "", Transform()))
    change(made, *(box(*values) for *values, _ in BOXES))
    return made


def boxes_met() -> np.ndarray:
    """The row of BOXES that a ray through each pixel's centre meets first, -1 for none: faces of boxes are squares."""
    x = ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5) * METRES * WIDTH / HEIGHT
    y = (0.5 - (np.arange(HEIGHT) + 0.5) / HEIGHT) * METRES
    met, nearest = np.full((HEIGHT, WIDTH), -1), np.full((HEIGHT, WIDTH), -np.inf)
    for row, (*_, (left, up), z, _) in enumerate(BOXES):
        inside = (np.abs(x - left) < 0.5)[None, :] & (np.abs(y - up) < 0.5)[:, None] & (z > nearest)
        met[inside], nearest[inside] = row, z
    return met


@pytest.mark.gl
def test_pixels_are_of_the_class_of_what_is_seen_there(context, mirror) -> None:
    with OfflineRenderer(mirror, width=WIDTH, height=HEIGHT, shows="segmentation", context=context) as renderer:
        classes = renderer.values(camera=CAMERA)
        picture = renderer.picture(camera=CAMERA)
        legend = {one.id: one for one in renderer.legend()}
    with OfflineRenderer(mirror, width=WIDTH, height=HEIGHT, shows="entity", context=context) as renderer:
        entity = renderer.values(camera=CAMERA)
    assert (classes.shape, classes.dtype) == ((HEIGHT, WIDTH, 1), np.uint32)
    met = boxes_met()
    assert set(met.ravel()) == {-1, *range(len(BOXES))}
    expected = np.array([*(name for *_, name in BOXES), ""])[met]
    names = {0: "", **{number: one.name for number, one in legend.items()}}
    assert (np.vectorize(names.get)(classes[..., 0]) == expected).mean() > 0.995  # edges go through some centres
    class_of = {0: "", **{number: name for number, *_, name in BOXES}}
    np.testing.assert_array_equal(np.vectorize(names.get)(classes[..., 0]), np.vectorize(class_of.get)(entity[..., 0]))
    colors = np.array([(0, 0, 0), *(legend[number].color for number in sorted(legend))])
    np.testing.assert_array_equal(picture[..., :3], colors[classes[..., 0]])
    assert len(np.unique(colors, axis=0)) == len(colors)


def test_numbers_go_by_names_and_stay_with_them(mirror) -> None:
    classes = SceneClasses(mirror)
    before = {one.name: one.id for one in classes.legend()}
    assert before == {name: number for number, name in enumerate(sorted({name for *_, name in BOXES}), 1)}
    change(mirror, Despawned(entity=33), Renamed(entity=31, name="Barrel 7"))
    change(mirror, spawned(50, "Apple", 0, "", MeshRenderer()), Despawned(entity=36))
    after = {one.name: one.id for one in classes.legend()}
    assert after == before | {"Apple": len(before) + 1, "Barrel": len(before) + 2}
    seen = classes.seen(np.array([[0, 31, 32, 33, 50, 36, GROUP, 99]], np.uint32))
    assert seen.tolist() == [[0, after["Barrel"], after["Crate"], 0, after["Apple"], 0, 0, 0]]
    change(mirror, ComponentSet(entity=GROUP, component="MeshRenderer", values=values_of(MeshRenderer())))
    assert {one.name for one in classes.legend()} == {*after, "Traffic"}
    colors = {one.name: one.color for one in classes.legend()}
    assert {one.name: one.color for one in SceneClasses(mirror).legend()}.items() <= colors.items()


def test_an_empty_scene_has_no_classes() -> None:
    classes = SceneClasses(SceneMirror())
    assert classes.legend() == ()
    np.testing.assert_array_equal(classes.seen(np.array([[0, 5]], np.uint32)), [[0, 0]])


def test_the_legend_stands_beside_the_picture(mirror, tmp_path: Path) -> None:
    path = legend_path(tmp_path / "seen.v2.npy")
    assert path == tmp_path / "seen.v2.classes.json"
    legend = SceneClasses(mirror).legend()
    save_legend(path, legend)
    found = msgspec.json.decode(path.read_bytes())
    assert [(one["id"], one["name"], tuple(one["color"])) for one in found["classes"]] == list(legend)
    save_legend(path, ())
    assert msgspec.json.decode(path.read_bytes()) == {"classes": []}
    with pytest.raises(ElysError, match="cannot be written"):
        save_legend(tmp_path / "gone" / "a.classes.json", legend)
