"""Lines and letters over pictures: where they are, what hides them, and that each kind says what is so."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from elys.bus.messages.physics import ContactBatch, DebugLines, Meetings, Touches
from elys.bus.messages.scene import EnabledSet, SceneDelta, Spawned
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.components import Component, Joint, Material, MeshRenderer, Transform, values_of
from elys.common.errors import ElysError
from elys.common.scene import PictureSettings, SceneSettings
from elys.render_node.camera import View
from elys.render_node.debug_drawing import DEBUG_KINDS, PHYSICS_LINES, DebugDrawing, parsed_kinds
from elys.render_node.lettering import Sheet, free_places, sheet_for, write_on
from elys.render_node.marks import ARROW, IMPULSE, LETTERS, STATIC, Label, Lines, Marks, arrows, box_corners, box_edges
from elys.render_node.passes.marks import placed_labels
from elys.render_node.quality import FAST, FULL
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_reader import SceneReader
from elys.render_node.trails import TRAIL_SECONDS

CAMERA = ViewCamera(position=(0.0, 0.0, 5.0), rotation=(0.0, 0.0, 0.0, 1.0))
RED = (255, 0, 0)
GLOWING = Material(base_color=(0.0, 0.0, 0.0), emissive=(0.0, 0.2, 0.0))


def scene(*things: tuple[str, int, tuple[Component, ...]]) -> SceneMirror:
    """A mirror of entities 1, 2, ... by name, parent and components."""
    mirror = SceneMirror()
    mirror.epoch = 1
    changes = tuple(
        Spawned(
            entity=number,
            name=name,
            parent=parent,
            enabled=True,
            components={type(part).__name__: values_of(part) for part in parts},
        )
        for number, (name, parent, parts) in enumerate(things, 1)
    )
    mirror.apply_delta(SceneDelta(epoch=1, sequence=0, tick=0, changes=changes))
    return mirror


def placed(mirror: SceneMirror) -> RenderWorld:
    """The mirror's scene as it stands."""
    world = RenderWorld()
    world.read_scene(SceneReader(mirror))
    if mirror.latest_frame is not None:
        world.take_state(mirror.latest_frame)
    for batch in world.batches:
        world.assets.mesh(batch.mesh)
    world.assets.settle()
    world.place()
    return world


def box(position: tuple[float, float, float], scale: float = 1.0) -> tuple[Component, ...]:
    return (Transform(position=position, scale=(scale,) * 3), MeshRenderer())


# --- lines ---------------------------------------------------------------------------------------------------------


def across(y: float, z: float, *, width: float = 4.0, hidden: float = 0.0) -> Marks:
    """A red line from left to right."""
    ends = np.array([[(-3.0, y, z), (3.0, y, z)]])
    return Marks(lines=Lines.of(ends, RED, width=width, hidden=hidden))


@pytest.mark.gl
@pytest.mark.parametrize("quality", [FULL, FAST])
@pytest.mark.parametrize("exposure", [0.0, -3.0])
def test_lines_have_their_width_and_colour_whatever_the_exposure(context, quality, exposure, stage) -> None:
    stage.settings = SceneSettings(
        background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0), picture=PictureSettings(exposure=exposure)
    )
    renderer = Renderer(context, quality=quality)
    pixels = renderer.read_pixels(renderer.draw(stage.world(), CAMERA, 100, 80, marks=across(0.0, 0.0))).astype(int)
    column = pixels[:, 50]
    red = (column[:, 0] > 200) & (column[:, 1] < 60)
    assert 3 <= red.sum() <= 5
    assert red[38:42].all()


@pytest.mark.gl
def test_what_stands_before_a_line_hides_it_as_far_as_it_wants(renderer: Renderer, stage) -> None:
    stage.add(Transform(scale=(2.0, 2.0, 0.1)), MeshRenderer(), GLOWING)

    def red_at(column: int, marks: Marks) -> int:
        pixels = renderer.read_pixels(renderer.draw(stage.world(), CAMERA, 100, 80, marks=marks))
        return int(pixels[38:42, column, 0].max())

    assert red_at(50, across(0.0, 1.0)) > 220  # before the plate
    assert red_at(50, across(0.0, -1.0)) < 5  # behind it
    assert red_at(10, across(0.0, -1.0)) > 220  # beside it
    assert 40 < red_at(50, across(0.0, -1.0, hidden=0.5)) < 220
    assert red_at(50, across(0.0, 0.05)) > 220  # on its face


@pytest.mark.gl
def test_a_line_that_begins_behind_the_eye_is_seen_from_where_it_comes_before_it(renderer: Renderer, stage) -> None:
    world = stage.world()
    behind = Marks(lines=Lines.of(np.array([[(0.0, -0.5, 9.0), (0.0, -0.5, -40.0)]]), RED, width=3.0))
    pixels = renderer.read_pixels(renderer.draw(world, CAMERA, 100, 80, marks=behind)).astype(int)
    seen = pixels[..., 0] > 150
    assert seen[45:, 48:52].any(axis=1).all()  # from the lower edge up to near the horizon
    assert not seen[:38].any()
    gone = Marks(lines=Lines.of(np.array([[(0.0, 0.0, 9.0), (1.0, 0.0, 6.0)]]), RED))
    assert not renderer.read_pixels(renderer.draw(world, CAMERA, 100, 80, marks=gone))[..., :3].any()


@pytest.mark.gl
def test_parts_of_a_picture_fit_lines_and_letters_included(renderer: Renderer, stage) -> None:
    stage.add(*box((0.0, 0.0, 0.0)))
    world = stage.world()
    marks = Marks(
        lines=Lines.of(np.array([[(-3.0, -1.3, 0.0), (3.0, 1.7, 0.5)]]), RED, width=3.0),
        labels=(Label("Quick brown fox", (0.0, 0.4, 0.0)), Label("left", (-2.0, 0.1, 0.0))),
        notes=("tick 12",),
    )
    whole = renderer.read_pixels(renderer.draw(world, CAMERA, 160, 120, marks=marks))
    parts = np.zeros_like(whole)
    for x, y in ((0, 0), (80, 0), (0, 60), (80, 60)):
        target = renderer.draw(world, CAMERA, 160, 120, marks=marks, region=(x, y, 80, 60))
        parts[y : y + 60, x : x + 80] = renderer.read_pixels(target)
    far_off = np.abs(whole.astype(int) - parts.astype(int)).max(axis=-1) > 16
    assert far_off.mean() < 0.002


# --- letters -------------------------------------------------------------------------------------------------------


@pytest.mark.gl
@pytest.mark.parametrize("ground", [0.0, 40.0])
def test_letters_are_read_on_black_and_on_white_and_are_what_the_sheet_holds(renderer: Renderer, stage, ground) -> None:
    stage.settings = SceneSettings(background=(ground,) * 3, ambient=(0.0, 0.0, 0.0))
    plain = renderer.read_pixels(renderer.draw(stage.world(), CAMERA, 120, 60))
    pixels = renderer.read_pixels(renderer.draw(stage.world(), CAMERA, 120, 60, marks=Marks(notes=("Tick 7",))))
    expected = plain.copy()
    write_on(expected, ("Tick 7",), LETTERS)
    assert np.abs(pixels[..., :3].astype(int) - expected[..., :3].astype(int)).max() <= 2
    written = pixels[5:30, 5:60, :3].astype(int)
    assert written.max() - written.min() > 150  # light letters with dark edges, on either ground


def test_letters_that_no_font_has_lose_their_accents_or_become_question_marks() -> None:
    sheet = Sheet(14)
    names = ("\U0010ffff", "\n")
    unknown = sheet.letter("?")
    for name in names:
        letter = sheet.letter(name)
        cell = np.s_[letter.row : letter.row + sheet.cell[1], letter.column : letter.column + sheet.cell[0]]
        other = np.s_[unknown.row : unknown.row + sheet.cell[1], unknown.column : unknown.column + sheet.cell[0]]
        np.testing.assert_array_equal(sheet.texels[cell], sheet.texels[other])
    accented = sheet.letter("é")
    assert (
        sheet.texels[accented.row : accented.row + sheet.cell[1], accented.column :][:, : sheet.cell[0], 0].max() > 200
    )
    for number in range(0x4E00, 0x4E00 + 600):  # more than there is room for
        sheet.letter(chr(number))
    assert sheet.letter("A").advance > 5


def test_labels_stand_above_their_places_and_the_nearer_push_out_the_farther() -> None:
    view, sheet = View.of(CAMERA, 400, 300), sheet_for(300)
    labels = (
        Label("behind", (0.02, 0.0, -3.0)),
        Label("before", (0.0, 0.0, 0.0)),
        Label("not seen", (0.0, 0.0, 9.0)),
        Label("aside", (1.5, 0.0, 0.0)),
    )
    shown = {text: (x, y) for text, x, y, _ in placed_labels(labels, view, sheet)}
    assert set(shown) == {"before", "aside"}
    x, y = shown["before"]
    assert x + sheet.width("before") / 2 == pytest.approx(200.0)
    assert y + sheet.line_height < 150.0 < y + 2 * sheet.line_height
    pixel = 300 / (2 * np.tan(0.45) * 5.0)
    assert shown["aside"][0] + sheet.width("aside") / 2 == pytest.approx(200 + 1.5 * pixel)


def test_free_places_overlap_none_that_is_kept() -> None:
    rng = np.random.default_rng(3)
    boxes = np.concatenate([rng.uniform(0, 100, (60, 2)), rng.uniform(2, 30, (60, 2))], axis=1)

    def overlap(a: Any, b: Any) -> bool:
        return a[0] < b[0] + b[2] and b[0] < a[0] + a[2] and a[1] < b[1] + b[3] and b[1] < a[1] + a[3]

    kept: list[int] = []
    for row in range(60):
        if not any(overlap(boxes[row], boxes[other]) for other in kept):
            kept.append(row)
    assert free_places(boxes).tolist() == kept
    assert 5 < len(kept) < 60


# --- kinds ---------------------------------------------------------------------------------------------------------


def test_kinds_are_named_with_commas_and_come_in_one_order() -> None:
    assert parsed_kinds("labels, aabb") == ("aabb", "labels")
    assert parsed_kinds("") == ()
    with pytest.raises(ElysError, match="there is no debug drawing 'boxes': there are aabb, obb"):
        parsed_kinds("aabb,boxes")


def test_boxes_of_both_kinds_hold_what_is_drawn() -> None:
    turned = (
        Transform(position=(3.0, 0.0, 0.0), rotation=(0.0, 0.0, np.sin(np.pi / 8), np.cos(np.pi / 8))),
        MeshRenderer(),
    )
    mirror = scene(("A", 0, box((0.0, 1.0, 0.0), 2.0)), ("B", 0, turned))
    world = placed(mirror)
    drawing = DebugDrawing(mirror)
    along = drawing.marks(world, ("aabb",)).lines.ends.reshape(2, 24, 3)
    np.testing.assert_allclose(along[0].min(axis=0), (-1.0, 0.0, -1.0), atol=1e-6)
    np.testing.assert_allclose(along[1].max(axis=0) - along[1].min(axis=0), (2**0.5, 2**0.5, 1.0), atol=1e-6)
    tight = drawing.marks(world, ("obb",)).lines.ends
    np.testing.assert_allclose(np.linalg.norm(tight[:12, 1] - tight[:12, 0], axis=1), 2.0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(tight[12:, 1] - tight[12:, 0], axis=1), 1.0, atol=1e-6)
    only = drawing.marks(world, ("aabb", "labels"), (2,))
    assert len(only.lines) == 12
    assert [label.text for label in only.labels] == ["B"]
    assert only.labels[0].position == pytest.approx((3.0, 0.5 * 2**0.5, 0.0), abs=1e-6)


def test_lines_of_physics_go_before_what_can_be_guessed_and_of_another_run_do_not() -> None:
    mirror = scene(("A", 0, box((0.0, 0.0, 0.0))))
    world, drawing = placed(mirror), DebugDrawing(mirror)
    ends = np.array([[(0.0, 0.0, 0.0), (0.0, 0.0, 2.0)]], "<f4")

    def told(epoch: int, positions: bytes) -> DebugLines:
        return DebugLines(epoch=epoch, tick=4, positions=positions, colors=b"\x01")

    drawing.take_lines("boxes", told(1, ends.tobytes()))
    assert drawing.marks(world, ("aabb",)).lines.ends.tolist() == ends.tolist()
    assert len(drawing.marks(world, ("aabb",), (1,)).lines) == 12  # whose these lines are is not said
    drawing.take_lines("boxes", told(1, ends.tobytes()[:-3]))  # cut: as if it had not come
    assert drawing.marks(world, ("aabb",)).lines.ends.tolist() == ends.tolist()
    drawing.take_lines("boxes", told(7, ends.tobytes()))
    assert len(drawing.marks(world, ("aabb",)).lines) == 12


def test_contacts_of_physics_have_normals_impulses_and_numbers() -> None:
    mirror = scene(("A", 0, box((0.0, 0.0, 0.0))))
    drawing = DebugDrawing(mirror)
    cross = np.zeros((3, 2, 3))
    normals = np.array([[(0, 0, 0), (0, 0.2, 0)], [(1, 0, 0), (1, 0, 0.2)]])
    positions = np.concatenate([cross, cross + np.array((1, 0, 0)), normals]).astype("<f4")
    values = np.array([4.0] * 3 + [1.0] * 3 + [4.0, 1.0], "<f4")
    colors = bytes([0] * 6 + [1] * 2)
    lines = DebugLines(epoch=1, tick=1, positions=positions.tobytes(), colors=colors, values=values.tobytes())
    drawing.take_lines("contacts", lines)
    made = drawing.marks(placed(mirror), ("contacts",))
    assert [label.text for label in made.labels] == ["4 N s", "1 N s"]
    ends = made.lines.ends
    lengths = np.linalg.norm(ends[:2, 1] - ends[:2, 0], axis=1)  # of the impulses
    assert lengths[0] == pytest.approx(4 * lengths[1])
    np.testing.assert_allclose(ends[2:4], normals, atol=1e-6)


def test_contacts_of_a_recording_begin_go_along_and_end(make_frame: Callable[..., Any]) -> None:
    mirror = scene(("Floor", 0, box((0.0, -0.5, 0.0))), ("Ball", 0, box((0.0, 0.5, 0.0))))
    drawing = DebugDrawing(mirror)
    mirror.keep_frame(make_frame({2: (0.0, 0.5, 0.0)}))
    pair = {"entity_a": (1,), "entity_b": (2,), "body_a": (1,), "body_b": (2,)}
    touches = Touches(
        **pair, point=((0.0, 0.0, 0.0),), normal=((0.0, 1.0, 0.0),), depth=(0.0,), normal_impulse=(2.0,), speed=(1.0,)
    )
    drawing.take_contacts(ContactBatch(epoch=1, tick=1, begun=touches))
    mirror.keep_frame(make_frame({2: (4.0, 0.5, 0.0)}, tick=2))
    made = drawing.marks(placed(mirror), ("contacts",))
    assert made.lines.ends[1].tolist() == [
        [4.0, 0.0, 0.0],
        [4.0, 0.2, 0.0],
    ]  # the normal, below the ball that rolled on
    assert [label.text for label in made.labels] == ["2 N s"]
    assert len(drawing.marks(placed(mirror), ("contacts",), (1,)).lines) == len(made.lines)
    drawing.take_contacts(ContactBatch(epoch=1, tick=2, ended=Meetings(**pair)))
    assert len(drawing.marks(placed(mirror), ("contacts",)).lines) == 0


def test_ways_are_those_of_the_last_seconds_of_who_moved(make_frame: Callable[..., Any]) -> None:
    mirror = scene(*((name, 0, box((0.0, 0.0, 0.0))) for name in ("Runner", "Sitter", "Late")))
    drawing, step = DebugDrawing(mirror), 1 / 60
    for tick in range(241):
        poses = {1: (tick * step, 0.0, 0.0), 2: (0.0, 3.0, 0.0)} | ({3: (0.0, tick * step, 0.0)} if tick > 200 else {})
        frame = make_frame(poses, tick=tick, simulation_time=tick * step, published_at=tick)
        mirror.keep_frame(frame)
        drawing.take_state(frame)
    lines = drawing.marks(placed(mirror), ("trajectories",)).lines
    runner = lines.ends[np.abs(lines.ends[..., 1]).max(axis=1) < 1e-9]
    assert runner[0, 0, 0] == pytest.approx(4.0 - TRAIL_SECONDS, abs=2.5 * step)
    assert runner[-1, 1].tolist() == [pytest.approx(4.0), 0.0, 0.0]
    np.testing.assert_array_equal(runner[1:, 0], runner[:-1, 1])  # one way, without gaps
    late = lines.ends[np.abs(lines.ends[..., 1]).max(axis=1) > 1e-9]
    assert late[..., 1].min() == pytest.approx(201 * step, abs=2.5 * step)
    assert late[..., 1].max() == pytest.approx(4.0)
    only = drawing.marks(placed(mirror), ("trajectories",), (3,)).lines
    assert len(only) == len(late)


def test_velocities_joints_and_axes(make_frame: Callable[..., Any]) -> None:
    hinge = Joint(
        kind="hinge", other=1, anchor=(0.0, 0.5, 0.0), other_anchor=(0.0, -0.5, 0.0), axis=(0.0, 0.0, 2.0), fit=False
    )
    mirror = scene(("Post", 0, box((0.0, 2.0, 0.0))), ("Door", 0, (*box((0.0, 1.0, 0.0)), hinge)))
    frame = make_frame({2: (0.0, 1.0, 0.0)})
    frame.linear_velocity[:] = (0.0, 0.0, 5.0)
    mirror.keep_frame(frame)
    world, drawing = placed(mirror), DebugDrawing(mirror)
    shaft = drawing.marks(world, ("velocity",)).lines.ends[0]
    np.testing.assert_allclose(shaft, [(0, 1, 0), (0, 1, 1)])
    ends = drawing.marks(world, ("joints",)).lines.ends
    assert [(0.0, 1.0, 0.0), (0.0, 1.5, 0.0)] in [[tuple(end) for end in line] for line in ends.tolist()]
    np.testing.assert_allclose(ends[-1], [(0, 1.5, -0.3), (0, 1.5, 0.3)])
    made = drawing.marks(world, ("axes",))
    assert [label.text for label in made.labels] == ["x", "y", "z"]
    directions = made.lines.ends[:, 1] - made.lines.ends[:, 0]
    np.testing.assert_allclose(directions[-3:], np.eye(3))
    np.testing.assert_allclose(directions[:3] / np.linalg.norm(directions[:3], axis=1)[:, None], np.eye(3), atol=1e-6)


def test_an_empty_scene_has_nothing_to_show_of_any_kind() -> None:
    mirror = SceneMirror()
    made = DebugDrawing(mirror).marks(placed(mirror), DEBUG_KINDS)
    assert len(made.lines) == 3  # the world's axes
    assert made.grid


def test_arrows_point_to_their_ends_and_boxes_have_twelve_edges() -> None:
    made = arrows(np.zeros((2, 3)), np.array([(0.0, 0.0, 2.0), (0.0, 0.0, 0.0)]))
    assert made.shape == (6, 2, 3)
    assert np.isfinite(made).all()
    np.testing.assert_allclose(made[[0, 2, 4], 1], [(0, 0, 2)] * 3)
    edges = box_edges(box_corners(np.zeros((1, 3)), np.array([(1.0, 2.0, 3.0)])))
    lengths = sorted(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).tolist())
    assert lengths == [1.0] * 4 + [2.0] * 4 + [3.0] * 4


# --- who is out of sight -------------------------------------------------------------------------------------------


def told_boxes(
    mirror: SceneMirror, entities: list[tuple[int, int]], *, islands: list[float] | None = None
) -> DebugLines:
    """Lines of physics, twelve each in the space of a unit box that stands at its first entity's number along x."""
    edges = box_edges(
        box_corners(np.array([(a, 0.0, 0.0) for a, _ in entities]), np.array([(a + 1, 1, 1) for a, _ in entities]))
    )
    return DebugLines(
        epoch=mirror.epoch,
        tick=1,
        positions=edges.astype("<f4").tobytes(),
        colors=bytes([1]) * len(edges),
        values=b"" if islands is None else np.repeat(np.array(islands, "<f4"), 12).tobytes(),
        entities=np.repeat(np.array(entities, "<u4"), 12, axis=0).tobytes(),
    )


@pytest.mark.parametrize("way", ["hidden", "hidden above", "switched off", "switched off above"])
def test_of_who_is_out_of_sight_nothing_is_marked(make_frame: Callable[..., Any], way: str) -> None:
    """As if it were not there: marks of a scene without it are the same."""
    hinge = Joint(kind="hinge", other=1, anchor=(0.0, 0.5, 0.0), other_anchor=(0.0, -0.5, 0.0), axis=(0.0, 0.0, 1.0))
    both = ("Post", 0, box((0.0, 2.0, 0.0))), ("Group", 0, ()), ("Door", 2, (*box((3.0, 1.0, 0.0)), hinge))
    pair = {"entity_a": (1,), "entity_b": (3,), "body_a": (1,), "body_b": (3,)}
    touches = Touches(
        **pair, point=((0.0, 0.0, 0.0),), normal=((0.0, 1.0, 0.0),), depth=(0.0,), normal_impulse=(2.0,), speed=(1.0,)
    )

    def made(things: tuple[Any, ...], hidden: tuple[int, ...] = (), off: int = 0) -> Marks:
        mirror = scene(*things)
        if off:
            mirror.apply_delta(
                SceneDelta(epoch=1, sequence=1, tick=0, changes=(EnabledSet(entity=off, enabled=False),))
            )
        drawing = DebugDrawing(mirror)
        for tick in range(2):
            poses = {entity: (float(entity), 0.5 * tick, 0.0) for entity in (1, 3) if entity in mirror.entities}
            frame = make_frame(poses, tick=tick, simulation_time=float(tick), published_at=tick)
            frame.linear_velocity[:] = (0.0, 0.5, 0.0)
            mirror.keep_frame(frame)
            drawing.take_state(frame)
        if 3 in mirror.entities:
            drawing.take_contacts(ContactBatch(epoch=1, tick=1, begun=touches))
        return drawing.marks(placed(mirror), DEBUG_KINDS, hidden=hidden)

    number = 2 if way.endswith("above") else 3
    out_of_sight = made(both, hidden=(number,)) if way.startswith("hidden") else made(both, off=number)
    alone, everybody = made(both[:2]), made(both)
    np.testing.assert_array_equal(out_of_sight.lines.ends, alone.lines.ends)
    assert out_of_sight.labels == alone.labels
    assert len(everybody.lines) > len(alone.lines) + 30
    assert {label.text for label in everybody.labels} - {label.text for label in alone.labels} >= {"Door", "2 N s"}


@pytest.mark.parametrize("kind", ["aabb", "contacts", "joints", "sleeping"])
def test_lines_of_physics_are_of_whom_they_say(kind: str) -> None:
    mirror = scene(*((name, 0, ()) for name in "ABC"))
    world, drawing = placed(mirror), DebugDrawing(mirror)
    drawing.take_lines(PHYSICS_LINES[kind], told_boxes(mirror, [(1, 0), (1, 2), (3, 0)]))

    def nearest(**asked: Any) -> float:
        """The least x of any line."""
        return float(drawing.marks(world, (kind,), **asked).lines.ends[..., 0].min())

    def count(**asked: Any) -> int:
        return len(drawing.marks(world, (kind,), **asked).lines)

    whole = count()
    assert 0.9 < nearest() < 1.1
    assert count(entities=(3,)) * 3 == count(entities=(2,)) * 3 == whole
    assert count(entities=(1,)) * 3 == whole * 2
    assert 2.9 < nearest(hidden=(1,)) < 3.1
    assert count(hidden=(2,)) * 3 == whole * 2
    assert count(entities=(1,), hidden=(2,)) * 3 == whole


def test_an_island_is_boxed_as_far_as_it_is_seen() -> None:
    mirror = scene(*((name, 0, ()) for name in "ABC"))
    world, drawing = placed(mirror), DebugDrawing(mirror)
    drawing.take_lines("islands", told_boxes(mirror, [(1, 0), (2, 0), (3, 0)], islands=[0.0, 0.0, 1.0]))

    def spans(**asked: Any) -> list[tuple[float, float]]:
        ends = drawing.marks(world, ("islands",), **asked).lines.ends.reshape(-1, 24, 3)
        return [(float(box[:, 0].min()), float(box[:, 0].max())) for box in ends]

    assert spans() == [(1.0, 3.0), (3.0, 4.0)]
    assert spans(hidden=(1,)) == [(2.0, 3.0), (3.0, 4.0)]
    assert spans(hidden=(1, 2)) == [(3.0, 4.0)]
    assert spans(entities=(2,)) == [(2.0, 3.0)]


def test_forces_are_arrows_as_long_as_they_are_strong() -> None:
    """The strongest is 0.6 m; letters say how strong, in the colour of what pushes."""
    mirror = scene(("Crate", 0, box((0.0, 0.0, 0.0))), ("Other", 0, box((5.0, 0.0, 0.0))))
    world = placed(mirror)
    starts = np.array([(0.0, 0.0, 0.0), (0.0, -0.5, 0.0), (5.0, 0.0, 0.0)])
    ways = np.array([(0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)])
    told = DebugLines(
        epoch=mirror.epoch,
        tick=1,
        positions=np.stack([starts, starts + 0.2 * ways], axis=1).astype("<f4").tobytes(),
        colors=bytes([0, 1, 4]),
        values=np.array([500.0, 2000.0, 40.0], "<f4").tobytes(),
        entities=np.array([(1, 0), (1, 0), (2, 0)], "<u4").tobytes(),
    )
    drawing = DebugDrawing(mirror)
    drawing.take_lines("forces", told)
    made = drawing.marks(world, ("forces",))
    shafts = made.lines.ends[:3]
    np.testing.assert_allclose(shafts[:, 0], starts, atol=1e-6)
    np.testing.assert_allclose(shafts[:, 1] - shafts[:, 0], np.array([[0.15], [0.6], [0.012]]) * ways, atol=1e-6)
    assert [label.text for label in made.labels] == ["2 kN", "500 N", "40 N"]
    assert [label.color for label in made.labels] == [IMPULSE, STATIC, ARROW]
    (alone,) = drawing.marks(world, ("forces",), (2,)).labels
    assert alone.text == "40 N"
