"""A recorded frame against the simulation as it is: the first value that differs, in the words of components."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.sim_node.simulation import Simulation

# By column of the frame: component and field that it shows, and the column of the entities that its rows are of.
SHOWN: Final[Mapping[str, tuple[str, str, str]]] = {
    "position": ("Transform", "position (world)", "entity"),
    "rotation": ("Transform", "rotation (world)", "entity"),
    "linear_velocity": ("RigidBody", "linear_velocity", "entity"),
    "angular_velocity": ("RigidBody", "angular_velocity", "entity"),
    "local_position": ("Transform", "position", "local_entity"),
    "local_rotation": ("Transform", "rotation", "local_entity"),
    "local_scale": ("Transform", "scale", "local_entity"),
    "weight": ("Mesh", "weight of a morph target", "weight_entity"),
}
_ROWS: Final = ("entity", "local_entity", "weight_entity", "weight_target")


class Difference(msgspec.Struct, frozen=True, kw_only=True):
    """Where a recording and its run part for the first time."""

    tick: int
    time: float  # [s]
    text: str  # what, in a sentence
    entity: int = 0
    name: str = ""
    component: str = ""
    field: str = ""
    recorded: Any = None
    computed: Any = None
    difference: float = 0.0
    missing_command: int = 0  # number of a command that is not in the file


def compared(frame: StateFrame, simulation: Simulation, bounds: Mapping[str, float]) -> Difference | None:
    """What differs by more than `bounds` (by column, in its unit; of rotations [rad]); to the bit where there is none."""
    here = _columns_of(simulation)
    for rows in _ROWS:
        theirs, ours = getattr(frame, rows), here[rows]
        if not np.array_equal(theirs, ours):
            return _other_rows(frame, simulation, theirs, ours)
    for column, (_, _, rows) in SHOWN.items():
        theirs, ours = getattr(frame, column), here[column]
        bad = _differing(column, theirs, ours, bounds.get(column, 0.0))
        if bad.any():
            # The one that is farthest off is the likeliest to have moved the others.
            amounts = [difference_of(column, theirs[row], ours[row]) for row in np.flatnonzero(bad)]
            row = int(np.flatnonzero(bad)[int(np.nanargmax([*amounts, -1.0])) % len(amounts)])
            return _of_row(frame, simulation, column, int(here[rows][row]), theirs[row], ours[row])
    return None


def of_hash(frame: StateFrame, simulation: Simulation) -> Difference:
    """Nothing that is shown differs, but the hash of the state does."""
    computed = simulation.state_hash()
    return Difference(
        tick=frame.tick,
        time=frame.simulation_time,
        text=(
            f"tick {frame.tick} ({frame.simulation_time:.3f} s): the state's hash is {frame.state_hash:016x} in the recording "
            f"and {computed:016x} when run again, though all that is recorded of bodies is equal"
        ),
        recorded=f"{frame.state_hash:016x}",
        computed=f"{computed:016x}",
    )


def _columns_of(simulation: Simulation) -> dict[str, NDArray[Any]]:
    bodies = simulation.moving_bodies()
    return {
        **{name: getattr(bodies, name) for name in ("entity", "position", "rotation")},
        **{name: getattr(bodies, name) for name in ("linear_velocity", "angular_velocity")},
        **simulation.animated()._asdict(),
    }


def _differing(column: str, theirs: NDArray[Any], ours: NDArray[Any], bound: float) -> NDArray[np.bool_]:
    """[rows] which rows differ by more than a bound."""
    count = len(theirs)
    if not count:
        return np.zeros(0, np.bool_)
    theirs = np.ascontiguousarray(theirs).reshape(count, -1)
    ours = np.ascontiguousarray(ours).astype(theirs.dtype, copy=False).reshape(count, -1)
    bits = np.dtype(f"u{theirs.dtype.itemsize}")
    differs: NDArray[np.bool_] = (theirs.view(bits) != ours.view(bits)).any(axis=1)
    if bound > 0.0 and differs.any():
        amounts = np.array([difference_of(column, a, b) for a, b in zip(theirs[differs], ours[differs], strict=True)])
        differs[differs] = ~(amounts <= bound)
    return differs


def difference_of(column: str, a: NDArray[Any], b: NDArray[Any]) -> float:
    """How far two values of a column are apart, in its unit; of rotations the angle between them [rad]."""
    a, b = np.atleast_1d(a).astype(np.float64), np.atleast_1d(b).astype(np.float64)
    if column.endswith("rotation"):
        # atan2 of the quaternion between them: exact for small angles, where the arc cosine is not.
        scalar = abs(float(a @ b))
        vector = a[3] * b[:3] - b[3] * a[:3] - np.cross(a[:3], b[:3])
        return float(2.0 * np.arctan2(np.linalg.norm(vector), scalar))
    return float(np.linalg.norm(a - b))


def _of_row(
    frame: StateFrame, simulation: Simulation, column: str, entity: int, theirs: NDArray[Any], ours: NDArray[Any]
) -> Difference:
    component, field, _ = SHOWN[column]
    amount = difference_of(column, theirs, ours)
    unit = " rad" if column.endswith("rotation") else ""
    named = simulation.named(entity)
    return Difference(
        tick=frame.tick,
        time=frame.simulation_time,
        text=(
            f"tick {frame.tick} ({frame.simulation_time:.3f} s): {component}.{field} of {named} is {_text(theirs)} in the "
            f"recording and {_text(ours)} when run again, {amount:.3g}{unit} apart"
        ),
        entity=entity,
        name=named,
        component=component,
        field=field,
        recorded=np.atleast_1d(theirs).tolist(),
        computed=np.atleast_1d(ours).tolist(),
        difference=amount,
    )


def _other_rows(frame: StateFrame, simulation: Simulation, theirs: NDArray[Any], ours: NDArray[Any]) -> Difference:
    """The frame tells of other entities than there are."""
    only_there, only_here = sorted({*theirs.tolist()} - {*ours.tolist()}), sorted({*ours.tolist()} - {*theirs.tolist()})
    if only_there:
        entity, text = only_there[0], f"entity {only_there[0]} moves in the recording and is not there when run again"
    elif only_here:
        entity = only_here[0]
        text = f"{simulation.named(entity)} moves when run again and is not in the recording"
    else:
        entity, text = 0, "bodies stand in another order in the recording than when run again"
    return Difference(
        tick=frame.tick,
        time=frame.simulation_time,
        text=f"tick {frame.tick} ({frame.simulation_time:.3f} s): {text}",
        entity=entity,
        name=simulation.named(entity) if entity else "",
    )


def _text(value: NDArray[Any]) -> str:
    numbers = [np.format_float_positional(number, trim="-") for number in np.atleast_1d(value)]
    return numbers[0] if len(numbers) == 1 else f"({', '.join(numbers)})"
