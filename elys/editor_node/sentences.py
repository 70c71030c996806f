"""Sentences that travel: what nodes say and what edits are called is English on the bus, and translated where it is shown.

    node, or sentence()  ──English──>  bus, history, files  ──English──>  tr_sentence()  ──>  a person

So two editors of one session each show the same history in their own language. A language that is not English has a list of
templates, `languages/{code}.sentences.json`, with what they are there:

    "{count:n} of {whole} with {what}": "{count} {what} sur {whole}"

A template's place takes a number (`n`), a text that is a name or a value and stays as it is (`t`), what an edit is of (`e`: a
name, or so many entities), a list of phrases with commas (`l`), or, without a letter, a phrase that is translated as a sentence.
"""

from __future__ import annotations

import functools
import json
import re
import string
from collections.abc import Callable, Mapping
from importlib import resources
from typing import Final, NamedTuple

from elys.editor_node.language import current_language, tr

_NUMBER: Final = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_COUNTED: Final = re.compile(r"(\d+) entities\Z")


class _Template(NamedTuple):
    """An English sentence with places, and what it is in another language."""

    pattern: re.Pattern[str]
    kinds: Mapping[str, str]
    translation: str


def sentence(template: str, **values: object) -> str:
    """What an edit is called, say: English, to be read by everybody through `tr_sentence`."""
    return template.format(**values) if values else template


def tr_sentence(text: str) -> str:
    """A sentence in the chosen language, as far as it is known there; else as it is."""
    return _translated(current_language(), text)


def is_known(text: str, code: str) -> bool:
    """Whether a language has a template for a sentence."""
    return _match(code, text) is not None


@functools.lru_cache(maxsize=8192)
def _translated(code: str, text: str) -> str:
    found = _match(code, text)
    if found is None:
        return text
    template, values = found
    return template.translation.format(
        **{name: _IN_PLACE[template.kinds[name]](code, value) for name, value in values.items()}
    )


def _match(code: str, text: str) -> tuple[_Template, dict[str, str]] | None:
    exact, templates = _templates(code)
    if text in exact:
        return exact[text], {}
    for template in templates:
        found = template.pattern.fullmatch(text)
        if found is not None:
            return template, found.groupdict()
    return None


@functools.cache
def _templates(code: str) -> tuple[Mapping[str, _Template], list[_Template]]:
    """Those without places by their text, and the others, what has most letters of its own first."""
    exact: dict[str, _Template] = {}
    others: list[tuple[int, _Template]] = []
    for english, translation in sentences_of(code).items():
        parts = list(string.Formatter().parse(english))
        kinds = {name: kind or "" for _, name, kind, _ in parts if name is not None}
        if kinds:
            pattern = "".join(re.escape(literal) + _place(name, kind) for literal, name, kind, _ in parts)
            letters = sum(len(literal) for literal, *_ in parts)
            others.append((letters, _Template(re.compile(pattern, re.DOTALL), kinds, translation)))
        else:
            exact[english] = _Template(re.compile(""), {}, translation)
    others.sort(key=lambda one: -one[0])
    return exact, [template for _, template in others]


def _place(name: str | None, kind: str | None) -> str:
    return "" if name is None else f"(?P<{name}>{_NUMBER if kind == 'n' else '.+?'})"


def sentences_of(code: str) -> dict[str, str]:
    """The templates of a language with what they are there; none for one that has no such list, as English."""
    place = resources.files("elys.editor_node") / "languages" / f"{code}.sentences.json"
    if not place.is_file():
        return {}
    found: dict[str, str] = json.loads(place.read_text(encoding="utf-8"))
    return found


def _edited(code: str, text: str) -> str:
    counted = _COUNTED.match(text)
    return tr("{count} entities", count=counted[1]) if counted else tr(text) if text == "an entity" else text


def _listed(code: str, text: str) -> str:
    return ", ".join(_translated(code, part) for part in text.split(", "))


_IN_PLACE: Final[Mapping[str, Callable[[str, str], str]]] = {
    "": _translated,
    "n": lambda code, text: text,
    "t": lambda code, text: text,
    "e": _edited,
    "l": _listed,
}
