"""Where overlays stand, against arithmetic done by hand, and what texts say."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from elys.bus.messages.views import ViewCamera
from elys.common.components import Overlay, OverlayBar, OverlayImage, OverlayPanel, OverlayText
from elys.common.components.overlay import Anchor
from elys.render_node.camera import View
from elys.render_node.fonts import face_of
from elys.render_node.glyph_sheet import GlyphSheet
from elys.render_node.overlay_layout import Rectangle, bar_filled, contained, followed, kept_inside, placed, unit_of
from elys.render_node.overlay_quads import GLYPH, IMAGE, PANEL, RING, QuadMaker, to_screen
from elys.render_node.overlay_text import TextSetter, said, shown, time_told
from elys.render_node.overlays import OverlayNode, Overlays

CAMERA = ViewCamera(position=(0.0, 0.0, 10.0), rotation=(0.0, 0.0, 0.0, 1.0))
WHOLE = Rectangle(0.0, 0.0, 1920.0, 1080.0)


def view(width: int = 1920, height: int = 1080) -> View:
    return View.of(CAMERA, width, height)


def node(
    overlay: Overlay = Overlay(),  # noqa: B008
    *,
    parent: int = -1,
    panel: OverlayPanel | None = None,
    bar: OverlayBar | None = None,
    image: OverlayImage | None = None,
    text: OverlayText | None = None,
) -> OverlayNode:
    return OverlayNode(1, parent, overlay, panel, bar, image, text)


def no_image(reference: str) -> None:
    return None


@pytest.mark.parametrize(
    ("anchor", "corner"),
    [
        ("top_left", (0, 0)),
        ("top", (860, 0)),
        ("top_right", (1720, 0)),
        ("left", (0, 490)),
        ("center", (860, 490)),
        ("right", (1720, 490)),
        ("bottom_left", (0, 980)),
        ("bottom", (860, 980)),
        ("bottom_right", (1720, 980)),
    ],
)
def test_each_anchor_is_the_same_point_of_frame_and_overlay(anchor: Anchor, corner: tuple[float, float]) -> None:
    found = placed(Overlay(anchor=anchor), WHOLE, 1080.0, (200.0, 100.0))
    assert found == Rectangle(*corner, 200.0, 100.0)
    moved = placed(Overlay(anchor=anchor, x=0.1, y=-0.05, width=0.5), WHOLE, 1080.0, (200.0, 100.0))
    across = {"left": 0.0, "right": 1.0}.get(anchor.split("_")[-1], 0.5)
    assert moved.x == pytest.approx(across * (1920 - 540) + 108)
    assert moved[1:] == pytest.approx((corner[1] - 54, 540, 100))


def test_lengths_are_those_of_the_largest_picture_of_16_to_9() -> None:
    assert unit_of(1920, 1080) == unit_of(2560, 1080) == 1080.0
    assert unit_of(1080, 1920) == 1080 * 9 / 16
    assert unit_of(640, 480) == 360.0
    assert unit_of(1, 1) > 0.0


def test_a_layout_is_the_same_in_every_size_to_a_pixel() -> None:
    """At 4K everything is where it is at 320 x 180, twelve times as far."""
    overlays = Overlays(
        (
            node(Overlay(anchor="center", width=0.5, height=0.3), panel=OverlayPanel(border=0.01)),
            node(Overlay(anchor="bottom", y=-0.02, width=0.4, height=0.05), parent=0, bar=OverlayBar(value=0.25)),
        )
    )
    small, large = (
        QuadMaker().quads(overlays, view(*size), no_image).rows.copy() for size in ((320, 180), (3840, 2160))
    )
    np.testing.assert_allclose(large[:, :4], 12.0 * small[:, :4], rtol=1e-6)
    assert small[:, 11].tolist() == [PANEL, RING, PANEL, PANEL]
    x, y, width, height = small[3, :4]
    assert small[3, 12:] == pytest.approx((x, y, x + width / 4, y + height))


def test_what_is_below_another_is_laid_out_in_it_and_fades_and_hides_with_it() -> None:
    parts = (
        node(Overlay(anchor="right", x=-0.1, width=0.5, height=0.5, opacity=0.5), panel=OverlayPanel(opacity=1.0)),
        node(
            Overlay(anchor="bottom_left", width=0.1, height=0.1, opacity=0.5), parent=0, panel=OverlayPanel(opacity=1)
        ),
    )
    rows = QuadMaker().quads(Overlays(parts), view(), no_image).rows
    assert rows[0, :4] == pytest.approx((1920 - 540 - 108, 270, 540, 540))
    assert rows[1, :4] == pytest.approx((1920 - 540 - 108, 810 - 108, 108, 108))
    assert rows[:, 7] == pytest.approx((0.5, 0.25))
    parts[0].overlay = Overlay(visible=False)
    assert not len(QuadMaker().quads(Overlays(parts), view(), no_image).rows)
    parts[0].overlay = Overlay(player=2)
    assert not len(QuadMaker().quads(Overlays(parts), view(), no_image).rows)
    assert (
        len(QuadMaker().quads(Overlays(parts, player=2), view(), no_image).rows) == 1
    )  # one without a size is not seen


def test_order_goes_before_the_tree() -> None:
    parts = tuple(
        node(Overlay(width=0.1, height=0.1, order=order), panel=OverlayPanel(opacity=(k + 1) / 4))
        for k, order in enumerate((5, -1, 5, 0))
    )
    rows = QuadMaker().quads(Overlays(parts), view(), no_image).rows
    assert rows[:, 7] == pytest.approx((0.5, 1.0, 0.25, 0.75))


def test_a_point_of_the_world_is_followed_where_the_camera_sees_it() -> None:
    seen = view(1000, 500)
    assert followed(Overlay(), (0.0, 0.0, 0.0), seen) == pytest.approx((500, 250, 0, 0))
    # By the pinhole: 10 m away, 1 m is focal length / 10.
    focal = 250 / np.tan(0.45)
    assert followed(Overlay(), (1.0, 2.0, 0.0), seen) == pytest.approx((500 + focal / 10, 250 - 2 * focal / 10, 0, 0))
    for hidden in ((99.0, 0.0, 0.0), (0.0, 0.0, 20.0), (0.0, 0.0, -5000.0)):
        assert followed(Overlay(), hidden, seen) is None


@pytest.mark.parametrize(
    ("point", "place"),
    [
        ((99.0, 0.0, 0.0), (1000, 250)),
        ((-99.0, 0.0, 0.0), (0, 250)),
        ((0.0, 99.0, 0.0), (500, 0)),
        ((0.0, 0.0, 20.0), (500, 500)),  # right behind: below
        ((3.0, 0.0, 20.0), (1000, 250)),  # behind on the right is shown on the right
        ((0.0, 0.0, 10.0), (500, 500)),  # the eye itself
    ],
)
def test_clamped_it_is_shown_at_the_edge(point: tuple[float, float, float], place: tuple[float, float]) -> None:
    found = followed(Overlay(clamp=True), point, view(1000, 500))
    assert found is not None
    assert found[:2] == pytest.approx(place)


def test_rectangles_in_rectangles() -> None:
    assert kept_inside(Rectangle(-5, 90, 20, 20), 100, 100) == (0, 80, 20, 20)
    assert kept_inside(Rectangle(5, 5, 200, 20), 100, 100) == (0, 5, 200, 20)
    assert contained(Rectangle(0, 0, 100, 50), 1, 1) == (25, 0, 50, 50)
    assert contained(Rectangle(0, 0, 100, 50), 4, 1) == (0, 12.5, 100, 25)
    box = Rectangle(10, 20, 100, 40)
    assert [bar_filled(box, 0.25, grows) for grows in ("right", "left", "down", "up")] == [
        (10, 20, 25, 40),
        (85, 20, 25, 40),
        (10, 20, 100, 10),
        (10, 50, 100, 10),
    ]


def test_a_text_is_as_wide_as_its_letters_and_stands_as_it_is_aligned() -> None:
    face = face_of(40.0)
    lines = ("1234", "12")
    set_left, set_right, set_center = (TextSetter().set("\n".join(lines), 40.0, a) for a in ("left", "right", "center"))
    width = 4 * face.advance("1")
    assert (set_left.width, set_left.height) == (width, 2 * face.line_height)
    for found, share in ((set_left, 0.0), (set_right, 1.0), (set_center, 0.5)):
        assert found.pen[4:, 0] == pytest.approx([share * width / 2, share * width / 2 + face.advance("1")])
        assert found.pen[4, 1] == face.ascent + face.line_height


def test_digits_are_equally_wide_so_that_clocks_do_not_tremble() -> None:
    setter = TextSetter()
    assert (
        len({setter.set(f"1:{a}{b}.0", 31.0, "left").width for a, b in itertools.product("0123456789", repeat=2)}) == 1
    )


def test_a_panel_takes_the_size_of_its_text_and_keeps_some_free() -> None:
    text = OverlayText(text="Hello", size=0.05, outline=0.0)
    made = QuadMaker().quads(Overlays((node(panel=OverlayPanel(padding=0.02), text=text),)), view(), no_image)
    layout = TextSetter().set("Hello", 54.0, "left")
    free = 2 * 0.02 * 1080
    assert made.rows[0, 2:4] == pytest.approx((layout.width + free, layout.height + free))
    assert made.rows[1, 0] == pytest.approx(0.02 * 1080, abs=5)
    assert (made.rows[1:, 11] == GLYPH).all()
    assert len(made.rows) == 1 + 5


def test_an_image_keeps_its_proportions() -> None:
    parts = (
        node(Overlay(height=0.1), image=OverlayImage(image="a")),
        node(Overlay(width=0.1), image=OverlayImage(image="a")),
        node(image=OverlayImage(image="a")),
        node(Overlay(width=0.1, height=0.1), image=OverlayImage(image="a", fit="stretch")),
        node(Overlay(width=0.1, height=0.1), image=OverlayImage(image="missing")),
        node(Overlay(width=0.1, height=0.1), panel=OverlayPanel()),
        node(Overlay(width=0.1, height=0.1), image=OverlayImage(image="b")),
    )
    made = QuadMaker().quads(Overlays(parts), view(960, 540), {"a": (200, 100), "b": (1, 1)}.get)
    assert made.rows[:4, 2:4].tolist() == [
        pytest.approx((108, 54)),
        pytest.approx((54, 27)),
        pytest.approx((100, 50)),  # half its pixels: the picture has half of 1080 lines
        pytest.approx((54, 54)),
    ]
    assert [(run.length, run.image) for run in made.runs] == [(4, "a"), (1, ""), (1, "b")]
    assert set(made.rows[:4, 11]) == {IMAGE}


@pytest.mark.parametrize(
    ("text", "value", "expected"),
    [
        ("plain", 3.0, "plain"),
        ("{} m", 2.5, "2.5 m"),
        ("{:.2f}", 2.0 / 3.0, "0.67"),
        ("{:03d}", 7.4, "007"),
        ("{:,d} points", 12345.0, "12,345 points"),
        ("{:.0%}", 0.256, "26%"),
        ("{:time}", 83.456, "1:23.46"),
        ("{:time}", 59.999, "1:00.00"),
        ("{:time}", -0.004, "0:00.00"),
        ("a {b} {:999999999f} {:.99f} {:x} {0}", 1.0, "a {b} {:999999999f} " + f"{1.0:.99f}" + " {:x} {0}"),
        ("{{}}", 1.0, "{1}"),
        ("{:d}", 1e308, f"{round(1e308)}"),
    ],
)
def test_a_value_stands_in_a_text_as_it_is_asked_for(text: str, value: float, expected: str) -> None:
    assert said(OverlayText(text=text, value=value)) == expected


def test_times_are_told_as_races_are() -> None:
    assert [time_told(seconds) for seconds in (0.0, 61.0, 3599.994, -1.5)] == [
        "0:00.00",
        "1:01.00",
        "59:59.99",
        "-0:01.50",
    ]


HOSTILE = (
    "",
    "\0\x07\x1b[31m\n\n\n",
    "x" * 100_000,
    "\n" * 100_000,
    "שלום עולם مرحبا \u202e reversed",
    "🎉👩‍👩‍👧‍👦🇫🇷",
    "Z" + "\u0301" * 500,
    "\u0301\u0327",
    "\ufffe\uffff\U000f0000\u200b\u2028",
    "\ud800",
    "é" * 4096,
)


@pytest.mark.parametrize("text", HOSTILE)
@pytest.mark.parametrize("size", [0.001, 0.05, 2.0])
def test_hostile_texts_are_drawn_or_replaced(text: str, size: float) -> None:
    part = node(text=OverlayText(text=text, size=size, shadow=0.5))
    made = QuadMaker().quads(Overlays((part,)), view(320, 180), no_image)
    assert np.isfinite(made.rows).all()
    assert len(made.rows) <= 3 * 4096


def test_controls_and_marks_without_letters_are_left_out() -> None:
    assert shown("a\x00b\tc\u202ed") == "ab    cd"
    assert shown("e\u0301") == "é"
    assert shown("\u0301") == ""


def test_accented_letters_are_the_letter_and_more_above_or_below_it() -> None:
    face = face_of(48.0)
    for plain, accented in zip("eaocuzCAE", "éåöçůžÇÄÉ", strict=True):
        bare, full = face.glyph(plain), face.glyph(accented)
        assert bare is not None
        assert full is not None
        row, column = bare.top - full.top, bare.left - full.left
        height, width = bare.mask.shape
        inner = full.mask[max(row, 0) : row + height, max(column, 0) : column + width]
        assert (inner >= bare.mask[: inner.shape[0], : inner.shape[1]]).all()
        assert full.mask.sum(dtype=int) > bare.mask.sum(dtype=int) * 1.02
        assert face.advance(accented) == face.advance(plain)


def test_a_sheet_that_is_full_is_begun_anew_and_everything_in_the_picture_is_in_it() -> None:
    maker = QuadMaker()
    maker.sheet = GlyphSheet(64, largest=128)
    for number in range(40):
        text = "".join(chr(65 + (number + k) % 26) for k in range(6))
        overlays = Overlays((node(text=OverlayText(text=text, size=0.05, outline=0.0)),))
        made = maker.quads(overlays, view(960, 540), no_image)
        for row, letter in zip(made.rows, text, strict=True):
            glyph = face_of(27.0).glyph(letter)
            assert glyph is not None
            u, v = int(row[8]), int(row[9])
            np.testing.assert_array_equal(
                maker.sheet.texels[v : v + glyph.mask.shape[0], u : u + glyph.mask.shape[1]], glyph.mask
            )
    assert maker.sheet.generation > 0
    assert len(maker.sheet.texels) == 128


def test_colours_are_those_of_a_screen() -> None:
    assert to_screen((0.0, 0.5, 1.0)) == pytest.approx((0.0, 0.735357, 1.0), abs=1e-5)
