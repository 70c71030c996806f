"""Every text a person reads goes through `tr`, and has its French; every colour comes from the theme."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import elys.editor_node
from elys.editor_node.language import tr_label, tr_title, translations, use_language

SOURCE = Path(elys.editor_node.__file__).parent
# They say what they draw in their own way, and are looked through where they do it.
_ELSEWHERE = {"hierarchy.py", "inspector.py", "field_rows.py", "scene_settings.py", "timeline.py"}
# Calls whose texts are read, and which of their arguments (by place or name) those are.
_READ = {
    "text": (0,), "text_unformatted": (0,), "text_wrapped": (0,), "text_disabled": (0,), "bullet_text": (0,),
    "separator_text": (0,), "text_colored": (1,), "colored_text": (1,), "dim_text": (0,), "centered_text": (0,),
    "button": (0,), "small_button": (0,), "checkbox": (0,), "radio_button": (0,), "selectable": (0,), "menu_item": (0,),
    "begin_menu": (0,), "begin_combo": (0, 1), "collapsing_header": (0,), "set_tooltip": (0,), "set_item_tooltip": (0,),
    "input_text_with_hint": (1,), "icon_button": (2,), "begin": (0,), "begin_popup_modal": (0,), "with_keys": (1,),
    "action_item": (2,),
}  # fmt: skip
# Names, units and what is the same in every language.
_SAME_EVERYWHERE = re.compile(r"ELYS|tcp/HOST:|\bms\b|\bmm\b|\bs\b|ENTER|X|Y|Z")


def panels() -> list[Path]:
    return [path for path in sorted((SOURCE / "panels").glob("*.py")) if path.name not in _ELSEWHERE]


def spelled(node: ast.expr) -> str:
    """The words that stand in a text itself, without what is put into it and without the id behind ###."""
    match node:
        case ast.Constant(value=str(text)):
            return text.partition("###")[0]
        case ast.JoinedStr(values=values):
            words = "".join(spelled(value) if isinstance(value, ast.Constant) else _whole(value) for value in values)
            return words.partition("###")[0]
        case ast.BinOp(left=left, right=right):
            return spelled(left) + spelled(right)
        case ast.IfExp(body=body, orelse=other):
            return spelled(body) + spelled(other)
        case _:
            return ""


def _whole(value: ast.expr) -> str:
    return spelled(value.value) if isinstance(value, ast.FormattedValue) else ""


def name_of(call: ast.Call) -> str:
    function = call.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def untranslated(source: str) -> list[tuple[int, str]]:
    found = []
    for call in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)):
        for place in _READ.get(name_of(call), ()):
            words = spelled(call.args[place]) if place < len(call.args) else ""
            if re.search(r"[A-Za-z]{2,}", _SAME_EVERYWHERE.sub("", words)):
                found.append((call.lineno, words))
    return found


def texts_of(path: Path) -> set[str]:
    """What a file gives to `tr` and its like, as far as it is spelled out there."""
    found = set()
    for call in (node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)):
        if name_of(call) in ("tr", "tr_label") and call.args:
            found |= set(_constants(call.args[0]))
        if name_of(call) == "Action":
            found |= {t for word in call.keywords if word.arg == "label" for t in _constants(word.value)}
    return found


def _constants(node: ast.expr) -> list[str]:
    match node:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.IfExp(body=body, orelse=other):
            return _constants(body) + _constants(other)
        case _:
            return []


def test_the_search_finds_what_is_not_translated():
    assert untranslated('imgui.button("Save")') == [(1, "Save")]
    assert untranslated('icon_button(icon, "x", f"Undo {what}" if what else "Nothing")') == [(1, "Undo Nothing")]
    assert untranslated('imgui.text_unformatted("a " + f"{icon}  word")') == [(1, "a   word")]
    assert (
        untranslated("""imgui.button(tr_label("Save")); dim_text(f"{icon}  {tr('Words')}"); imgui.button("###id")""")
        == []
    )


@pytest.mark.parametrize("path", panels(), ids=lambda path: path.name)
def test_what_is_drawn_is_translated(path):
    assert untranslated(path.read_text(encoding="utf-8")) == []


def said_in_english(source: str) -> list[tuple[int, str]]:
    """What is told to a person in the console without `tr`."""
    found = []
    for call in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)):
        texts = {"say": call.args[1:2], "_say": call.args[1:2], "praise": call.args[:1], "_refuse": call.args[:1]}
        said = [spelled(text) for text in texts.get(name_of(call), [])]
        found += [(call.lineno, text) for text in said if re.search(r"[A-Za-z]{2,}", _SAME_EVERYWHERE.sub("", text))]
    return found


def test_what_is_told_is_translated():
    assert said_in_english('model.say("error", f"cannot do {what}")') == [(1, "cannot do ")]
    assert said_in_english('model.say("error", tr("cannot do {what}", what=what))') == []
    found = {path.name: said_in_english(path.read_text(encoding="utf-8")) for path in sorted(SOURCE.rglob("*.py"))}
    assert {name: texts for name, texts in found.items() if texts} == {}


def test_everything_that_is_said_has_its_french():
    french = translations("fr")
    missing = {text for path in sorted(SOURCE.rglob("*.py")) for text in texts_of(path) if text not in french}
    assert sorted(missing) == []


def test_words_in_tables_have_their_french_too():
    from elys.editor_node.console_log import LEVELS
    from elys.editor_node.frame_profiles import REST
    from elys.editor_node.instruments import EDITOR, SIMULATION
    from elys.editor_node.panels import diagnostics, keys_help, preferences_window, toolbar, topics, tour
    from elys.samples.registry import SAMPLES

    said = {words for _, _, words in toolbar._TOOLS}
    said |= {words for row in keys_help._MOUSE for words in row}
    said |= {curve.label for curve in diagnostics._CURVES} | set(preferences_window._THEME_NAMES.values())
    said |= {words for step in tour._STEPS for words in (step.title, step.text)}
    said |= {*topics._COLUMNS, REST, EDITOR, SIMULATION, "view", "pixels"}
    said |= set(LEVELS) | {sample.title for sample in SAMPLES.values()}
    assert sorted(said - set(translations("fr"))) == []


@pytest.mark.gl
def test_the_fonts_have_all_letters(at_the_editor):
    async def scenario(person):
        letters = set("".join([*translations("fr"), *translations("fr").values(), "éèêëàâùûôîïçœæÉÈÀÇŒ«»’…°µ"])) - {
            "\n"
        }
        fonts = person.editor.ui.fonts
        for font in (fonts.regular, fonts.bold):
            assert [letter for letter in sorted(letters) if not font.is_glyph_in_font(ord(letter))] == []

    at_the_editor(scenario)


def test_french_is_sorted_and_uses_its_accents():
    text = (SOURCE / "languages" / "fr.json").read_text(encoding="utf-8")
    keys = list(translations("fr"))
    assert keys == sorted(keys)
    for bare in (
        r"\bdeja\b",
        r"\bou est\b",
        r"\betat\b",
        r"\bfenetre\b",
        r"\bscene\b",
        r"\bselection\b",
        r"\bannule\b",
    ):
        values = "\n".join(translations("fr").values())
        assert not re.search(bare, values, re.IGNORECASE), bare
    assert "\\u" not in text  # to be read by people


def colours_spelled(source: str) -> list[int]:
    """The lines on which numbers make a colour; an alpha beside a shade is none, nor is what is not seen at all."""
    tree = ast.parse(source)
    takers = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and name_of(node) in ("ImVec4", "color_code", "colored_text", "get_color_u32")
    ]
    constants = [node.value for node in tree.body if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value]
    tuples = [
        node for top in (*takers, *constants) for node in ast.walk(top) if isinstance(node, (ast.Tuple, ast.Call))
    ]
    found = []
    for node in tuples:
        elements = node.elts if isinstance(node, ast.Tuple) else node.args
        values = [element.value for element in elements if isinstance(element, ast.Constant)]
        if len(values) == len(elements) and len(values) in (3, 4) and all(isinstance(v, float) for v in values):
            found += [node.lineno] * any(values)
    return found


def test_the_search_finds_spelled_colours():
    assert colours_spelled("x = 1\nimgui.ImVec4(1.0, 1.0, 1.0, 0.05)") == [2]
    assert colours_spelled("color_code((0.1, 0.2, 0.3, 1.0))") == [1]
    assert colours_spelled("imgui.ImVec4(0.0, 0.0, 0.0, 0.0); color_code((*ACCENT[:3], 0.5)); f((0.0, 1.0, 1.0))") == []


@pytest.mark.parametrize("path", panels(), ids=lambda path: path.name)
def test_no_panel_spells_a_colour(path):
    assert colours_spelled(path.read_text(encoding="utf-8")) == []


def test_titles_and_labels_keep_their_ids():
    use_language("fr")
    try:
        assert tr_title("icon  Viewport###Viewport") == "icon  Vue###Viewport"
        assert tr_label("Save", "x") == "Enregistrer###x"
    finally:
        use_language("en")
