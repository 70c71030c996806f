"""The timeline without a window: views, loops, bookmarks, markers; and its panel, by hand."""

from __future__ import annotations

import asyncio
from pathlib import Path

import msgspec
import pytest

from elys.bus import topics
from elys.bus.messages import commands as c
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.timeline import Marker, Markers
from elys.editor_node.bookmarks import Bookmarks
from elys.editor_node.keys import Key
from elys.editor_node.language import LANGUAGES, translations, use_language
from elys.editor_node.timeline import NEAR, Timeline, round_times
from tests.unit.editor_node.person import CTRL, SHIFT, Person


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ELYS_STATE_DIR", str(tmp_path))
    return tmp_path


class Session:
    name = "yard"

    def start(self, work):
        return asyncio.ensure_future(work)


class Host:
    """What a timeline asks for, written down."""

    def __init__(
        self, *, start: float = 0.0, end: float = 10.0, now: float = 10.0, kind: str = "simulation", **more
    ) -> None:
        self.session = Session()
        self.sought: list[float] = []
        self.commands: list[c.Command] = []
        self.status = SessionStatus(
            epoch=1,
            kind=kind,
            scene="yard",
            tick=round(now * 60),
            simulation_time=now,
            playing=False,
            tick_rate=60.0,
            start_time=start,
            end_time=end,
            **more,
        )

    @property
    def is_playing(self) -> bool:
        return self.status.playing

    def request_redraw(self, within: float) -> None:
        pass

    def seek(self, time: float) -> None:
        self.sought.append(time)

    def command(self, label: str, command: c.Command):
        self.commands.append(command)
        return asyncio.ensure_future(asyncio.sleep(0))

    def at(self, time: float, **more) -> None:
        self.status = msgspec.structs.replace(self.status, simulation_time=time, **more)


def line_of(host: Host) -> Timeline:
    return Timeline(host, clock=lambda: 0.0)


def marker(time: float, kind: str = "edit", strength: float = 0.0, **more) -> Marker:
    return Marker(tick=round(time * 60), time=time, kind=kind, text="x", strength=strength, **more)


def test_the_bar_shows_all_there_is_until_somebody_zooms():
    host = Host(start=2.0, end=12.0, now=12.0)
    line = line_of(host)
    assert line.view == (2.0, 12.0)
    assert (line.x_of(7.0, 200.0), line.time_at(100.0, 200.0)) == (100.0, 7.0)
    line.zoom(0.5, 4.0)
    assert line.view == (3.0, 8.0)
    assert line.x_of(4.0, 200.0) == pytest.approx(200.0 * (4.0 - 2.0) / 10.0)  # it stayed where it was
    line.pan(100.0)
    assert line.view == (7.0, 12.0)
    line.pan(-100.0)
    assert line.view == (2.0, 7.0)
    line.zoom(1e-9, 4.0)
    assert line.view[1] - line.view[0] == pytest.approx(0.05)
    line.zoom(1e9, 4.0)
    assert line.view == (2.0, 12.0)
    assert not line.is_zoomed


def test_nobody_goes_beyond_what_is_kept():
    host = Host(start=2.0, end=12.0)
    line = line_of(host)
    line.go_to(-5.0), line.go_to(50.0), line.go_to(3.0), line.go_to_start(), line.go_to_end()
    assert host.sought == [2.0, 12.0, 3.0, 2.0, 12.0]
    assert line.can_wind
    assert not line_of(Host(start=3.0, end=3.0)).can_wind


def test_only_a_rewound_simulation_goes_on_from_here():
    async def main() -> None:
        host = Host()
        line = line_of(host)
        line.go_on_from_here()
        assert host.commands == []
        host.at(4.0, is_rewound=True)
        line.go_on_from_here()
        assert host.commands == [c.Resume()]

    asyncio.run(main())


def test_a_loop_goes_back_to_its_beginning_and_plays():
    async def main() -> None:
        host = Host(now=3.0)
        line = line_of(host)
        line.set_loop_start()
        host.at(5.0, playing=True)
        line.set_loop_end()
        line.follow(4.9)
        assert host.commands == []
        line.follow(5.0)
        line.follow(5.0)  # on its way already
        await asyncio.sleep(0)
        await line._jumping
        assert host.commands == [c.Seek(time=3.0), c.SetPlaying(playing=True)]
        line.follow(1.0)  # before it: into it
        await asyncio.sleep(0)
        await line._jumping
        assert host.commands[2:] == host.commands[:2]
        line.toggle_loop()
        line.follow(6.0)
        assert len(host.commands) == 4

    asyncio.run(main())


def test_without_ends_a_simulation_loops_over_what_is_kept_and_a_recording_loops_itself():
    async def main() -> None:
        host = Host(start=2.0, now=5.0)
        line = line_of(host)
        line.toggle_loop()
        host.at(10.5, end_time=10.5, playing=True)
        assert line.loop == (2.0, 10.0)
        assert host.commands == []
        recording = Host(kind="replay")
        line = line_of(recording)
        line.toggle_loop()
        recording.at(10.0, playing=True, loop=True)
        line.follow(10.0)
        await asyncio.sleep(0)
        assert recording.commands == [c.SetRange(), c.SetLoop(loop=True)]
        line.is_looping = False
        assert line.loops
        line.toggle_loop()
        assert recording.commands[2:] == [c.SetRange(), c.SetLoop(loop=False)]

    asyncio.run(main())


def test_a_recording_loops_a_range_by_itself():
    async def main() -> None:
        recording = Host(kind="replay", now=3.0)
        line = line_of(recording)
        line.set_loop_start()
        recording.at(5.0, playing=True)
        line.set_loop_end()
        assert recording.commands[2:] == [c.SetRange(start=3.0, end=5.0), c.SetLoop(loop=True)]
        line.follow(5.0)
        line.toggle_loop()  # its ends are remembered, and it plays on
        assert recording.commands[4:] == [c.SetRange(), c.SetLoop(loop=False)]
        line.toggle_loop()
        assert recording.commands[6] == c.SetRange(start=3.0, end=5.0)
        line.forget_loop()
        assert recording.commands[8:] == [c.SetRange(), c.SetLoop(loop=False)]

    asyncio.run(main())


def test_ends_of_a_loop_that_cross_forget_the_other():
    host = Host(now=5.0)
    line = line_of(host)
    line.set_loop_end()
    host.at(7.0)
    line.set_loop_start()
    assert (line.loop_start, line.loop_end, line.loop) == (7.0, None, (7.0, 10.0))
    host.at(6.0)
    line.set_loop_end()
    assert line.loop == (0.0, 6.0)
    line.forget_loop()
    assert not line.is_looping


def test_bookmarks_outlive_the_editor_and_are_each_session_s_own(own_state):
    line = line_of(Host(now=4.0))
    line.add_bookmark()
    line.add_bookmark("  first hit  ")
    line.bookmarks.add("early", 1.0)
    again = line_of(Host(now=4.0)).bookmarks
    assert [(b.name, b.time) for b in again.all] == [("early", 1.0), ("Bookmark 1", 4.0), ("first hit", 4.0)]
    again.rename(again.all[0], "the earliest")
    again.remove(again.all[1])
    assert [b.name for b in line_of(Host()).bookmarks.all] == ["the earliest", "first hit"]
    assert Bookmarks("replay-yard").all == ()
    assert Bookmarks("../../etc/x y").all == ()
    Bookmarks("../../etc/x y").add("here", 1.0)
    assert sorted(path.name for path in (own_state / "bookmarks").iterdir()) == [
        "..-..-etc-x-y.json",
        "simulation-yard.json",
    ]


def test_bookmarks_that_cannot_be_read_are_put_aside_and_a_full_disk_is_no_end(own_state, caplog):
    path = own_state / "bookmarks" / "simulation-yard.json"
    path.parent.mkdir()
    path.write_text("[{]")
    line = line_of(Host())
    assert line.bookmarks.all == ()
    assert path.with_suffix(".broken").read_text() == "[{]"
    path.parent.joinpath("simulation-yard.draft").mkdir()
    line.add_bookmark("kept in memory")
    assert [b.name for b in line.bookmarks.all] == ["kept in memory"]
    assert "bookmarks were not saved" in caplog.text


def test_markers_that_would_stand_on_one_another_are_one_and_the_weightiest_counts():
    line = line_of(Host(end=100.0))
    line._log.add([marker(10.0, "collision", 5.0), marker(10.0, "error"), marker(10.0, "collision", 9.0)])
    line._log.add(
        [marker(50.0, "trigger"), marker(50.0 + 100.0 * NEAR / 1000.0, "edit"), marker(5.0, "collision", 0.5)]
    )
    clusters = line.clusters(1000.0)
    assert [(round(k.x), [m.kind for m in k.markers]) for k in clusters] == [
        (100, ["error", "collision", "collision"]),
        (500, ["trigger"]),
        (505, ["edit"]),
    ]
    assert clusters[0].markers[1].strength == 9.0
    line.shown_kinds -= {"error", "trigger"}
    line.least_impulse = 6.0
    assert [m.kind for m in line.markers] == ["collision", "edit"]
    line.zoom(0.01, 10.0)
    assert len(line.clusters(1000.0)) == 1


def test_to_the_next_marker_or_bookmark_and_back():
    host = Host(now=2.0)
    line = line_of(host)
    line._log.add([marker(1.0), marker(2.0), marker(8.0), marker(11.0)])
    line.bookmarks.add("here", 5.0)
    for now, direction, expected in ((2.0, 1, 5.0), (5.0, 1, 8.0), (2.0, -1, 1.0), (9.0, -1, 8.0)):
        host.at(now)
        line.go_to_next(direction)
        assert host.sought.pop() == expected
    for now, direction in ((8.0, 1), (1.0, -1)):  # the one at 11 s cannot be gone to
        host.at(now)
        line.go_to_next(direction)
        assert host.sought == []


def test_another_line_of_history_replaces_what_is_known():
    line = line_of(Host())
    line._log.take(Markers(markers=(marker(1.0), marker(2.0)), line=1))
    line._log.take(Markers(markers=(marker(2.0), marker(3.0)), line=1))
    assert [m.time for m in line.markers] == [1.0, 2.0, 3.0]
    line._log.take(Markers(markers=(marker(1.0),), line=2, left_out=4))
    assert [m.time for m in line.markers] == [1.0]
    line.forget()
    assert line.marker_count == 0


def test_labels_are_round_and_far_enough_apart():
    assert round_times(0.0, 10.0, 500.0, 90.0) == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
    assert round_times(3.2, 3.4, 500.0, 90.0) == [3.2, 3.25, 3.3, 3.35, 3.4]


# --- by hand ---------------------------------------------------------------------------------------------------------------


def with_time(person: Person, *, start: float = 0.0, end: float = 10.0, now: float = 10.0, **more) -> None:
    """Has the host of the stage keep a span of time."""
    host = person.stage.host
    status = person.editor.model.status
    changed = msgspec.structs.replace(
        status, start_time=start, end_time=end, simulation_time=now, tick=round(now * 60), **more
    )
    host.publish_status = lambda: host.session.publish(topics.STATUS, changed)
    host.publish_status()


async def opened(person: Person, **more) -> None:
    from imgui_bundle import imgui

    from elys.editor_node.panels import timeline

    async def show_markers(request, key):
        return Markers(markers=(marker(5.0, "error"), marker(7.5, "collision", 50.0, entity=1, other=2)), line=1)

    person.stage.host.session.serve(topics.MARKERS, show_markers)
    with_time(person, **more)
    imgui.set_window_focus(timeline.TITLE)
    await person.until(lambda: "timeline/bar" in person.editor.ui.landmarks.rectangles)
    await person.until(lambda: person.editor.model.timeline.marker_count == 2)
    await person.frames(3)


def seeks(person: Person) -> list[float]:
    return [command.time for command in person.stage.host.received if isinstance(command, c.Seek)]


def place(person: Person, share: float, height: float) -> tuple[float, float]:
    left, top, right, bottom = person.editor.ui.landmarks.rectangles["timeline/bar"]
    return left + share * (right - left), top + height * (bottom - top)


def test_the_bar_is_scrubbed_and_marks_are_jumped_to(at_the_editor):
    from elys.editor_node.events import MouseButton, MouseMoved, MousePressed, MouseReleased, MouseScrolled

    async def scenario(person: Person) -> None:
        await opened(person)
        await person.do(MouseMoved(*place(person, 0.25, 0.3)), MousePressed(MouseButton.LEFT))
        await person.until(lambda: seeks(person))
        await person.do(MouseMoved(*place(person, 0.4, 0.3)))
        await person.do(MouseReleased(MouseButton.LEFT))
        await person.until(lambda: seeks(person)[-1] == pytest.approx(4.0, abs=0.05))
        assert seeks(person)[0] == pytest.approx(2.5, abs=0.05)
        x, y = place(person, 0.5, 0.9)
        await person.do(MouseMoved(x + 2.0, y), MousePressed(MouseButton.LEFT), MouseReleased(MouseButton.LEFT))
        await person.until(lambda: seeks(person)[-1] == 5.0)  # of the error exactly, not of the pixel
        await person.do(MouseMoved(*place(person, 0.5, 0.3)), MouseScrolled(0.0, 3.0))
        await person.until(lambda: person.editor.model.timeline.is_zoomed)
        await person.click("timeline/all")
        assert not person.editor.model.timeline.is_zoomed

    at_the_editor(scenario)


def test_buttons_and_keys_do_the_same(at_the_editor):
    async def scenario(person: Person) -> None:
        received = person.stage.host.received
        await opened(person, now=4.0, is_rewound=True)
        await person.click("timeline/step_back")
        await person.until(lambda: c.StepTicks(count=-1) in received)
        received.clear()
        await person.press(Key.COMMA)
        await person.until(lambda: c.StepTicks(count=-1) in received)
        await person.press(Key.COMMA, SHIFT)
        await person.until(lambda: seeks(person) == [0.0])
        await person.press(Key.PERIOD, SHIFT)
        await person.until(lambda: seeks(person) == [0.0, 10.0])
        await person.click("timeline/next_marker")
        await person.until(lambda: seeks(person)[-1] == 5.0)
        await person.click("timeline/resume")
        await person.until(lambda: c.Resume() in received)
        await person.click("timeline/now")
        await person.until(lambda: seeks(person)[-1] == 10.0)
        await person.click("timeline/rate")
        await person.click("timeline/rate/0.25")
        await person.until(lambda: c.SetRate(rate=0.25) in received)
        line = person.editor.model.timeline
        await person.click("timeline/loop_start")
        assert (line.loop_start, line.is_looping) == (4.0, True)
        await person.click("timeline/forget_loop")
        assert line.loop_start is None

    at_the_editor(scenario)


def test_bookmarks_and_kinds_of_markers_by_hand(at_the_editor):
    async def scenario(person: Person) -> None:
        await opened(person, now=4.0)
        line = person.editor.model.timeline
        await person.click("timeline/bookmark")
        assert [bookmark.time for bookmark in line.bookmarks.all] == [4.0]
        await person.click("timeline/bookmarks")
        await person.click("timeline/bookmark/0/name")
        await person.press(Key.A, CTRL)
        await person.type("hit")
        await person.press(Key.ENTER)
        await person.until(lambda: line.bookmarks.all[0].name == "hit")
        await person.click("timeline/bookmark/0")
        await person.until(lambda: seeks(person) == [4.0])
        await person.click("timeline/bookmark/0/remove")
        assert line.bookmarks.all == ()
        await person.press(Key.ESCAPE)
        await person.click("timeline/markers")
        await person.click("timeline/kind/error")
        assert [shown.kind for shown in line.markers] == ["collision"]

    at_the_editor(scenario)


def test_a_host_that_keeps_nothing_says_so(at_the_editor):
    async def scenario(person: Person) -> None:
        await person.frames(3)
        assert "timeline/bar" not in person.editor.ui.landmarks.rectangles

    at_the_editor(scenario)


def test_the_timeline_speaks_french():
    known = translations("fr")
    for text in ("Return to now", "Go on from here", "Least impulse", "One tick back", "Bookmark this instant"):
        assert known[text] != text
    assert "fr" in LANGUAGES
    use_language("en")
