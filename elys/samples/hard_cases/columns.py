"""Scenes of plain columns (`rigid_cases`) as hard cases: a document for ELYS, the columns still there for its peers."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import PALETTE, Vector
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase
from elys.samples.hard_cases.scenery import fixture, scene, solid
from elys.samples.rigid_cases import BOX, SPHERE, STATIC, Measure, RigidCase, RigidScene, Trajectory

_SHAPES: Final = {BOX: "box", SPHERE: "sphere"}


def case_of_columns(
    case: RigidCase,
    *,
    answer: str,
    eye: Vector,
    target: Vector,
    picture_time: float,
) -> HardCase:
    """The hard case that a case of columns is, seen from `eye`."""

    def build(seed: int) -> SceneDocument:
        return document_of_columns(case.title, case.build(seed), eye=eye, target=target)

    return HardCase(
        name=case.name,
        title=case.title,
        difficulty=case.difficulty,
        answer=answer,
        build=build,
        duration=case.duration,
        measures=tuple(_measure(case, measure) for measure in case.measures),
        picture_time=picture_time,
        seeds=case.seeds,
        stride=case.stride,
        sleeping=False,
    )


def document_of_columns(title: str, columns: RigidScene, *, eye: Vector, target: Vector) -> SceneDocument:
    """A scene document in which row N of the columns is the entity `Body N + 1`. Boxes and spheres only."""
    rows = range(len(columns.bodies.motion))
    bodies = [_entity(columns, row) for row in rows]
    return scene(title, bodies, eye=eye, target=target, gravity=columns.gravity)


def _entity(columns: RigidScene, row: int) -> EntityNode:
    bodies = columns.bodies
    is_box = int(bodies.shape[row]) == BOX
    shape = _SHAPES[int(bodies.shape[row])]
    size = bodies.size[row] if is_box else np.full(3, 2.0 * bodies.radius[row])
    turn = bodies.rotation[row]
    surface: dict[str, Any] = {"friction": float(bodies.friction[row]), "restitution": float(bodies.restitution[row])}
    name = f"Body {row + 1}"
    if int(bodies.motion[row]) == STATIC:
        return fixture(name, shape=shape, size=size, position=bodies.position[row], rotation=turn, **surface)
    return solid(
        name,
        shape,
        size=size,
        position=bodies.position[row],
        rotation=turn,
        color=PALETTE[row % len(PALETTE)],
        **surface,
        mass=float(bodies.mass[row]),
        linear_velocity=bodies.linear_velocity[row],
        angular_velocity=bodies.angular_velocity[row],
    )


def _measure(case: RigidCase, measure: Measure) -> CaseMeasure:
    def of(run: CaseRun) -> float:
        columns = case.build(run.seed)
        order = [run.place(f"Body {row + 1}") for row in range(len(columns.bodies.motion))]
        motion = Trajectory(run.motion.time, *(column[:, order] for column in run.motion[1:]))
        return measure.of(columns, motion)

    return CaseMeasure(name=measure.name, unit=measure.unit, bound=measure.bound, of=of)
