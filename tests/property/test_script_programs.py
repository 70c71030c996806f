"""Programs made of async functions against Python's own coroutines: random functions, kept and put back at every wait."""

from __future__ import annotations

import ast
import random
import textwrap
from types import FunctionType
from typing import Any

import pytest

from elys.sim_node.scripts.memory import Finder, Keeper
from elys.sim_node.scripts.program import Program, program_of
from elys.sim_node.scripts.task import Task
from elys.sim_node.scripts.waiting import Call, ticks

FUNCTIONS = 3


class Writer:
    """Writes random functions that end, with everything in them that steps are made of."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.loops = 0

    def source(self) -> str:
        return "\n".join(self.function(number) for number in range(FUNCTIONS))

    def function(self, number: int) -> str:
        body = self.block(number, depth=0, in_loop=False)
        return (
            f"async def f{number}(log, a, b=2):\n    c = 0\n" + textwrap.indent(body, "    ") + "\n    return a, b, c\n"
        )

    def block(self, number: int, *, depth: int, in_loop: bool) -> str:
        count = self.random.randint(1, 4)
        return "\n".join(self.statement(number, depth=depth, in_loop=in_loop) for _ in range(count))

    def statement(self, number: int, *, depth: int, in_loop: bool) -> str:
        simple = ["assign", "assign", "log", "wait", "call", "raise", "return", "comprehension"]
        if in_loop:
            simple += ["break", "continue"]
        nested = ["if", "for", "while", "try", "finally", "both"] if depth < 3 else []
        kind = self.random.choice(simple + nested + nested)

        def inner(loop: bool = in_loop) -> str:
            return textwrap.indent(self.block(number, depth=depth + 1, in_loop=loop), "    ")

        choice, name = self.random.choice, self.random.choice("abc")
        match kind:
            case "assign":
                return f"{name} = {choice('abc')} {choice('+-*')} {self.random.randint(0, 5)}; {name} %= 97"
            case "log":
                return f"log.append(({self.random.randint(0, 999)}, a, b, c))"
            case "comprehension":
                return f"log.append([{name} + k for k in range(3) if k != a])"
            case "wait":
                return choice(
                    (
                        "await ticks(1)",
                        f"{name} = await give({self.random.randint(0, 9)})",
                        f"{name} += 1; await ticks(1)",
                    )
                )
            case "call" if number + 1 < FUNCTIONS:
                return f"({name}, b, log_size) = await f{number + 1}(log, {choice('abc')})"
            case "raise":
                error = choice(("ValueError", "KeyError", "ZeroDivisionError"))
                return f"if {name} % 3 == {self.random.randint(0, 2)}: raise {error}({name})"
            case "return":
                return f"if {name} % 5 == {self.random.randint(0, 4)}: return {name}, a, c"
            case "break" | "continue":
                return f"if {name} % 2 == {self.random.randint(0, 1)}: {kind}"
            case "if":
                return f"if {name} % 2:\n{inner()}\nelse:\n{inner()}"
            case "for":
                tail = f"\nelse:\n{inner()}" if self.random.random() < 0.4 else ""
                return f"for {name} in range({self.random.randint(0, 3)}):\n{inner(True)}{tail}"
            case "while":
                self.loops += 1
                n = f"n{self.loops}"
                return f"{n} = 0\nwhile {n} < {self.random.randint(1, 3)}:\n    {n} += 1\n{inner(True)}"
            case "try":
                kinds = choice(("ValueError", "(KeyError, ValueError)", "Exception"))
                return f"try:\n{inner()}\nexcept {kinds} as error:\n{self.quiet(in_loop)}"
            case "finally":
                return f"try:\n{inner()}\nfinally:\n    log.append(('finally', a))"
            case "both":
                tried = f"try:\n{inner()}\nexcept ValueError:\n{self.quiet(in_loop)}\nelse:\n{inner()}"
                return f"{tried}\nfinally:\n    c += 1\n    log.append(c)"
        return "log.append(a)"

    def quiet(self, in_loop: bool) -> str:
        """What may stand in a handler: it cannot wait."""
        leaving = ["return 1, 2, 3", "raise", "raise KeyError(a)"] + (["break", "continue"] if in_loop else [])
        last = self.random.choice(["pass", "c = 7", *leaving])
        return f"    log.append(('caught', b))\n    if a % 2:\n        {last}"


class PythonWait:
    """A wait of Python's own."""

    def __init__(self, value: Any = None) -> None:
        self.value = value

    def __await__(self) -> Any:
        yield
        return self.value


def by_python(source: str) -> tuple[list[Any], str]:
    names: dict[str, Any] = {"ticks": PythonWait, "give": PythonWait}
    exec(compile(source.replace("await ticks(1)", "await ticks()"), "random.py", "exec"), names)
    log: list[Any] = []
    running = names["f0"](log, 3)
    waits = 0
    try:
        while True:
            running.send(None)
            waits += 1
            log.append("wait")
    except StopIteration as end:
        return log, repr(end.value)
    except Exception as error:
        return log, repr(error)


class NoWorld:
    """Nothing but programs has a name."""

    def __init__(self, programs: dict[str, Program]) -> None:
        self.programs = programs

    def word_for(self, value: Any) -> None:
        return None

    def program(self, name: str, digest: str) -> Program:
        return self.programs[name]

    def name_of_record(self, kind: type[Any]) -> None:
        return None


def by_programs(source: str) -> tuple[list[Any], str]:
    source += "\nasync def give(value):\n    await ticks(1)\n    return value\n"
    names: dict[str, Any] = {"ticks": ticks}
    exec(compile(source, "random.py", "exec"), names)
    programs = {}
    for node in ast.parse(source).body:
        assert isinstance(node, ast.AsyncFunctionDef)
        function = names[node.name]
        assert isinstance(function, FunctionType)
        made = program_of(function, node)
        programs[made.name] = made
        names[node.name] = lambda *given, made=made, **named: Call(made, given, named)
    world: Any = NoWorld(programs)
    log: list[Any] = []
    task = Task.of(names["f0"](log, 3), 0, round)
    for now in range(10_000):
        try:
            task.advance(now, round, {})
        except Exception as error:
            return log, repr(error)
        if task.is_done:
            return log, repr(task.result)
        log.append("wait")
        # Through a state and back: all that goes on is what was kept.
        keeper = Keeper(world)
        kept_log, kept = keeper.kept(log, "log"), keeper.task(task, "task")
        finder = Finder(world)
        log, task = finder.found(kept_log), finder.task(kept)
    raise AssertionError("it never ends")


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("part", range(4))
def test_programs_do_what_coroutines_do(part: int, soak: bool) -> None:
    waited = ended = failed = 0
    for seed in range(part * 100_000, part * 100_000 + (2000 if soak else 100)):
        source = Writer(seed).source()
        expected, found = by_python(source), by_programs(source)
        assert found == expected, source
        waited += "wait" in expected[0]
        failed += "Error" in expected[1]
        ended += "Error" not in expected[1]
    assert min(waited, ended, failed) > 30
