"""The lower panels of the real editor, used by hand: console, profiler, plots, topics and plan."""

from __future__ import annotations

import csv

import pytest
from imgui_bundle import imgui
from PIL import Image

from elys.bus import topics
from elys.bus.messages.plan import PhysicsPlan, RenderProfile, StagePlan
from elys.bus.messages.session import LogLine, TickProfile
from elys.common.errors import RequestError
from elys.editor_node.events import MouseButton, MousePressed, MouseReleased, MouseScrolled
from elys.editor_node.instruments import EDITOR, SIMULATION
from elys.editor_node.keys import Key
from tests.unit.editor_node.person import CTRL

pytestmark = pytest.mark.gl


async def show(person, name: str) -> None:
    await person.frames(8)  # docked windows have taken their places
    person.editor.workspace.show(f"###{name}")
    await person.frames(4)


def log(host, text: str, *, level="info", node="simulation-1") -> None:
    host.session.publish(topics.LOG, LogLine(node=node, level=level, text=text, time=1.0))


def tick_profile(tick: int, total: float = 4.0) -> TickProfile:
    stages = {"apply_commands": 0.5, "physics.solve": 1.0, "simulate_physics": 2.0, "publish_state": 1.0}
    return TickProfile(tick=tick, total=total, stages=stages, counts={"bodies": 7}, late=0.5)


# --- console -----------------------------------------------------------------------------------------------------------


def shown_lines(person) -> list[str]:
    console = person.editor.workspace.console
    return [row.line.text for row in console._view.rows(console._filter(), merges=console._merges)]


def test_lines_are_filtered_by_level_source_text_and_pattern(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        editor.model.console.clear()
        log(host, "tick 7 was late", level="warning")
        log(host, "drawing views", node="render-1")
        log(host, "tick 12 failed", level="error")
        log(host, "tick 13 failed", level="error")
        await person.until(lambda: len(editor.model.console) == 4)
        await show(person, "Console")
        await person.click("console/level/warning")
        assert shown_lines(person) == ["drawing views", "tick 12 failed", "tick 13 failed"]
        await person.click("console/level/warning")
        await person.click("console/sources")
        await person.click("console/source/render")
        await person.press(Key.ESCAPE)
        await person.frames(2)
        assert shown_lines(person) == ["tick 7 was late", "tick 12 failed", "tick 13 failed"]
        await person.click("console/filter")
        await person.type("tick 1")
        assert shown_lines(person) == ["tick 12 failed", "tick 13 failed"]
        await person.press(Key.A, CTRL)
        await person.type("tick [3-9] |12 f")
        assert shown_lines(person) == []
        await person.click("console/regex")
        await person.frames(2)
        assert shown_lines(person) == ["tick 7 was late", "tick 12 failed"]
        await person.click("console/clear")
        assert len(editor.model.console) == 0

    at_the_editor(scenario)


def test_equal_lines_are_one_and_what_is_shown_is_copied(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        editor.model.console.clear()
        for _ in range(3):
            log(host, "late", level="warning")
            log(host, "on time")
        await person.until(lambda: len(editor.model.console) == 6)
        await show(person, "Console")
        assert len(shown_lines(person)) == 6
        await person.click("console/merge")
        assert shown_lines(person) == ["late", "on time"]
        await person.click("console/copy")
        lines = [line.split("\t")[2:] for line in imgui.get_clipboard_text().split("\n")]
        assert lines == [["simulation", "warning", "late (3x)"], ["simulation", "info", "on time (3x)"]]

    at_the_editor(scenario)


def test_a_click_on_a_line_selects_the_entity_it_names(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        crate, box = person.stage.named("Crate"), person.stage.named("Box 3")
        editor.model.console.clear()
        log(host, f"body of entity {crate} left the world")
        log(host, "nobody is meant")
        log(host, "the joint of 'Box 3' broke")
        await person.until(lambda: len(editor.model.console) == 3)
        await show(person, "Console")
        await person.click("console/line/2")
        assert editor.model.selection.entities == (box,)
        await person.click("console/line/1")
        assert editor.model.selection.entities == (box,)
        await person.click("console/line/0")
        assert editor.model.selection.entities == (crate,)

    at_the_editor(scenario)


def test_the_newest_line_is_followed_until_one_scrolls_up(at_the_editor):
    async def scenario(person):
        editor = person.editor
        console = editor.workspace.console
        await show(person, "Console")
        for number in range(1000):
            editor.model.console.add("simulation", "info", f"line {number}")
        rectangles = editor.ui.landmarks.rectangles
        await person.frames(4)
        newest = f"console/line/{len(editor.model.console) - 1}"
        assert newest in rectangles
        await person.point(newest)
        await person.do(MouseScrolled(0.0, 3.0))
        await person.frames(3)
        assert not console.follows
        editor.model.console.add("simulation", "info", "another")
        rectangles.clear()
        await person.frames(3)
        assert f"console/line/{len(editor.model.console) - 1}" not in rectangles
        await person.click("console/newest")
        await person.frames(3)
        assert console.follows
        assert f"console/line/{len(editor.model.console) - 1}" in rectangles

    at_the_editor(scenario)


# --- profiler ----------------------------------------------------------------------------------------------------------


def test_the_worst_tick_is_held_and_let_go_and_any_tick_can_be_clicked(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        assert not host.session.has_listener(topics.PROFILE)  # hidden, it costs the host nothing
        await show(person, "Profiler")
        await person.until(lambda: host.session.has_listener(topics.PROFILE))
        for tick in range(1, 100):
            host.session.publish(topics.PROFILE, tick_profile(tick, 30.0 if tick == 40 else 4.0))
            await person.stage.until(lambda tick=tick: editor.workspace.profiler.track.samples[-1].number == tick
                                     if editor.workspace.profiler.track else False)  # fmt: skip
        track = editor.workspace.profiler.track
        assert track.budget == pytest.approx(1000.0 / 60.0)
        await person.frames(3)
        await person.click("profiler/worst")
        assert track.held.number == 40
        await person.click("profiler/hold")
        assert track.held is None
        await person.click("profiler/curves")
        assert track.held is not None
        assert abs(track.held.number - 50) < 12  # the middle of what is drawn
        editor.ui.actions.run("profiler.release")
        assert track.held is None
        editor.workspace.show("###Console")
        await person.frames(4)
        await person.until(lambda: not host.session.has_listener(topics.PROFILE))

    at_the_editor(scenario)


def test_pictures_and_the_editor_have_their_own_tracks(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        await show(person, "Profiler")
        await person.until(lambda: host.session.has_listener(topics.RENDER_PROFILE, key="main"))
        host.session.publish(topics.RENDER_PROFILE, render_profile(), key="main")
        await person.until(lambda: "view main" in editor.workspace.instruments.tracks)
        await person.frames(3)
        await person.click("profiler/track")
        await person.click("profiler/track/view main")
        await person.frames(2)
        assert editor.workspace.profiler.track.chosen.total == 9.0
        await person.click("profiler/track")
        await person.click(f"profiler/track/{EDITOR}")
        await person.frames(3)
        chosen = editor.workspace.profiler.track.chosen
        assert list(chosen.stages) == ["build", "draw", "show"]
        assert sum(chosen.stages.values()) == pytest.approx(chosen.total)
        assert SIMULATION not in editor.workspace.instruments.tracks

    at_the_editor(scenario)


# --- plots -------------------------------------------------------------------------------------------------------------


async def fall(person, *, ticks: int = 60) -> None:
    """The crate goes up a metre a second."""
    host, crate = person.stage.host, person.stage.named("Crate")
    table, is_paused = person.editor.workspace.instruments.plots.table, person.editor.workspace.plots.is_paused
    for _ in range(ticks):
        host.tick += 1
        host.publish_frame({crate: (1.0, host.tick / 60.0, 3.0)})
        await person.stage.until(lambda: is_paused or table.ticks[-1:].tolist() == [host.tick])


def test_a_field_is_found_with_completion_and_plotted(at_the_editor, tmp_path):
    async def scenario(person):
        editor = person.editor
        table = editor.workspace.instruments.plots.table
        await show(person, "Plots")
        await person.click("plots/path")
        await person.type("crat")
        await person.press(Key.TAB)
        await person.type("tra")
        await person.press(Key.TAB)
        await person.type("position.y")
        await person.press(Key.ENTER)
        assert [series.path for series in table.series] == ["Crate.Transform.position.y"]
        await fall(person)
        values = table.values(table.series[0])
        assert values[-60:].tolist() == pytest.approx([tick / 60.0 for tick in range(1, 61)])

        await person.click("plots/path")
        await person.type("Crate.Transform.position.")
        await person.frames(2)
        await person.click("plots/suggestion/0")
        assert table.series[1].path == "Crate.Transform.position.x"
        assert table.series[1].axis == table.series[0].axis  # metres both

        await person.click("plots/path")
        await person.type("Crate.Transform.nonsense")
        await person.press(Key.ENTER)
        assert "position.x" in editor.workspace.plots._error
        assert len(table.series) == 2

    at_the_editor(scenario)


def test_plots_are_paused_zoomed_moved_to_other_axes_and_exported(at_the_editor, tmp_path):
    async def scenario(person):
        editor = person.editor
        panel, table = editor.workspace.plots, editor.workspace.instruments.plots.table
        await show(person, "Plots")
        assert panel.plot("Crate.Transform.position.y")
        await fall(person, ticks=20)
        await person.frames(3)
        await person.click("plots/pause")
        count = len(table)
        await fall(person, ticks=5)
        assert len(table) == count
        await person.click("plots/pause")
        await fall(person, ticks=1)
        assert len(table) == count + 1

        await person.point("plots/plot")
        assert panel._follows
        await person.do(MouseScrolled(0.0, 1.0))
        await person.frames(2)
        assert not panel._follows
        await person.click("plots/follow")
        assert panel._follows

        await person.click("plots/axis/Crate.Transform.position.y")
        await person.click("plots/axis/3")
        assert table.series[0].axis == 2
        await person.frames(3)

        panel._export_path = str(tmp_path / "falls")
        await person.click("plots/export")
        await person.frames(3)
        await person.click("plots/export/csv")
        with (tmp_path / "falls.csv").open(newline="") as file:
            header, *rows = list(csv.reader(file))
        assert header[2] == "Crate.Transform.position.y [m]"
        assert [float(row[2]) for row in rows] == table.values(table.series[0]).tolist()
        await person.click("plots/export")
        await person.frames(3)
        await person.click("plots/export/png")
        await person.until((tmp_path / "falls.png").exists)
        left, top, right, bottom = editor.ui.landmarks.rectangles["panel/Plots"]
        assert Image.open(tmp_path / "falls.png").size == (round(right) - round(left), round(bottom) - round(top))

        panel._export_path = str(tmp_path / "nowhere" / "falls")
        editor.ui.actions.run("plots.export_csv")
        assert "nowhere" in editor.model.error
        await person.click("plots/shown/Crate.Transform.position.y")
        assert not table.series[0].is_shown
        await person.click("plots/remove/Crate.Transform.position.y")
        assert table.series == []

    at_the_editor(scenario)


def test_a_field_of_the_inspector_is_plotted_from_its_menu(at_the_editor):
    async def scenario(person):
        editor = person.editor
        await person.click("hierarchy/Crate")
        await person.frames(4)
        await person.point("inspector/Transform/position/label")
        await person.do(MousePressed(MouseButton.RIGHT), MouseReleased(MouseButton.RIGHT))
        await person.click("inspector/Transform/position/menu/plot")
        await person.frames(4)
        table = editor.workspace.instruments.plots.table
        assert [series.path for series in table.series] == [f"Crate.Transform.position.{axis}" for axis in "xyz"]
        assert "plots/plot" in editor.ui.landmarks.rectangles

    at_the_editor(scenario)


# --- topics ------------------------------------------------------------------------------------------------------------


def test_topics_are_heard_while_they_are_shown_and_their_messages_opened(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        assert not host.session.has_listener(topics.CONTACTS)
        await show(person, "Topics")
        await person.until(lambda: host.session.has_listener(topics.CONTACTS))
        assert not host.session.has_listener(topics.DIAGNOSTICS)
        host.session.publish(topics.PROFILE, tick_profile(5))
        watch = editor.workspace.instruments.topics
        await person.until(lambda: watch.flow(("profile", "")).total == 1)
        await person.frames(3)
        await person.click("topics/profile")
        await person.frames(3)
        rectangles = editor.ui.landmarks.rectangles
        assert "topics/message/stages/apply_commands" not in rectangles
        await person.click("topics/message/stages")
        await person.frames(3)
        assert "topics/message/stages/apply_commands" in rectangles
        await person.point("topics/profile")
        await person.do(MouseScrolled(0.0, -1.0))  # the list is longer than the panel is high
        await person.frames(3)
        await person.click("topics/diagnostics")
        await person.until(lambda: host.session.has_listener(topics.DIAGNOSTICS))
        editor.workspace.show("###Console")
        await person.frames(4)
        await person.until(lambda: not host.session.has_listener(topics.CONTACTS))
        assert not host.session.has_listener(topics.DIAGNOSTICS)

    at_the_editor(scenario)


# --- plan --------------------------------------------------------------------------------------------------------------


def stage(name: str, is_on: bool, why: str = "because") -> StagePlan:
    return StagePlan(name=name, is_on=is_on, why=why)


def render_profile() -> RenderProfile:
    return RenderProfile(
        node="render-1",
        view="main",
        sequence=1,
        tick=3,
        width=640,
        height=480,
        total=9.0,
        stages={"shadow": 3.0, "opaque": 5.0},
        passes=(stage("shadow", True), stage("bloom", False)),
    )


def test_the_plan_says_what_is_on_and_what_is_off(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        asked = []

        async def give(request, key):
            asked.append(1)
            return PhysicsPlan(tick=3, bodies=7, contacts=2, stages=(stage("solver", True), stage("joints", False)))

        host.session.serve(topics.PLAN, give)
        await person.frames(10)
        assert not asked  # nobody looks
        await show(person, "Plan")
        await person.until(lambda: editor.workspace.instruments.plan.newest is not None)
        await person.until(lambda: host.session.has_listener(topics.RENDER_PROFILE, key="main"))
        host.session.publish(topics.RENDER_PROFILE, render_profile(), key="main")
        await person.until(lambda: "main" in editor.workspace.instruments.views)
        await person.frames(3)
        rectangles = editor.ui.landmarks.rectangles
        expected = {"plan/physics/solver", "plan/physics/joints", "plan/view/main/shadow", "plan/view/main/bloom"}
        assert expected <= rectangles.keys()
        await person.click("plan/off")
        for name in expected:
            rectangles.pop(name)
        await person.frames(3)
        assert expected & rectangles.keys() == {"plan/physics/solver", "plan/view/main/shadow"}

    at_the_editor(scenario)


def test_why_there_is_no_plan_is_said(at_the_editor):
    async def scenario(person):
        async def refuse(request, key):
            raise RequestError("a recording is played")

        person.stage.host.session.serve(topics.PLAN, refuse)
        await show(person, "Plan")
        await person.until(lambda: person.editor.workspace.instruments.plan.refusal == "a recording is played")

    at_the_editor(scenario)
