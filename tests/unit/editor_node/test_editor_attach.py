"""Attaching, detaching and coming back: what is kept, what is said, and that frames go on when the host dies."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

import pytest

from elys.bus.access.credentials import Credentials
from elys.bus.beacon import FoundSession
from elys.bus.discovery import SessionRecord
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.errors import ConnectionLost, LaunchError
from elys.common.scene import EntityRecord
from elys.editor_node import attachments as attachments_module
from elys.editor_node.attachments import Attachments
from elys.editor_node.keys import Key
from elys.editor_node.link_meter import LinkMeter
from elys.editor_node.model import EditorModel
from elys.editor_node.preferences import Preferences
from elys.editor_node.seat import Seat
from tests.unit.editor_node.person import CTRL, person_at
from tests.unit.editor_node.scene_host import SceneHost
from tests.unit.editor_node.stage import yard_records

A, B = "tcp/127.0.0.1:7447", "tcp/127.0.0.1:7448"


class Town:
    """Hosts at endpoints; who knocks where nobody listens hears so."""

    def __init__(self) -> None:
        self.brokers: dict[str, LoopbackBroker] = {}
        self.hosts: dict[str, SceneHost] = {}
        self.started: list[str] = []
        self.shown: dict[str, Credentials | None] = {}

    async def host(
        self, endpoint: str, *, name: str, epoch: int = 1, records: list[EntityRecord] | None = None
    ) -> SceneHost:
        broker = self.brokers.setdefault(endpoint, LoopbackBroker())
        session = await Session.host(broker.listen(), name=name, kind="simulation", epoch=epoch)
        host = self.hosts[endpoint] = SceneHost(session, epoch=epoch)
        host.load(yard_records() if records is None else records)
        return host

    async def kill(self, endpoint: str) -> None:
        await self.hosts.pop(endpoint).session.close()

    async def join(self, seat: Seat, endpoint: str) -> Session:
        if endpoint not in self.hosts:
            raise ConnectionLost(f"nobody answers at {endpoint}")
        return await Session.join(self.brokers[endpoint].connect(), kind="editor", node=seat.node)

    async def close(self) -> None:
        for endpoint in list(self.hosts):
            await self.kill(endpoint)

    # As `Openers`.
    samples = (("yard", "200 boxes and spheres rain into a yard"), ("stack", "A tower of ten cubes"))

    async def simulate(self, scene: str) -> str:
        if scene == "gone":
            raise LaunchError("there is no scene 'gone'")
        self.started.append(f"simulate {scene}")
        await self.host(B, name=scene)
        return B

    async def play(self, recording: str) -> str:
        self.started.append(f"play {recording}")
        await self.host(B, name="replay")
        return B

    async def draw(self, endpoint: str) -> None:
        self.started.append(f"draw {endpoint}")

    def show(self, endpoint: str, credentials: Credentials | None) -> None:
        self.shown[endpoint] = credentials

    async def until(self, condition) -> None:
        async with asyncio.timeout(5.0):
            while not condition():
                await asyncio.sleep(0.001)


class Desk:
    """Model and attachments without a window."""

    def __init__(self, town: Town, *, openers: Town | None = None) -> None:
        self.seat = Seat()
        self.preferences = Preferences()
        self.attachments = Attachments(
            self.seat, self.preferences, openers=openers, join=lambda endpoint: town.join(self.seat, endpoint)
        )
        self.model = EditorModel(self.seat)
        self.following = asyncio.create_task(self.model.run())

    def named(self, name: str) -> int:
        return next(e.id for e in self.model.scene.mirror.entities.values() if e.name == name)

    async def close(self) -> None:
        await self.attachments.close()
        self.following.cancel()
        await asyncio.gather(self.following, return_exceptions=True)


@contextlib.asynccontextmanager
async def town_and_desk(*, openers: bool = False) -> AsyncIterator[tuple[Town, Desk]]:
    town = Town()
    desk = Desk(town, openers=town if openers else None)
    try:
        yield town, desk
    finally:
        await desk.close()
        await town.close()


def test_a_model_needs_no_session_and_finds_one_later():
    async def scenario():
        async with town_and_desk() as (town, desk):
            model, attachments = desk.model, desk.attachments
            assert not attachments.is_attached and not model.connected and model.status is None
            await town.host(A, name="yard")
            attachments.connect("127.0.0.1")
            assert attachments.doing == f"Connecting to {A}"
            await town.until(lambda: model.scene.is_known)
            town.hosts[A].publish_status()
            await town.until(lambda: model.status is not None)
            assert (model.session.name, model.connected, attachments.doing) == ("yard", True, "")
            assert desk.preferences.recent_endpoints == [A]
            await model.edit.rename(desk.named("Sun"), "Star")
            assert town.hosts[A].mirror.entities[desk.named("Star")].name == "Star"

    asyncio.run(scenario())


def test_an_editor_that_was_started_by_name_comes_back_by_name():
    """As `elys edit --session yard` does, where other sessions are behind the same endpoint."""

    async def scenario():
        town = Town()
        await town.host(A, name="yard")
        session = await town.join(Seat(), A)
        session.place = f"yard@{A}"
        seat, asked = Seat(session), []

        async def join(place: str) -> Session:
            asked.append(place)
            raise ConnectionLost(f"nobody answers at {place}")

        attachments = Attachments(seat, Preferences(), openers=None, join=join)
        assert attachments.endpoint == f"yard@{A}"
        attachments.retry()
        await town.until(lambda: attachments.error)
        assert asked == [f"yard@{A}"]
        await attachments.close()
        await session.close()
        await town.close()

    asyncio.run(scenario())


def test_what_is_no_endpoint_or_nobody_is_said_and_changes_nothing():
    async def scenario():
        async with town_and_desk() as (town, desk):
            await town.host(A, name="yard")
            desk.attachments.connect(A)
            await town.until(lambda: desk.model.scene.is_known)
            desk.attachments.connect("tcp/somewhere:99999")
            assert "is no endpoint: give tcp/HOST:PORT" in desk.attachments.error
            desk.attachments.connect("elsewhere:1234")
            await town.until(lambda: not desk.attachments.is_busy)
            assert desk.attachments.error == "nobody answers at tcp/elsewhere:1234"
            assert desk.model.connected and desk.seat.name == "yard"

    asyncio.run(scenario())


def test_detach_and_back_keeps_selection_and_undo():
    async def scenario():
        async with town_and_desk() as (town, desk):
            model = desk.model
            await town.host(A, name="yard")
            desk.attachments.connect(A)
            await town.until(lambda: model.scene.is_known)
            crate = desk.named("Crate")
            model.selection.replace((desk.named("Sun"), crate))
            await model.edit.rename(crate, "Chest")
            kept = model.selection.entities
            desk.attachments.detach()
            assert not desk.attachments.is_attached and not model.connected and model.status is None
            assert town.hosts[A].session.nodes_of("editor") == [] or await gone(town, A)
            desk.attachments.connect(A)
            await town.until(lambda: model.connected)
            assert model.selection.entities == kept
            assert model.history.undo_label == "Rename to Chest"
            await model.history.undo()
            assert town.hosts[A].mirror.entities[crate].name == "Crate"

    async def gone(town: Town, endpoint: str) -> bool:
        await town.until(lambda: not town.hosts[endpoint].session.nodes_of("editor"))
        return True

    asyncio.run(scenario())


def test_another_run_is_selected_by_name_and_another_session_has_no_file():
    async def scenario():
        async with town_and_desk() as (town, desk):
            model = desk.model
            await town.host(A, name="yard")
            desk.attachments.connect(A)
            await town.until(lambda: model.scene.is_known)
            model.selection.replace((desk.named("Lid"), desk.named("Box 2")))
            await model.edit.rename(desk.named("Sun"), "Star")
            model.file.path = "kept.scene.json"
            others = [EntityRecord(name="First"), *yard_records(1), EntityRecord(name="Lid")]
            others = [r if r.parent < 0 else EntityRecord(name=r.name, parent=r.parent + 1) for r in others]
            await town.host(B, name="meadow", epoch=2, records=others)
            desk.attachments.connect(B)
            await town.until(lambda: model.scene.mirror.epoch == 2)
            assert len(model.selection) == 1  # there is no second box
            assert model.scene.path_of(model.selection.primary) == ("Crate", "Lid")
            assert not model.history.undo_label
            assert model.file.path is None and not model.file.is_dirty

    asyncio.run(scenario())


def test_scenes_and_recordings_are_opened_by_those_who_can():
    async def scenario():
        async with town_and_desk(openers=True) as (town, desk):
            desk.attachments.open_scene("stack")
            await town.until(lambda: "draw " + B in town.started)
            assert town.started == ["simulate stack", f"draw {B}"]
            assert desk.preferences.recent_scenes == ["stack"]
            await town.kill(B)
            desk.attachments.open_recording("it.mcap")
            await town.until(lambda: desk.preferences.recent_recordings == ["it.mcap"] or desk.attachments.error)
            assert desk.seat.name == "replay"
            desk.attachments.open_scene("gone")
            await town.until(lambda: not desk.attachments.is_busy)
            assert desk.attachments.error == "there is no scene 'gone'"
            assert desk.preferences.recent_scenes == ["stack"]
        async with town_and_desk() as (town, desk):
            desk.attachments.open_scene("stack")
            assert "elys run" in desk.attachments.error

    asyncio.run(scenario())


def test_the_link_is_measured_only_while_somebody_looks():
    async def scenario():
        async with town_and_desk() as (town, desk):
            host = await town.host(A, name="yard")
            desk.attachments.connect(A)
            await town.until(lambda: desk.model.connected)
            now, meter = [100.0], None
            meter = LinkMeter(desk.seat, clock=lambda: now[0], interval=0.0)
            assert meter.round_trip is None and meter.age is None and not meter.is_measuring
            meter.look()
            await town.until(lambda: meter.round_trip is not None)
            host.playing = True
            for tick in (10, 11, 15):
                host.tick = tick
                host.publish_frame({})
                await town.until(lambda: meter._last_tick == host.tick)
            assert meter.dropped_per_second == 3.0
            now[0] += 2.0
            before = meter.age
            assert 1.0 < before <= 2.0  # published after the ping whose answer tells the host's clock
            now[0] += 0.5
            assert meter.age == pytest.approx(before + 0.5, abs=1e-6)
            now[0] -= 2.25
            now[0] += 1.0
            assert meter.dropped_per_second == 0.0
            now[0] += 5.0
            await town.until(lambda: not meter.is_measuring)
            assert meter.round_trip is None

    asyncio.run(scenario())


# --- with the window -----------------------------------------------------------------------------------------------


def at_a_lonely_editor(scenario) -> None:
    """Runs `await scenario(person, town)` at an editor that is attached to nothing."""
    from elys.editor_node.node import Editor

    async def main() -> None:
        town = Town()
        with Editor(
            openers=town, join=lambda endpoint: town.join(editor.seat, endpoint), null_platform=True, size=(1600, 900)
        ) as editor:
            try:
                async with person_at(editor, town) as person:
                    await person.frames(3)
                    await scenario(person, town)
            finally:
                await town.close()

    asyncio.run(main())


@pytest.mark.gl
def test_the_start_page_attaches(monkeypatch, screenshot_directory):
    found = [
        SessionRecord(name="yard", endpoint=A, pid=1, kind="simulation", scene="yard", started=0.0),
        SessionRecord(name="meadow", endpoint=B, pid=1, kind="replay", scene="meadow", started=0.0),
    ]
    monkeypatch.setattr(attachments_module, "find_sessions", lambda: found)

    async def scenario(person, town):
        editor = person.editor
        await town.host(A, name="yard")
        await person.point("start/session/1")
        await person.click("start/endpoint")
        await person.type("nowhere:x")
        await person.press(Key.ENTER)
        await person.until(lambda: "is no endpoint" in editor.attachments.error)
        await person.frames(2)
        editor.screenshot(screenshot_directory / "start-error.png")
        assert "start/error" in editor.ui.landmarks.rectangles
        await person.click("start/session/0")
        await person.until(lambda: editor.model.scene.is_known)
        await person.frames(8)  # panels take their places
        await person.click("hierarchy/Crate")
        assert editor.model.selection

        await person.click("menu/file")
        await person.click("menu/file.detach")
        await person.frames(3)
        assert not editor.attachments.is_attached
        await person.click("start/sample/stack")
        await person.until(lambda: editor.seat.name == "stack")
        await person.until(lambda: town.started == [f"draw {A}", "simulate stack", f"draw {B}"])
        assert [record.key for record in editor.workspace._recent_entries()] == [
            "scene:stack", f"session:{B}", f"session:{A}",
        ]  # fmt: skip

        await person.click("menu/file")
        await person.click("menu/file.connect")
        await person.frames(3)
        await person.press(Key.A, CTRL)
        await person.type("127.0.0.1:1")
        await person.click("connect/connect")
        await person.until(lambda: "nobody answers" in editor.attachments.error)
        await person.frames(2)
        editor.screenshot(screenshot_directory / "connect-error.png")
        assert "connect/error" in editor.ui.landmarks.rectangles
        await person.click("connect/close")

    at_a_lonely_editor(scenario)


@pytest.mark.gl
def test_a_dead_host_is_a_banner_and_frames_go_on(screenshot_directory):
    async def scenario(person, town):
        editor = person.editor
        await town.host(A, name="yard")
        editor.attachments.connect(A)
        await person.until(lambda: editor.model.scene.is_known)
        await person.frames(8)  # panels take their places
        await person.click("hierarchy/Crate")
        await town.kill(A)
        await person.until(lambda: editor.attachments.lost_for is not None)
        await person.point("banner/text")
        drawn = editor.application.frame_count
        await person.frames(5)
        assert editor.application.frame_count >= drawn + 5
        editor.screenshot(screenshot_directory / "banner.png")

        await person.click("banner/retry")  # nobody is there yet
        await person.until(lambda: "nobody answers" in editor.attachments.error)
        await person.point("banner/error")
        await town.host(A, name="yard", epoch=2)
        await person.until(lambda: editor.attachments.lost_for is None)
        await person.until(lambda: editor.model.scene.mirror.epoch == 2)
        assert editor.model.scene.name_of(editor.model.selection.primary) == "Crate"
        del editor.ui.landmarks.rectangles["banner/retry"]
        await person.frames(3)
        assert "banner/retry" not in editor.ui.landmarks.rectangles

        await town.kill(A)  # another session comes where this one was: only Retry takes it
        await person.until(lambda: editor.attachments.lost_for is not None)
        await town.host(A, name="meadow", epoch=3)
        await person.frames(4)  # a window that fits itself to its text takes its place late
        await person.click("banner/retry")
        await person.until(lambda: editor.seat.name == "meadow" and editor.model.connected)

        await town.kill(A)
        await person.until(lambda: editor.attachments.lost_for is not None)
        await person.frames(4)
        await person.click("banner/disconnect")
        await person.frames(3)
        assert not editor.attachments.is_attached
        assert "start/connect" in editor.ui.landmarks.rectangles

    at_a_lonely_editor(scenario)


@pytest.mark.gl
def test_the_link_shows_its_figures(screenshot_directory):
    async def scenario(person, town):
        editor = person.editor
        await town.host(A, name="yard")
        editor.attachments.connect(A)
        await person.until(lambda: editor.model.scene.is_known)
        assert not editor.ui.meter.is_measuring
        town.hosts[A].publish_status()
        await person.frames(8)
        await person.click("toolbar/link")
        await person.until(lambda: editor.ui.meter.round_trip is not None)
        await person.frames(2)
        editor.screenshot(screenshot_directory / "link.png")
        await person.click("link/disconnect")
        await person.frames(2)
        assert not editor.attachments.is_attached

    at_a_lonely_editor(scenario)


@pytest.mark.gl
def test_the_start_page_looks_around_when_asked(monkeypatch, screenshot_directory):
    asked: list[int] = []

    async def answers() -> list[FoundSession]:
        asked.append(1)
        found = FoundSession(
            name="meadow", kind="simulation", scene="Meadow", endpoint=A, age=300.0, load=0.25, clients=2,
            needs_secret=True, version="",
        )  # fmt: skip
        return [found] if len(asked) > 1 else []

    monkeypatch.setattr(attachments_module, "find_sessions", lambda: [])
    monkeypatch.setattr(attachments_module, "look_around", answers)

    async def scenario(person, town):
        editor = person.editor
        await person.frames(20)
        assert not asked, "nobody is asked before somebody wants it"
        await town.host(f"meadow@{A}", name="meadow")
        await person.click("start/look around")
        await person.until(lambda: editor.attachments.nearby == ())
        await person.click("start/look around")
        await person.until(lambda: editor.attachments.nearby)
        await person.frames(3)
        editor.screenshot(screenshot_directory / "start-nearby.png")
        await person.click("start/nearby/0")
        await person.frames(5)
        await person.until(lambda: editor.model.scene.is_known)
        assert editor.seat.name == "meadow"

    at_a_lonely_editor(scenario)
