"""python -m tests.scale: the load of trees of routers that no single machine carries, from what a message costs on this one.

python -m tests.scale                  with the costs that stand in docs/scale.json: tables, and docs/pictures/scale.svg
python -m tests.scale --measure        measures them anew first, and holds the model against a real router with 1, 10, 100 viewers
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from tests.benchmarks.machine import machine
from tests.scale import measured
from tests.scale.model import Costs, Level, Outcome, join_storm, run, tree_for
from tests.scale.picture import draw

ROOT: Final = Path(__file__).parents[2]
KEPT: Final = ROOT / "docs" / "scale.json"
PICTURE: Final = ROOT / "docs" / "pictures" / "scale.svg"
VIEWERS: Final = (100, 1000, 3000, 10_000, 30_000, 100_000)
SIZES: Final = {"full states of 1000 bodies": 68_064.0, "deltas of 4 kB": 4096.0}
FAN_OUT: Final = {"full states of 1000 bodies": 30, "deltas of 4 kB": 100}
SITE: Final = 0.040  # [s] between sites; routers of the last level stand near their viewers
LAST_MILE: Final = 0.010  # [s]
JITTER: Final = 0.002  # [s]
UPLINK: Final = 1.25e9  # [bytes/s]: 10 Gbit/s
CORES: Final = 4.0  # of a router that work at the same time


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.scale")
    parser.add_argument("--measure", action="store_true", help="measure the costs anew, and check the model")
    parser.add_argument("--seconds", type=float, default=6.0, help="of each measurement")
    chosen = parser.parse_args()
    if chosen.measure:
        KEPT.write_text(json.dumps(taken(chosen.seconds), indent=2) + "\n")
    facts = json.loads(KEPT.read_text())
    costs = Costs(**facts["costs"])
    print(f"{facts['machine']}\n\n{check_table(facts['check'])}\n")
    outcomes = {name: [tree(count, costs, name) for count in VIEWERS] for name in SIZES}
    for name, found in outcomes.items():
        print(f"{name}, routers of at most {FAN_OUT[name]}\n\n{table(found, costs)}\n")
    draw(PICTURE, outcomes, facts["check"])


def taken(seconds: float) -> dict[str, Any]:
    """The costs, from some counts of viewers, and how well they tell of others."""
    points = measured.measure(measured.CALIBRATED_AT, seconds=seconds)
    costs = measured.fitted(points, snapshot=measured.snapshot_cost())
    checked = measured.measure(measured.CHECKED_AT, seconds=seconds)
    check = [
        {**asdict(point), "predicted": measured.predicted(point, costs), "predicted_age": age_of(point, costs)}
        for point in checked
    ]
    return {"machine": machine(), "costs": asdict(costs), "calibration": [asdict(p) for p in points], "check": check}


def age_of(point: measured.Point, costs: Costs) -> float:
    """[ms] the median that the model tells for a measured point."""
    return run([Level(fan_out=1), Level(fan_out=point.viewers)], costs, size=point.size).age(50)


def tree(viewers: int, costs: Costs, name: str) -> Outcome:
    """A tree over several sites: routers below the host are a site apart, the last ones near their viewers."""
    fan_outs = tree_for(viewers, fan_out=FAN_OUT[name])
    levels = [
        Level(
            fan_out=fan_out,
            delay=LAST_MILE if place == len(fan_outs) - 1 else SITE if place == 1 else 0.001,
            jitter=JITTER,
            bandwidth=UPLINK,
            cores=CORES,
        )
        for place, fan_out in enumerate(fan_outs)
    ]
    return run(levels, costs, size=SIZES[name], ticks=120)


def check_table(check: list[dict[str, Any]]) -> str:
    """Predicted and measured, as Markdown."""
    lines = [
        "| below one router | router, predicted | measured | age p50, predicted | measured | p99 |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {row['viewers']} viewers, {row['size'] / 1000:.1f} kB | {1e3 * row['predicted']:.2f} ms a tick "
        f"| {1e3 * row['router']:.2f} ms | {row['predicted_age']:.1f} ms | {row['age_p50']:.1f} ms "
        f"| {row['age_p99']:.1f} ms |"
        for row in check
    ]
    return "\n".join(lines)


def table(outcomes: list[Outcome], costs: Costs) -> str:
    """What trees carry, as Markdown."""
    lines = [
        "| viewers | routers | levels | age p50 / p99 | lost | busiest router | it sends | all join: host, presence |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for found in outcomes:
        routers = found.levels[1:]
        busiest = max(routers, key=lambda load: load.processor)
        storm = join_storm(found.viewers, costs, routers=sum(load.nodes for load in routers))
        lines.append(
            f"| {found.viewers:,} | {sum(load.nodes for load in routers):,} | {len(routers)} "
            f"| {found.age(50):.0f} / {found.age(99):.0f} ms | {100 * found.lost:.1f} % "
            f"| {100 * busiest.processor:.0f} % of {CORES:g} cores | {8 * busiest.sent / 1e9:.2f} Gbit/s "
            f"| {storm.host:.0f} s, {storm.presence:.0e} messages |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
