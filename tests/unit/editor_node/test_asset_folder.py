"""A folder of assets, what is searched in it, what its files hold, and files imported into it."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from elys.common.assets.store import AssetStore, reference_of
from elys.editor_node.asset_browsing import AssetBrowsing, Search, choose_folder, project_folder
from elys.editor_node.asset_folder import AssetFile, AssetFolder, asset_type, walk
from elys.editor_node.asset_import import carry_out, plan_import
from elys.editor_node.asset_pictures import ThumbnailCache, image_thumbnail, thumbnail_request
from elys.editor_node.asset_reading import read_asset
from elys.editor_node.gpu import TextureShelf
from elys.editor_node.preferences import Preferences
from tests.unit.editor_node.asset_files import write_image, write_model, write_project


@pytest.fixture
def project(tmp_path: Path) -> Path:
    folder = tmp_path / "project"
    folder.mkdir()
    write_project(folder)
    return folder


def found(folder: Path, name: str) -> AssetFile:
    return next(file for file in walk(folder).files if file.name == name)


# --- the folder --------------------------------------------------------------------------------------------------------


def test_a_folder_lists_what_a_scene_can_use_and_passes_over_what_is_hidden(project: Path):
    listing = walk(project)
    assert {file.name: file.type for file in listing.files} == {
        "brick.png": "image",
        "grass.png": "image",
        "square.gltf": "model",
        "broken.glb": "model",
        "sky.hdr": "light",
        "pair.prefab.json": "prefab",
    }
    assert listing.folders == ("textures",)
    assert listing.cut == ""
    assert found(project, "brick.png").folder == "textures"
    assert asset_type(Path("Yard.SCENE.json")) == "scene"
    assert asset_type(Path("package.json")) is None


def test_a_folder_too_large_is_cut_and_said_so(project: Path):
    assert walk(project, file_limit=2).cut == "files"
    assert len(walk(project, file_limit=2).files) == 2
    assert walk(project, folder_limit=0).cut == "folders"
    (project / "loop").symlink_to(project)
    assert walk(project).folders == ("textures",)
    assert walk(project / "nowhere").cut == "unreadable"


@pytest.mark.parametrize("is_watched", [True, False])
def test_what_changes_on_the_disk_is_told(project: Path, monkeypatch: pytest.MonkeyPatch, is_watched: bool):
    monkeypatch.setattr("elys.editor_node.asset_folder.POLL_INTERVAL", 0.01)
    told: list[list[str]] = []
    heard = threading.Condition()

    def on_change(changed: list[AssetFile]) -> None:
        with heard:
            told.append(sorted(file.name for file in changed))
            heard.notify()

    def wait_for(names: set[str]) -> None:
        with heard:
            assert heard.wait_for(lambda: names <= {name for some in told for name in some}, timeout=20.0), told

    folder = AssetFolder(project, on_change=on_change, is_watched=is_watched)
    try:
        with heard:
            assert heard.wait_for(lambda: bool(told), timeout=20.0)
        assert told == [[]]
        write_image(project / "textures" / "brick.png", (1, 2, 3), (20, 20))
        wait_for({"brick.png"})
        (project / "new").mkdir()
        write_image(project / "new" / "late.png", (1, 2, 3))
        wait_for({"late.png"})
        write_image(project / "new" / "late.png", (1, 2, 3), (7, 7))
        wait_for({"late.png"})
        (project / "grass.png").unlink()
        with heard:
            assert heard.wait_for(lambda: "grass.png" not in {f.name for f in folder.listing.files}, timeout=20.0)
    finally:
        folder.close()
    assert not folder._thread.is_alive()


# --- searching ---------------------------------------------------------------------------------------------------------


def test_search_by_name_and_type(project: Path):
    listing = walk(project)
    browsing = AssetBrowsing()

    def names(search: str) -> list[str]:
        browsing.search = search
        return [file.name for file in browsing.shown(listing)[1]]

    assert names("") == ["broken.glb", "grass.png", "pair.prefab.json", "sky.hdr", "square.gltf"]
    assert browsing.shown(listing)[0] == ["textures"]
    assert names("t:image") == ["brick.png", "grass.png"]
    assert names("t:mod SQ") == ["square.gltf"]
    assert names("t:hdr") == ["sky.hdr"]
    assert names("textures") == ["brick.png"]  # folders count
    assert names("t:image t:light") == ["brick.png", "grass.png", "sky.hdr"]
    assert names("t:nonsense") == []
    assert Search.parsed("t:nonsense").unknown == ("nonsense",)


def test_folders_are_entered_left_and_forgotten_when_they_are_gone(project: Path):
    browsing = AssetBrowsing()
    browsing.enter("textures")
    assert [file.name for file in browsing.shown(walk(project))[1]] == ["brick.png"]
    assert browsing.parts() == [("textures", "textures")]
    browsing.up()
    assert browsing.folder == ""
    browsing.enter("textures")
    (project / "textures" / "brick.png").unlink()
    (project / "textures").rmdir()
    assert "grass.png" in [file.name for file in browsing.shown(walk(project))[1]]
    assert browsing.folder == ""


def test_files_stand_in_the_order_that_was_chosen(project: Path):
    write_image(project / "large.png", (0, 0, 0), (500, 500))
    write_image(project / "large.png", (9, 9, 9), (900, 900))
    browsing = AssetBrowsing(order="size", search="t:image")
    sizes = [file.size for file in browsing.shown(walk(project))[1]]
    assert sizes == sorted(sizes, reverse=True)
    browsing.order = "newest"
    assert browsing.shown(walk(project))[1][0].name == "large.png"


def test_the_folder_is_beside_the_scene_else_the_one_chosen_last(project: Path, monkeypatch: pytest.MonkeyPatch):
    preferences = Preferences()
    monkeypatch.chdir(project / "textures")
    assert project_folder(preferences, None) == project / "textures"
    assert choose_folder(preferences, f" {project} ") == project
    assert project_folder(preferences, None) == project
    assert project_folder(preferences, project / "textures" / "yard.scene.json") == project / "textures"
    with pytest.raises(OSError, match="there is no folder"):
        choose_folder(preferences, str(project / "nowhere"))
    with pytest.raises(OSError, match="is a file"):
        choose_folder(preferences, str(project / "grass.png"))
    assert preferences.recent_folders == [str(project)]


# --- what files hold ---------------------------------------------------------------------------------------------------


def test_files_are_read_as_what_a_scene_holds_of_them(project: Path):
    store = AssetStore()
    image, _ = read_asset(found(project, "brick.png"), store)
    data = (project / "textures" / "brick.png").read_bytes()
    assert image.dragged == ({"brick.png": reference_of(data)}, "image")
    model, records = read_asset(found(project, "square.gltf"), store)
    assert model.dragged == ({"Square": model.parts["0/0"]}, "mesh")
    assert store.has(model.parts["0/0"])
    assert records[0].prefab == str(project / "square.gltf")
    prefab, records = read_asset(found(project, "pair.prefab.json"), store)
    assert prefab.references == {model.parts["0/0"]}
    assert records[0].name == "Pair"
    assert records[0].prefab == str(project / "pair.prefab.json")
    light, records = read_asset(found(project, "sky.hdr"), store)
    assert records[0].components["Environment"]["image"] == light.parts[""]


def test_a_broken_file_is_one_sentence(project: Path):
    content, records = read_asset(found(project, "broken.glb"), AssetStore())
    assert records == ()
    assert content.error.startswith("broken.glb: ") and "\n" not in content.error
    (project / "bad.scene.json").write_text('{"elys_scene": 1, "entities": [{"prefab": "gone.glb"}, {}]}')
    content, _ = read_asset(found(project, "bad.scene.json"), AssetStore())
    assert "gone.glb" in content.error


def test_the_key_follows_what_a_file_holds(project: Path):
    before, _ = read_asset(found(project, "square.gltf"), AssetStore())
    write_model(project / "square.gltf", size=1.0)
    assert read_asset(found(project, "square.gltf"), AssetStore())[0].key == before.key
    write_model(project / "square.gltf", color=(0.0, 1.0, 0.0))
    assert read_asset(found(project, "square.gltf"), AssetStore())[0].key != before.key


# --- thumbnails --------------------------------------------------------------------------------------------------------


def test_images_are_made_small_and_kept_on_the_disk(tmp_path: Path):
    write_image(tmp_path / "wide.png", (200, 60, 40), (1000, 500))
    pixels = image_thumbnail((tmp_path / "wide.png").read_bytes())
    assert pixels.shape == (64, 128, 4)
    assert (pixels == (200, 60, 40, 255)).all()
    cache = ThumbnailCache(tmp_path / "cache")
    cache.put("blake2b:ab", pixels)
    assert np.array_equal(ThumbnailCache(tmp_path / "cache").get("blake2b:ab"), pixels)
    assert cache.get("blake2b:cd") is None
    (tmp_path / "cache" / "cd.png").write_bytes(b"damaged")
    assert cache.get("blake2b:cd") is None


def test_the_cache_of_thumbnails_keeps_below_its_size(tmp_path: Path):
    cache = ThumbnailCache(tmp_path)
    rng = np.random.default_rng(1)
    for number in range(8):
        cache.put(f"blake2b:{number}", rng.integers(0, 255, (128, 128, 4), np.uint8))
    size = sum(path.stat().st_size for path in tmp_path.iterdir())
    ThumbnailCache(tmp_path, max_size=size // 2)
    assert 0 < sum(path.stat().st_size for path in tmp_path.iterdir()) <= size // 2


def test_what_is_sent_to_be_drawn_is_small_and_has_what_it_takes_to_be_seen(project: Path):
    for name, wanted in (
        ("square.gltf", {"Camera", "Light", "MeshRenderer"}),
        ("sky.hdr", {"Camera", "Environment", "MeshRenderer"}),
    ):
        store = AssetStore()
        file = found(project, name)
        content, records = read_asset(file, store)
        request = thumbnail_request(file, records, store)
        assert wanted <= {component for record in request.records for component in record.components}
        assert request.contents.keys() == content.references
        assert all(record.prefab == "" for record in request.records[1:])


class Texture:
    made = 0

    def __init__(self, pixels) -> None:
        Texture.made += 1
        self.glo = Texture.made
        self.is_released = False

    def release(self) -> None:
        assert not self.is_released
        self.is_released = True


def test_textures_come_a_few_a_frame_and_go_when_they_are_out_of_sight():
    made: list[Texture] = []

    def make(pixels) -> Texture:
        made.append(Texture(pixels))
        return made[-1]

    shelf: TextureShelf[int] = TextureShelf(make, uploads=3)
    pixels = np.zeros((4, 4, 4), np.uint8)
    for first in range(0, 300, 5):  # scrolls through three hundred
        for _ in range(3):
            shelf.begin_frame()
            names = [shelf.name(key, pixels) for key in range(first, first + 7)]
            assert len(shelf) <= 14
        assert all(names) and not shelf.is_behind
        assert len(set(names)) == 7
    shelf.begin_frame()
    shelf.begin_frame()
    assert len(shelf) == 0
    assert all(texture.is_released for texture in made)


# --- importing ---------------------------------------------------------------------------------------------------------


def test_a_model_is_imported_with_all_that_it_names(tmp_path: Path, project: Path):
    outside = tmp_path / "outside"
    outside.mkdir()
    write_model(outside / "chair.gltf", buffer="chair data.bin")
    plan = plan_import([outside / "chair.gltf"], project)
    assert plan.clashes == () and plan.refused == ()
    assert carry_out(plan) == []
    content, _ = read_asset(found(project, "chair.gltf"), AssetStore())
    assert content.error == ""
    assert (project / "chair data.bin").is_file()


def test_names_that_are_taken_are_asked_for_and_kept_apart(tmp_path: Path, project: Path):
    outside = tmp_path / "outside"
    outside.mkdir()
    write_image(outside / "grass.png", (1, 1, 1))
    write_model(outside / "square.gltf", buffer="square.bin", size=3.0)
    sources = [outside / "grass.png", outside / "square.gltf"]
    before = (project / "grass.png").read_bytes()
    assert {path.name for path in plan_import(sources, project).clashes} == {"grass.png", "square.gltf"}
    assert carry_out(plan_import(sources, project, on_clash="skip")) == []
    assert (project / "grass.png").read_bytes() == before
    assert carry_out(plan_import(sources, project, on_clash="rename")) == []
    assert (project / "grass 2.png").read_bytes() == sources[0].read_bytes()
    assert (project / "square 2" / "square.bin").is_file()  # the model names it so
    assert read_asset(found(project / "square 2", "square.gltf"), AssetStore())[0].error == ""
    assert carry_out(plan_import(sources, project, on_clash="replace")) == []
    assert (project / "grass.png").read_bytes() == sources[0].read_bytes()
    again = plan_import(sources, project)  # the same files clash with nobody
    assert again.clashes == ()


def test_what_cannot_be_imported_is_said(tmp_path: Path, project: Path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "notes.txt").write_text("")
    (outside / "thief.gltf").write_text('{"asset": {"version": "2.0"}, "buffers": [{"uri": "../../etc/passwd"}]}')
    plan = plan_import([outside / "notes.txt", outside / "gone.png", outside / "thief.gltf"], project)
    assert [source.name for source, _ in plan.copies] == ["thief.gltf"]
    assert any("is no asset" in sentence for sentence in plan.refused)
    assert any("there is no file" in sentence for sentence in plan.refused)
    assert any("outside of its folder" in sentence for sentence in plan.refused)
    blocked = plan_import([outside / "thief.gltf"], project / "grass.png" / "below")
    assert "cannot be copied" in carry_out(blocked)[0]
