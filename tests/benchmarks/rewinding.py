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


def measure(count: int, ticks: int) -> None:
    simulation = load(count)
    for _ in range(60):
        simulation.step()
    recorder = FlightRecorder(simulation)
    worked, noted = [], []
    for _ in range(ticks):
        began = time.perf_counter()
        simulation.step()
        stepped = time.perf_counter()
        recorder.note((), steps=True, is_told=False, seconds=stepped - began)
        worked.append(stepped - began)
        noted.append(time.perf_counter() - stepped)
    bodies = simulation.physics.body_count
    captures = 1e3 * statistics.median(recorder.capture_times)
    one = simulation.capture().size / 1e6
    print(
        f"{bodies} bodies, {simulation.physics.touching_count} contacts: tick {1e3 * statistics.median(worked):.2f} ms; a "
        f"keyframe {captures:.2f} ms (worst {1e3 * max(recorder.capture_times):.2f}), {one:.2f} MB; {recorder.keyframe_count} "
        f"kept in {recorder.size / 1e6:.1f} MB; share of the ticks {100.0 * sum(noted) / sum(worked):.2f} %"
    )
    state = simulation.capture()
    began = time.perf_counter()
    simulation.restore(state)
    restored = 1e3 * (time.perf_counter() - began)
    print(f"    to go back to a keyframe {restored:.2f} ms, as bytes {len(state.to_bytes()) / 1e6:.2f} MB")


def main() -> None:
    measure(1000, 300)
    measure(1000, 1200)
    measure(10_000, 240)


if __name__ == "__main__":
    main()
