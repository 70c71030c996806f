"""What the simulation tells of scripts beside what they do: the fields that one declares, so that an inspector can show them."""

from __future__ import annotations

from typing import Any

import msgspec


class ScriptFormRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks for the fields of a script that an entity of the scene carries."""

    source: str  # as its component names it


class ScriptField(msgspec.Struct, frozen=True, kw_only=True):
    """One field, as a component's is declared: `kind` is a value of `Kind`, and what has no range or unit leaves it out."""

    name: str
    kind: str
    default: Any
    text: str = ""
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    step: float = 0.1
    choices: tuple[str, ...] = ()


class ScriptForm(msgspec.Struct, frozen=True, kw_only=True):
    """A script's name and fields; with a `problem` there are none, and the sentence says why."""

    name: str = ""  # "door.py:Door"
    text: str = ""  # what it does, the first line of its docstring
    fields: tuple[ScriptField, ...] = ()
    problem: str = ""
