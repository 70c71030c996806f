"""Curves by hand: the real inspector on GLFW's null platform, a small host behind it."""

from __future__ import annotations

import pytest

from elys.common.scene import EntityRecord
from elys.editor_node import curve_editing
from elys.editor_node.curve_editing import view_of
from elys.editor_node.events import MouseMoved
from elys.editor_node.keys import Key
from tests.unit.editor_node.hand import by_hand as by_hand
from tests.unit.editor_node.person import CTRL

PULSE = ((0.0, 1.0, 0.0, 0.0), (1.0, 2.0, 0.0, 0.0), (2.0, 1.0, 0.0, 0.0))
FIELD = "inspector/Light/over_time"


def test_keys_keep_between_their_neighbours() -> None:
    assert curve_editing.moved(PULSE, 1, 5.0, 4.0)[1] == (1.999, 4.0, 0.0, 0.0)
    assert curve_editing.moved(PULSE, 1, -5.0, 4.0)[1] == (0.001, 4.0, 0.0, 0.0)
    assert curve_editing.moved(PULSE, 0, -5.0, 4.0)[0] == (0.0, 4.0, 0.0, 0.0)
    longer, place = curve_editing.added(PULSE, 0.5, 1.75)
    assert place == 1 and longer[1] == (0.5, 1.75, 1.0, 1.0)  # as steep as the line between its neighbours
    assert curve_editing.removed(longer, 1) == PULSE
    assert curve_editing.added(PULSE, 1.0002, 5.0) == (PULSE, -1)
    assert curve_editing.straightened(PULSE, 1)[1] == (1.0, 2.0, 1.0, -1.0)


def test_all_of_a_curve_is_seen_also_where_it_swings_beyond_its_keys() -> None:
    swinging = ((0.0, 1.0, 0.0, 40.0), (2.0, 1.0, 40.0, 0.0))
    view = view_of(swinging)
    reached = [value for _, value in curve_editing.samples(swinging, view, 200)]
    assert view.low < min(reached) and max(reached) < view.high
    assert view_of(()).end == 1.0


@pytest.mark.gl
def test_a_curve_is_made_dragged_and_undone(by_hand, screenshot_directory) -> None:
    lamp = EntityRecord(name="Lamp", components={"Transform": {}, "Light": {"kind": "point"}})

    async def scenario(hand) -> None:
        person = hand.person

        async def curve(count: int) -> tuple:
            await hand.settle()
            found = hand.value("Lamp", "Light", "over_time")
            assert len(found) == count
            return found

        await hand.fold("Transform")
        await person.click(f"{FIELD}/canvas", times=2)
        ((time, value, _, _),) = await curve(1)
        assert time == pytest.approx(0.5, abs=0.02) and value > 0.0
        left, top, right, bottom = hand.landmarks.rectangles[f"{FIELD}/canvas"]
        await person.do(MouseMoved(left + 0.8 * (right - left), top + 0.04 * (bottom - top)))
        await person.double_click_here()
        first, second = await curve(2)
        assert first[0] < second[0] and second[1] > first[1]
        await person.drag(f"{FIELD}/key/0", 25.0, -12.0)
        dragged, _ = await curve(2)
        assert dragged[0] > first[0] and dragged[1] > first[1]
        assert person.editor.model.history.undo_label == "Set Light.over_time of Lamp"
        await person.drag(f"{FIELD}/slope_after", 0.0, -20.0)
        sloped, _ = await curve(2)
        assert sloped[:2] == dragged[:2] and sloped[3] > dragged[3] and sloped[2] == sloped[3]
        if screenshot_directory is not None:
            person.editor.screenshot(screenshot_directory / "curve.png")
        for _ in range(2):
            await person.press(Key.Z, CTRL)
        assert (await curve(2))[0] == first
        await hand.right_click(f"{FIELD}/key/1")
        await person.click(f"{FIELD}/menu/remove")
        assert await curve(1) == (first,)

    by_hand(scenario, select="Lamp", records=[lamp])
