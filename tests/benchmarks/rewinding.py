"""What the flight recorder costs: `python -m tests.benchmarks.rewinding` prints it for piles of 1000 and of 10,000 bodies."""

from __future__ import annotations

import statistics
import time
from pathlib import Path

from elys.common.assets.store import AssetStore
from elys.common.scene import OpenedScene, expand
from elys.samples.pile import pile
from elys.sim_node.flight_recorder import FlightRecorder
from elys.sim_node.simulation import Simulation


def load(count: int) -> Simulation:
    """The sample's pile, of so many cubes."""
    document, assets = pile(count), AssetStore()
    records = expand(document, directory=Path(), assets=assets)
    opened = OpenedScene(name=document.name, path=Path(), settings=document.settings, records=records)
    return Simulation.load(opened, assets)


def measure(what: str, count: int, *, first: int, ticks: int) -> None:
    """Steps `ticks` from tick `first` on, and prints what keyframes cost meanwhile."""
    simulation = load(count)
    for _ in range(first):
        simulation.step()
    simulation.capture(), simulation.state_hash()  # machine code is loaded
    recorder = FlightRecorder(simulation)
    worked, noted = [], []  # [s]
    for _ in range(ticks):
        began = time.perf_counter()
        simulation.step()
        stepped = time.perf_counter()
        recorder.note((), steps=True, is_told=False, seconds=stepped - began)
        noted.append(time.perf_counter() - stepped)
        worked.append(stepped - began)
    keyframe = _keyframe_cost(simulation)
    taken = len(recorder.capture_times) - 1
    share = (ticks * statistics.median(noted) + taken * keyframe) / sum(worked)
    one = simulation.capture().size / 1e6
    print(
        f"{count} cubes {what}: {ticks} ticks, half of them above {1e3 * statistics.median(worked):.2f} ms; to note one "
        f"{1e6 * statistics.median(noted):.1f} us; {taken} keyframes of {1e3 * keyframe:.1f} ms and {one:.1f} MB, with the first "
        f"{recorder.keyframe_count} kept in {recorder.size / 1e6:.1f} MB; share of the ticks {100.0 * share:.2f} %"
    )
    state = simulation.capture()
    began = time.thread_time()
    simulation.restore(state)
    restored = 1e3 * (time.thread_time() - began)
    print(f"    to go back to a keyframe {restored:.1f} ms, as bytes {len(state.to_bytes()) / 1e6:.1f} MB")


def _keyframe_cost(simulation: Simulation) -> float:
    """What a keyframe takes of this thread [s], the median of five with ticks between."""
    state, times = simulation.capture(), []
    for _ in range(5):
        simulation.step()
        began = time.thread_time()
        state = simulation.capture(state)
        times.append(time.thread_time() - began)
    return statistics.median(times)


def main() -> None:
    measure("that fall upon one another", 1000, first=10, ticks=900)
    measure("that lie", 1000, first=600, ticks=1200)
    measure("that fall upon one another", 10_000, first=10, ticks=480)


if __name__ == "__main__":
    main()
