"""Streams over a laboratory's links, measured against what the simulation recorded of itself."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from elys.bus.recording import Recording
from elys.common.scene import SceneDocument, SceneSettings, write_scene
from elys.samples.entities import PALETTE, body, camera, group, sun
from elys.samples.hard_cases.scenery import fixture
from tests.network.laboratory import Laboratory, RelayedLink

PORT = 7447
WATCHER = Path(__file__).parent / "programs" / "stream_watcher.py"


def bouncing(count: int) -> SceneDocument:
    """Balls of restitution 1 in an open box: they never come to rest."""
    chance = np.random.default_rng(5)
    columns = int(np.ceil(np.sqrt(count)))
    half, wall = 0.9 * columns, {"friction": 0.3, "restitution": 1.0}
    balls = [
        body(
            f"Ball {number + 1}",
            "sphere",
            size=(0.5,) * 3,
            position=(
                1.8 * (number % columns) - half + 0.9,
                float(chance.uniform(0.6, 4.0)),
                1.8 * (number // columns) - half + 0.9,
            ),
            velocity=chance.normal(0.0, 1.5, 3).tolist(),
            color=PALETTE[number % len(PALETTE)],
            **wall,
        )
        for number in range(count)
    ]
    walls = [
        fixture("Floor", size=(2.0 * half + 20.0, 1.0, 2.0 * half + 20.0), position=(0.0, -0.5, 0.0), **wall),
        fixture("North", size=(2.0 * half + 2.0, 40.0, 1.0), position=(0.0, 20.0, -half - 0.5), **wall),
        fixture("South", size=(2.0 * half + 2.0, 40.0, 1.0), position=(0.0, 20.0, half + 0.5), **wall),
        fixture("West", size=(1.0, 40.0, 2.0 * half), position=(-half - 0.5, 20.0, 0.0), **wall),
        fixture("East", size=(1.0, 40.0, 2.0 * half), position=(half + 0.5, 20.0, 0.0), **wall),
    ]
    eye = (0.0, half, 2.5 * half)
    nodes = [sun(), camera(eye, (0.0, 0.0, 0.0)), group("Box", walls), group("Balls", balls)]
    return SceneDocument(name=f"{count} balls", settings=SceneSettings(), entities=nodes)


@dataclass
class Watched:
    """What a viewer saw."""

    states: np.ndarray  # [S, 6] came [s], published [s], tick, claimed [m], [rad], bodies
    ages: np.ndarray  # [A, 2] when [s], how old [s] the newest state was
    reports: np.ndarray  # [R, 10] when, age, rate, loss, round trip, step, waiting, restarts, lanes, allowed
    errors: np.ndarray  # [K, 4] of those kept whole: off by [m], [rad], and what was claimed
    bytes_per_second: float  # that went over the link to the viewer, everything included
    ticks: list[float]  # [ms] lateness of the simulation's ticks is in its report
    directory: Path

    def ages_between(self, start: float, end: float) -> np.ndarray:
        """[s] of the moments from `start` to `end` [s] after the first state."""
        first = self.states[0, 0]
        rows = (self.ages[:, 0] >= first + start) & (self.ages[:, 0] < first + end)
        return self.ages[rows, 1]


def watch(
    lab: Laboratory,
    directory: Path,
    *,
    bodies: int = 1000,
    seconds: float = 15.0,
    during: Callable[[RelayedLink], None] = lambda _: None,
    variables: dict[str, str] | None = None,
    **conditions: float,
) -> Watched:
    """A simulation at one end of a link, a viewer at the other, for `seconds` after its first state; `during` may spoil
    the link."""
    server, laptop = lab.machines("server", "laptop")
    link = lab.link(server, laptop, **conditions)
    scene, recording, output = (directory / name for name in ("balls.scene.json", "exact.mcap", "seen.npz"))
    write_scene(bouncing(bodies), scene)
    words = (
        "--headless",
        "--realtime",
        "--listen",
        f"tcp/0.0.0.0:{PORT}",
        "--record",
        recording,
        "--keep",
        "0",
        "--no-guard",
    )
    keys = {"ELYS_CONFIG_DIR": str(directory / "config")}
    simulation = server.start("run", scene, *words, **keys)
    simulation.wait_for("first tick", seconds=120.0)
    endpoint = f"tcp/{link.address_of(server)}:{PORT}"
    shown = ("env", f"ELYS_CONFIG_DIR={directory / 'config'}", sys.executable, "-m", "elys", "keys", "show", "viewer")
    secret = server.run(shown).strip().splitlines()[-1]
    environment = {"ELYS_SECRET": secret, "ELYS_CONFIG_DIR": str(directory / "nobody"), **(variables or {})}
    viewer = laptop.start_program(WATCHER, endpoint, str(seconds), output, **environment)
    viewer.wait_for("shown", seconds=60.0)
    before = link.passed(laptop)
    during(link)
    viewer.wait_for("saved", seconds=seconds + 60.0)
    passed = link.passed(laptop)
    simulation.end()
    seen = np.load(output)
    errors = _errors(seen, recording)
    carried = (passed.bytes - before.bytes) / seconds
    return Watched(seen["states"], seen["ages"], seen["reports"], errors, carried, [], directory)


def _errors(seen: np.lib.npyio.NpzFile, path: Path) -> np.ndarray:
    """How far what was shown is from the recording, by scipy, and what was claimed of it."""
    found = []
    states = seen["states"]
    with Recording(path) as recording:
        place = {int(tick): position for position, tick in enumerate(recording.tick)}
        for index, tick in enumerate(seen["kept_tick"]):
            if int(tick) not in place:
                continue  # the end of the recording was cut off
            truth = recording.frame(place[int(tick)])
            rows = {int(entity): row for row, entity in enumerate(truth.entity)}
            order = [rows[int(entity)] for entity in seen[f"e_{index}"]]
            off = np.linalg.norm(seen[f"p_{index}"] - truth.position[order], axis=1)
            turned = Rotation.from_quat(seen[f"q_{index}"].astype(float)).inv()
            turned = (turned * Rotation.from_quat(truth.rotation[order].astype(float))).magnitude()
            claimed = states[index * 10, 3:5]
            found.append((off.max(), turned.max(), *claimed, np.median(off), np.percentile(off, 95)))
    return np.array(found)
