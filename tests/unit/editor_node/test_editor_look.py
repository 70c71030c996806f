"""How the editor looks and what it says: themes that can be read, size of text, language, keys, layouts; chosen by hand."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from elys.editor_node import theme
from elys.editor_node.key_bindings import Chord
from elys.editor_node.keys import Key
from elys.editor_node.language import translations, use_language
from elys.editor_node.panels.preferences_window import FONT_SCALES, change_font_scale
from elys.editor_node.preferences import Preferences, SessionState, keep_session, load_preferences
from elys.editor_node.theme import THEMES, contrast
from tests.unit.editor_node.person import CTRL, Person, person_at

READ = ("text", "text_dim", "accent", "good", "warning", "error")
GROUNDS = ("panel", "panel_low", "popup", "field", "field_hovered", "field_active", "button", "button_hovered")


def blend(front: tuple[float, ...], back: tuple[float, ...], alpha: float) -> tuple[float, ...]:
    return tuple(alpha * f + (1.0 - alpha) * b for f, b in zip(front[:3], back[:3], strict=True))


def test_contrast_is_that_of_wcag():
    black, white, grey = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0x77 / 255,) * 3
    assert contrast(black, white) == pytest.approx(21.0)
    assert contrast(white, white) == 1.0
    assert contrast(grey, white) == pytest.approx(4.48, abs=0.005)  # the well-known grey that just fails
    assert contrast((1.0, 0.0, 0.0), white) == pytest.approx(3.998, abs=0.005)


@pytest.mark.parametrize("name", THEMES)
def test_all_that_is_read_can_be_read(name):
    colors = THEMES[name]
    for text in READ:
        for ground in GROUNDS:
            assert contrast(colors[text], colors[ground]) >= 4.5, (text, ground)
        # A notice lies on a picture, which may be black or white, and lets a little of it through.
        for behind in ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)):
            ground = blend(colors["notice"], behind, colors["notice"][3])
            assert contrast(colors[text], ground) >= 4.5, (text, behind)
    for alpha in (0.28, 0.40):  # a selected row, at rest and pressed
        assert contrast(colors["text"], blend(colors["fill"], colors["panel"], alpha)) >= 4.5
    for axis in ("axis_x", "axis_y", "axis_z"):
        assert contrast(colors["on_axis"], colors[axis]) >= 4.5
        assert contrast(colors[axis], colors["panel"]) >= 3.0  # what is no text (WCAG 2.1, 1.4.11)


def test_themes_have_the_same_colours_by_name():
    assert set(THEMES["dark"]) == set(THEMES["light"])
    for value in vars(theme).values():
        if isinstance(value, theme.Shade):
            assert value.name in THEMES["dark"]


def test_sizes_go_up_and_down_in_steps():
    preferences = Preferences()
    for direction, end in ((1, 2.0), (-1, 0.75), (0, 1.0)):
        seen = [preferences.font_scale]
        for _ in range(10):
            change_font_scale(preferences, direction)
            seen.append(preferences.font_scale)
        assert seen[-1] == end
        assert set(seen) <= set(FONT_SCALES)


def test_only_the_last_sessions_are_remembered():
    preferences = Preferences()
    state = SessionState(tools={"tool": "move"})
    for number in [*range(40), 20]:
        keep_session(preferences, f"s{number}", state)
    assert list(preferences.sessions)[-1] == "s20"
    assert len(preferences.sessions) == 24


def brightness(editor, path, name: str) -> float:
    editor.screenshot(path)
    pixels = np.asarray(Image.open(path)).astype(float)
    left, top, right, bottom = (int(edge) for edge in editor.ui.landmarks.rectangles[name])
    return float(pixels[top:bottom, left:right].mean())


def button_height(editor) -> float:
    _, top, _, bottom = editor.ui.landmarks.rectangles["toolbar/play"]
    return bottom - top


@pytest.mark.gl
def test_theme_size_and_language_change_at_once(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor = person.editor
        await person.press(Key.COMMA, CTRL)
        await person.frames(3)
        path = screenshot_directory / "preferences.png"
        dark = brightness(editor, path, "panel/Inspector")
        await person.click("preferences/theme")
        await person.click("preferences/theme/light")
        await person.frames(2)
        assert brightness(editor, screenshot_directory / "preferences-light.png", "panel/Inspector") > dark + 120.0
        assert editor.preferences.theme == "light"

        height = button_height(editor)
        await person.click("preferences/size")
        await person.click("preferences/size/150")
        await person.frames(2)
        assert 1.25 * height < button_height(editor) < 1.6 * height
        editor.screenshot(screenshot_directory / "preferences-large.png")
        await person.press(Key.DIGIT_0, CTRL)
        await person.frames(2)
        assert button_height(editor) == height
        await person.press(Key.EQUAL, CTRL)
        assert editor.preferences.font_scale == 1.1
        await person.press(Key.MINUS, CTRL)

        await person.click("preferences/language")
        await person.click("preferences/language/fr")
        await person.frames(2)
        assert editor.preferences.language == "fr"
        editor.screenshot(screenshot_directory / "preferences-french.png")
        await person.press(Key.COMMA, CTRL)
        await person.frames(2)
        assert not editor.workspace.preferences.is_open

    try:
        at_the_editor(scenario)
    finally:
        use_language("en")


@pytest.mark.gl
def test_spacing_does_not_drift_however_often_the_look_changes(at_the_editor):
    async def scenario(person):
        before = [
            imgui.get_style().item_spacing.x,
            imgui.get_style().scrollbar_size,
            imgui.get_style().tab_min_width_base,
        ]
        for theme_name, scale in (("light", 2.0), ("dark", 0.75), ("light", 1.1), ("dark", 1.0)):
            person.editor.preferences.theme, person.editor.preferences.font_scale = theme_name, scale
            await person.frames(1)
        style = imgui.get_style()
        assert [style.item_spacing.x, style.scrollbar_size, style.tab_min_width_base] == before

    at_the_editor(scenario)


@pytest.mark.gl
def test_the_display_may_change_its_scale(at_the_editor, monkeypatch):
    async def scenario(person):
        height = button_height(person.editor)
        monkeypatch.setattr(type(person.editor.window), "content_scale", property(lambda window: 2.0))
        await person.frames(2)
        assert button_height(person.editor) == pytest.approx(2.0 * height, abs=1.0)

    at_the_editor(scenario)


@pytest.mark.gl
def test_keys_are_bound_anew_swapped_and_reset(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor, keys = person.editor, person.editor.ui.keys
        await person.press(Key.COMMA, CTRL)
        await person.click("preferences/filter")
        await person.type("duplicate")
        await person.frames(2)
        await person.click("preferences/keys/edit.duplicate")
        await person.press(Key.F8)
        assert keys.label_of("edit.duplicate") == "F8"

        await person.click("preferences/keys/edit.duplicate")
        await person.press(Key.ESCAPE)
        assert keys.label_of("edit.duplicate") == "F8"

        await person.click("preferences/keys/edit.duplicate")
        await person.press(Key.Z, CTRL)  # Undo's: it is told, and nothing has happened yet
        await person.frames(2)
        editor.screenshot(screenshot_directory / "preferences-taken.png")
        assert (keys.label_of("edit.duplicate"), keys.label_of("edit.undo")) == ("F8", "Ctrl+Z")
        await person.click("preferences/leave")
        assert keys.label_of("edit.undo") == "Ctrl+Z"

        await person.click("preferences/keys/edit.duplicate")
        await person.press(Key.Z, CTRL)
        await person.click("preferences/swap")
        assert (keys.label_of("edit.duplicate"), keys.label_of("edit.undo")) == ("Ctrl+Z", "F8")
        count = len(person.stage.host.mirror.entities)
        await person.click("hierarchy/Sun")
        await person.press(Key.Z, CTRL)
        await person.until(lambda: len(person.stage.host.mirror.entities) == count + 1)

        await person.click("preferences/reset/edit.duplicate")
        assert keys.label_of("edit.duplicate") == "Ctrl+D"
        await person.click("preferences/reset all")
        assert keys.chosen == {}
        assert keys.action_for(Chord.parse("Ctrl+Z")).name == "edit.undo"

    at_the_editor(scenario)


@pytest.mark.gl
def test_every_action_has_a_french_label(at_the_editor):
    async def scenario(person):
        french = translations("fr")
        assert [action.label for action in person.editor.ui.actions if action.label not in french] == []
        assert [name for name in person.editor.workspace._panels if name not in french] == []

    at_the_editor(scenario)


def front_panels(person: Person) -> dict[str, tuple[int, ...]]:
    rectangles = person.editor.ui.landmarks.rectangles
    return {
        name: tuple(map(round, rectangles[name])) for name in ("panel/Hierarchy", "panel/Viewport", "panel/Console")
    }


@pytest.mark.gl
def test_layouts_are_named_chosen_deleted_and_reset(at_the_editor):
    async def scenario(person):
        editor = person.editor
        await person.frames(6)
        first = front_panels(person)
        await person.click("menu/view")
        await person.click("menu/layout")
        await person.click("menu/view.save_layout")
        await person.frames(2)
        await person.type("mine")
        await person.press(Key.ENTER)
        assert list(editor.preferences.layouts) == ["mine"]

        imgui.internal.dock_builder_set_node_size(
            imgui.internal.find_window_by_name("###Hierarchy").dock_node.id_, (600.0, 500.0)
        )
        editor.workspace._hidden.add("Inspector")
        await person.frames(3)
        moved = front_panels(person)
        assert moved["panel/Hierarchy"] != first["panel/Hierarchy"]

        await person.click("menu/view")
        await person.click("menu/layout")
        await person.click("layout/mine")
        await person.frames(4)
        assert front_panels(person) == first
        assert editor.workspace.hidden_panels == ()

        editor.workspace._hidden.add("Inspector")
        await person.click("menu/view")
        await person.click("menu/layout")
        await person.click("menu/view.reset_layout")
        await person.frames(6)
        for name, place in front_panels(person).items():  # the first frame knew no bars yet
            assert place == pytest.approx(first[name], abs=40.0)
        assert editor.workspace.hidden_panels == ()

        await person.click("menu/view")
        await person.click("menu/layout")
        await person.click("layout/delete")
        await person.click("layout/delete/mine")
        assert editor.preferences.layouts == {}

    at_the_editor(scenario)


@pytest.mark.gl
def test_what_was_chosen_outlives_the_editor(on_stage, tmp_path):
    from elys.bus.session import Session
    from elys.editor_node.node import PREFERENCES, Editor

    async def editing(stage, scenario) -> None:
        session = await Session.join(stage.broker.connect(), kind="editor")
        with Editor(session, null_platform=True, directory=tmp_path) as editor:
            async with person_at(editor, stage) as person:
                await person.until(lambda: editor.model.scene.is_known)
                await person.frames(4)
                await scenario(person)
        await session.close()

    async def change(person) -> None:
        editor = person.editor
        await person.click("tour/skip")
        editor.preferences.theme = "light"
        editor.ui.tools.move_snap = 2.0
        editor.ui.keys.bind("edit.duplicate", Chord.parse("F8"))
        editor.panel.camera.distance = 33.0
        await person.click("menu/view")
        editor.workspace._hidden.add("Profiler")
        await person.press(Key.ESCAPE)

    async def check(person) -> None:
        editor = person.editor
        assert editor.preferences.theme == "light"
        assert editor.ui.tools.move_snap == 2.0
        assert editor.ui.keys.label_of("edit.duplicate") == "F8"
        assert editor.panel.camera.distance == 33.0
        assert editor.workspace.hidden_panels == ("Profiler",)
        assert editor.workspace.tour.step is None

    async def twice(stage) -> None:
        await editing(stage, change)
        assert load_preferences(tmp_path / PREFERENCES).has_seen_tour
        assert (tmp_path / "editor.ini").exists()
        await editing(stage, check)

    on_stage(twice)


def next_frame_in(person: Person) -> float:
    """After how long [s] a frame is drawn next, if nothing happens until then."""
    application = person.application
    application._awake_until = 0.0
    application.draw_frame()
    return application._redraw_at - application._clock()


@pytest.mark.gl
def test_nothing_is_drawn_while_nothing_happens(at_the_editor):
    async def scenario(person):
        editor = person.editor
        assert next_frame_in(person) > 1.0
        editor.workspace.preferences.is_open = True
        await person.frames(3)
        assert next_frame_in(person) > 1.0
        editor.workspace.link.is_open = True  # its figures go on, once a second
        await person.frames(3)
        assert 0.5 < next_frame_in(person) <= 1.0
        editor.attachments.detach()
        await person.frames(3)
        assert next_frame_in(person) > 1.0

    at_the_editor(scenario)


@pytest.mark.gl
def test_the_tour_points_at_five_things(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor = person.editor
        await person.click("menu/help")
        await person.click("menu/help.tour")
        await person.frames(2)
        for number in range(5):
            await person.frames(2)
            assert editor.workspace.tour.step == number
            editor.screenshot(screenshot_directory / f"tour-{number + 1}.png")
            if number == 1:
                await person.click("tour/back")
                assert editor.workspace.tour.step == 0
                await person.click("tour/next")
            await person.click("tour/next")
        assert editor.workspace.tour.step is None
        assert editor.preferences.has_seen_tour
        await person.click("menu/help")
        await person.click("menu/help.about")
        await person.frames(2)
        editor.screenshot(screenshot_directory / "about.png")
        await person.click("about/close")

    at_the_editor(scenario)
