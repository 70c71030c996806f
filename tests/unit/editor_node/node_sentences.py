"""The sentences that nodes say, found in their sources: what is put into them is a 7, counted things are one and seven."""

from __future__ import annotations

import ast
import itertools
from collections.abc import Iterator
from pathlib import Path

import elys
from elys.sim_node.physics.plan import _counted

ROOT = Path(elys.__file__).parent


def parsed(module: str) -> ast.Module:
    return ast.parse((ROOT / module).read_text(encoding="utf-8"))


def variants(node: ast.expr, known: dict[str, list[str]]) -> list[str]:
    """What an expression may say; `known` are names for which only some texts stand."""
    match node:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.JoinedStr(values=values):
            return ["".join(parts) for parts in itertools.product(*(variants(value, known) for value in values))]
        case ast.FormattedValue(value=value):
            return variants(value, known)
        case ast.IfExp(body=body, orelse=other):
            return [*variants(body, known), *variants(other, known)]
        case ast.BinOp(left=left, right=right, op=ast.Add()):
            return [a + b for a, b in itertools.product(variants(left, known), variants(right, known))]
        case ast.Call(func=ast.Name(id="_counted"), args=[_, noun]):
            return [_counted(count, text) for count in (1, 7) for text in variants(noun, known)]
        case ast.Name(id=name) | ast.Attribute(attr=name) if name in known:
            return known[name]
        case _:
            return ["7"]


def raised(module: str, **known: list[str]) -> Iterator[str]:
    """The sentences of all errors that a module raises."""
    tree = parsed(module)
    constants = {
        target.id: variants(node.value, {})
        for node in tree.body
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and isinstance(node.value, (ast.Constant, ast.JoinedStr))
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
        if isinstance(target, ast.Name) and isinstance(getattr(node.value, "value", ""), str)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args:
            yield from variants(node.exc.args[0], {**constants, **known})


def told(module: str, prefix: str, **known: list[str]) -> Iterator[str]:
    """The sentences in functions whose names begin so: every text of several words in them that is no documentation."""
    for function in ast.walk(parsed(module)):
        if isinstance(function, ast.FunctionDef) and function.name.startswith(prefix):
            inner: set[int] = set()
            for node in function.body[ast.get_docstring(function) is not None :]:
                for expr in ast.walk(node):
                    if id(expr) in inner or not isinstance(expr, (ast.JoinedStr, ast.Constant)):
                        continue
                    inner |= {id(below) for below in ast.walk(expr)}
                    if isinstance(expr, ast.JoinedStr) or (isinstance(expr.value, str) and " " in expr.value):
                        yield from variants(expr, known)
