"""Bodies that should stay where they are: stacks, heavy on light, pyramids, far from the origin."""

from __future__ import annotations

from functools import partial
from typing import Any, Final

import numpy as np

from elys.samples.rigid_cases.case import Measure, RigidCase, Trajectory
from elys.samples.rigid_cases.overlap import deepest_overlap
from elys.samples.rigid_cases.scene import DYNAMIC, Bodies, RigidScene, bodies, ground, joined

Array = np.ndarray[Any, Any]

OFFSET: Final = 0.002  # [m] how far cubes of a stack start from its middle, at most
FAR: Final = 1e4  # [m]
VERY_FAR: Final = 1e5  # [m]
_FALLEN: Final = 0.25  # [m] a cube that went so far has left its place

# ---------------------------------------------------------------- measures


def overlap(scene: RigidScene, trajectory: Trajectory) -> float:
    """The deepest overlap of any pair at any recorded moment of the final second [mm]."""
    last = trajectory.final(1.0)
    moments = zip(last.position, last.rotation, strict=True)
    return 1000.0 * max(deepest_overlap(scene.bodies, position, rotation) for position, rotation in moments)


def drift(scene: RigidScene, trajectory: Trajectory) -> float:
    """The farthest that any dynamic body was horizontally from its start, at any moment [mm]."""
    away = _moved(scene, trajectory)[:, :, [0, 2]]
    return 1000.0 * float(np.linalg.norm(away, axis=2).max())


def sink(scene: RigidScene, trajectory: Trajectory) -> float:
    """How far the last body, which is the top, ended below its start [mm]."""
    return -1000.0 * float(_moved(scene, trajectory)[-1, -1, 1])


def fallen(scene: RigidScene, trajectory: Trajectory) -> float:
    """How many dynamic bodies ended away from their places."""
    return float((np.linalg.norm(_moved(scene, trajectory)[-1], axis=1) > _FALLEN).sum())


def overlap_standing(scene: RigidScene, trajectory: Trajectory) -> float:
    """`overlap` of what still stands; infinity if a body fell, for what lies on the ground overlaps little."""
    return float("inf") if fallen(scene, trajectory) else overlap(scene, trajectory)


def _moved(scene: RigidScene, trajectory: Trajectory) -> Array:
    """(T, D, 3) of the dynamic bodies."""
    chosen = scene.bodies.motion == DYNAMIC
    return np.asarray(trajectory.position[:, chosen] - trajectory.position[0, chosen])


def _far_against_near(measure: Any, floor: float, scene: RigidScene, trajectory: Trajectory) -> float:
    """An error of the far stack over that of the same stack at the origin; either counts as `floor` [mm] at least."""
    far = scene.bodies.position[:, 0] > 0.5 * FAR
    errors = []
    for part in (far, ~far):
        own = RigidScene(Bodies(*(column[part] for column in scene.bodies)), scene.gravity)
        columns = (column[:, part] for column in trajectory[1:])
        errors.append(max(measure(own, Trajectory(trajectory.time, *columns)), floor))
    return float(errors[0] / errors[1])


# ---------------------------------------------------------------- scenes


def tower(count: int, seed: int, *, x: float = 0.0) -> Bodies:
    """`count` cubes of 1 m, one on the other, each off the middle by up to OFFSET."""
    position = np.zeros((count, 3))
    position[:, 1] = np.arange(count) + 0.5
    position[:, [0, 2]] = np.random.default_rng(seed).uniform(-OFFSET, OFFSET, (count, 2))
    position[:, 0] += x
    return bodies(position)


def _stack(count: int, seed: int) -> RigidScene:
    return RigidScene(joined(ground(), tower(count, seed)))


def _far_stack(distance: float, seed: int) -> RigidScene:
    near, far = joined(ground(), tower(10, seed)), joined(ground(x=distance), tower(10, seed, x=distance))
    return RigidScene(joined(near, far))


def _far_case(name: str, distance: float, steps: str) -> RigidCase:
    return RigidCase(
        name=name,
        title=f"stack of 10 at {distance / 1000:.0f} km against the same at the origin, 10 s",
        difficulty=f"single precision has steps of {steps} there",
        build=partial(_far_stack, distance),
        duration=10.0,
        measures=(
            Measure(name="drift ratio", unit="1", bound=2.0, of=partial(_far_against_near, drift, 0.05)),
            Measure(name="overlap ratio", unit="1", bound=2.0, of=partial(_far_against_near, overlap, 0.05)),
        ),
    )


def _heavy_on_light(ratio: float, seed: int) -> RigidScene:
    return RigidScene(joined(ground(), bodies([[0, 0.5, 0], [0, 1.5, 0]], mass=[1.0, ratio])))


def pyramid(base: int) -> RigidScene:
    """Rows of cubes of 1 m that touch, each row one shorter than that below; the last body is the top."""
    position = [
        [column + 0.5 * row - 0.5 * (base - 1), row + 0.5, 0.0] for row in range(base) for column in range(base - row)
    ]
    return RigidScene(joined(ground(), bodies(position)))


def _overlap_under(bound: float) -> Measure:
    return Measure(name="overlap", unit="mm", bound=bound, of=overlap_standing)


def _drift_under(bound: float) -> Measure:
    return Measure(name="drift", unit="mm", bound=bound, of=drift)


NONE_FALLEN: Final = Measure(name="fallen", unit="cubes", bound=0, of=fallen)

STANDING_CASES: Final = (
    RigidCase(
        name="stack-10",
        title="stack of 10, offsets of 2 mm, 20 s",
        difficulty="soft contacts let it lean, the lowest carries ten",
        build=partial(_stack, 10),
        duration=20.0,
        measures=(_drift_under(0.5), _overlap_under(1.0)),
        seeds=(0, 1, 2),
    ),
    RigidCase(
        name="stack-30",
        title="stack of 30, offsets of 2 mm, 20 s",
        difficulty="a soft column of this height buckles under its own weight",
        build=partial(_stack, 30),
        duration=20.0,
        measures=(NONE_FALLEN, _overlap_under(2.0)),
        seeds=(0, 1, 2, 3, 4),
    ),
    RigidCase(
        name="ratio-100",
        title="100 kg cube on a 1 kg cube, 10 s",
        difficulty="iterations pass on little of the weight",
        build=partial(_heavy_on_light, 100.0),
        duration=10.0,
        measures=(_overlap_under(1.0),),
    ),
    RigidCase(
        name="ratio-1000",
        title="1000 kg cube on a 1 kg cube, 10 s",
        difficulty="iterations pass on next to nothing of the weight",
        build=partial(_heavy_on_light, 1000.0),
        duration=10.0,
        measures=(NONE_FALLEN, _overlap_under(2.0)),
    ),
    RigidCase(
        name="pyramid-20",
        title="pyramid of base 20, 20 s",
        difficulty="weight spreads sideways through cubes that also touch their neighbours",
        build=lambda seed: pyramid(20),
        duration=20.0,
        measures=(Measure(name="top sinks", unit="mm", bound=5.0, of=sink), _drift_under(5.0)),
        stride=6,
    ),
    RigidCase(
        name="pyramid-40-stands",
        title="pyramid of base 40, 5 s",
        difficulty="820 cubes of which the lowest rows are squeezed out where contacts are too soft, or too stiff",
        build=lambda seed: pyramid(40),
        duration=5.0,
        measures=(NONE_FALLEN,),
        stride=30,
    ),
    _far_case("stack-far", FAR, "1 mm"),
    _far_case("stack-100-km", VERY_FAR, "8 mm"),
)
