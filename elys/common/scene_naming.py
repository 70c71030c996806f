"""How entities of a file call one another: by name, or by the end of the path of names that leads to them.

"Door" is the one entity of that name, "House/Door" the one of them in the house, "/Door" a root. Where several would answer, the
one whose whole path it is does.
"""

from __future__ import annotations

import difflib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from elys.common.components import Kind, declaration_of
from elys.common.errors import SceneError


class Names:
    """The entities of one list by name. What it refuses does not say where the name stands."""

    def __init__(self, entities: Sequence[tuple[str, int]]) -> None:
        """`entities` (N,) are names and the places of parents in the same list, who stand first; a negative one is nobody."""
        self._paths: list[str] = []
        self._rows: dict[str, list[int]] = defaultdict(list)  # by last name
        for row, (name, parent) in enumerate(entities):
            self._paths.append(f"{self._paths[parent]}/{name}" if parent >= 0 else f"/{name}")
            self._rows[name.rpartition("/")[2]].append(row)

    def find(self, text: str) -> int:
        """The place of the one entity that `text` names; SceneError if there is none, or several."""
        last = text.rpartition("/")[2]
        ending = text if text.startswith("/") else f"/{text}"
        found = [row for row in self._rows.get(last, ()) if self._paths[row].endswith(ending)]
        whole = [row for row in found if self._paths[row] == ending]
        if text.startswith("/"):
            found = whole
        if len(whole) == 1 or (not whole and len(found) == 1):
            return (whole or found)[0]
        if not found:
            close = difflib.get_close_matches(last, list(self._rows), n=1, cutoff=0.6)
            raise SceneError(f"nobody here is called '{text}'{f'; did you mean {close[0]!r}?' if close else ''}")
        raise SceneError(
            f"{len(found)} entities are called '{text}'; name the way to one, as '{self._paths[found[0]][1:]}', or give them "
            "different names"
        )

    def name_of(self, row: int) -> str:
        """The shortest end of an entity's path by which `find` finds it; SceneError if there is none."""
        path = self._paths[row]
        start = path.rfind("/")
        while start >= 0:
            text = path[start + 1 :]
            if self._is_found(text, row):
                return text
            start = path.rfind("/", 0, start)
        if self._is_found(path, row):
            return path
        raise SceneError(f"several entities have the path '{path[1:]}'; give siblings different names")

    def _is_found(self, text: str, row: int) -> bool:
        try:
            return bool(text) and self.find(text) == row
        except SceneError:
            return False


def take_references(components: dict[str, dict[str, Any]], place_of: Mapping[int, int]) -> dict[str, int]:
    """Takes the ENTITY fields that name entities of a list out of component values; returns them as a record has them.

    `place_of` gives the place in the list of each entity's id. Those that name others stay.
    """
    references: dict[str, int] = {}
    for name, values in components.items():
        for field in declaration_of(name).fields:
            if field.kind is Kind.ENTITY and values.get(field.name, 0) in place_of:
                references[f"{name}.{field.name}"] = place_of[values.pop(field.name)]
    return references
