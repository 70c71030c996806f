"""The language of the interface: English stands in the code, others in `languages/`.

`tr` translates a text; where it is part of a widget the id behind ### stays, so layouts and tests outlive a change of language.
"""

from __future__ import annotations

import json
from importlib import resources
from typing import Final

LANGUAGES: Final = {"en": "English", "fr": "Français"}

_texts: dict[str, str] = {}  # from English; what is not in it stays English
_chosen = ["en"]


def use_language(code: str) -> None:
    """Makes `tr` speak a language of LANGUAGES; English for others."""
    _texts.clear()
    _chosen[0] = code if code in LANGUAGES else "en"
    if code in LANGUAGES:
        _texts.update(translations(code))


def current_language() -> str:
    """The code of the language that `tr` speaks."""
    return _chosen[0]


def translations(code: str) -> dict[str, str]:
    """The texts of a language by what they are in English; none for English itself."""
    if code not in LANGUAGES:
        raise KeyError(code)
    if code == "en":
        return {}
    text = (resources.files("elys.editor_node") / "languages" / f"{code}.json").read_text(encoding="utf-8")
    found: dict[str, str] = json.loads(text)
    return found


def tr(text: str, **values: object) -> str:
    """`text` in the chosen language, with `{name}` places filled from `values`."""
    translated = _texts.get(text, text)
    return translated.format(**values) if values else translated


def tr_title(title: str) -> str:
    """A panel's title `icon  Label###Label` with its label in the chosen language; the id behind ### stays."""
    label, _, name = title.partition("###")
    icon, gap, words = label.rpartition("  ")
    return f"{icon}{gap}{tr(words)}###{name}"


def tr_label(text: str, name: str = "") -> str:
    """A widget's label: translated text and an id that is the same in every language (`name`, or the English text)."""
    return f"{tr(text)}###{name or text}"
