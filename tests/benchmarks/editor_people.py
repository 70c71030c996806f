"""Editors as processes of their own, and what is asked of them."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections.abc import Iterator
from typing import Any, Final

from tests.benchmarks.processes import environment

PATIENCE: Final = 60.0  # [s] for an editor to end


class Person:
    """Somebody at an editor."""

    def __init__(self, env: dict[str, str], core: int | None) -> None:
        chosen = {} if core is None else {"ELYS_BENCH_CORE": str(core)}
        self._process = subprocess.Popen(
            (sys.executable, "-m", "tests.benchmarks.editor_child"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**env, "ELYS_NULL_PLATFORM": "1", **chosen},
        )

    @property
    def id(self) -> int:
        """Of the process."""
        return self._process.pid

    def ask(self, *words: str) -> None:
        """Says something; `answer` waits until it is done."""
        assert self._process.stdin is not None
        self._process.stdin.write(" ".join(words) + "\n")
        self._process.stdin.flush()

    def answer(self) -> Any:
        """What the editor said last."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("an editor ended before it answered")
        return json.loads(line)

    def do(self, *words: str) -> Any:
        """Says something and waits until it is done."""
        self.ask(*words)
        return self.answer()

    def leave(self) -> None:
        """Closes the editor."""
        with contextlib.suppress(OSError):
            self.ask("end")
        try:
            self._process.wait(PATIENCE)
        finally:
            self._process.kill()
            self._process.wait()


@contextlib.contextmanager
def people(count: int, *, core: int | None = None) -> Iterator[list[Person]]:
    """So many editors that are attached to nothing yet, on one core if it is named."""
    with environment() as env:
        persons = [Person(env, core) for _ in range(count)]
        try:
            for person in persons:
                person.answer()
            yield persons
        finally:
            for person in persons:
                person.leave()


def all_do(persons: list[Person], *words: str) -> list[Any]:
    """All at once."""
    for person in persons:
        person.ask(*words)
    return [person.answer() for person in persons]
