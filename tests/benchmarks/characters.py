"""Characters: what a tick with a hundred of them costs, and how exactly they do what their sheets say.

python -m tests.benchmarks characters

A hundred walk, run, jump and turn about on a floor with walls, steps, slopes and crates. Time is processor time of the thread, so
that what else the machine does counts little.
"""

from __future__ import annotations

import math
import time

import numpy as np

from elys.common.components import Character, Collider, RigidBody, Transform
from elys.common.math import quaternion
from elys.sim_node.simulation import Simulation

COUNT = 100
TICKS = 600
TURN = 20  # ticks between two wishes
DT = 1.0 / 60.0
GRAVITY = 9.81
SKIN = 0.01  # [m]
Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    return [*speed(), *abilities()]


def crowd(count: int) -> tuple[Simulation, list[int]]:
    """A floor with things on it, and so many characters."""
    chance = np.random.default_rng(1)
    simulation = Simulation()
    world = simulation.world
    world.spawn([Transform(position=(0.0, -0.5, 0.0)), Collider(size=(80.0, 1.0, 80.0))])
    for x, z, size in ((40, 0, (1, 3, 80)), (-40, 0, (1, 3, 80)), (0, 40, (80, 3, 1)), (0, -40, (80, 3, 1))):
        world.spawn([Transform(position=(float(x), 1.5, float(z))), Collider(size=tuple(map(float, size)))])
    for _ in range(300):
        x, z = chance.uniform(-35.0, 35.0, 2)
        height = float(chance.choice((0.1, 0.2, 0.3, 1.0, 2.0)))
        turn = quaternion.from_axis_angle((0.0, 1.0, 0.0), float(chance.uniform(0.0, 3.0)))
        box = Collider(size=(float(chance.uniform(0.5, 3.0)), height, float(chance.uniform(0.5, 3.0))))
        world.spawn([Transform(position=(x, height / 2.0, z), rotation=tuple(turn.tolist())), box])
    for _ in range(60):
        x, z = chance.uniform(-35.0, 35.0, 2)
        world.spawn([Transform(position=(x, 3.0, z)), RigidBody(mass=20.0), Collider(size=(0.8, 0.8, 0.8))])
    side = math.ceil(math.sqrt(count))
    walkers = [
        world.spawn([Transform(position=(6.0 * (k % side) - 27.0, 3.0, 6.0 * (k // side) - 27.0)), Character()])
        for k in range(count)
    ]
    simulation.settle()
    return simulation, walkers


def speed() -> list[Row]:
    """What ticks cost with a hundred characters, and with none in the same place."""
    rows = []
    for count in (0, COUNT):
        simulation, walkers = crowd(count)
        chance = np.random.default_rng(2)
        ticks, stages = [], []
        for tick in range(TICKS):
            if tick % TURN == 0 and walkers:
                wish(simulation, walkers, chance)
            started = time.thread_time()
            simulation.step()
            ticks.append(1000.0 * (time.thread_time() - started))
            stages.append(simulation.stage_times["move_characters"])
        ticks, stages = ticks[60:], stages[60:]
        p50, p99 = np.percentile(ticks, (50, 99))
        rows.append((f"tick at 60 Hz, {count} characters, 360 bodies around, p50 / p99", f"{p50:.2f} / {p99:.2f} ms"))
    return rows


def wish(simulation: Simulation, walkers: list[int], chance: np.random.Generator) -> None:
    """Everybody wants something else, as scripts would write it."""
    table = simulation.world.table(Character)
    rows = table.rows(np.array(walkers, np.uint32))
    angles = chance.uniform(0.0, 2.0 * math.pi, len(rows))
    table.column("wish")[rows] = np.stack([np.cos(angles), np.zeros(len(rows)), np.sin(angles)], axis=1)
    table.column("wish_run")[rows] = chance.random(len(rows)) < 0.5
    table.column("wish_jump")[rows] = chance.random(len(rows)) < 0.3
    table.column("wish_crouch")[rows] = chance.random(len(rows)) < 0.1


# --- abilities


class Alone:
    """One character on a floor."""

    def __init__(self, at: tuple[float, float, float] = (0.0, SKIN, 0.0), **sheet: float) -> None:
        self.simulation = Simulation()
        self.world = self.simulation.world
        self.box((200.0, 1.0, 200.0), (0.0, -0.5, 0.0))
        self.one = self.world.spawn([Transform(position=at), Character(**sheet)])  # type: ignore[arg-type]

    def box(
        self, size: tuple[float, ...], place: tuple[float, ...], turn: float = 0.0, axis: int = 2, **body: object
    ) -> int:
        """A box, turned by an angle [rad] about an axis; with values of a RigidBody it moves."""
        around = [0.0, 0.0, 0.0]
        around[axis] = 1.0
        rotation = tuple(quaternion.from_axis_angle(around, turn).tolist())
        parts = [Transform(position=place, rotation=rotation), Collider(size=size)]  # type: ignore[arg-type]
        return self.world.spawn([*parts, RigidBody(motion="kinematic", **body)] if body else parts)  # type: ignore[arg-type]

    def ramp(self, degrees: float) -> None:
        """A slope up along x."""
        a = math.radians(degrees)
        self.box(
            (40.0, 1.0, 20.0), (20 * math.cos(a) + 0.5 * math.sin(a), 20 * math.sin(a) - 0.5 * math.cos(a), 0.0), a
        )

    def path(self, ticks: int, **wishes: object) -> np.ndarray:
        """Places (T, 3) at the ends of ticks."""
        self.simulation.settle()
        self.world.set_fields(self.one, Character, wishes)
        places = []
        for _ in range(ticks):
            self.simulation.step()
            places.append(self.world.transforms.world_pose(self.one)[0])
        return np.array(places)


AHEAD = (1.0, 0.0, 0.0)


def abilities() -> list[Row]:
    """What a character does, against what its sheet or a closed form says."""
    return [
        ("walking and running speed, worst error", f"{1e6 * speed_error():.2g} um/s"),
        ("jump of 0.3 to 7 m, worst error of the highest place", f"{1e9 * jump_error():.2g} nm"),
        ("highest step climbed, of 0.35 m allowed", f"{climbed_step():.3f} m"),
        ("steepest slope climbed, of 50 degrees allowed", f"{climbed_slope():.1f} degrees"),
        ("speed up a slope of 45 degrees, error", f"{1e6 * slope_error():.2g} um/s"),
        ("sliding down 60 degrees, error of the acceleration g sin 60", f"{100 * slide_error():.2g} %"),
        ("running into a V of 40 degrees for 2 s, trembling", f"{1e6 * trembling():.2g} um"),
        ("rough floor of unit boxes, highest bump", f"{1e6 * seam_bump():.2g} um"),
        ("ten turns on a disc, drift", f"{1e6 * disc_drift():.2g} um"),
        ("100 m/s at a fence of 2 mm, nearest of its surface", f"{1000 * fence_gap():.2f} mm"),
    ]


def speed_error() -> float:
    errors = []
    for runs, wanted in ((False, 3.0), (True, 6.0)):
        path = Alone().path(120, wish=AHEAD, wish_run=runs)
        errors.append(abs(path[-1, 0] - path[-61, 0] - wanted))
    return max(errors)


def jump_error() -> float:
    errors = []
    for height in (0.3, 0.7, 1.2, 2.5, 7.0):
        alone = Alone(jump_height=height)
        start = alone.path(5)[-1, 1]
        errors.append(abs(alone.path(240, wish_jump=True)[:, 1].max() - start - height))
    return max(errors)


def climbed_step() -> float:
    best = 0.0
    for millimetres in range(300, 400, 5):
        alone = Alone()
        alone.box((40.0, millimetres / 1000, 4.0), (21.0, millimetres / 2000, 0.0))
        if alone.path(120, wish=AHEAD)[-1, 1] > millimetres / 1000:
            best = millimetres / 1000
    return best


def climbed_slope() -> float:
    best = 0.0
    for tenths in range(480, 520, 2):
        alone = Alone(at=(-1.0, SKIN, 0.0))
        alone.ramp(tenths / 10)
        if alone.path(120, wish=AHEAD)[-1, 1] > 1.0:
            best = tenths / 10
    return best


def slope_error() -> float:
    alone = Alone(at=(-1.0, SKIN, 0.0))
    alone.ramp(45.0)
    path = alone.path(180, wish=AHEAD)
    return float(abs(np.linalg.norm(path[-1] - path[-61]) - 3.0))


def slide_error() -> float:
    a = math.radians(60.0)
    alone = Alone(at=(20.0 * math.cos(a), 20.0 * math.sin(a) + 0.5, 0.0))
    alone.ramp(60.0)
    path = alone.path(90)
    speeds = np.linalg.norm(np.diff(path, axis=0), axis=1) / DT
    return float(abs((speeds[-1] - speeds[-31]) / (30 * DT) / (GRAVITY * math.sin(a)) - 1.0))


def trembling() -> float:
    alone = Alone(at=(-3.0, SKIN, 0.1))
    a = math.radians(20.0)
    for side in (1.0, -1.0):
        middle = (-5 * math.cos(a) + 0.5 * math.sin(a), 2.0, side * (5 * math.sin(a) + 0.5 * math.cos(a)))
        alone.box((10.0, 4.0, 1.0), middle, side * a, axis=1)
    path = alone.path(300, wish=(1.0, 0.0, 0.1), wish_run=True)
    return float(np.ptp(path[-120:], axis=0).max())


def seam_bump() -> float:
    alone = Alone(at=(0.0, 1.0 + SKIN, 0.2))
    for x in range(-1, 30):
        for z in (-1, 0, 1, 2, 3):
            alone.box((1.0, 1.0, 1.0), (float(x), 0.5, float(z)))
    return float(np.ptp(alone.path(270, wish=(1.0, 0.0, 0.13))[30:, 1]))


def disc_drift() -> float:
    alone = Alone(at=(2.0, 1.0 + SKIN, 0.0))
    alone.box((8.0, 0.4, 8.0), (0.0, 0.8, 0.0), angular_velocity=(0.0, math.pi, 0.0))
    path = alone.path(1210)
    return float(np.linalg.norm(path[-1] - path[-1201]))


def fence_gap() -> float:
    alone = Alone(run_speed=100.0, acceleration=1e4)
    alone.box((0.002, 3.0, 20.0), (4.0, 1.5, 0.0))
    path = alone.path(120, wish=AHEAD, wish_run=True)
    return float(4.0 - 0.001 - 0.3 - path[:, 0].max())
