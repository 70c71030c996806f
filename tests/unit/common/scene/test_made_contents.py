"""What code made is saved beside the scene that names it, and comes back the same; nothing that is there is written over."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from elys.common import trust
from elys.common.assets.mesh import Mesh, decode_mesh, encode_mesh
from elys.common.assets.primitives import primitive
from elys.common.assets.scripts import ScriptBundle
from elys.common.assets.store import AssetStore
from elys.common.errors import SceneError
from elys.common.made_contents import keep_made_contents
from elys.common.scene import (
    EntityRecord,
    OpenedScene,
    SceneSettings,
    collapse,
    open_scene,
    read_script_file,
    write_scene,
)
from elys.samples.game.levels import LEVELS

EMPTY = Mesh(positions=np.zeros((0, 3)), normals=np.zeros((0, 3)), uvs=np.zeros((0, 2)), indices=np.zeros(0, np.uint32))


def saved(records: list[EntityRecord], assets: AssetStore, path: Path) -> OpenedScene:
    keep_made_contents(records, path, assets)
    settings = SceneSettings()
    write_scene(collapse(records, name="", settings=settings, directory=path.parent, assets=assets), path)
    return open_scene(path, AssetStore())


def with_script(assets: AssetStore, **files: str) -> list[EntityRecord]:
    named = {name.replace("__", "/") + ".py": text for name, text in files.items()}
    bundle = ScriptBundle(behaviour="Door", main=next(iter(named)), files=named)
    source = assets.put(msgspec.json.encode(bundle), kind="script")
    return [EntityRecord(name="Door", components={"Transform": {}, "Script": {"source": source}})]


@pytest.mark.parametrize("name", list(LEVELS))
def test_a_level_made_by_code_is_a_file_with_the_same_in_it(tmp_path: Path, name: str) -> None:
    assets = AssetStore()
    level, _ = LEVELS[name].open(assets)
    keep_made_contents(level.records, tmp_path / "own.scene.json", assets)
    document = collapse(level.records, name="Own", settings=level.settings, directory=tmp_path, assets=assets)
    write_scene(document, tmp_path / "own.scene.json")
    again = AssetStore()
    opened = open_scene(tmp_path / "own.scene.json", again)
    assert [record.name for record in opened.records] == [record.name for record in level.records]
    text = (tmp_path / "own.scene.json").read_text()
    assert '"elys:game/race.py#Race"' in text and "blake2b" not in text
    meshes = 0
    for before, after in zip(level.records, opened.records, strict=True):
        made = (before.components.get("MeshRenderer") or {}).get("mesh", "")
        if made.startswith("blake2b:"):
            one, two = decode_mesh(assets.get(made)), decode_mesh(again.get(after.components["MeshRenderer"]["mesh"]))
            np.testing.assert_array_equal(one.positions, two.positions)
            np.testing.assert_array_equal(one.indices, two.indices)
            np.testing.assert_allclose(one.normals, two.normals, atol=1e-7)  # read again, they are made as long as 1
            np.testing.assert_array_equal(one.colors, two.colors)
            meshes += 1
    assert meshes >= 3
    (model,) = (tmp_path / "own.parts").iterdir()
    before_again = model.read_bytes()
    keep_made_contents(level.records, tmp_path / "own.scene.json", assets)
    assert [model] == list((tmp_path / "own.parts").iterdir()) and model.read_bytes() == before_again


def test_a_script_of_another_machine_is_written_beside_the_scene(tmp_path: Path) -> None:
    assets = AssetStore()
    records = with_script(assets, door="from .hinges.iron import turn\nclass Door: ...\n", hinges__iron="turn = 1\n")
    opened = saved(records, assets, tmp_path / "house.scene.json")
    assert opened.records[0].components["Script"]["source"] == records[0].components["Script"]["source"]
    assert (tmp_path / "house.parts/hinges/iron.py").read_text() == "turn = 1\n"
    assert '"house.parts/door.py#Door"' in (tmp_path / "house.scene.json").read_text()


def test_a_script_that_somebody_has_changed_there_stays_and_the_other_goes_beside_it(tmp_path: Path) -> None:
    own = "class Door:\n    mine = True\n"
    (tmp_path / "house.parts").mkdir()
    (tmp_path / "house.parts/door.py").write_text(own)
    assets = AssetStore()
    saved(with_script(assets, door="class Door: ...\n"), assets, tmp_path / "house.scene.json")
    assert (tmp_path / "house.parts/door.py").read_text() == own
    assert (tmp_path / "house.parts/2/door.py").read_text() == "class Door: ...\n"


@pytest.mark.parametrize("name", ["../door.py", "/tmp/door.py", "a/../../door.py", "door.sh", "c:door.py", "a\\b.py"])
def test_names_that_lead_elsewhere_are_not_followed(tmp_path: Path, name: str) -> None:
    assets = AssetStore()
    bundle = ScriptBundle(behaviour="Door", main=name, files={name: "class Door: ...\n"})
    source = assets.put(msgspec.json.encode(bundle), kind="script")
    records = [EntityRecord(name="Door", components={"Script": {"source": source}})]
    with pytest.raises(SceneError, match="'Door' cannot be saved: no file is known here"):
        saved(records, assets, tmp_path / "sub" / "house.scene.json")
    assert not list(tmp_path.rglob("*.py")) and not list(tmp_path.rglob("*.sh"))


def test_where_nothing_can_be_written_it_is_said(tmp_path: Path) -> None:
    (tmp_path / "ball.parts").write_text("in the way")
    assets = AssetStore()
    mesh = assets.put(encode_mesh(primitive("sphere")), kind="mesh")
    records = [EntityRecord(name="Ball", components={"MeshRenderer": {"mesh": mesh}})]
    with pytest.raises(SceneError, match=r"ball\.parts cannot be written: "):
        saved(records, assets, tmp_path / "ball.scene.json")


def test_a_script_whose_file_was_changed_since_stays_that_files(tmp_path: Path) -> None:
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts/door.py").write_text("class Door:\n    half a fi")  # it is just being written
    assets = AssetStore()
    read_script_file(tmp_path / "scripts/door.py", "Door", assets)
    saved(with_script(assets, door="class Door: ...\n"), assets, tmp_path / "house.scene.json")
    assert '"scripts/door.py#Door"' in (tmp_path / "house.scene.json").read_text()
    assert not (tmp_path / "house.parts").exists()


def test_saving_trusts_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ELYS_TRUST_SCRIPTS", raising=False)
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))
    trust.remember(tmp_path)
    assets = AssetStore()
    saved(with_script(assets, door="class Door: ...\n"), assets, tmp_path / "house.scene.json")
    assert trust.is_trusted(str(tmp_path / "own.py"))
    assert not trust.is_trusted(str(tmp_path / "house.parts/door.py"))
    trust.remember(tmp_path / "house.parts")
    assert trust.is_trusted(str(tmp_path / "house.parts/door.py"))


@pytest.mark.parametrize("content", [b"[" * 100_000, encode_mesh(EMPTY), b"", b"ELYM", b"\xff" * 100])
def test_strange_content_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    assets = AssetStore()
    records = [EntityRecord(name="Odd", components={"MeshRenderer": {"mesh": assets.put(content, kind="mesh")}})]
    with pytest.raises(SceneError, match="'Odd' cannot be saved: no file is known here"):
        saved(records, assets, tmp_path / "odd.scene.json")
    assert not (tmp_path / "odd.parts").exists()
