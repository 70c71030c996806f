"""What in a script is no error and yet hardly meant: awaitables that nobody awaits, and methods that are nearly hooks.

A doubt may be wrong, so it is said once, and nothing is refused.
"""

from __future__ import annotations

import ast
import difflib
import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from types import FunctionType, ModuleType
from typing import Any, Final

from elys.sim_node.scripts.behaviour import HOOKS, Behaviour
from elys.sim_node.scripts.checking import fits
from elys.sim_node.scripts.handles import EntityHandle
from elys.sim_node.scripts.modules import AsyncFunction
from elys.sim_node.scripts.script_text import ClassText, FileText, Function, ScriptText
from elys.sim_node.scripts.waiting import all_of, event, first_of, seconds, ticks, until

_WAITS: Final = (seconds, ticks, event, until, all_of, first_of)
_LONGEST: Final = 60  # characters of a call that a sentence shows
# What an entity does over some time.
_DEEDS: Final = frozenset(
    name for name, value in vars(EntityHandle).items() if getattr(value, "__annotations__", {}).get("return") == "Call"
)
_PLAIN_HOOKS: Final = {hook.replace("_", ""): hook for hook in HOOKS}
# What hooks are called in other engines, where no letters give them away.
_ELSEWHERE: Final = (
    ("collision", "on_contact"),
    ("collide", "on_contact"),
    ("hit", "on_contact"),
    ("touch", "on_contact"),
    ("enter", "on_trigger_enter"),
    ("exit", "on_trigger_exit"),
    ("leave", "on_trigger_exit"),
    ("key", "on_input"),
    ("click", "on_input"),
    ("message", "on_event"),
    ("signal", "on_event"),
)
_ON: Final = re.compile(r"on_|[oO]n[A-Z]")


@dataclass(frozen=True, slots=True)
class Doubt:
    """A sentence about a file, with its line; of the same text it is the same doubt."""

    sentence: str
    text: str


def doubts_of(behaviour: type[Behaviour], text: ScriptText) -> list[Doubt]:
    """All that is hardly meant in the files of a behaviour, as far as they have been run."""
    classes = text.classes(behaviour)
    mentioned = {name for file in text.files.values() for name in _mentioned(file.tree)}
    defined = {node.name for file in text.files.values() for node in ast.walk(file.tree) if isinstance(node, Function)}
    reader = _Reader(behaviour, {id(method) for one in classes for method in one.methods()}, _DEEDS - defined)
    found: list[tuple[FileText, int, str]] = []
    for file in text.files.values():
        if file.names:
            found += [(file, line, words) for line, words in reader.forgotten(file)]
    for one in classes:
        found += [(one.file, line, words) for line, words in _nearly(one, mentioned)]
    return [Doubt(f"{file.place}:{line}: {words}", file.text) for file, line, words in found]


# --- awaitables that nobody awaits


@dataclass(frozen=True, slots=True)
class _Reader:
    """Looks for statements that only make what can be awaited.

    Attributes:
        methods: those of the behaviour, by `id`: in them it is known what `self` has.
        deeds: what only an entity can be told to do.
    """

    behaviour: type[Behaviour]
    methods: set[int]
    deeds: frozenset[str]

    def forgotten(self, file: FileText) -> Iterator[tuple[int, str]]:
        """The lines of a file, and what is to be said of them."""
        for call, around in _calls_alone(file.tree):
            known = _known(call.func, file)
            if any(known is wait for wait in _WAITS) and not _is_local(call.func, around):
                shown = _shown(call, file)
                yield call.lineno, f"{shown} waits for nothing by itself: await it in an async function"
            elif (
                (isinstance(known, AsyncFunction) and not _is_local(call.func, around))
                or self._is_own(call.func, around)
                or (isinstance(call.func, ast.Attribute) and call.func.attr in self.deeds)
            ):
                shown = _shown(call, file)
                yield (
                    call.lineno,
                    f"{shown} begins nothing by itself: await it in an async function, or self.begin({shown})",
                )

    def _is_own(self, called: ast.expr, around: tuple[Function, ...]) -> bool:
        """Whether it is `self.NAME` or `super().NAME`, of an async method."""
        method = next((function for function in around if id(function) in self.methods), None)
        if method is None or not method.args.args:
            return False
        match called:
            case ast.Attribute(value=ast.Name(id=name), attr=attribute) if name == method.args.args[0].arg:
                return isinstance(inspect.getattr_static(self.behaviour, attribute, None), AsyncFunction)
            case ast.Attribute(value=ast.Call(func=ast.Name(id="super")), attr=attribute):
                above = (vars(base)[attribute] for base in self.behaviour.__mro__[1:] if attribute in vars(base))
                return isinstance(next(above, None), AsyncFunction)
        return False


def _calls_alone(tree: ast.Module) -> Iterator[tuple[ast.Call, tuple[Function, ...]]]:
    """Calls that are whole statements, in their order, each with the functions around it, outermost first."""
    # No recursion: neither a long elif nor a long sum is a script's mistake.
    waiting: list[tuple[ast.AST, tuple[Function, ...]]] = [(tree, ())]
    while waiting:
        node, around = waiting.pop()
        if isinstance(node, ast.Expr):
            if isinstance(node.value, ast.Call):
                yield node.value, around
            continue
        if isinstance(node, Function):
            around = (*around, node)
        inner = [
            part
            for part in ast.iter_child_nodes(node)
            if isinstance(part, ast.stmt | ast.ExceptHandler | ast.match_case)
        ]
        waiting += [(part, around) for part in reversed(inner)]


def _known(called: ast.expr, file: FileText) -> Any:
    """What a name, or a name of a module, stands for in a file; None for what is only known as it runs."""
    match called:
        case ast.Name(id=name):
            return file.names.get(name)
        case ast.Attribute(value=value, attr=name) if isinstance(module := _known(value, file), ModuleType):
            return vars(module).get(name)
    return None


def _is_local(called: ast.expr, around: tuple[Function, ...]) -> bool:
    """Whether a name is given something else in a function around it."""
    while isinstance(called, ast.Attribute):
        called = called.value
    for node in (inner for function in around for inner in ast.walk(function)):
        match node:
            case ast.arg(arg=name) | ast.Name(id=name, ctx=ast.Store()) if isinstance(called, ast.Name):
                if name == called.id:
                    return True
    return False


def _shown(call: ast.Call, file: FileText) -> str:
    """A call as it is written; without what it is given if that is long."""
    written = " ".join((ast.get_source_segment(file.text, call) or "").split())
    if 0 < len(written) <= _LONGEST:
        return written
    name = " ".join((ast.get_source_segment(file.text, call.func) or "").split())
    return f"{name[-_LONGEST:]}(...)"


# --- methods that are nearly hooks


def _nearly(one: ClassText, mentioned: set[str]) -> Iterator[tuple[int, str]]:
    elsewhere = {name for base in one.kind.__mro__[1:] for name in vars(base)}
    for method in one.methods():
        name = method.name
        if name in HOOKS or name in mentioned or name in elsewhere or name.startswith("_") or method.decorator_list:
            continue
        meant = _meant(name, vars(one.kind).get(name))
        if meant:
            yield method.lineno, f"{name} is called by nobody; did you mean {meant}?"
        elif _ON.match(name):
            yield (
                method.lineno,
                f"{name} is called by nobody in its files, and is no hook: hooks are {', '.join(HOOKS)}",
            )


def _mentioned(tree: ast.Module) -> Iterator[str]:
    """All names that a file may call something by; texts too, for getattr()."""
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(attr=name) | ast.Name(id=name, ctx=ast.Load()) | ast.Constant(value=str(name)):
                yield name


def _meant(name: str, value: Any) -> str:
    """The hook that a method was to be; "" where none is likely."""
    plain = name.lower().replace("_", "")
    if _ON.match(name):
        near = difflib.get_close_matches(plain, _PLAIN_HOOKS, 1, 0.75)
        return _PLAIN_HOOKS[near[0]] if near else next((hook for part, hook in _ELSEWHERE if part in plain), "")
    # Any other name may be a helper's: it has to be a slip of the hand, and can be called as the hook is.
    signature = _signature(value)
    for written, hook in _PLAIN_HOOKS.items():
        if _is_slip(plain, written) and signature is not None and fits(signature, hook):
            return hook
    return ""


def _is_slip(plain: str, written: str) -> bool:
    if plain == written or (plain, written) == ("lateupdate", "update"):
        return True
    if plain.startswith(written):
        return False  # updated, starts, startup
    likeness = difflib.SequenceMatcher(None, plain, written).ratio()
    are_swapped = sorted(plain) == sorted(written) and likeness >= 0.8
    return are_swapped or likeness >= 0.9


def _signature(value: Any) -> inspect.Signature | None:
    if isinstance(value, AsyncFunction):
        return value.program.signature
    return inspect.signature(value) if isinstance(value, FunctionType) else None
