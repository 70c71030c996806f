"""A hundred viewers below one router: what each of them gets, and what it costs the simulation, in turns with none.

python -m tests.benchmarks viewers                         the whole: 100 below one router, a thousand bodies; 300 below a tree
python -m tests.benchmarks viewers --count 50 --scene stack --seconds 5

Processor time is measured, not load: the machine may have other work. The simulation's is that of the thread that ticks, which
tells it itself; ages are by one clock, from the tick that published to the arrival at the viewer.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from tests.benchmarks.processes import environment, running

IN_ONE_PROCESS: Final = 25  # viewers
TOUCHES: Final = 4.0  # [1/s] changes of the scene, so that deltas are told
Row = tuple[str, str]


@dataclass
class Phase:
    """What was counted while so many viewers were there."""

    viewers: int
    ticks: int
    seconds: float  # [s] as a clock on the wall goes
    thread: float  # [s] processor time of the thread that ticks
    process: float  # [s] of the simulation's process
    routers: tuple[float, ...]  # [s] of each router's
    crowd: float = 0.0  # [s] of all viewers together
    states: int = 0
    state_size: float = 0.0  # [bytes]
    missed_states: int = 0
    deltas: int = 0
    missed_deltas: int = 0
    fewest_states: int = 0  # of any viewer
    ages: np.ndarray = field(default_factory=lambda: np.zeros(0))  # [ms]

    @property
    def tick(self) -> float:
        """[ms] of the ticking thread in a tick."""
        return 1e3 * self.thread / self.ticks


class Program:
    """A process that is asked by lines."""

    def __init__(self, env: dict[str, str], *words: str) -> None:
        command = (sys.executable, "-m", *words)
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=env)

    def send(self, line: str = "") -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def read(self) -> str:
        assert self.process.stdout is not None
        if not (line := self.process.stdout.readline()):
            raise RuntimeError(f"{self.process.args} ended")
        return line

    def ask(self, line: str = "") -> Any:
        self.send(line)
        return json.loads(self.read())

    def end(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


class Stage:
    """A simulation and routers below it: `depth` 1 is one router, 2 one with `width` below it, at which viewers come in."""

    def __init__(self, env: dict[str, str], host: Program, routers: list[tuple[str, int]], entries: list[str]) -> None:
        self.env = env
        self.host = host
        self.routers = routers  # endpoint and process
        self.entries = entries

    def phase(self, viewers: int, seconds: float) -> Phase:
        """Counts for a while, with so many viewers that come for it and go."""
        with self._crowd(viewers) as crowd:
            for program in crowd:
                program.send()
            before, routers = self.host.ask("count"), [processor_time(pid) for _, pid in self.routers]
            began = time.perf_counter()
            while time.perf_counter() - began < seconds:
                time.sleep(1.0 / TOUCHES)
                after = self.host.ask("touch")
            took = time.perf_counter() - began
            after = self.host.ask("count")
            routers = [processor_time(pid) - was for (_, pid), was in zip(self.routers, routers, strict=True)]
            told = [program.ask() for program in crowd]
        states = [count for one in told for count in one["states"]]
        return Phase(
            viewers=viewers,
            ticks=after["ticks"] - before["ticks"],
            seconds=took,
            thread=after["thread"] - before["thread"],
            process=after["process"] - before["process"],
            routers=tuple(routers),
            crowd=sum(one["process"] for one in told),
            states=sum(states),
            state_size=sum(sum(one["sizes"]) for one in told) / max(sum(states), 1),
            fewest_states=min(states, default=0),
            missed_states=sum(sum(one["missed_states"]) for one in told),
            deltas=sum(sum(one["deltas"]) for one in told),
            missed_deltas=sum(sum(one["missed_deltas"]) for one in told),
            ages=np.array([age for one in told for age in one["ages"]]),
        )

    @contextlib.contextmanager
    def _crowd(self, viewers: int) -> Iterator[list[Program]]:
        counts = [min(IN_ONE_PROCESS, viewers - start) for start in range(0, viewers, IN_ONE_PROCESS)]
        crowd: list[Program] = []
        try:
            for place, count in enumerate(counts):
                entry = self.entries[place % len(self.entries)]
                crowd.append(Program(self.env, "tests.benchmarks.viewer_crowd", entry, str(count)))
            for program in crowd:
                program.read()
            yield crowd
        finally:
            for program in crowd:
                program.end()


@contextlib.contextmanager
def stage(scene: str = "pile", *, branches: int = 0) -> Iterator[Stage]:
    """A simulation with one router below it, or with one and so many more below that."""
    ports = iter(free_ports(2 + branches))
    host_endpoint, top, *below = (f"tcp/127.0.0.1:{port}" for port in ports)
    with environment() as env, contextlib.ExitStack() as stack:
        host = Program(env, "tests.benchmarks.viewer_host", host_endpoint, scene)
        stack.callback(host.end)
        while "hosting" not in host.read():
            pass
        routers = []
        for endpoint, above in [(top, host_endpoint), *((endpoint, top) for endpoint in below)]:
            words = (sys.executable, "-m", "elys", "router", "--listen", endpoint, "--connect", above)
            router = stack.enter_context(running(words, env=env, wait_for="session bench"))
            routers.append((endpoint, router.pid))
        yield Stage(env, host, routers, below or [top])


def processor_time(pid: int) -> float:
    """[s] that a process took so far: its processor clock, clock_getcpuclockid(3)."""
    return time.clock_gettime((~pid << 3) | 2)


def free_ports(count: int) -> list[int]:
    """Ports of loopback that nobody uses now."""
    probes = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [int(probe.getsockname()[1]) for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def in_turns(on: Stage, *, counts: Sequence[int], seconds: float, turns: int = 2) -> list[list[Phase]]:
    """Phases with each of these counts of viewers, in turns, so that what drifts meanwhile drifts for all."""
    phases: list[list[Phase]] = [[] for _ in counts]
    for _ in range(turns):
        for place, count in enumerate(counts):
            phases[place].append(on.phase(count, seconds))
    return phases


def rows_of(alone: list[Phase], one: list[Phase], watched: list[Phase], *, what: str) -> list[Row]:
    """The table's rows for one setting."""
    ages = np.concatenate([phase.ages for phase in watched])
    total = sum(phase.states + phase.missed_states for phase in watched)
    deltas = sum(phase.deltas for phase in watched)
    none, first, all_of_them = (float(np.median([phase.tick for phase in phases])) for phases in (alone, one, watched))
    spread = max(phase.tick for phase in alone) / min(phase.tick for phase in alone) - 1.0
    share = sum(sum(phase.routers) for phase in watched) / sum(phase.seconds for phase in watched)
    return [
        (f"{what}: age of a state at arrival, p50 / p99", f"{np.percentile(ages, 50):.1f} / {np.percentile(ages, 99):.1f} ms"),
        (f"{what}: states missed; deltas missed", f"{sum(p.missed_states for p in watched)} of {total}; "
         f"{sum(p.missed_deltas for p in watched)} of {deltas}"),
        (f"{what}: processor time of the ticking thread in a tick with none / one / all of them",
         f"{none:.3f} / {first:.3f} / {all_of_them:.3f} ms (turns with none differ by {100 * spread:.1f} %)"),
        (f"{what}: processor time of the routers together", f"{100 * share:.0f} % of a core"),
    ]  # fmt: skip


def measure() -> list[Row]:
    """Rows of the table."""
    return [
        *measured("pile", count=100, seconds=15.0),
        *measured("stack", count=300, seconds=10.0, branches=4),
    ]


def measured(scene: str, *, count: int, seconds: float, branches: int = 0) -> list[Row]:
    """One setting."""
    below = f"a tree of {branches + 1} routers" if branches else "one router"
    with stage(scene, branches=branches) as on:
        alone, one, watched = in_turns(on, counts=(0, 1, count), seconds=seconds)
    return rows_of(alone, one, watched, what=f"{count} viewers below {below}, {scene}")


def main(words: list[str]) -> None:
    """One setting of one's own."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks viewers")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--scene", default="pile", help="name of a sample")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each phase")
    parser.add_argument("--branches", type=int, default=0, help="routers below the first")
    chosen = parser.parse_args(words)
    for what, figure in measured(chosen.scene, count=chosen.count, seconds=chosen.seconds, branches=chosen.branches):
        print(f"{what}: {figure}")
