"""Refuses hooks that would never run, or fail as soon as they are called: said as the file is loaded, with the line."""

from __future__ import annotations

import functools
import inspect
from types import FunctionType
from typing import Any, Final

from elys.common.errors import ScriptError
from elys.sim_node.scripts.behaviour import HOOKS, Behaviour
from elys.sim_node.scripts.modules import AsyncFunction
from elys.sim_node.scripts.script_text import ScriptText

_OTHERWISE: Final = {
    staticmethod: "a staticmethod",
    classmethod: "a classmethod",
    property: "a property",
    functools.cached_property: "a property",
}


def called_with(hook: str) -> tuple[str, ...]:
    """What a hook is given, besides the behaviour itself."""
    return tuple(inspect.signature(getattr(Behaviour, hook)).parameters)[1:]


def fits(signature: inspect.Signature, hook: str) -> bool:
    """Whether a method can be called as a hook is."""
    try:
        signature.bind(None, *called_with(hook))
    except TypeError:
        return False
    return True


def require_hooks(behaviour: type[Behaviour], text: ScriptText) -> None:
    """Raises ScriptError for a hook that cannot be called or would never run, and for what neither awaits nor is awaited."""
    seen = set()
    for owner in behaviour.__mro__:
        if owner is Behaviour or owner is object:
            continue
        for name, value in vars(owner).items():
            if name in seen:
                continue  # what a class nearer by has is called, not this
            seen.add(name)
            wrong = _wrong_with_hook(name, value) if name in HOOKS else _wrong_with_method(name, value)
            if wrong:
                raise ScriptError(f"{text.place_of(owner, name)}: {wrong}")


def _wrong_with_hook(name: str, value: Any) -> str:
    """What is wrong with a hook, and what to write; "" for nothing."""
    head = f"def {name}({', '.join(('self', *called_with(name)))})"
    if inspect.isgeneratorfunction(value) or inspect.isasyncgenfunction(value):
        return f"{name} has a yield, and would never run: write async {head} and await what it waits for"
    if inspect.iscoroutinefunction(value):
        return (
            f"{name} is async, and would never run: an async function of a script stands in a class at the top of its file, "
            "and has no decorator"
        )
    for kind, words in _OTHERWISE.items():
        if isinstance(value, kind):
            return f"{name} is {words}, and is called as a method: write {head}"
    if isinstance(value, AsyncFunction):
        return _wrong_with_call(name, value.program.signature, f"async {head}")
    if isinstance(value, FunctionType):
        # As it is called: a wrapper, not what it wraps.
        return _wrong_with_call(name, inspect.signature(value, follow_wrapped=False), head)
    return "" if callable(value) or hasattr(value, "__get__") else f"{name} is no function: write {head}"


def _wrong_with_call(name: str, signature: inspect.Signature, head: str) -> str:
    given = " and ".join(called_with(name)) or "nothing"
    return "" if fits(signature, name) else f"{name} is called with {given}: write {head}"


def _wrong_with_method(name: str, value: Any) -> str:
    if inspect.isasyncgenfunction(value):
        return f"{name} has a yield, and nothing could await or begin it: await what it waits for"
    return ""
