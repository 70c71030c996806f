"""The browser of assets by hand: the real panel on GLFW's null platform, a small host behind it, files on the disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from elys.bus import topics
from elys.bus.asset_service import serve_assets
from elys.bus.messages.commands import SetComponent, Spawn
from elys.bus.messages.views import PickReply, Thumbnail, ThumbnailRequest
from elys.bus.session import Session
from elys.common.assets.store import AssetStore, reference_of
from elys.common.errors import RequestError
from elys.common.scene import EntityRecord
from elys.editor_node.asset_pictures import ThumbnailCache
from elys.editor_node.events import FilesDropped, MouseMoved, MousePressed, MouseReleased, MouseScrolled
from elys.editor_node.keys import Key
from tests.unit.editor_node.asset_files import write_cart, write_image, write_model, write_project
from tests.unit.editor_node.person import CTRL

pytestmark = pytest.mark.gl
PLACE = (3.0, 0.5, -2.0)  # [m] what the pictures' source says is seen


class Browser:
    """What hands do in the browser again and again."""

    def __init__(self, person, folder: Path, host_assets: AssetStore) -> None:
        self.person = person
        self.folder = folder
        self.host_assets = host_assets
        self.editor = person.editor
        self.library = person.editor.assets
        self.model = person.editor.model
        self.landmarks = person.editor.ui.landmarks
        self.panel = person.editor.workspace.assets

    @property
    def host(self):
        return self.person.stage.host

    async def open(self, name: str) -> None:
        await self.person.click(f"assets/{name}/", times=2)
        await self.person.frames(2)

    async def shown(self) -> set[str]:
        self.landmarks.rectangles.clear()
        await self.person.frames(2)
        return {name for name in self.landmarks.rectangles if name.startswith("assets/")}

    async def search(self, text: str) -> None:
        await self.person.click("assets/search")
        await self.person.press(Key.A, CTRL)
        await self.person.type(text)
        await self.person.frames(2)

    async def drop(self, name: str, place: str) -> None:
        """Drags a tile onto another widget and lets go there."""
        await self.person.until(lambda: self.content(name) is not None)
        start, end = self.landmarks.center(f"assets/{name}"), self.landmarks.center(place)
        await self.person.do(MouseMoved(*start), MousePressed(0))
        await self.person.do(MouseMoved(start[0] + 12.0, start[1]))
        held = self.content(name).dragged
        if held is not None:
            await self.person.until(lambda: self.library.is_at_host(self.file(name)))
        await self.person.do(MouseMoved(*end), MouseMoved(end[0] + 1.0, end[1]))
        await self.person.frames(2)
        await self.person.do(MouseReleased(0))

    def file(self, name: str):
        return next((file for file in self.library.listing.files if file.name == name), None)

    def content(self, name: str):
        file = self.file(name)
        return self.library.content(file) if file is not None else None

    def entity(self, name: str):
        return next((e for e in self.host.mirror.entities.values() if e.name == name), None)


@pytest.fixture
def at_the_browser(at_the_editor, tmp_path, monkeypatch):
    """Runs `await scenario(browser)` with the panel in front, on a small project."""
    folder = tmp_path / "project"
    folder.mkdir()
    write_project(folder)
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))

    def play(scenario, records=None) -> None:
        async def with_person(person):
            host_assets = AssetStore()
            stop = serve_assets(person.stage.host.session, host_assets)
            browser = Browser(person, folder, host_assets)
            browser.library._cache = ThumbnailCache(tmp_path / "thumbnails")
            await person.frames(6)
            browser.library.open(folder)
            browser.panel.search()
            await person.until(lambda: browser.library.folder is not None and browser.library.folder.is_known)
            await person.until(lambda: "assets/grass.png" in browser.landmarks.rectangles)
            try:
                await scenario(browser)
            finally:
                stop()

        at_the_editor(with_person, records)

    return play


async def render_node(stage, *, color=(10, 200, 10)):
    """A render node whose thumbnails are of one colour, and that sees PLACE on the entity it is told of."""
    session = await Session.join(stage.broker.connect(), kind="render")
    asked: list[ThumbnailRequest] = []

    async def draw(request: ThumbnailRequest, _: str) -> Thumbnail:
        asked.append(request)
        if any("Refused" in record.name for record in request.records):
            raise RequestError("this cannot be drawn")
        rows = np.full((request.size, request.size, 3), color, np.uint8)
        return Thumbnail(jpeg=simplejpeg.encode_jpeg(rows, colorspace="RGB"))

    session.serve(topics.THUMBNAIL, draw, key=session.node.id)
    return session, asked


# --- looking -----------------------------------------------------------------------------------------------------------


def test_folders_are_entered_and_files_found(at_the_browser):
    async def scenario(browser):
        assert {"assets/textures/", "assets/square.gltf", "assets/sky.hdr"} <= await browser.shown()
        await browser.open("textures")
        assert "assets/brick.png" in await browser.shown()
        assert "assets/grass.png" not in await browser.shown()
        await browser.person.click("assets/part/0")
        await browser.search("t:image bri")
        assert "assets/brick.png" in await browser.shown()
        assert "assets/square.gltf" not in await browser.shown()

    at_the_browser(scenario)


def test_images_get_thumbnails_here_and_models_from_a_render_node(at_the_browser):
    async def scenario(browser):
        person, library = browser.person, browser.library
        await person.until(lambda: library.picture(browser.file("grass.png")) is not None)
        assert (library.picture(browser.file("grass.png"))[0, 0] == (40, 160, 50, 255)).all()
        await person.until(lambda: browser.content("square.gltf") is not None)
        await person.frames(3)
        assert library.picture(browser.file("square.gltf")) is None  # nobody draws: an icon
        session, asked = await render_node(person.stage)
        for name in ("square.gltf", "pair.prefab.json", "sky.hdr"):
            await person.until(lambda name=name: library.picture(browser.file(name)) is not None)
        assert len(asked) == 3
        assert "assets/square.gltf" in await browser.shown()
        await session.close()

    at_the_browser(scenario)


def test_a_broken_model_is_told_of_on_its_tile(at_the_browser):
    async def scenario(browser):
        await browser.person.until(lambda: browser.content("broken.glb") is not None)
        assert "broken.glb" in browser.content("broken.glb").error
        await browser.person.click("assets/broken.glb")
        await browser.person.frames(2)
        assert browser.panel.browsing.selected == browser.folder / "broken.glb"

    at_the_browser(scenario)


def test_tiles_out_of_sight_keep_no_texture(at_the_browser, tmp_path):
    for number in range(300):
        write_image(tmp_path / "project" / "textures" / f"{number:03}.png", (number % 255, 0, 0), (8, 8))

    async def scenario(browser):
        person, shelf = browser.person, browser.editor._shelf
        await browser.open("textures")
        seen: set[str] = set()
        most = 0
        for step in range(12):
            await person.point("assets/search")
            left, top, right, bottom = browser.landmarks.rectangles["panel/Assets"]
            await person.do(MouseMoved((left + right) / 2, (top + bottom) / 2 + 20))
            await person.do(MouseScrolled(0.0, -4.0 if step else 0.0))
            names = await browser.shown()
            seen |= names
            tiles = {name for name in names if name.endswith(".png")}
            await person.until(lambda: not browser.library._wanted)
            await person.frames(6)
            most = max(most, len(shelf))
            assert len(shelf) <= len(tiles) + 40
        assert len(seen) > 60
        assert 0 < most < 150
        browser.editor.workspace._hidden.add("Assets")
        await person.frames(3)
        assert len(shelf) == 0

    at_the_browser(scenario)


# --- into the scene ----------------------------------------------------------------------------------------------------


def test_an_image_is_dragged_into_a_field(at_the_browser):
    async def scenario(browser):
        person = browser.person
        await person.click("hierarchy/Crate")
        for name in ("Transform", "RigidBody", "Collider"):
            await person.click(f"inspector/{name}")
            await person.frames(2)
        await browser.drop("grass.png", "inspector/Material/base_color_texture")
        data = (browser.folder / "grass.png").read_bytes()
        await person.until(lambda: browser.entity("Crate").components["Material"].base_color_texture)
        assert browser.entity("Crate").components["Material"].base_color_texture == reference_of(data)
        assert browser.host_assets.get(reference_of(data)) == data
        browser.editor.seat.detach()  # another host would have to be given it anew
        assert not browser.library.is_at_host(browser.file("grass.png"))

    at_the_browser(scenario)


def test_of_a_model_of_several_meshes_one_is_chosen_by_name(at_the_browser, screenshot_directory):
    async def scenario(browser):
        person = browser.person
        source = await person.stage.picture_source(entity=person.stage.named("Ground"))
        await person.until(lambda: browser.editor.stream.shown is not None)
        write_cart(browser.folder / "cart.gltf")
        await person.until(lambda: browser.content("cart.gltf") is not None)
        meshes = browser.content("cart.gltf").meshes
        assert list(meshes) == ["Cart", "Wheel", "Cover"] and len(set(meshes.values())) == 3
        await person.click("hierarchy/Box 1")
        for name in ("Transform", "RigidBody"):
            await person.click(f"inspector/{name}")
            await person.frames(2)
        field = "inspector/MeshRenderer/mesh"
        await browser.drop("cart.gltf", field)
        await person.frames(3)
        offered = {name for name in browser.landmarks.rectangles if name.startswith(f"{field}/pick/")}
        assert offered == {f"{field}/pick/{name}" for name in meshes}
        browser.editor.screenshot(screenshot_directory / "editor-assets-meshes.png")
        await person.click(f"{field}/pick/Wheel")
        await person.until(lambda: browser.entity("Box 1").components["MeshRenderer"].mesh == meshes["Wheel"])
        assert browser.host_assets.has(meshes["Wheel"])
        # Or typed, and Enter takes the first of that name.
        await browser.drop("cart.gltf", field)
        await person.frames(3)
        await person.type("cov")
        await person.press(Key.ENTER)
        await person.until(lambda: browser.entity("Box 1").components["MeshRenderer"].mesh == meshes["Cover"])
        # What the scene knows is still what the crosshairs offer.
        browser.landmarks.rectangles.clear()
        await person.frames(2)
        await person.click(f"{field}/pick")
        await person.frames(2)
        assert f"{field}/pick/box" in browser.landmarks.rectangles
        await person.press(Key.ESCAPE)

        # In the view it is the whole tree.
        await browser.drop("cart.gltf", "viewport/picture")
        await person.until(lambda: browser.entity("Cover") is not None)
        root = browser.entity("cart")
        assert root.prefab == str(browser.folder / "cart.gltf")
        tree = browser.host.mirror
        names = [tree.entities[entity].name for entity in tree.descendants(root.id)]
        assert sorted(names) == ["Cart", "Cover", "Wheel", "Wheel 2", "cart"]
        await source.close()

    at_the_browser(scenario)


def test_a_model_is_dropped_where_the_pointer_points_as_one_edit(at_the_browser):
    async def scenario(browser):
        person = browser.person
        source = await person.stage.picture_source(entity=person.stage.named("Ground"))

        async def pick(request, _):
            return PickReply(entity=person.stage.named("Ground"), position=PLACE)

        source._pick = pick
        session, _ = await render_node(person.stage)
        session.serve(topics.PICK, pick, key=session.node.id)
        await person.until(lambda: browser.editor.stream.shown is not None)
        browser.editor.stream.renderer = session.node
        before = len(browser.host.mirror.entities)
        await browser.drop("square.gltf", "viewport/picture")
        await person.until(lambda: browser.entity("square") is not None)
        root = browser.entity("square")
        assert root.components["Transform"].position == PLACE  # its lowest point is its origin
        assert root.prefab == str(browser.folder / "square.gltf")
        assert isinstance(browser.host.received[-1], Spawn)
        mesh = (
            next(e for e in browser.host.mirror.entities.values() if e.name == "Square").components["MeshRenderer"].mesh
        )
        assert browser.host_assets.has(mesh)
        await person.until(lambda: browser.model.selection.primary == root.id)
        await browser.model.history.settle()
        await person.press(Key.Z, CTRL)
        await person.until(lambda: len(browser.host.mirror.entities) == before)
        await session.close()
        await source.close()

    at_the_browser(scenario)


def test_light_and_images_go_where_they_belong(at_the_browser):
    async def scenario(browser):
        person, placing = browser.person, browser.library.placing
        await person.until(lambda: browser.content("sky.hdr") is not None)
        await person.click("assets/sky.hdr", times=2)
        await person.until(lambda: browser.entity("sky") is not None)
        assert browser.entity("sky").components["Environment"].kind == "image"
        await placing.place(browser.file("sky.hdr"), np.zeros(3))
        assert sum("Environment" in e.components for e in browser.host.mirror.entities.values()) == 1
        crate = person.stage.named("Crate")
        await placing.place(browser.file("grass.png"), np.zeros(3), onto=crate)
        assert browser.entity("Crate").components["Material"].base_color_texture
        received = len(browser.host.received)
        await placing.place(browser.file("grass.png"), np.zeros(3), onto=person.stage.named("Sun"))
        await placing.place(browser.file("broken.glb"), np.zeros(3))
        assert len(browser.host.received) == received
        assert "broken.glb" in browser.model.error

    at_the_browser(scenario)


# --- following the disk ------------------------------------------------------------------------------------------------


def test_the_scene_follows_a_texture_that_changes_on_the_disk_and_undo_takes_it_back(at_the_browser):
    async def scenario(browser):
        person = browser.person
        await person.until(lambda: browser.content("grass.png") is not None)
        old = reference_of((browser.folder / "grass.png").read_bytes())
        crate, box = person.stage.named("Crate"), person.stage.named("Box 1")
        await browser.library.placing.bring([old], _store_of(browser.folder / "grass.png"), "grass.png")
        for entity, value in ((crate, f"{old}?scale=2,2"), (box, old)):
            await browser.model.edit.set_fields((entity,), "Material", {"base_color_texture": value})
        write_image(browser.folder / "grass.png", (250, 250, 0), (16, 16))
        new = reference_of((browser.folder / "grass.png").read_bytes())

        def textures() -> list[str]:
            return [browser.entity(n).components["Material"].base_color_texture for n in ("Crate", "Box 1")]

        await person.until(lambda: textures() == [f"{new}?scale=2,2", new])
        assert browser.host_assets.has(new)
        await browser.model.history.settle()
        assert browser.model.history.undo_label == "Reload grass.png"
        browser.editor.ui.actions.run("edit.undo")
        await person.until(lambda: textures() == [f"{old}?scale=2,2", old])

    at_the_browser(scenario)


def test_a_model_is_followed_part_by_part_and_a_broken_one_waited_for(at_the_browser):
    async def scenario(browser):
        person = browser.person
        await person.until(lambda: browser.content("square.gltf") is not None)
        await browser.library.placing.place(browser.file("square.gltf"), np.zeros(3))
        mesh = browser.entity("Square").components["MeshRenderer"].mesh
        (browser.folder / "square.gltf").write_text("half of a mo")
        await person.until(lambda: "square.gltf" in said(browser.model))
        assert browser.entity("Square").components["MeshRenderer"].mesh == mesh
        write_model(browser.folder / "square.gltf", size=4.0)
        await person.until(lambda: browser.entity("Square").components["MeshRenderer"].mesh != mesh)
        assert browser.host_assets.has(browser.entity("Square").components["MeshRenderer"].mesh)
        browser.editor.ui.actions.run("assets.follow")
        count = len(browser.host.received)
        write_model(browser.folder / "square.gltf", size=5.0)
        key = browser.content("square.gltf")
        await person.until(lambda: browser.content("square.gltf") not in (None, key))
        assert not any(isinstance(command, SetComponent) for command in browser.host.received[count:])

    at_the_browser(scenario)


# --- uses, and what is missing -----------------------------------------------------------------------------------------


def test_users_of_an_asset_are_selected(at_the_browser):
    async def scenario(browser):
        person = browser.person
        crate, box = person.stage.named("Crate"), person.stage.named("Box 2")
        await person.until(lambda: browser.content("grass.png") is not None)
        for entity in (crate, box):
            await browser.library.placing.place(browser.file("grass.png"), np.zeros(3), onto=entity)
        await person.click("assets/grass.png")
        await person.frames(2)
        await person.click("assets/users")
        assert set(browser.model.selection) == {crate, box}

    at_the_browser(scenario)


def test_what_nobody_has_is_listed_and_selected(at_the_browser):
    gone = "blake2b:" + "7" * 32
    records = [
        EntityRecord(name="Ghost", components={"Transform": {}, "MeshRenderer": {"mesh": gone}, "Material": {}}),
        EntityRecord(
            name="Painted", components={"MeshRenderer": {}, "Material": {"normal_texture": f"{gone}?scale=2,2"}}
        ),
        EntityRecord(name="Ball", components={"MeshRenderer": {"mesh": "sphere"}, "Script": {"source": "a.py:B"}}),
    ]

    async def scenario(browser):
        person = browser.person
        await person.click("assets/missing")
        await person.until(lambda: browser.library.missing is not None)
        (missing,) = browser.library.missing
        assert missing.reference == gone
        assert [(use.component, use.field) for use in missing.uses] == [
            ("MeshRenderer", "mesh"),
            ("Material", "normal_texture"),
        ]
        await person.click("assets/missing/1")
        assert browser.model.selection.primary == person.stage.named("Painted")
        await browser.model.edit.set_fields((person.stage.named("Ghost"),), "MeshRenderer", {"mesh": "box"})
        await person.until(lambda: len(browser.library.missing[0].uses) == 1)

    at_the_browser(scenario, records)


# --- importing ---------------------------------------------------------------------------------------------------------


def test_files_dropped_on_the_window_are_imported_and_clashes_asked(at_the_browser, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    write_image(outside / "sand.png", (200, 200, 90))
    write_image(outside / "grass.png", (0, 0, 0))

    async def scenario(browser):
        person = browser.person
        await person.do(FilesDropped((str(outside / "sand.png"),)))
        await person.until(lambda: browser.file("sand.png") is not None)
        await person.until(lambda: "assets/sand.png" in browser.landmarks.rectangles)
        await person.do(FilesDropped((str(outside / "grass.png"),)))
        await person.click("assets/clash/rename")
        await person.until(lambda: browser.file("grass 2.png") is not None)
        await person.do(FilesDropped((str(outside / "grass.png"),)))
        await person.until(lambda: browser.panel.dialogs._clash.clashes)
        await person.click("assets/clash/replace")
        await person.until(lambda: (browser.folder / "grass.png").read_bytes() == (outside / "grass.png").read_bytes())

    at_the_browser(scenario)


def test_another_folder_is_chosen_and_remembered(at_the_browser, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    write_image(other / "only.png", (1, 2, 3))

    async def scenario(browser):
        person = browser.person
        await person.click("assets/choose")
        await person.frames(2)
        await person.press(Key.A, CTRL)
        await person.type(str(tmp_path / "nowhere"))
        await person.press(Key.ENTER)
        assert "there is no folder" in browser.panel.dialogs._error
        await person.frames(2)
        await person.press(Key.A, CTRL)
        await person.type(str(other))
        await person.press(Key.ENTER)
        await person.until(lambda: browser.file("only.png") is not None)
        assert browser.editor.preferences.recent_folders[0] == str(other)

    at_the_browser(scenario)


def _store_of(path: Path) -> AssetStore:
    store = AssetStore()
    store.put(path.read_bytes(), kind="image")
    return store


def said(model) -> str:
    """All that stands in the console."""
    return " ".join(line.text for line in model.console)
