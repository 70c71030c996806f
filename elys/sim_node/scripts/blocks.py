"""Parts of a function as functions of their own, which take its local variables as a dict and leave them changed.

Inside they are Python's own code with Python's own rules: comprehensions and lambdas see the variables, a variable that has no
value yet is an UnboundLocalError, and a traceback names the script's file, line and function.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from types import CodeType, FunctionType
from typing import Any, Final, TypeVar

Locals = dict[str, Any]
Block = Callable[[Locals], Any]
N = TypeVar("N", bound=ast.AST)

RESULT: Final = "__result__"  # the variable by which steps hand values to blocks
RETURNED: Final = "__returned__"  # the one that keeps what is returned while `finally` runs
_VARIABLES: Final = "__variables__"
_KEEP: Final = "__keep_variables__"
_OWNER: Final = "__owner__"


class BlockMaker:
    """Makes blocks of one function."""

    def __init__(self, function: FunctionType, owner: type | None) -> None:
        code = function.__code__
        self._function = function
        self._owner = owner
        self._itself = code.co_varnames[0] if code.co_argcount else "self"
        self._names = frozenset((*code.co_varnames, *code.co_cellvars, RESULT, RETURNED))

    def statements(self, body: list[ast.stmt]) -> Block:
        """A block that runs statements."""
        return self._made(body)

    def value(self, expression: ast.expr) -> Block:
        """A block that gives what an expression does."""
        return self._made([located(ast.Return(expression), expression)])

    def assignment(self, target: ast.expr) -> Block:
        """A block that gives the variable RESULT to a target."""
        result = located(ast.Name(RESULT, ast.Load()), target)
        return self._made([located(ast.Assign([target], result), target)])

    def _made(self, body: list[ast.stmt]) -> Block:
        inner = [_SuperCalls(self._itself).visit(part) for part in body]
        used = sorted(
            self._names & {found.id for part in body for found in ast.walk(part) if isinstance(found, ast.Name)}
        )
        bound = sorted(self._names & set().union(*map(_bound_names, body)))
        first = body[0]
        lines = [f"if {name!r} in {_VARIABLES}: {name} = {_VARIABLES}[{name!r}]" for name in sorted({*used, *bound})]
        prologue = _parsed("\n".join(lines), first)
        if bound:
            kept = _parsed(f"{_KEEP}({_VARIABLES}, locals(), {tuple(bound)!r})", first)
            inner = [located(ast.Try(inner, [], [], kept), first)]
        arguments = ast.arguments(
            posonlyargs=[],
            args=[ast.arg(name) for name in (_VARIABLES, _KEEP, _OWNER)],
            kwonlyargs=[],
            kw_defaults=[],
            defaults=[],
        )
        made = ast.FunctionDef(self._function.__name__, arguments, [*prologue, *inner], [], None)
        module = ast.Module([located(made, first)], [])
        ast.fix_missing_locations(module)
        compiled = compile(module, self._function.__code__.co_filename, "exec", dont_inherit=True)
        code = next(part for part in compiled.co_consts if isinstance(part, CodeType))
        return FunctionType(code, self._function.__globals__, self._function.__name__, (_keep, self._owner))


def located(made: N, like: ast.AST) -> N:
    """A made node with the place of another in the file, for tracebacks."""
    for name in ("lineno", "col_offset", "end_lineno", "end_col_offset"):
        setattr(made, name, getattr(like, name, 0))
    return made


def walk_scope(node: ast.AST) -> Iterator[ast.AST]:
    """A node and all below it that run with it: not what stands in functions and classes defined there."""
    yield node
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda | ast.ClassDef):
            yield from walk_scope(child)


def _keep(variables: Locals, now: Locals, names: tuple[str, ...]) -> None:
    for name in names:
        if name in now:
            variables[name] = now[name]
        else:
            variables.pop(name, None)


def _bound_names(statement: ast.stmt) -> set[str]:
    """The names that a statement may give another value to, or take it from."""
    found = set()
    for node in ast.walk(statement):
        match node:
            case ast.Name(id=name, ctx=ast.Store() | ast.Del()):
                found.add(name)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                found.add(name)
            case ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)):
                found.add(name)
            case ast.MatchMapping(rest=str(name)):
                found.add(name)
            case ast.alias(name=name, asname=other):
                found.add(other or name.partition(".")[0])
            case ast.Nonlocal(names=names):
                found.update(names)
    return found


class _SuperCalls(ast.NodeTransformer):
    """`super()` finds its class in the function around it, which a block is not."""

    def __init__(self, itself: str) -> None:
        self._itself = itself

    def visit_Call(self, node: ast.Call) -> ast.Call:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id == "super" and not node.args:
            node.args = [located(ast.Name(_OWNER, ast.Load()), node), located(ast.Name(self._itself, ast.Load()), node)]
        return node


def _parsed(text: str, like: ast.stmt) -> list[ast.stmt]:
    parsed = ast.parse(text).body
    for part in parsed:
        for node in ast.walk(part):
            located(node, like)
            # A place, not a span: the end of a statement of several lines may stand further left than its beginning.
            node.end_lineno, node.end_col_offset = node.lineno, node.col_offset  # type: ignore[attr-defined]
    return parsed
