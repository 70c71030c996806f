"""Scenes as files: opened, reverted, compared, kept aside and recovered; a disk that is full loses nothing."""

from __future__ import annotations

import asyncio
import errno
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import msgspec
import pytest

from elys.bus.messages.commands import Rename
from elys.common.assets import AssetStore
from elys.common.errors import SceneError
from elys.common.scene import EntityNode, EntityRecord, SceneDocument, SceneSettings, open_scene, write_scene
from elys.editor_node.model import EditorModel
from elys.editor_node.recovery import Recovery
from elys.editor_node.scene_diff import scene_diff
from elys.editor_node.scene_documents import AUTOSAVE_INTERVAL
from elys.samples.game.levels import LEVELS
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_edits import apply_edits
from tests.property.test_undo_at_a_simulation import desk_at


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))


def garden(folder: Path, *, height: float = 2.0, name: str = "garden.scene.json") -> Path:
    """A ground, and an apple that falls on it."""
    apple = {"Transform": {"position": [0.0, height, 0.0]}, "RigidBody": {}, "Collider": {"shape": "sphere"}}
    nodes = [
        EntityNode(name="Ground", components={"Transform": {"position": [0.0, -1.0, 0.0]}, "Collider": {}}),
        EntityNode(name="Apple", components=apple),
    ]
    path = folder / name
    write_scene(SceneDocument(name="Garden", entities=nodes), path)
    return path


def simulation_of(path: Path) -> Simulation:
    assets = AssetStore()
    return Simulation.load(open_scene(path, assets), assets)


def named(model: EditorModel, name: str) -> int:
    return next(entity.id for entity in model.scene.mirror.entities.values() if entity.name == name)


def height_in(path: Path, name: str = "Apple") -> float:
    record = next(record for record in open_scene(path, AssetStore()).records if record.name == name)
    return record.components["Transform"]["position"][1]


def test_saving_keeps_what_was_edited_and_not_where_bodies_have_fallen(tmp_path):
    path = garden(tmp_path)
    before = path.read_text()

    async def scenario():
        async with desk_at(simulation_of(path)) as desk:
            model = desk.model
            assert model.file.path == path and not model.file.is_dirty
            await desk.play(30)
            await model.save(str(path))
            assert path.read_text() == before  # nothing was edited
            apple = named(model, "Apple")
            fallen = model.scene.component_of(apple, "Transform").position[1]
            assert fallen < 1.9
            await model.edit.set_fields([apple], "RigidBody", {"mass": 3.0})
            await model.edit.spawn("Box")
            await desk.play(5)
            assert model.file.is_dirty
            await model.save(str(path))
            assert height_in(path) == 2.0 and not model.file.is_dirty
            # Where somebody puts it after time began counts as edited, and undoing that goes back to the first.
            await model.edit.set_fields([apple], "Transform", {"position": (0.0, 5.0, 0.0)})
            await desk.play(5)
            await model.save(str(path))
            assert height_in(path) == 5.0
            await model.history.undo()
            await model.save(str(path))
            assert height_in(path) == 2.0
            running = tmp_path / "running.scene.json"
            await model.save(str(running), running=True)
            assert height_in(running) == model.scene.component_of(apple, "Transform").position[1] != 2.0
            assert model.file.path == path

    asyncio.run(scenario())


def test_what_comes_back_after_a_deletion_is_saved_as_it_was_edited(tmp_path):
    path = garden(tmp_path)
    before = path.read_text()

    async def scenario():
        async with desk_at(simulation_of(path)) as desk:
            await desk.play(30)
            desk.model.selection.replace([named(desk.model, "Apple")])
            await desk.model.edit.delete()
            await desk.play(3)
            await desk.model.history.undo()
            await desk.play(3)
            await desk.model.save(str(path))

    asyncio.run(scenario())
    assert path.read_text() == before


def test_another_scene_is_opened_in_the_running_session_and_the_file_reverted(tmp_path):
    path, other = garden(tmp_path), garden(tmp_path, height=7.0, name="other.scene.json")

    async def scenario():
        async with desk_at(simulation_of(path)) as desk:
            model = desk.model
            await desk.play(10)
            await model.edit.rename(named(model, "Apple"), "Pear")
            await model.documents.open(other)
            async with asyncio.timeout(10.0):
                while model.file.path != other or not model.history.is_attached:
                    await asyncio.sleep(0.001)
            assert not model.history.undo_label and not model.file.is_dirty
            assert model.scene.component_of(named(model, "Apple"), "Transform").position == (0.0, 7.0, 0.0)
            assert desk.simulation.world.entity_count == 2 and desk.simulation.physics.body_count == 2
            fresh = simulation_of(other)
            for _ in range(10):
                fresh.step()
            await desk.play(10)
            assert desk.simulation.moving_bodies().position.tolist() == fresh.moving_bodies().position.tolist()
            await model.edit.rename(named(model, "Apple"), "Pear")
            await model.documents.revert()
            async with asyncio.timeout(10.0):
                while not any(e.name == "Apple" for e in model.scene.mirror.entities.values()):
                    await asyncio.sleep(0.001)
            assert model.scene.component_of(named(model, "Apple"), "Transform").position == (0.0, 7.0, 0.0)

    asyncio.run(scenario())


def test_a_scene_with_a_model_is_opened_where_its_meshes_are_not_known(tmp_path, shared_assets):
    path = garden(tmp_path)
    helmet = shared_assets / "FlightHelmet" / "FlightHelmet.gltf"

    async def scenario():
        async with desk_at(simulation_of(path)) as desk:
            await desk.model.documents.open(helmet)
            meshes = [
                desk.simulation.world.get(entity, "MeshRenderer").mesh
                for entity in desk.simulation.world.table("MeshRenderer").entities.tolist()
            ]
            assert meshes and all(desk.simulation.assets.get(mesh) for mesh in meshes)

    asyncio.run(scenario())


def test_a_level_that_code_made_is_edited_while_it_runs_and_saved_with_its_meshes_and_scripts(tmp_path):
    assets = AssetStore()
    opened, _ = LEVELS["meadow"].open(assets)

    async def scenario():
        async with desk_at(Simulation.load(opened, assets)) as desk:
            gate = named(desk.model, "Gate 2")
            await desk.model.edit.set_fields([gate], "Transform", {"position": (1.0, 2.0, 3.0)})
            await desk.model.documents.save(tmp_path / "mine.scene.json")
            saved = open_scene(tmp_path / "mine.scene.json", AssetStore())
            assert len(saved.records) == len(opened.records)
            place = next(record for record in saved.records if record.name == "Gate 2").components["Transform"]
            assert place["position"] == [1.0, 2.0, 3.0]
            assert len(list((tmp_path / "mine.parts").glob("*.glb"))) == 1
            assert not desk.model.file.is_dirty

    asyncio.run(scenario())


def test_a_scene_that_is_missing_or_broken_is_one_sentence_and_changes_nothing(tmp_path):
    path = garden(tmp_path)
    (tmp_path / "broken.scene.json").write_text('{"elys_scene": 1, "entities": [{"components": {"Nope": {}}}]}')

    async def scenario():
        async with desk_at(simulation_of(path)) as desk:
            await desk.model.edit.rename(named(desk.model, "Apple"), "Pear")
            with pytest.raises(SceneError, match=r"there is no scene file .*gardem\.scene\.json; did you mean garden"):
                await desk.model.documents.open(tmp_path / "gardem.scene.json")
            with pytest.raises(SceneError, match="there is no such component"):
                await desk.model.documents.open(tmp_path / "broken.scene.json")
            assert desk.simulation.world.entity_count == 2 and desk.model.history.undo_label == "Rename to Pear"
            path.unlink()
            with pytest.raises(SceneError, match="there is no scene file"):
                await desk.model.documents.revert()
            await desk.model.save(str(path))  # and yet it is not lost
            assert [record.name for record in open_scene(path, AssetStore()).records] == ["Ground", "Pear"]

    asyncio.run(scenario())


def full_disk(monkeypatch):
    """Every new file lies on /dev/full: what is written into it fails as on a disk that is full."""

    def make(*, dir, prefix):
        draft = Path(dir) / f"{prefix}draft"
        draft.touch()
        return os.open("/dev/full", os.O_WRONLY), str(draft)

    monkeypatch.setattr(tempfile, "mkstemp", make)


def test_a_full_disk_loses_nothing(tmp_path, monkeypatch):
    path = garden(tmp_path)
    before = path.read_bytes()

    async def scenario():
        async with desk_at(simulation_of(path)) as desk:
            model = desk.model
            await model.edit.rename(named(model, "Apple"), "Pear")
            with monkeypatch.context() as patch:
                full_disk(patch)
                with pytest.raises(SceneError, match=f"cannot be written: {os.strerror(errno.ENOSPC)}"):
                    await model.save(str(path))
            assert path.read_bytes() == before and model.file.is_dirty
            assert sorted(file.name for file in tmp_path.glob(".*")) == []  # no draft stays
            assert model.history.undo_label and named(model, "Pear")
            await model.save(str(path))  # there is room again
            assert not model.file.is_dirty

    asyncio.run(scenario())
    assert [record.name for record in open_scene(path, AssetStore()).records] == ["Ground", "Pear"]


def test_edits_are_kept_aside_after_a_minute_and_offered_after_a_crash(tmp_path):
    path = garden(tmp_path)
    now = [0.0]

    async def edit_and_die() -> None:
        async with desk_at(simulation_of(path)) as desk:
            documents = desk.model.documents
            documents.recovery, documents._clock = Recovery(tmp_path / "state"), lambda: now[0]
            assert not await documents.keep_if_due()
            await desk.model.edit.rename(named(desk.model, "Apple"), "Pear")
            assert not await documents.keep_if_due()  # the minute begins
            now[0] += AUTOSAVE_INTERVAL
            assert await documents.keep_if_due()
            assert not await documents.keep_if_due()  # it is kept already
            await desk.model.edit.rename(named(desk.model, "Pear"), "Plum")
            now[0] += AUTOSAVE_INTERVAL
            assert await documents.keep_if_due()

    asyncio.run(edit_and_die())
    note = next((tmp_path / "state" / "recovery").glob("*-1.json"))
    # A process that has ended, and another run: as after a crash.
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    kept = msgspec.json.decode(note.read_bytes())
    scene = Path(kept["scene"]).rename(note.parent / f"{dead.pid}-7.scene.json")
    note.unlink()
    note = note.parent / f"{dead.pid}-7.json"
    note.write_bytes(msgspec.json.encode({**kept, "scene": str(scene), "process": dead.pid, "epoch": 7}))

    async def come_back() -> None:
        async with desk_at(simulation_of(path)) as desk:
            model = desk.model
            model.documents.recovery = Recovery(tmp_path / "state")
            model.documents.look_for_left_behind()
            left = model.documents.left_behind
            assert left is not None and left.path == str(path)
            await model.documents.recover(left)
            async with asyncio.timeout(10.0):
                while not (model.file.is_dirty and model.history.is_attached):
                    await asyncio.sleep(0.001)
            assert named(model, "Plum") and model.file.path == path and model.documents.left_behind is None
            assert not Path(left.scene).exists()
            # A second crash would not find less.
            assert model.documents.recovery.place(1).is_file()
            await model.save(str(path))
            assert not model.documents.recovery.place(1).exists()

    asyncio.run(come_back())
    assert [record.name for record in open_scene(path, AssetStore()).records] == ["Ground", "Plum"]


def test_what_changed_since_the_file_is_told_by_entity_and_field(tmp_path):
    path = garden(tmp_path)

    async def scenario():
        async with desk_at(simulation_of(path)) as desk:
            model = desk.model
            assert await model.documents.changes() == []
            await desk.play(20)
            assert await model.documents.changes() == []  # time is no edit
            apple = named(model, "Apple")
            await model.edit.set_fields([apple], "RigidBody", {"mass": 3.0})
            await model.edit.add_component([named(model, "Ground")], "Light")
            await model.edit.spawn("Box", parent=apple)
            await model.edit.set_settings(SceneSettings(substeps=4))
            lines = await model.documents.changes()
            assert [(line.kind, line.path, line.what, line.before, line.after) for line in lines] == [
                ("changed", "", "substeps", "8", "4"),
                ("added", "Ground", "Light", "", ""),
                ("changed", "Apple", "RigidBody.mass", "1", "3"),
                ("added", "Apple/Box", "", "", ""),
            ]
            while model.history.undo_label:
                await model.history.undo()
            assert await model.documents.changes() == []

    asyncio.run(scenario())


def test_the_comparison_matches_by_place_and_name_and_knows_what_was_renamed():
    def crate(name: str, **extra) -> EntityRecord:
        return EntityRecord(name=name, components={"Transform": {"position": [1, 2, 3]}}, **extra)

    before = [crate("A"), crate("A"), EntityRecord(name="Lamp", components={"Light": {}}), crate("Gone")]
    after = [
        crate("A"),
        crate("A", enabled=False),
        EntityRecord(name="Sun", components={"Light": {}}),
        EntityRecord(name="New", components={"Camera": {}}),
    ]
    settings = SceneSettings()
    lines = scene_diff(before, after, settings_before=settings, settings_after=settings)
    assert [(line.kind, line.path, line.what, line.before, line.after) for line in lines] == [
        ("changed", "A", "enabled", "yes", "no"),
        ("changed", "Sun", "name", "Lamp", "Sun"),
        ("added", "New", "", "", ""),
        ("removed", "Gone", "", "", ""),
    ]


def test_a_reference_differs_only_where_it_names_another():
    def swing(other: int) -> EntityRecord:
        return EntityRecord(name="Seat", components={"Joint": {}}, references={"Joint.other": other})

    beams = [EntityRecord(name="Left"), EntityRecord(name="Right")]
    settings = SceneSettings()
    both = {"settings_before": settings, "settings_after": settings}
    assert scene_diff([*beams, swing(0)], [beams[1], beams[0], swing(1)], **both) == []
    [line] = scene_diff([*beams, swing(0)], [*beams, swing(1)], **both)
    assert (line.path, line.what) == ("Seat", "Joint.other")


def test_names_with_any_unicode_are_saved_compared_and_undone(tmp_path):
    path = garden(tmp_path)
    names = ["日本語 🍎", "a/b\\c", "\u202e\u05d0\u05d1\u05d2", "e\u0301", " ", "'\"{}"]

    async def scenario():
        async with desk_at(simulation_of(path)) as desk:
            model = desk.model
            apple = named(model, "Apple")
            for name in names:
                request = Rename(entity=apple, name=name)
                outcome = await model.history.perform(f"Rename to {name}", (request,))
                assert outcome.accepted
                await model.save(str(path))
                assert [record.name for record in open_scene(path, AssetStore()).records] == ["Ground", name]
                assert await model.documents.changes() == []
            await model.history.go_to(0)
            assert named(model, "Apple") == apple

    asyncio.run(scenario())


def test_a_cyclic_move_among_several_is_refused_whole(tmp_path):
    from elys.bus.messages.commands import Reparent
    from elys.common.errors import HierarchyError

    simulation = simulation_of(garden(tmp_path))
    ground, apple = simulation.world.entities().tolist()
    before = simulation.state_hash()
    with pytest.raises(HierarchyError, match="cannot stand under"):
        apply_edits(simulation, (Reparent(entity=apple, parent=ground), Reparent(entity=ground, parent=apple)))
    simulation.settle()
    assert simulation.world.hierarchy.parent_of(apple) == 0 and simulation.state_hash() == before


@pytest.mark.parametrize("played", [0, 20])
@pytest.mark.parametrize(("folder", "file"), [("AnimatedCube", "03_animated_cube.gltf"), ("Fox", "Fox.glb")])
def test_saving_keeps_the_poses_that_were_edited_and_not_those_of_clips(tmp_path, shared_assets, folder, file, played):
    """A model that plays its clip from the middle on: saved before time goes on and after."""
    (tmp_path / "models").symlink_to(shared_assets / folder)
    node = EntityNode(name="It", prefab=f"models/{file}", components={"Animation": {"time": 0.4}})
    path = tmp_path / "moving.scene.json"
    write_scene(SceneDocument(name="moving", entities=[node]), path)
    before = path.read_text()

    async def scenario():
        async with desk_at(simulation_of(path)) as desk:
            model = desk.model
            if played:
                await desk.play(played)
            await model.save(str(path))
            assert path.read_text() == before
            moved = desk.simulation.animated().local_entity.tolist()
            assert moved
            seen = model.scene.mirror.local_pose(moved[0])
            await model.edit.set_fields([moved[0]], "Transform", {"scale": (2.0, 2.0, 2.0)})
            await desk.play(2)
            assert model.scene.mirror.local_pose(moved[0]) != seen
            await model.save(str(path))
            await model.history.undo()
            await desk.play(2)
            again = tmp_path / "again.scene.json"
            await model.save(str(again))
            assert again.read_text() == before

    asyncio.run(scenario())
    assert path.read_text() != before
