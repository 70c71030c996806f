"""Makes of an `async` function a program whose place can be kept, put back and gone on from.

Python can neither copy nor save a coroutine, but a simulation is wound back, forked and run again on other machines, and the
behaviours in it with it. So an `async def` of a script is not run by Python: it is cut at its `await`s into steps, and what a
running one is comes down to a number, the next step, and its local variables.

What stands between two awaits stays Python's own code (blocks.py). Only statements that an `await` passes through, or a `return`,
`break` or `continue` out of them, are taken apart: if, while, for, try.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
from dataclasses import dataclass, field
from types import FunctionType
from typing import Any, Final, NoReturn

from elys.common.errors import ScriptError
from elys.sim_node.scripts.blocks import RETURNED, Block, BlockMaker, Locals, located, walk_scope

_ALONE: Final = (
    "await stands alone or on the right of an assignment, not inside other expressions: give its result a name first"
)
_BLOCKED: Final = "await cannot stand inside `{}`: a place in there could not be kept; await before or after it"
_LEFT: Final = "`{}` cannot be left from inside `{}` where a function awaits: note it in a variable, and leave below"


# Steps. What follows is the step below, unless a step says otherwise.


@dataclass(frozen=True, slots=True)
class Do:
    """Runs a block."""

    run: Block


@dataclass(frozen=True, slots=True)
class Await:
    """Evaluates what is awaited; when that is over, `store` takes what came of it as RESULT."""

    run: Block
    store: Block | None
    line: int


@dataclass(slots=True)
class Jump:
    """Goes on elsewhere."""

    target: int = -1


@dataclass(slots=True)
class Unless:
    """Goes on elsewhere if a condition does not hold."""

    run: Block
    target: int = -1


@dataclass(frozen=True, slots=True)
class Begin:
    """Begins a `for`: what it goes through is kept as a list, with how far it has come."""

    run: Block
    slot: str


@dataclass(slots=True)
class Next:
    """Takes the next of a `for` as RESULT, or goes on behind it."""

    slot: str
    store: Block
    target: int = -1


@dataclass(slots=True)
class Guard:
    """From here on an error goes on elsewhere, as the newest of those that are dealt with."""

    target: int = -1


@dataclass(frozen=True, slots=True)
class Unguard:
    """The last guard is over."""


@dataclass(slots=True)
class Catch:
    """Goes on elsewhere unless the newest error is of these kinds; `store` takes it as RESULT."""

    kinds: Block | None
    store: Block | None
    target: int = -1


@dataclass(frozen=True, slots=True)
class Forget:
    """The newest error is dealt with, and the variable that had it is no more."""

    name: str = ""


@dataclass(frozen=True, slots=True)
class Reraise:
    """Nobody has dealt with the newest error."""


@dataclass(frozen=True, slots=True)
class Return:
    """Ends the program."""

    run: Block | None


Step = Do | Await | Jump | Unless | Begin | Next | Guard | Unguard | Catch | Forget | Reraise | Return


@dataclass(frozen=True, slots=True)
class Program:
    """An `async` function as steps.

    Attributes:
        name: its file and what it is called there, "door.py:Door.open".
        digest: tells its code from another's: a place in one means nothing in the other.
    """

    name: str
    steps: tuple[Step, ...]
    digest: str
    signature: inspect.Signature

    def place_at(self, place: int) -> str:
        """The line of a step, "door.py:12": that of the nearest block, for jumps have none."""
        blocks = ((abs(number - place), getattr(step, "run", None)) for number, step in enumerate(self.steps))
        nearest = min((pair for pair in blocks if pair[1] is not None), key=lambda pair: pair[0], default=None)
        code = getattr(nearest[1], "__code__", None) if nearest is not None else None
        return f"{code.co_filename}:{code.co_firstlineno}" if code is not None else ""

    def bind(self, *arguments: Any, **named: Any) -> Locals:
        """The variables it begins with; TypeError as from a call."""
        try:
            bound = self.signature.bind(*arguments, **named)
        except TypeError as error:
            raise TypeError(f"{self.name.partition(':')[2]}() {error}") from None
        bound.apply_defaults()
        return dict(bound.arguments)


def program_of(
    function: FunctionType, node: ast.AsyncFunctionDef, *, owner: type | None = None, file: str = ""
) -> Program:
    """The program of an `async` function.

    Args:
        node: where it stands in the tree of its file.
        owner: the class it is a method of, for `super()`.
        file: what its file is called.

    Raises:
        ScriptError: an `await` stands where a program cannot be stopped; the sentence names line and remedy.
    """
    compiler = _Compiler(function, BlockMaker(function, owner))
    text = ast.dump(node)
    steps = compiler.compile(node)
    digest = hashlib.blake2b(text.encode(), digest_size=8).hexdigest()
    return Program(f"{file}:{function.__qualname__}", steps, digest, inspect.signature(function))


@dataclass(slots=True)
class _Loop:
    again: int  # step that `continue` goes to
    depth: int  # of what is open around it
    breaks: list[Jump] = field(default_factory=list)


class _Compiler:
    def __init__(self, function: FunctionType, blocks: BlockMaker) -> None:
        self._function = function
        self._blocks = blocks
        self._steps: list[Step] = []
        self._loops: list[_Loop] = []
        self._slots = 0
        # What leaving has to end, innermost last: a guard, an error, or the statements of a `finally`.
        self._open: list[Unguard | Forget | list[ast.stmt]] = []

    def compile(self, node: ast.AsyncFunctionDef) -> tuple[Step, ...]:
        closed = [name for name in self._function.__code__.co_freevars if name != "__class__"]
        if closed:
            self._fail(node, f"it uses {', '.join(closed)} of the function around it: take that as an argument")
        for found in walk_body(node):
            if isinstance(found, ast.AsyncFor | ast.AsyncWith):
                self._fail(found, "`async for` and `async with` cannot be kept: loop with `for` and await inside")
            if isinstance(found, ast.Yield | ast.YieldFrom):
                self._fail(found, "an async function of a script cannot yield: await what it waits for")
        self._statements(node.body)
        self._steps.append(Return(None))
        return tuple(self._steps)

    def _statements(self, body: list[ast.stmt]) -> None:
        together: list[ast.stmt] = []  # that one block can do
        for statement in [*body, None]:
            if statement is not None and _is_whole(statement):
                together.append(statement)
                continue
            if together:
                self._steps.append(Do(self._blocks.statements(together)))
                together = []
            if statement is not None:
                self._take_apart(statement)

    def _take_apart(self, statement: ast.stmt) -> None:
        match statement:
            case ast.Expr(value=ast.Await(value=awaited)):
                self._await(awaited, None)
            case ast.Assign(targets=[target], value=ast.Await(value=awaited)):
                self._await(awaited, target)
            case ast.AnnAssign(target=target, value=ast.Await(value=awaited)):
                self._await(awaited, target)
            case ast.Return(value=value):
                self._return(value)
            case ast.Break() | ast.Continue():
                self._leave_loop(statement)
            case ast.If():
                self._if(statement)
            case ast.While():
                self._while(statement)
            case ast.For():
                self._for(statement)
            case ast.Try():
                self._try(statement)
            case _:
                self._refuse(statement)

    def _refuse(self, statement: ast.stmt) -> NoReturn:
        kind = type(statement).__name__.lower()
        found = next((part for part in walk_scope(statement) if isinstance(part, ast.Await)), None)
        if isinstance(statement, ast.With | ast.Match | ast.TryStar):
            word = {"trystar": "except*"}.get(kind, kind)
            self._fail(
                found or statement, (_BLOCKED if found else _LEFT.replace("{}", "a function or loop", 1)).format(word)
            )
        self._fail(found or statement, _ALONE)

    def _await(self, awaited: ast.expr, target: ast.expr | None) -> None:
        store = None if target is None else self._blocks.assignment(target)
        self._steps.append(Await(self._value(awaited), store, awaited.lineno))

    def _return(self, value: ast.expr | None) -> None:
        if value is None:
            self._unwind(0)
            self._steps.append(Return(None))
            return
        returned = located(ast.Name(RETURNED, ast.Store()), value)
        if isinstance(value, ast.Await):
            self._await(value.value, returned)
        else:
            self._no_await_in(value)
            kept = located(ast.Assign([returned], value), value)
            self._steps.append(Do(self._blocks.statements([kept])))
        self._unwind(0)
        self._steps.append(Return(self._blocks.value(located(ast.Name(RETURNED, ast.Load()), value))))

    def _leave_loop(self, statement: ast.Break | ast.Continue) -> None:
        loop = self._loops[-1]
        self._unwind(loop.depth)
        jump = Jump(loop.again)
        self._steps.append(jump)
        if isinstance(statement, ast.Break):
            loop.breaks.append(jump)

    def _unwind(self, depth: int) -> None:
        """Ends what is open, down to a depth, as who leaves it must; it stays open for who does not."""
        kept = list(self._open)
        while len(self._open) > depth:
            ended = self._open.pop()
            if isinstance(ended, list):
                self._statements(ended)
            else:
                self._steps.append(ended)
        self._open = kept

    def _if(self, statement: ast.If) -> None:
        unless = Unless(self._value(statement.test))
        self._steps.append(unless)
        self._statements(statement.body)
        over = Jump()
        if statement.orelse:
            self._steps.append(over)
        unless.target = len(self._steps)
        self._statements(statement.orelse)
        over.target = len(self._steps)

    def _while(self, statement: ast.While) -> None:
        self._loops.append(_Loop(len(self._steps), len(self._open)))
        self._loop(Unless(self._value(statement.test)), statement)

    def _for(self, statement: ast.For) -> None:
        self._slots += 1
        slot = f"<for {self._slots}>"
        self._steps.append(Begin(self._value(statement.iter), slot))
        self._loops.append(_Loop(len(self._steps), len(self._open)))
        self._loop(Next(slot, self._blocks.assignment(statement.target)), statement)

    def _loop(self, head: Unless | Next, statement: ast.While | ast.For) -> None:
        self._steps.append(head)
        self._statements(statement.body)
        loop = self._loops.pop()
        self._steps.append(Jump(loop.again))
        head.target = len(self._steps)
        self._statements(statement.orelse)
        for jump in loop.breaks:
            jump.target = len(self._steps)

    def _try(self, statement: ast.Try) -> None:
        for part in (*statement.handlers, *statement.finalbody):
            self._no_await_in(part, "await cannot stand in `except` and `finally`: note what to do there, await below")
        if not statement.finalbody:
            self._try_handlers(statement)
            return
        self._open.append(statement.finalbody)
        guard = self._guarded(lambda: self._try_handlers(statement))
        self._open.pop()
        self._statements(statement.finalbody)
        over = Jump()
        self._steps.append(over)
        guard.target = len(self._steps)
        self._failing(statement.finalbody, Forget())
        self._steps.append(Reraise())
        over.target = len(self._steps)

    def _try_handlers(self, statement: ast.Try) -> None:
        if not statement.handlers:
            self._statements(statement.body)
            return
        guard = self._guarded(lambda: self._statements(statement.body))
        self._statements(statement.orelse)
        ends = [Jump()]
        self._steps.append(ends[0])
        guard.target = len(self._steps)
        for handler in statement.handlers:
            named = handler.name and located(ast.Name(handler.name, ast.Store()), handler)
            catch = Catch(
                None if handler.type is None else self._value(handler.type),
                self._blocks.assignment(named) if named else None,
            )
            self._steps.append(catch)
            self._failing(handler.body, Forget(handler.name or ""))
            self._steps += [Forget(handler.name or ""), end := Jump()]
            ends.append(end)
            catch.target = len(self._steps)
        self._steps.append(Reraise())
        for end in ends:
            end.target = len(self._steps)

    def _guarded(self, body: Any) -> Guard:
        guard = Guard()
        self._steps.append(guard)
        self._open.append(Unguard())
        body()
        self._open.pop()
        self._steps.append(Unguard())
        return guard

    def _failing(self, body: list[ast.stmt], end: Forget) -> None:
        """Statements that run while an error is dealt with."""
        self._open.append(end)
        self._statements(body)
        self._open.pop()

    def _value(self, expression: ast.expr) -> Block:
        self._no_await_in(expression)
        return self._blocks.value(expression)

    def _no_await_in(self, node: ast.AST, sentence: str = _ALONE) -> None:
        for found in walk_scope(node):
            if isinstance(found, ast.Await):
                self._fail(found, sentence)

    def _fail(self, node: ast.AST, sentence: str) -> NoReturn:
        code = self._function.__code__
        line = getattr(node, "lineno", code.co_firstlineno)
        raise ScriptError(f"{code.co_filename}:{line}, in {self._function.__qualname__}: {sentence}")


def walk_body(node: ast.AsyncFunctionDef) -> list[ast.AST]:
    """All that runs with a function, without the functions defined in it."""
    return [found for statement in node.body for found in walk_scope(statement)]


def _is_whole(statement: ast.stmt) -> bool:
    """Whether a block can do a statement: nothing in it waits, and nothing leaves it."""
    return not _waits_or_leaves(statement, in_loop=False)


def _waits_or_leaves(node: ast.AST, *, in_loop: bool) -> bool:
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.Lambda() | ast.ClassDef():
            return False
        case ast.Await() | ast.Return():
            return True
        case ast.Break() | ast.Continue():
            return not in_loop
        case ast.For() | ast.While():
            head = [node.iter, node.target] if isinstance(node, ast.For) else [node.test]
            return any(_waits_or_leaves(part, in_loop=True) for part in (*head, *node.body)) or any(
                _waits_or_leaves(part, in_loop=in_loop) for part in node.orelse
            )
    return any(_waits_or_leaves(part, in_loop=in_loop) for part in ast.iter_child_nodes(node))
