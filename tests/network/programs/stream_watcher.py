"""A viewer without a picture behind a network: what states came when, what was said of them, and some of them whole.

    python stream_watcher.py ENDPOINT SECONDS OUTPUT.npz

It says `watching` when it has joined and `shown` with the first state; clocks are the machine's, which all machines of a
laboratory share, so that ages need no estimate. OUTPUT holds of each state `came` and `published` [s], `tick`, `claimed` [m]
and [rad], `is_streamed`; of one in ten its bodies; and every 5 ms how old the newest was.
"""

from __future__ import annotations

import asyncio
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from elys.bus import topics
from elys.bus.discovery import join_session
from elys.bus.messages.state_frame import StateFrame

KEPT = 10  # one in so many is kept whole


class Watch:
    """Everything that came."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []
        self.kept: list[StateFrame] = []
        self.ages: list[tuple[float, float]] = []
        self.reports: list[tuple[float, ...]] = []

    def heard(self, frame: StateFrame, report: Any) -> None:
        claim = (np.inf, np.inf) if report is None else (report.position_error, report.rotation_error)
        if not self.rows:
            print("shown", flush=True)
        self.rows.append((time.time(), frame.published_at * 1e-9, frame.tick, *claim, len(frame.entity)))
        if len(self.rows) % KEPT == 1:
            self.kept.append(frame)

    def look(self, report: Any) -> None:
        now = time.time()
        if self.rows:
            self.ages.append((now, now - self.rows[-1][1]))
        if report is not None and len(self.ages) % 40 == 0:
            figures = (report.age, report.rate, report.loss, report.round_trip, report.step, report.waiting)
            self.reports.append((now, *figures, report.restarts, report.lanes, report.allowed))

    def save(self, path: Path) -> None:
        bodies = [
            (index, frame.tick, frame.position, frame.rotation, frame.entity) for index, frame in enumerate(self.kept)
        ]
        np.savez(
            path,
            states=np.array(self.rows),
            ages=np.array(self.ages),
            reports=np.array(self.reports),
            kept_tick=np.array([tick for _, tick, *_ in bodies]),
            **{f"{name}_{row[0]}": row[2 + place] for row in bodies for place, name in enumerate(("p", "q", "e"))},
        )


async def main(endpoint: str, seconds: float, path: Path) -> None:
    session = await join_session(endpoint, kind="tool", timeout=30.0)
    watch = Watch()

    def report() -> Any:
        return None if session.states is None else session.states.report()

    session.subscribe(topics.STATE, lambda frame, _: watch.heard(frame, report()))
    print("watching", flush=True)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        await asyncio.sleep(0.005)
        watch.look(report())
    watch.save(path)
    print("saved", flush=True)
    await session.close()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], float(sys.argv[2]), Path(sys.argv[3])))
