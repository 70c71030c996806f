"""How even time is seen to go, and how old what is seen is, over links of several kinds: `python -m tests.benchmarks.clock`.

Writes the table and the curves of docs/clock.md anew. All of it is in virtual time: two runs give the same.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from elys.bus.messages.state_frame import StateFrame
from elys.render_node.timeline import Timeline
from tests.benchmarks.two_frames import TwoFrames
from tests.link_traces import LINKS, Come, Course, Watched, Watcher, trace, watched

ROOT = Path(__file__).parents[2]
PAGE, CURVES = ROOT / "docs" / "clock.md", ROOT / "docs" / "pictures" / "clock.svg"
SECONDS, DRIFT = 40.0, 200e-6
SHOWN = ("wireless", "wireless, asleep between", "2 % lost, 200 ms each")  # in curves
SPAN = (20.0, 24.0)  # [s] of them


def frame_of(come: Come, *, epoch: int = 1, position: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> StateFrame:
    """A frame with one body."""
    return StateFrame(
        epoch=epoch,
        tick=come.tick,
        simulation_time=come.simulation_time,
        published_at=round(come.published * 1e9),
        delta_sequence=0,
        state_hash=0,
        playing=come.playing,
        position=np.array([position], np.float64),
        rotation=np.array([(0.0, 0.0, 0.0, 1.0)], np.float32),
        linear_velocity=np.zeros((1, 3), np.float32),
        angular_velocity=np.zeros((1, 3), np.float32),
        entity=np.array([1], np.uint32),
    )


def watcher_of(timeline: Timeline) -> Watcher:
    """A viewer's timeline as what is fed with a trace."""
    return Watcher(lambda come: timeline.take(frame_of(come), come.came, first=come.first), timeline.seen_time)


def compared(name: str, *, course: Course | None = None) -> tuple[Watched, Watched, float]:
    """What is seen over a link, before and now, and the delay [s] now."""
    states = trace(LINKS[name], seconds=SECONDS, course=course, drift=DRIFT)
    before, timeline = TwoFrames(), Timeline()
    old = watched(states, Watcher(before.take, before.seen_time), course=course, drift=DRIFT)
    return old, watched(states, watcher_of(timeline), course=course, drift=DRIFT), timeline.delay


def main() -> None:
    rows = [
        "| link | stutter before | now | age before, p50 / p95 | now | delay |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    curves = {}
    for name in LINKS:
        old, new, delay = compared(name)
        ages = [" / ".join(f"{np.percentile(a.settled_age(), p) * 1e3:.0f}" for p in (50, 95)) for a in (old, new)]
        stutter = f"{old.stutter() * 100:.1f} % | {new.stutter() * 100:.1f} %"
        rows.append(f"| {name} | {stutter} | {ages[0]} ms | {ages[1]} ms | {delay * 1e3:.0f} ms |")
        if name in SHOWN:
            curves[name] = (old, new)
    table = "\n".join(rows)
    print(table)
    if sys.argv[1:] != ["--show"]:
        head, _, rest = PAGE.read_text().partition("<!-- measured -->")
        PAGE.write_text(
            f"{head}<!-- measured -->\n{table}\n<!-- until here -->{rest.partition('<!-- until here -->')[2]}"
        )
        CURVES.write_text(drawn(curves))


WIDTH, HEIGHT, LEFT = 860, 170, 60


def drawn(curves: dict[str, tuple[Watched, Watched]]) -> str:
    """Ages over time as SVG, a panel a link: before thin and grey, now blue."""
    panels = [_panel(name, number, *pair) for number, (name, pair) in enumerate(curves.items())]
    height = HEIGHT * len(panels) + 10
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="12">'
        f'<rect width="{WIDTH}" height="{height}" fill="#fff"/>{"".join(panels)}</svg>\n'
    )


def _panel(name: str, number: int, old: Watched, new: Watched) -> str:
    top, bottom = number * HEIGHT + 26, number * HEIGHT + HEIGHT - 22
    highest = max(float(run.settled_age().max()) for run in (old, new)) * 1.05
    lines = []
    for run, color, width in ((old, "#999", 1.0), (new, "#1565c0", 2.0)):
        time = run.now - run.now[0]
        rows = (time >= SPAN[0]) & (time <= SPAN[1])
        x = LEFT + (time[rows] - SPAN[0]) / (SPAN[1] - SPAN[0]) * (WIDTH - LEFT - 10)
        y = bottom - run.age[rows] / highest * (bottom - top)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        lines.append(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="{width}"/>')
    axis = f'<path d="M{LEFT} {top}V{bottom}H{WIDTH - 10}" fill="none" stroke="#333"/>'
    texts = (
        f'<text x="{LEFT}" y="{top - 8}" font-weight="bold">{name}</text>'
        f'<text x="{LEFT - 6}" y="{top + 10}" text-anchor="end">{highest * 1e3:.0f} ms</text>'
        f'<text x="{LEFT - 6}" y="{bottom}" text-anchor="end">0</text>'
        f'<text x="{WIDTH - 10}" y="{bottom + 15}" text-anchor="end">{SPAN[1] - SPAN[0]:.0f} s</text>'
        f'<text x="{WIDTH - 95}" y="{top - 8}" text-anchor="end">age of what is seen:</text>'
        f'<text x="{WIDTH - 90}" y="{top - 8}" fill="#777">before</text>'
        f'<text x="{WIDTH - 40}" y="{top - 8}" fill="#1565c0">now</text>'
    )
    return axis + "".join(lines) + texts


if __name__ == "__main__":
    main()
