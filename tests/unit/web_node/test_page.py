"""The page's files: nothing from elsewhere, nothing inline, the editor's colours, every text in French as well."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

import elys.web_node
from elys.bus.access.roles import GIVEN
from elys.bus.tree import filter as tree_filter
from elys.common.input_names import BUTTONS, MOTIONS
from elys.editor_node.language import translations
from elys.editor_node.theme import THEMES
from elys.web_node.browser import _FORBIDDEN
from elys.web_node.page_files import page_files

PAGE = Path(elys.web_node.__file__).parent / "page"
SCRIPTS = sorted(PAGE.glob("*.js"))
FRENCH: dict[str, str] = json.loads(
    (PAGE / "fr.json").read_text(encoding="utf-8")
)  # what the editor does not say as well
_CALL = re.compile(r'\btr\(\s*"((?:[^"\\]|\\.)*)"')


def script(name: str) -> str:
    return (PAGE / name).read_text(encoding="utf-8")


class Elements(HTMLParser):
    """All elements with their attributes, and the texts that stand in the page itself."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self._open: list[str] = []

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))
        self._open.append(tag)

    def handle_data(self, data):
        if data.strip():
            self.texts.append(data.strip())


@pytest.fixture(scope="module")
def page() -> Elements:
    elements = Elements()
    elements.feed(script("index.html"))
    return elements


def said() -> set[str]:
    """Every English text that the page gives to its `tr`, but for those of components, which the editor's tests look after."""
    texts = {found for path in SCRIPTS for found in _CALL.findall(path.read_text(encoding="utf-8"))}
    texts |= {role.title for role in GIVEN} | {_FORBIDDEN}
    source = Path(tree_filter.__file__).read_text(encoding="utf-8")
    texts |= set(re.findall(r'problem = "([^"]+)"', source)) | set(tree_filter._WANTED.values())
    return texts


def test_nothing_comes_from_elsewhere_and_nothing_is_inline(page):
    for tag, attributes in page.found:
        for name, value in attributes.items():
            assert not name.startswith("on"), f"<{tag} {name}>"
            assert name != "style", f"<{tag} style>"
            if name in ("src", "href", "action"):
                assert re.fullmatch(r"(page/[a-z]+\.(js|css|svg)|#i-[a-z]+)", value or ""), value
        assert tag != "style"
    for path in PAGE.iterdir():
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"https?://|//cdn|@import", text), path.name
    for path in SCRIPTS:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\beval\(|new Function|document\.write|insertAdjacentHTML", text), path.name
        # What is put in as HTML is spelled here, and nothing that anybody else has written.
        for put in re.findall(r"innerHTML = ([^;]+);", text):
            assert re.fullmatch(r"[\w.]+ \? '[^'$]*' : \"\"", put), (path.name, put)


def test_every_reference_within_the_page_leads_somewhere(page):
    ids = {attributes["id"] for _, attributes in page.found if attributes.get("id")}
    for tag, attributes in page.found:
        for name in ("for", "aria-controls", "aria-labelledby"):
            if attributes.get(name):
                assert attributes[name] in ids, (tag, attributes)
        if tag == "use":
            assert (attributes["href"] or "").removeprefix("#") in ids
    for path in SCRIPTS:
        for wanted in re.findall(r'(?:byId|getElementById)\("([\w-]+)"\)', path.read_text(encoding="utf-8")):
            assert wanted in ids | {"field"}, (path.name, wanted)


def test_everything_that_can_be_used_has_a_name(page):
    for tag, attributes in page.found:
        if tag in ("button", "select", "input", "canvas") and "hidden" not in attributes:
            named = {"data-tr", "data-tr-label", "data-tr-title", "data-tr-placeholder"} & attributes.keys()
            labelled = any(other.get("for") == attributes.get("id") for _, other in page.found)
            assert named or labelled, (tag, attributes)


def test_colours_are_those_of_the_editor():
    css = script("colors.css")
    dark, light = css.split("@media (prefers-color-scheme: light)")
    for theme, block in (("dark", dark), ("light", light)):
        told = dict(re.findall(r"--([\w-]+): ([^;]+);", block))
        assert {"background", "panel", "text", "text-dim", "accent", "fill", "good", "warning", "error"} <= told.keys()
        for name, value in told.items():
            red, green, blue, alpha = THEMES[theme][name.replace("-", "_")]
            code = tuple(round(part * 255) for part in (red, green, blue))
            if alpha == 1.0:
                assert value == "#{:02x}{:02x}{:02x}".format(*code), name
            else:
                assert value == "rgb({} {} {} / {:g})".format(*code, alpha), name
    # A style names colours and spells none, but for white on a coloured button.
    assert set(re.findall(r"#[0-9a-f]{3,8}\b", script("style.css"))) <= {"#fff"}
    used = set(re.findall(r"var\(--([\w-]+)\)", script("style.css")))
    assert used <= set(re.findall(r"--([\w-]+):", css))


def test_everything_that_is_said_has_its_french(page):
    texts = said()
    for _, attributes in page.found:
        texts |= {value or "" for name, value in attributes.items() if name.startswith("data-tr")}
    assert sorted(texts - FRENCH.keys() - translations("fr").keys()) == []
    assert sorted(FRENCH.keys() - texts - spoken_by_name()) == []  # nothing is kept that nobody says
    assert list(FRENCH) == sorted(FRENCH)


def spoken_by_name() -> set[str]:
    """Reasons that come from the web node in English."""
    source = "".join(path.read_text(encoding="utf-8") for path in PAGE.parent.glob("*.py"))
    return {text for text in FRENCH if f'"{text}"' in source} | {
        text for text in FRENCH if any(f'"{text}"' in script(path.name) for path in SCRIPTS)
    }


def test_what_the_editor_says_too_is_translated_once_and_served_with_the_rest():
    assert sorted(FRENCH.keys() & translations("fr").keys()) == []
    served = page_files({"fr": translations("fr")})["fr.json"]
    assert json.loads(served.content) == {**translations("fr"), **FRENCH}
    assert served.tag != page_files({})["fr.json"].tag


def test_places_are_the_same_in_french():
    for text, french in FRENCH.items():
        assert sorted(re.findall(r"\{\w+\}", text)) == sorted(re.findall(r"\{\w+\}", french)), text


def test_no_text_of_the_page_is_left_without_translation(page):
    same = re.compile(r"ELYS|English|Français|[\d.]+ ×|needs JavaScript here\.|\W")
    assert [text for text in page.texts if re.search(r"[A-Za-z]{2,}", same.sub("", text))] == []


def test_keys_are_called_as_the_game_calls_them():
    source = script("game.js")
    named = re.search(r"const NAMED = \{(.*?)\};", source, re.DOTALL)
    buttons = re.search(r"const BUTTONS = \[(.*?)\]", source)
    assert named and buttons
    names = re.findall(r'\w+: "(\w+)"', named[1]) + re.findall(r'"(\w+)"', buttons[1])
    assert set(names) <= BUTTONS
    assert len(set(names)) == len(names) > 50
    assert set(re.findall(r'#move\("(\w+)"', source)) <= MOTIONS
