"""The sound of a film: mixed in the time of its pictures, the same each time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.session import Event
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.components import Vec3
from elys.render_node.render_world import RenderWorld
from elys.render_node.sound.hearing import ears_of
from elys.render_node.sound.library import SoundLibrary
from elys.render_node.sound.mixer import QUANTUM, RATE, Mixer
from elys.render_node.sound.stage import SoundStage

Heard = deque[tuple[float, Event]]
STEREO: Final = 2


class FilmSound:
    """Mixes what is heard between two pictures; events are taken from `heard` as their time [s] comes."""

    def __init__(self, mirror: SceneMirror, fetch: Callable[[str], bytes], heard: Heard) -> None:
        self._library = SoundLibrary(fetch)
        self._mixer = Mixer()
        self._stage = SoundStage(self._mixer, self._library.settle, mirror=mirror)
        self._mirror, self._heard = mirror, heard
        self._start: float | None = None
        self._count = -QUANTUM  # samples that were given out: the mixer's are late by a quantum

    def until(self, moment: float, camera: ViewCamera, world: RenderWorld) -> NDArray[np.float32]:
        """What is heard since the last call, up to a simulation time [s], by who looks through a camera: (N, 2) at 48 kHz."""
        self._start = moment if self._start is None else self._start
        place_of = places_in(world, self._mirror)
        pieces = [np.zeros((0, STEREO), np.float32)]
        while self._heard and self._heard[0][0] <= moment + 1e-9:
            time, event = self._heard.popleft()
            pieces.append(self._mixed(time))
            self._stage.hear(event)
        self._stage.place(ears_of(camera), place_of)
        pieces.append(self._mixed(moment))
        return np.concatenate(pieces)

    def close(self) -> None:
        """Ends its threads."""
        self._library.close()

    def _mixed(self, moment: float) -> NDArray[np.float32]:
        assert self._start is not None
        wanted = round((moment - self._start) * RATE)
        samples = self._mixer.mix(max(wanted - self._count, 0))
        late = max(-self._count, 0)
        self._count = max(self._count, wanted)
        return samples[late:]


def places_in(world: RenderWorld, mirror: SceneMirror) -> Callable[[int], Vec3]:
    """Where entities are, as the world is placed: bodies on their way, others where they are told to be."""
    bodies = world.bodies()
    rows = {entity: row for row, entity in enumerate(bodies.entity.tolist())} if len(bodies.entity) else {}

    def place_of(entity: int) -> Vec3:
        row = rows.get(entity)
        if row is None:
            return mirror.world_pose(entity).position
        x, y, z = bodies.position[row].tolist()
        return x, y, z

    return place_of
