"""What a viewer hears: a session's sounds, on this machine's loudspeakers."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from elys.bus import topics
from elys.bus.messages.session import EventBatch
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.bus.session import Session
from elys.render_node.sound.hearing import ears_of
from elys.render_node.sound.library import SoundLibrary
from elys.render_node.sound.mixer import Mixer
from elys.render_node.sound.output import SoundOutput
from elys.render_node.sound.stage import PlaceOf, SoundStage


class Loudspeaker:
    """Hears a session's events and, with a mirror, the sources in its scene. Nothing is opened before anything sounds."""

    def __init__(
        self,
        session: Session,
        fetch: Callable[[str], bytes],
        *,
        mirror: SceneMirror | None = None,
        open_output: Callable[[Callable[[int], NDArray[np.float32]]], SoundOutput] = SoundOutput,
    ) -> None:
        self._session = session
        self._library = SoundLibrary(fetch)
        self._mixer = Mixer()
        self._lock = threading.Lock()  # the device asks on a thread of its own
        self._stage = SoundStage(self._mixer, self._library.sound, mirror=mirror, is_pending=self._library.is_pending)
        self._open_output = open_output
        self._output: SoundOutput | None = None
        self.is_muted = False
        session.subscribe(topics.EVENTS, self._heard)

    @property
    def is_needed(self) -> bool:
        """Whether anything sounds, or would."""
        return self._stage.has_sounds

    def place(self, camera: ViewCamera, places: Callable[[], PlaceOf], *, is_running: bool = True) -> None:
        """Listens from where a camera stands; `places` is asked where sources are when there are any."""
        if not self.is_needed:
            return
        if self._output is None:
            self._output = self._open_output(self._mix)
        if not self._output.is_heard:
            return
        with self._lock:
            self._mixer.volume = 0.0 if self.is_muted else 1.0
            self._stage.place(ears_of(camera), places(), is_running=is_running)

    def close(self) -> None:
        """Falls silent."""
        if self._output is not None:
            self._output.close()
        self._library.close()

    def _mix(self, count: int) -> NDArray[np.float32]:
        with self._lock:
            return self._mixer.mix(count)

    def _heard(self, batch: EventBatch, _: str) -> None:
        if self._output is not None and not self._output.is_heard:
            return  # nobody would hear it: voices must not gather
        with self._lock:
            for event in batch.events:
                self._stage.hear(event)


def nowhere() -> PlaceOf:
    """Where sources are for who follows no scene."""
    return lambda entity: (0.0, 0.0, 0.0)
