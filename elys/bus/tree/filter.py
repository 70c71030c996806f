"""The language of the hierarchy's search: words that must all hold of an entity.

    box "big crate"     the name holds this, in any case of letters; quotes keep spaces and what else has a meaning
    t:Light t:sphere    what it is: a kind, a mesh that is built in, or a sort of light
    c:RigidBody         it has the component
    p:lamp              the root of an instance of a prefab whose file's name holds this; p:* of any
    enabled             it is switched on, with all above it
    locked hidden       it, or one above it, is so in this editor
    !c:RigidBody        not that

Kinds and components may be cut short, as t:li, as long as there is one that begins so.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from elys.bus.mirror import MirrorEntity, SceneMirror
from elys.bus.tree.kinds import DETAILS, KIND_NAMES, EntityKind, kind_of
from elys.common.components import declarations

TermKind = Literal["name", "kind", "component", "prefab", "enabled", "locked", "hidden"]
EXAMPLES: Final = (  # each with what it finds, in English
    ("t:Light", "all lights"),
    ("t:sphere !enabled", "spheres that are switched off"),
    ("c:RigidBody !c:Collider", "bodies that collide with nothing"),
    ("p:*", "instances of prefabs"),
    ("locked", "what is locked in this editor"),
    ('"big crate"', "names that hold both words, as they stand here"),
)
_KEYS: Final[dict[str, TermKind]] = {
    "t": "kind",
    "type": "kind",
    "c": "component",
    "has": "component",
    "p": "prefab",
    "prefab": "prefab",
    "n": "name",
    "name": "name",
}
_WORDS: Final[dict[str, TermKind]] = {"enabled": "enabled", "locked": "locked", "hidden": "hidden"}
_WANTED: Final[dict[TermKind, str]] = {
    "kind": "{key}: wants a kind behind it, as t:Light",
    "component": "{key}: wants a component behind it, as c:RigidBody",
    "prefab": "{key}: wants a part of a file's name behind it, as p:lamp",
    "name": "{key}: wants a part of a name behind it, as n:crate",
}

IsMarked = Callable[[str, int], bool]
KindOf = Callable[[MirrorEntity], EntityKind]


class FilterError(ValueError):
    """A search that means nothing: `problem` is English with {places}, `values` what stands in them."""

    def __init__(self, problem: str, **values: str) -> None:
        super().__init__(problem.format(**values))
        self.problem = problem
        self.values = values


class Term(NamedTuple):
    """One word of a search."""

    kind: TermKind
    text: str = ""  # as it is compared: without case
    chosen: frozenset[str] = frozenset()  # the kinds or components that it means
    wanted: bool = True  # False: what it says must not hold


@dataclass(frozen=True, slots=True)
class EntityFilter:
    """What a search asks of an entity."""

    terms: tuple[Term, ...] = ()

    @property
    def asks_above(self) -> bool:
        """Whether those above an entity have a say."""
        return any(term.kind in _WORDS.values() for term in self.terms)

    @property
    def asks_marks(self) -> bool:
        """Whether it depends on what is locked or hidden in this editor."""
        return any(term.kind in ("locked", "hidden") for term in self.terms)

    def lets_through(self, entity: MirrorEntity, mirror: SceneMirror, is_marked: IsMarked) -> bool:
        """Whether all words hold of the entity."""
        return all(_holds(term, entity, mirror, is_marked, kind_of) == term.wanted for term in self.terms)

    def found_among(
        self, entities: Iterable[MirrorEntity], mirror: SceneMirror, is_marked: IsMarked, kind_of: KindOf = kind_of
    ) -> set[int]:
        """Those that it lets through. Done at each letter that is typed, so what is typed most is done without calls."""
        left = list(entities)
        for term in self.terms:
            text, wanted, chosen = term.text, term.wanted, term.chosen
            if term.kind == "name":
                left = [e for e in left if (text in e.name.casefold()) == wanted]
            elif term.kind == "component":
                left = [e for e in left if chosen.isdisjoint(e.components) != wanted]
            else:
                left = [e for e in left if _holds(term, e, mirror, is_marked, kind_of) == wanted]
        return {e.id for e in left}


EVERYTHING: Final = EntityFilter()


def parse_filter(text: str) -> EntityFilter:
    """What a search means; FilterError says what is wrong with it, and how it is said."""
    terms = tuple(_term(*word) for word in _words(text))
    return EntityFilter(terms) if terms else EVERYTHING


class _Word(NamedTuple):
    key: str
    text: str
    wanted: bool
    is_quoted: bool


def _words(text: str) -> Iterable[_Word]:
    """Cuts a search into its words."""
    place = 0
    while place < len(text):
        if text[place].isspace():
            place += 1
            continue
        wanted = True
        while place < len(text) and text[place] == "!":
            wanted, place = not wanted, place + 1
        key, body, is_quoted, place = _body(text, place)
        if not key and not body:
            raise FilterError("'!' wants something behind it that is not to be, as !enabled")
        yield _Word(key, body, wanted, is_quoted)


def _body(text: str, place: int) -> tuple[str, str, bool, int]:
    """What stands before a colon and behind it, whether that is in quotes, and where the word ends."""
    key = ""
    start = place
    while place < len(text) and not text[place].isspace():
        if text[place] == '"':
            end = text.find('"', place + 1)
            if end < 0:
                raise FilterError("the quote is not closed: {word}", word=text[place:])
            return key, text[start:place] + text[place + 1 : end], True, end + 1
        if text[place] == ":" and not key:
            key, start = text[start:place], place + 1
            if not key:
                raise FilterError("':' wants t, c, p or n before it, as t:Light; a name with a colon goes in quotes")
        place += 1
    return key, text[start:place], False, place


def _term(key: str, text: str, wanted: bool, is_quoted: bool) -> Term:
    if not key:
        word = _WORDS.get(text.casefold())
        if word is not None and not is_quoted:
            return Term(word, wanted=wanted)
        return Term("name", text.casefold(), wanted=wanted)
    kind = _KEYS.get(key.casefold())
    if kind is None:
        raise FilterError(
            "there is no filter {key}: but t: for what it is, c: for a component, p: for a prefab and n: for a name; "
            "a name with a colon goes in quotes",
            key=key,
        )
    if not text:
        raise FilterError(_WANTED[kind], key=key)
    if kind == "kind":
        return Term(kind, text.casefold(), _meant(text, (*KIND_NAMES, *DETAILS), kind), wanted)
    if kind == "component":
        return Term(kind, text.casefold(), _meant(text, tuple(declarations()), kind), wanted)
    return Term(kind, text.casefold(), wanted=wanted)


def _meant(text: str, known: tuple[str, ...], kind: TermKind) -> frozenset[str]:
    """The one of that name, or all whose names begin so."""
    wanted = text.casefold()
    exact = frozenset(name for name in known if name.casefold() == wanted)
    found = exact or frozenset(name for name in known if name.casefold().startswith(wanted))
    if found:
        return found
    by_folded = {name.casefold(): name for name in known}
    close = difflib.get_close_matches(wanted, list(by_folded), n=1, cutoff=0.5)
    is_component = kind == "component"
    if close:
        problem = "no component begins with '{word}'; did you mean {near}?"
        if not is_component:
            problem = "no kind begins with '{word}'; did you mean {near}?"
        raise FilterError(problem, word=text, near=by_folded[close[0]])
    problem = "no component begins with '{word}'; there are {known}"
    if not is_component:
        problem = "no kind begins with '{word}'; there are {known}"
    raise FilterError(problem, word=text, known=", ".join(known))


def _holds(term: Term, entity: MirrorEntity, mirror: SceneMirror, is_marked: IsMarked, kind_of: KindOf) -> bool:
    match term.kind:
        case "name":
            return term.text in entity.name.casefold()
        case "component":
            return not term.chosen.isdisjoint(entity.components)
        case "kind":
            return not term.chosen.isdisjoint(kind_of(entity))
        case "prefab":
            return bool(entity.prefab) and (term.text == "*" or term.text in _file_name(entity.prefab))
        case "enabled":
            return mirror.world_enabled(entity.id)
        case mark:
            return is_marked(mark, entity.id)


def _file_name(path: str) -> str:
    return path.replace("\\", "/").rpartition("/")[2].casefold()
