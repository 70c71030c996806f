"""Loads script files: runs their text in modules of their own and makes programs of their `async` functions.

A script is the user's own code and may do what Python may: who opens a scene of a stranger's is asked first (docs/scripts.md).
Files that a script imports from beside it come out of its bundle, so that what runs is what was recorded; everything else is
imported as in any program.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import linecache
import traceback
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from types import FunctionType, MethodType, ModuleType
from typing import Any

from elys.common.assets.scripts import ScriptBundle
from elys.common.errors import ScriptError
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.scripts.interruption import is_interruption
from elys.sim_node.scripts.program import Program, program_of
from elys.sim_node.scripts.script_text import FileText, ScriptText
from elys.sim_node.scripts.waiting import Call
from elys.sim_node.scripts.watchdog import ScriptGrowth, ScriptTimeout, reason_of


class AsyncFunction:
    """Stands where a script has an `async def`: to call it gives what can be awaited, and begins nothing."""

    def __init__(self, function: FunctionType, program: Program) -> None:
        self.program = program
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self.__qualname__ = function.__qualname__

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        return self if instance is None else MethodType(self, instance)

    def __call__(self, *arguments: Any, **named: Any) -> Call:
        return Call(self.program, arguments, named)


class ScriptModules:
    """The modules of one bundle's files, each run once, when it is first imported."""

    def __init__(self, bundle: ScriptBundle, places: Mapping[str, str]) -> None:
        """`places` says how tracebacks call a file; its name in the bundle where nothing is said."""
        self._bundle = bundle
        self._places = places
        self._modules: dict[str, ModuleType] = {}
        self._running: list[str] = []
        self.programs: dict[tuple[str, str], Program] = {}
        self._builtins = {**vars(builtins), "__import__": self._import}

    @classmethod
    def of_file(cls, path: Path) -> ScriptModules:
        """The modules of a single file, which is run."""
        modules = cls(
            ScriptBundle(behaviour="", main=path.name, files={path.name: path.read_text()}), {path.name: str(path)}
        )
        modules._module(_module_name(path.name))
        return modules

    def names_of(self, kind: type[Any]) -> dict[str, Any]:
        """The names that the module of a class knows."""
        module = self._modules.get(kind.__module__)
        return vars(module) if module is not None else {}

    def loaded(self) -> tuple[ModuleType, ...]:
        """The modules that have been run."""
        return tuple(self._modules.values())

    def text(self) -> ScriptText:
        """Where in its files everything stands."""
        files = {}
        for file, text in self._bundle.files.items():
            name, place = _module_name(file), self._place(file)
            try:
                tree = ast.parse(text, place)
            except (SyntaxError, ValueError, RecursionError, MemoryError):
                continue  # a file that nobody has imported yet; who does is told
            names = vars(self._modules[name]) if name in self._modules else {}
            files[name] = FileText(place=place, text=text, tree=tree, names=names)
        return ScriptText(files)

    @property
    def places(self) -> list[str]:
        """What tracebacks call its files."""
        return [self._place(file) for file in self._bundle.files]

    def behaviour(self) -> type[Behaviour]:
        """Runs the bundle's file and gives the class that it is about.

        Raises:
            ScriptError: the file cannot be run, or has no such class; with file, line and what to do.
        """
        bundle = self._bundle
        module = self._module(_module_name(bundle.main))
        place = self._place(bundle.main)
        found = {name: value for name, value in vars(module).items() if _is_behaviour_of(value, module)}
        if bundle.behaviour:
            chosen = getattr(module, bundle.behaviour, None)
            if isinstance(chosen, type) and issubclass(chosen, Behaviour) and chosen is not Behaviour:
                return chosen
            there = f"; it has {', '.join(found)}" if found else f": write `class {bundle.behaviour}(Behaviour)`"
            raise ScriptError(f"{place} has no behaviour {bundle.behaviour}{there}")
        if len(found) == 1:
            return next(iter(found.values()))
        if not found:
            raise ScriptError(f"{place} has no behaviour: derive a class from elys.script.Behaviour")
        raise ScriptError(
            f"{place} has the behaviours {', '.join(found)}: say which, as {bundle.main}#{next(iter(found))}"
        )

    def record(self, name: str) -> type[Any] | None:
        """A class that the files declare, by "file.py:Name"."""
        file, _, qualified = name.partition(":")
        found: Any = self._modules.get(_module_name(file))
        for part in qualified.split("."):
            found = getattr(found, part, None)
        return found if isinstance(found, type) else None

    def name_of(self, kind: type[Any]) -> str | None:
        """The opposite; None for a class from elsewhere."""
        module = self._modules.get(kind.__module__)
        if (
            module is None
            or self.record(name := f"{_file_of(kind.__module__, self._bundle)}:{kind.__qualname__}") is not kind
        ):
            return None
        return name

    # --- running files

    def _module(self, name: str) -> ModuleType:
        if (known := self._modules.get(name)) is not None:
            return known
        file = _file_of(name, self._bundle)
        module = ModuleType(name)
        module.__dict__["__builtins__"] = self._builtins
        module.__package__ = name if PurePosixPath(file).name == "__init__.py" else name.rpartition(".")[0]
        self._modules[name] = module
        if file:
            self._running.append(name)
            try:
                self._run(module, file)
            except BaseException:
                del self._modules[name]
                raise
            finally:
                self._running.pop()
        if "." in name:
            package, _, last = name.rpartition(".")
            setattr(self._module(package), last, module)
        return module

    def _run(self, module: ModuleType, file: str) -> None:
        text, place = self._bundle.files[file], self._place(file)
        module.__file__ = place
        linecache.cache[place] = (len(text), None, text.splitlines(keepends=True), place)
        try:
            tree = ast.parse(text, place)
            code = compile(tree, place, "exec", dont_inherit=True)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise ScriptError(_of_syntax(place, error)) from error
        try:
            exec(code, module.__dict__)
        except BaseException as error:
            if isinstance(error, (ScriptError, ScriptTimeout, ScriptGrowth)) or is_interruption(error):
                raise
            raise ScriptError(self._of_running(place, error)) from error
        self._make_programs(module, tree, file)

    def _make_programs(self, module: ModuleType, tree: ast.Module, file: str) -> None:
        nodes = dict(_async_functions(tree))
        owners = [(module, None), *((value, value) for value in list(vars(module).values()) if isinstance(value, type))]
        for holder, owner in owners:
            if owner is not None and owner.__module__ != module.__name__:
                continue
            for name, function in list(vars(holder).items()):
                if not (inspect.iscoroutinefunction(function) and isinstance(function, FunctionType)):
                    continue
                if function.__module__ != module.__name__ or function.__qualname__ not in nodes:
                    continue
                program = program_of(function, nodes[function.__qualname__], owner=owner, file=file)
                self.programs[program.name, program.digest] = program
                setattr(holder, name, AsyncFunction(function, program))

    def _place(self, file: str) -> str:
        return self._places.get(file, file)

    def _of_running(self, place: str, error: BaseException) -> str:
        where = line_in(place, error)
        if isinstance(error, ImportError) and error.name in self._running:
            chain = " and ".join(_file_of(name, self._bundle) for name in self._running)
            return (
                f"{where}: {chain} import one another in a circle: import inside the function that needs it, or move what both "
                "need to a third file"
            )
        if isinstance(error, ModuleNotFoundError):
            return f"{where}: there is no module {error.name!r}: put {error.name}.py beside the script, or install it"
        return f"{where}: {reason_of(error) or describe(error)}"

    # --- imports

    def _import(
        self,
        name: str,
        globals: Mapping[str, Any] | None = None,
        locals: Mapping[str, Any] | None = None,
        fromlist: tuple[str, ...] = (),
        level: int = 0,
    ) -> ModuleType:
        full = name
        if level:
            parts = (
                str((globals or {}).get("__package__") or "").split(".") if (globals or {}).get("__package__") else []
            )
            kept = parts[: len(parts) - level + 1]
            full = ".".join([*kept, *([name] if name else [])])
        if not self._has(full):
            return builtins.__import__(name, globals, locals, fromlist, level)
        module = self._module(full)
        if not fromlist:
            return self._module(full.partition(".")[0])
        for part in fromlist:
            if not hasattr(module, part) and self._has(f"{full}.{part}"):
                self._module(f"{full}.{part}")
            elif not hasattr(module, part) and full in self._running:
                raise ImportError(f"cannot import {part!r} from {full!r}, which is being run", name=full)
        return module

    def _has(self, name: str) -> bool:
        folder = name.replace(".", "/") + "/"
        return bool(name) and (
            bool(_file_of(name, self._bundle)) or any(file.startswith(folder) for file in self._bundle.files)
        )


def describe(error: BaseException) -> str:
    """An error as a sentence says it: its kind and, if it has one, its text."""
    text = " ".join(text_of(error).split())
    return f"{type(error).__name__}: {text[:300]}" if text else type(error).__name__


def text_of(error: BaseException) -> str:
    """What an error says of itself. A script's own may fail at that."""
    try:
        return str(error)
    except BaseException as second:  # of whatever kind: what went wrong first is what is to be told
        if is_interruption(second):
            raise
        return f"its own text cannot be had ({type(second).__name__})"


def line_in(place: str, error: BaseException) -> str:
    """Where in a file an error came from: "door.py:12", the innermost line of that file; the file alone if none is."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == place]
    return f"{place}:{frames[-1].lineno}" if frames else place


def _of_syntax(place: str, error: BaseException) -> str:
    if isinstance(error, SyntaxError):
        text = (error.text or "").strip()
        return f"{place}:{error.lineno or 0}: {error.msg}" + (f", at `{text[:100]}`" if text else "")
    return f"{place} cannot be read as Python: {describe(error)}"


def _async_functions(tree: ast.Module) -> list[tuple[str, ast.AsyncFunctionDef]]:
    found = []
    for node in tree.body:
        if isinstance(node, ast.AsyncFunctionDef):
            found.append((node.name, node))
        elif isinstance(node, ast.ClassDef):
            found += [
                (f"{node.name}.{part.name}", part) for part in node.body if isinstance(part, ast.AsyncFunctionDef)
            ]
    return found


def _is_behaviour_of(value: object, module: ModuleType) -> bool:
    return isinstance(value, type) and issubclass(value, Behaviour) and value.__module__ == module.__name__


def _module_name(file: str) -> str:
    return file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _file_of(module: str, bundle: ScriptBundle) -> str:
    """The file of a module; "" for a folder without one, and for what is not in the bundle."""
    path = module.replace(".", "/")
    return next((file for file in (f"{path}.py", f"{path}/__init__.py") if file in bundle.files), "")
