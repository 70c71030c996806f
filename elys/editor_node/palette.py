"""What the command palette finds, and in which order. Without its window: that is `panels/command_palette.py`."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from elys.editor_node.actions import Action, Actions
from elys.editor_node.key_bindings import KeyBindings
from elys.editor_node.language import tr
from elys.editor_node.preferences import remember
from elys.editor_node.scene_mirror import EditorScene

SHOWN: Final = 60  # the best so many; who sees more reads none

Kind = Literal["action", "entity", "scene", "recording", "session"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PaletteEntry:
    """Something that can be chosen."""

    key: str  # tells it from all others, and is remembered when it was chosen
    kind: Kind
    label: str
    words: tuple[str, ...]  # what it is found by
    run: Callable[[], object]
    keys: str = ""
    is_possible: bool = True


def folded(text: str) -> str:
    """For comparing: without case and accents."""
    apart = unicodedata.normalize("NFKD", text.casefold())
    return "".join(letter for letter in apart if not unicodedata.combining(letter))


def closeness(query: str, text: str) -> int:
    """How well a text answers a query, both `folded`: 0 best, then the places of a worse match; -1 for none.

    The classes, each worse than the one before: the text begins with the query; a word of it does; it holds the query; each word
    of the query begins a word of it; its letters are there in order.
    """
    if text.startswith(query):
        return 0
    place = text.find(f" {query}")
    if place >= 0:
        return 1000 + place
    place = text.find(query)
    if place >= 0:
        return 2000 + place
    words = text.replace(".", " ").replace("_", " ").split()
    if all(any(word.startswith(part) for word in words) for part in query.split()):
        return 3000
    gap = _spread(query.replace(" ", ""), text)
    return 4000 + gap if gap >= 0 else -1


def _spread(letters: str, text: str) -> int:
    """How many other letters stand between those looked for, in the tightest place; -1 where they are not there in order."""
    best = -1
    for start in (place for place, letter in enumerate(text) if letter == letters[:1]):
        at = start
        for letter in letters[1:]:
            at = text.find(letter, at + 1)
            if at < 0:
                break
        else:
            spread = at - start + 1 - len(letters)
            best = spread if best < 0 else min(best, spread)
        if at < 0:  # further on there is even less of the text
            break
    return best


def matching(query: str, entries: Iterable[PaletteEntry], recent: Sequence[str]) -> list[PaletteEntry]:
    """The best SHOWN for a query: of equally good ones those chosen last come first; without a query all are equally good."""
    asked = folded(query.strip())
    age = {key: place for place, key in enumerate(recent)}
    found: list[tuple[int, int, int, int, PaletteEntry]] = []
    for order, entry in enumerate(entries):
        places = [closeness(asked, folded(word)) for word in entry.words] if asked else [0]
        best = min((place for place in places if place >= 0), default=-1)
        if best >= 0:
            found.append((best // 1000, age.get(entry.key, len(age)), best, order, entry))
    found.sort(key=lambda row: row[:4])
    return [entry for *_, entry in found[:SHOWN]]


def action_entries(actions: Actions, keys: KeyBindings) -> Iterable[PaletteEntry]:
    """All actions; found by their names in the chosen language and in English."""
    for action in actions:
        yield PaletteEntry(
            key=f"action:{action.name}",
            kind="action",
            label=tr(action.label),
            words=tuple(dict.fromkeys((tr(action.label), action.label, action.name))),
            run=_running(actions, action),
            keys=keys.label_of(action.name),
            is_possible=actions.may_run(action.name),
        )


def _running(actions: Actions, action: Action) -> Callable[[], object]:
    return lambda: actions.run(action.name)


class EntityNames:
    """The names of a scene's entities, ready to be searched: folded once, until the tree changes."""

    def __init__(self, scene: EditorScene, show: Callable[[int], object]) -> None:
        """`show` selects an entity and looks at it."""
        self._scene = scene
        self._show = show
        self._version = -1
        self._names: list[tuple[str, int]] = []

    def entries(self, query: str) -> list[PaletteEntry]:
        """The entities whose names hold the query; none without one, for there may be tens of thousands."""
        asked = folded(query.strip())
        if not asked:
            return []
        if self._version != self._scene.structure_version:
            self._version = self._scene.structure_version
            self._names = [(folded(found.name), entity) for entity, found in self._scene.mirror.entities.items()]
        found = [entity for name, entity in self._names if asked in name][: 4 * SHOWN]
        return [self._entry(entity) for entity in found]

    def _entry(self, entity: int) -> PaletteEntry:
        name = self._scene.name_of(entity)
        return PaletteEntry(
            key=f"entity:{name}", kind="entity", label=name, words=(name,), run=lambda: self._show(entity)
        )


def choose(entry: PaletteEntry, recent: list[str]) -> None:
    """Does what was chosen, and remembers that it was; nothing for what is impossible."""
    if entry.is_possible:
        remember(recent, entry.key)
        entry.run()
