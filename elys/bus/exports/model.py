"""A recording as one .glb: the scene as a tree of nodes, and its motion as an animation that other programs play.

Blender and three.js open it. Time 0 is the first frame taken. Who comes or goes meanwhile has a scale of 0 while it is not there.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import elys
from elys.bus.exports.files import whole_file
from elys.bus.exports.model_motion import Animation, Floats, PoseSamples, place
from elys.bus.exports.model_nodes import ModelNodes, extras_of, is_seen
from elys.bus.exports.selection import (
    EVERYTHING,
    NamedEntities,
    Progress,
    Selection,
    no_progress,
    selected_positions,
    selected_scenes,
)
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror, WorldPose
from elys.bus.recording import Recording
from elys.common.assets.gltf_writing import GltfModel
from elys.common.errors import AssetError, RecordingError

_LONGEST = 1e6  # [s] of an animation, whose times are float32: beyond it ticks would fall together
_NOWHERE = (0.0, 0.0, 0.0)


class ModelReport(NamedTuple):
    """What a model has."""

    nodes: int
    channels: int
    samples: int
    duration: float  # [s]


def export_glb(
    source: Path, target: Path, selection: Selection = EVERYTHING, progress: Progress = no_progress
) -> ModelReport:
    """Writes a .glb with the scene and its motion.

    Raises:
        RecordingError: the source is no recording, holds nothing of what is selected or more than a model can, or the target
            cannot be written.
    """
    with Recording(source, checked=True) as recording, whole_file(target) as part:
        positions = selected_positions(recording, selection)
        duration = float(recording.time[positions[-1]] - recording.time[positions[0]])
        if duration > _LONGEST:
            raise RecordingError(f"{source} says that it is {duration:g} s long, more than a model can tell")
        model = GltfModel(f"elys {elys.__version__}")
        named = NamedEntities(selection)
        motion = _Motion(ModelNodes(model, recording.asset), len(positions))
        try:
            for sample, (mirror, frame, changed) in enumerate(selected_scenes(recording, positions, progress)):
                if changed or not sample:
                    named.look(mirror)
                    motion.follow_scene(sample, mirror, named.chosen)
                if not sample:
                    model.document["asset"]["extras"] = extras_of(mirror)
                motion.follow_frame(sample, mirror, frame)
            named.check(source)
            animation = Animation(model, recording.path.stem, recording.time[positions])
            motion.write(animation)
            channels = animation.finish()
            with part.open("wb") as file:
                model.write(file)
        except (AssetError, MemoryError) as error:
            raise RecordingError(f"{source} does not fit into a model: {error}") from error
        return ModelReport(len(motion.nodes.node_of), channels, len(positions), duration)


class _Motion:
    """What is sampled of every node, and what is seldom changed."""

    def __init__(self, nodes: ModelNodes, sample_count: int) -> None:
        self.nodes = nodes
        self._bodies = PoseSamples(sample_count, 7)
        self._animated = PoseSamples(sample_count, 10)
        self._weights: dict[int, Floats] = {}
        self._sample_count = sample_count
        self._resting: dict[int, list[tuple[int, WorldPose]]] = {}
        self._rows: tuple[bytes, list[int], list[int]] = (
            b"",
            [],
            [],
        )  # of the bodies: all that are nodes, those below others

    def follow_scene(self, sample: int, mirror: SceneMirror, chosen: set[int] | None) -> None:
        """Takes a scene that has changed: new nodes, and who is elsewhere by an edit, or gone."""
        self.nodes.follow(mirror, chosen)
        self._rows = (b"", [], [])
        for entity in self.nodes.node_of:
            changes = self._resting.setdefault(entity, [])
            if is_seen(mirror, entity):
                now = self.nodes.local_pose(mirror, entity)
            elif changes:
                now = changes[-1][1]._replace(scale=_NOWHERE)
            else:
                now = self.nodes.local_pose(mirror, entity)._replace(scale=_NOWHERE)
            if not changes and sample:  # it was not there before
                changes.append((0, now._replace(scale=_NOWHERE)))
            if not changes or changes[-1][1] != now:
                changes.append((sample, now))

    def follow_frame(self, sample: int, mirror: SceneMirror, frame: StateFrame) -> None:
        """Takes where bodies are, and what is animated."""
        rows, below = self._rows_of(mirror, frame)
        position, rotation = frame.position[rows].astype(np.float64), frame.rotation[rows]
        if below:
            position, rotation = position.copy(), rotation.copy()
            for place_in_rows in below:
                pose = self.nodes.local_pose(mirror, int(frame.entity[rows[place_in_rows]]))
                position[place_in_rows], rotation[place_in_rows] = pose.position, pose.rotation
        self._bodies.put(sample, frame.entity[rows], position, rotation)
        if len(frame.local_entity):
            moved = np.flatnonzero([e in self.nodes.node_of for e in frame.local_entity.tolist()])
            columns = (frame.local_position[moved], frame.local_rotation[moved], frame.local_scale[moved])
            self._animated.put(sample, frame.local_entity[moved], *columns)
        for entity, number, weight in zip(
            frame.weight_entity.tolist(), frame.weight_target.tolist(), frame.weight.tolist(), strict=True
        ):
            self._morph(sample, entity, number, weight)

    def write(self, animation: Animation) -> None:
        """Makes channels of all that moved, and says in the nodes where they are at first."""
        for entity, number in self.nodes.node_of.items():
            node, changes = self.nodes.node(entity), self._resting[entity]
            samples = self._animated.of(entity)
            if samples is None:
                samples = self._bodies.of(entity)
            if samples is not None:
                animation.move(node, number, samples)
            else:
                for path, field in (("translation", "position"), ("rotation", "rotation")):
                    values = [(sample, getattr(pose, field)) for sample, pose in changes]
                    place(node, path, values[0][1])
                    animation.switch(number, path, _distinct(values))
            if samples is None or samples.shape[1] == 7:
                scales = [(sample, pose.scale) for sample, pose in changes]
                place(node, "scale", scales[0][1])
                animation.switch(number, "scale", _distinct(scales))
            if entity in self._weights:
                animation.morph(number, self._weights[entity])

    def _rows_of(self, mirror: SceneMirror, frame: StateFrame) -> tuple[list[int], list[int]]:
        key = frame.entity.tobytes()
        if self._rows[0] != key or not key:
            bodies = frame.entity.tolist()
            rows = [row for row, body in enumerate(bodies) if body in self.nodes.node_of and body in mirror.entities]
            below = [at for at, row in enumerate(rows) if mirror.entities[bodies[row]].parent]
            self._rows = key, rows, below
        return self._rows[1], self._rows[2]

    def _morph(self, sample: int, entity: int, number: int, weight: float) -> None:
        count = self.nodes.target_counts.get(entity, 0)
        if number >= count:
            return
        if entity not in self._weights:
            self._weights[entity] = np.zeros((self._sample_count, count), np.float32)
        self._weights[entity][sample:, number] = weight


def _distinct(changes: Sequence[tuple[int, tuple[float, ...]]]) -> list[tuple[int, tuple[float, ...]]]:
    """Without those that change nothing."""
    return [change for index, change in enumerate(changes) if not index or change[1] != changes[index - 1][1]]
