"""The files of pieces: each prefab runs by itself, and the page tells of every field and every event."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pytest

from elys.common.assets.scripts import decode_script
from elys.common.assets.store import AssetStore
from elys.common.components import InputMap
from elys.common.scene import (
    EntityNode,
    SceneDocument,
    SceneSettings,
    collapse,
    expand,
    open_scene,
    read_script_file,
)
from elys.common.scene_files import PIECES_FOLDER, path_of, relative_name
from elys.pieces import events
from elys.samples.pieces import check_pieces, pieces
from elys.sim_node.simulation import Simulation
from tests.unit.pieces.conftest import MakeStage, Stage, piece

PREFABS = sorted(path.name.removesuffix(".prefab.json") for path in PIECES_FOLDER.glob("*.prefab.json"))
PAGE = Path(__file__).parents[3] / "docs" / "pieces.md"


def behaviours() -> list[tuple[str, str]]:
    files = [path for path in sorted(PIECES_FOLDER.glob("*.py")) if path.name not in ("events.py", "signals.py")]
    return [
        (path.name, node.name)
        for path in files
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef)
    ]


@pytest.mark.parametrize("prefab", PREFABS)
def test_every_prefab_runs_by_itself(make_stage: MakeStage, prefab: str) -> None:
    make_stage(piece("Piece", prefab)).run(0.5)


@pytest.mark.parametrize(("file", "name"), behaviours())
def test_the_page_tells_of_every_piece_and_its_fields(make_stage: MakeStage, file: str, name: str) -> None:
    stage: Stage = make_stage()
    source = read_script_file(PIECES_FOLDER / file, name, stage.assets)
    row = next(line for line in PAGE.read_text().splitlines() if f"`{file}#{name}`" in line)
    for declared in stage.simulation.scripts.library.load(source).fields.values():
        assert f"`{declared.name}`" in row, f"{name}.{declared.name}"
        assert declared.text.endswith("."), f"{name}.{declared.name}"


def test_the_page_tells_of_every_event_and_its_values() -> None:
    told = [
        kind for _, kind in inspect.getmembers(events, lambda one: isinstance(one, type) and hasattr(one, "_fields"))
    ]
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    for kind in told:
        row = next(
            line for line in rows if line.startswith("| `") and f"`{events.kind_of(kind)}`" in line.split("|")[1]
        )
        for field in kind._fields:
            assert f"`{field}`" in row, f"{kind.__name__}.{field}"


def test_names_of_pieces_are_written_as_they_were_read(tmp_path: Path) -> None:
    assert path_of("elys:door.py", tmp_path) == PIECES_FOLDER / "door.py"
    assert relative_name(PIECES_FOLDER / "door.py", tmp_path) == "elys:door.py"
    assert relative_name(path_of("sub/own.py", tmp_path), tmp_path) == "sub/own.py"
    assets = AssetStore()
    document = pieces()
    records = expand(document, directory=tmp_path, assets=assets)
    again = collapse(records, name="Pieces", directory=tmp_path, assets=assets, settings=document.settings)
    written_again = collapse(
        expand(again, directory=tmp_path, assets=assets),
        name="Pieces",
        directory=tmp_path,
        assets=assets,
        settings=document.settings,
    )
    assert written_again == again
    written = {node.prefab for group in again.entities for node in group.children if node.prefab}
    assert {"elys:door.prefab.json", "elys:conveyor.prefab.json", "elys:gate.prefab.json"} <= written


def test_a_script_of_pieces_brings_what_it_imports_and_spawns() -> None:
    assets = AssetStore()
    bundle = decode_script(assets.get(read_script_file(PIECES_FOLDER / "breakable.py", "Breakable", assets)))
    assert set(bundle.files) == {"breakable.py", "events.py", "signals.py"}
    assert [record.name for record in bundle.prefabs["shard.prefab.json"]] == ["Shard"]


def test_the_sample_does_what_its_check_asks(tmp_path: Path) -> None:
    from elys.common.scene import write_scene

    write_scene(pieces(), tmp_path / "pieces.scene.json")
    assets = AssetStore()
    simulation = Simulation.load(open_scene(tmp_path / "pieces.scene.json", assets), assets)
    for _ in range(420):
        simulation.step()
        assert [event for event in simulation.take_events() if event.kind == "script"] == []
    hierarchy, transforms = simulation.world.hierarchy, simulation.world.transforms
    entities = simulation.world.entities().tolist()
    assert check_pieces({hierarchy.name_of(one): transforms.world_pose(one)[0] for one in entities}) == ""


def test_named_values_are_written_and_read_as_what_they_are_with_a_prefab_and_without(tmp_path: Path) -> None:
    assets = AssetStore()

    def again(values: dict[str, object], component: str, field: str, prefab: str = "") -> tuple[object, object]:
        node = EntityNode(name="One", prefab=prefab, components={component: {field: values}})
        records = expand(SceneDocument(entities=[node]), directory=tmp_path, assets=assets)
        written = collapse(records, name="", directory=tmp_path, assets=assets, settings=SceneSettings())
        back = expand(written, directory=tmp_path, assets=assets)
        assert back[0].components[component][field] == records[0].components[component][field]
        return records[0].components[component][field], written.entities[0].components[component][field]  # type: ignore[index]

    wind = "elys:wind.prefab.json"
    assert again({"signal": "a"}, "Script", "values", wind) == (
        {"wind": [0, 6, 0], "drag": 2.5, "signal": "a"},
        {"signal": "a"},
    )
    assert again({"drag": None}, "Script", "values", wind) == ({"wind": [0, 6, 0]}, {"drag": None})
    # Defaults that are not empty are replaced, not laid over.
    known = InputMap().actions
    assert again({"go": "g"}, "InputMap", "actions") == ({"go": "g"}, {"go": "g"})
    assert again({**known, "go": "g"}, "InputMap", "actions")[0] == {**known, "go": "g"}
