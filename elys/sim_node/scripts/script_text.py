"""Where in a script's files its classes, methods and fields stand, for sentences that name a line."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True, kw_only=True)
class FileText:
    """A file of a script.

    Attributes:
        place: what tracebacks call it.
        names: what its module knows; empty for one that has not been run.
    """

    place: str
    text: str
    tree: ast.Module
    names: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassText:
    """A class of a script's, and the statement that declares it."""

    kind: type[Any]
    file: FileText
    node: ast.ClassDef

    def methods(self) -> Iterator[Function]:
        """Its own, as they are written."""
        return (part for part in self.node.body if isinstance(part, Function))


class ScriptText:
    """The files of a script by the names of their modules."""

    def __init__(self, files: Mapping[str, FileText]) -> None:
        self.files = files

    def classes(self, kind: type[Any]) -> list[ClassText]:
        """A class and its bases, nearest first, as far as they stand in the files."""
        return [found for base in kind.__mro__ if (found := self._class(base)) is not None]

    def place_of(self, kind: type[Any], name: str) -> str:
        """The line of a method or field that a class itself declares, "door.py:12"; less where that is all that can be had."""
        found = self._class(kind)
        if found is not None:
            # The last counts, as it does for Python.
            lines = [part.lineno for part in found.node.body if _declares(part, name)]
            return f"{found.file.place}:{lines[-1] if lines else found.node.lineno}"
        code = getattr(vars(kind).get(name), "__code__", None)
        return f"{code.co_filename}:{code.co_firstlineno}" if code is not None else f"{kind.__module__}.{kind.__name__}"

    def _class(self, kind: type[Any]) -> ClassText | None:
        file = self.files.get(kind.__module__)
        if file is None:
            return None
        nodes = [node for node in ast.walk(file.tree) if isinstance(node, ast.ClassDef) and node.name == kind.__name__]
        return ClassText(kind=kind, file=file, node=nodes[-1]) if nodes else None


def _declares(part: ast.stmt, name: str) -> bool:
    match part:
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            return part.name == name
        case ast.AnnAssign(target=ast.Name(id=found)):
            return found == name
        case ast.Assign():
            return any(isinstance(target, ast.Name) and target.id == name for target in part.targets)
    return False
