"""How the nodes of a model move: sampled from frames into arrays, and from there into the channels of a glTF animation."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.gltf_writing import GltfModel
from elys.common.errors import RecordingError

MAX_SAMPLES: Final = 2 << 30  # [bytes] of poses held at once
_FARTHEST: Final = 1e30  # what a file of nonsense says beyond it would be no number in a model
POSE: Final = ("translation", "rotation", "scale")
_PARTS: Final = {"translation": slice(0, 3), "rotation": slice(3, 7), "scale": slice(7, 10)}

Floats = NDArray[np.float32]


class PoseSamples:
    """Poses of entities at S instants, room for more entities made as they come.

    `width` is 7 for a position and a rotation, 10 with a scale as well. NaN where nobody was told of.
    """

    def __init__(self, sample_count: int, width: int) -> None:
        self.row_of: dict[int, int] = {}
        self._values = np.full((0, sample_count, width), np.nan, np.float32)
        self._told: tuple[bytes, NDArray[np.intp]] = (b"", np.zeros(0, np.intp))

    def put(self, sample: int, entities: NDArray[np.uint32], *columns: NDArray[Any]) -> None:
        """Takes where entities [N] are at an instant: columns [N, 3], [N, 4] (and [N, 3])."""
        if not len(entities):
            return
        rows = self._rows(entities)
        first = 0
        for column in columns:
            self._values[rows, sample, first : first + column.shape[1]] = np.clip(column, -_FARTHEST, _FARTHEST)
            first += column.shape[1]

    def of(self, entity: int) -> Floats | None:
        """[S, width] of one entity, before its first and after its last instant as then; None if it was never told of."""
        row = self.row_of.get(entity)
        return None if row is None else _filled(self._values[row])

    def _rows(self, entities: NDArray[np.uint32]) -> NDArray[np.intp]:
        key = entities.tobytes()
        if key != self._told[0]:
            rows = [self.row_of.setdefault(entity, len(self.row_of)) for entity in entities.tolist()]
            self._told = key, np.array(rows, np.intp)
            if len(self.row_of) > len(self._values):
                self._grow(max(len(self.row_of), 2 * len(self._values)))
        return self._told[1]

    def _grow(self, count: int) -> None:
        _, samples, width = self._values.shape
        if 4 * count * samples * width > MAX_SAMPLES:
            raise RecordingError(
                f"{samples} samples of {len(self.row_of)} moving entities do not fit into a model: take fewer with --rate, "
                "--from and --to, or --entities"
            )
        values = np.full((count, samples, width), np.nan, np.float32)
        values[: len(self._values)] = self._values
        self._values = values


class Animation:
    """One glTF animation, channel by channel; times [S] in s."""

    def __init__(self, model: GltfModel, name: str, times: NDArray[np.float64]) -> None:
        self._model = model
        self._times = np.asarray(times - times[0], np.float32)
        self._inputs: dict[bytes, int] = {}
        self._outputs: dict[bytes, int] = {}
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        self._name = name

    def finish(self) -> int:
        """Adds the animation to the model, if anything moves; returns how many channels it has."""
        if self._channels:
            self._model.add("animations", {"name": self._name, "channels": self._channels, "samplers": self._samplers})
        return len(self._channels)

    def move(self, node: dict[str, Any], number: int, samples: Floats) -> None:
        """A node's pose [S, 7 or 10]: what stays is said by the node, what moves by a channel."""
        for path in POSE[: 2 if samples.shape[1] == 7 else 3]:
            values = samples[:, _PARTS[path]]
            if path == "rotation":
                values = _continuous(values)
            place(node, path, values[0])
            self._add(number, path, values, "LINEAR")

    def switch(self, number: int, path: str, changes: list[tuple[int, tuple[float, ...]]]) -> None:
        """What holds from some samples on, each until the next."""
        if len(changes) > 1 and len(self._times) > 1:
            keys = np.array([sample for sample, _ in changes], np.intp)
            self._channel(number, path, keys, np.array([value for _, value in changes], np.float32), "STEP")

    def morph(self, number: int, weights: Floats) -> None:
        """Weights [S, targets] of a node's mesh."""
        self._add(number, "weights", weights, "LINEAR")

    def _add(self, number: int, path: str, values: Floats, interpolation: str) -> None:
        keys = _needed(values)
        if len(keys) > 1:
            self._channel(number, path, keys, values[keys], interpolation)

    def _channel(self, number: int, path: str, keys: NDArray[np.intp], values: Floats, interpolation: str) -> None:
        times = self._times[keys]
        sampler = {
            "input": self._shared(self._inputs, times, has_bounds=True),
            "output": self._shared(self._outputs, values.reshape(-1) if path == "weights" else values),
            "interpolation": interpolation,
        }
        self._samplers.append(sampler)
        self._channels.append({"sampler": len(self._samplers) - 1, "target": {"node": number, "path": path}})

    def _shared(self, known: dict[bytes, int], array: Floats, *, has_bounds: bool = False) -> int:
        key = array.tobytes() + bytes((array.ndim,))
        if key not in known:
            known[key] = self._model.accessor(array, has_bounds=has_bounds)
        return known[key]


def place(node: dict[str, Any], path: str, value: Floats | tuple[float, ...]) -> None:
    """Says in a node where it is, unless that is where nodes are anyway."""
    numbers = [min(max(float(number), -_FARTHEST), _FARTHEST) for number in value]
    if numbers != {"translation": [0.0] * 3, "rotation": [0.0, 0.0, 0.0, 1.0], "scale": [1.0] * 3}[path]:
        node[path] = numbers


def _needed(values: Floats) -> NDArray[np.intp]:
    """The samples [K] between which all others lie: of what does not change the first and the last. One where nothing changes."""
    same = (values[1:] == values[:-1]).all(axis=1)
    if same.all():
        return np.zeros(1, np.intp)
    inner = ~(np.append(False, same) & np.append(same, False))
    inner[[0, -1]] = True
    return np.flatnonzero(inner)


def _filled(values: Floats) -> Floats:
    """Without NaN: each from the one before, those at the beginning from the first."""
    known = ~np.isnan(values[:, 0])
    before = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    return np.asarray(values[np.where(before < 0, int(np.argmax(known)), before)])


def _continuous(rotations: Floats) -> Floats:
    """Unit quaternions [S, 4], of the two that mean the same turn each the one nearer to the one before."""
    length = np.linalg.norm(rotations.astype(np.float64), axis=1, keepdims=True)
    units = np.where(length > 0, rotations / np.where(length > 0, length, 1), np.array((0, 0, 0, 1), np.float32))
    turns_over = np.append(1.0, np.where((units[1:] * units[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    return np.asarray(units * np.cumprod(turns_over)[:, None], np.float32)
