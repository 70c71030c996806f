"""The pieces of the Add menu: all that ELYS brings, in every language."""

from __future__ import annotations

import pytest

from elys.common.scene_files import PIECES_FOLDER, PREFAB_SUFFIX
from elys.editor_node.language import translations
from elys.editor_node.piece_list import PIECE_MENUS, piece_file

HIDDEN = {"shard", "shot"}  # that others throw


@pytest.mark.parametrize("menu", PIECE_MENUS)
def test_all_prefabs_that_elys_brings_are_offered(menu: str) -> None:
    folder, names = PIECE_MENUS[menu]
    there = {path.name.removesuffix(PREFAB_SUFFIX) for path in (PIECES_FOLDER / folder).glob(f"*{PREFAB_SUFFIX}")}
    assert {name.lower().replace(" ", "_") for name in names} == there - HIDDEN
    assert all(piece_file(menu, name).path.is_file() for name in names)


def test_their_names_have_their_french() -> None:
    french = translations("fr")
    assert [text for menu, (_, names) in PIECE_MENUS.items() for text in (menu, *names) if text not in french] == []


@pytest.mark.gl
def test_a_piece_is_chosen_in_the_add_menu(at_the_editor) -> None:
    async def scenario(person):
        chosen = []
        person.editor.ui.place_file = chosen.append
        await person.click("hierarchy/add")
        await person.frames(3)
        await person.click("add/Game")
        await person.frames(3)
        await person.click("add/Game/Gate")
        await person.frames(2)
        assert [file.path for file in chosen] == [PIECES_FOLDER / "game" / "gate.prefab.json"]

    at_the_editor(scenario)
