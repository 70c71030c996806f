"""What sounds in a scene, as voices of a mixer: sources as long as they are there, and single sounds when they are told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from elys.bus.messages.scene import ComponentRemoved, ComponentSet, Despawned, EnabledSet, Reparented, Spawned
from elys.bus.messages.session import Event
from elys.bus.messages.sounds import Sound, sound_of
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.common.components import SoundSource, Vec3
from elys.render_node.sound.hearing import Ears, heard
from elys.render_node.sound.mixer import Mixer, Samples, Voice

PlaceOf = Callable[[int], Vec3]
NOWHERE: Final = Ears((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
_SOURCE: Final = SoundSource.__name__
MOST_WAITING: Final = 64  # single sounds whose files are on their way
MIDDLE: Final = 0.5**0.5  # gain of either side of what comes from everywhere


@dataclass(slots=True)
class _Source:
    component: SoundSource
    voice: Voice | None = None  # once its sound has come
    has_ended: bool = False


class SoundStage:
    """Follows a mirror's sources and hears events. `place` brings all to where they are heard from now."""

    def __init__(
        self,
        mixer: Mixer,
        sound: Callable[[str], Samples | None],
        *,
        mirror: SceneMirror | None = None,
        is_pending: Callable[[str], bool] = lambda name: False,
    ) -> None:
        """`sound` gives samples by name, None while they are on their way, as `is_pending` tells."""
        self._mixer, self._sound, self._is_pending = mixer, sound, is_pending
        self._mirror = mirror
        self._sources: dict[int, _Source] = {}
        self._single: list[tuple[Sound, Voice]] = []
        self._waiting: list[Sound] = []
        self._ears = NOWHERE
        self._is_outdated = True
        self._is_running = True
        self._may_come = False  # there are sources that are switched off
        if mirror is not None:
            mirror.listen(self._note)

    @property
    def has_sounds(self) -> bool:
        """Whether anything sounds, or would."""
        return bool(self._current() or self._single or self._waiting)

    def hear(self, event: Event) -> None:
        """Plays a sound that an event tells, and passes over what tells none."""
        sound = sound_of(event)
        if sound is None:
            return
        if not self._play(sound) and self._is_pending(sound.sound) and len(self._waiting) < MOST_WAITING:
            self._waiting.append(sound)

    def place(self, ears: Ears, place_of: PlaceOf, *, is_running: bool = True) -> None:
        """Lets everything be heard from these ears; sources stand where `place_of` says. While time stands they are silent."""
        self._ears, self._is_running = ears, is_running
        self._waiting = [sound for sound in self._waiting if not self._play(sound) and self._is_pending(sound.sound)]
        for entity, source in self._current().items():
            self._follow(entity, source, place_of)
        self._single = [(sound, voice) for sound, voice in self._single if not voice.is_over]
        for sound, voice in self._single:
            voice.left, voice.right = self._gains_of(sound)

    def _play(self, sound: Sound) -> bool:
        samples = self._sound(sound.sound)
        if samples is None:
            return False
        left, right = self._gains_of(sound)
        voice = Voice(samples, left=left, right=right, pitch=sound.pitch)
        self._single.append((sound, voice))
        self._mixer.add(voice)
        return True

    def _gains_of(self, sound: Sound) -> tuple[float, float]:
        if sound.position is None:
            return sound.volume * MIDDLE, sound.volume * MIDDLE
        return heard(self._ears, sound.position, sound.volume, sound.reference_distance, sound.max_distance)

    def _follow(self, entity: int, source: _Source, place_of: PlaceOf) -> None:
        component = source.component
        if source.voice is not None and source.voice.is_over:
            source.voice, source.has_ended = None, True
        gains = self._source_gains(entity, component, place_of)
        if source.voice is None and not source.has_ended and self._is_running:
            samples = self._sound(component.sound)
            if samples is None:
                return
            # One that goes round is met in the middle of it, as far as anybody can tell.
            source.voice = Voice(samples, left=gains[0], right=gains[1], loop=component.loop, fades_in=component.loop)
            self._mixer.add(source.voice)
        if source.voice is not None:
            source.voice.pitch = component.pitch
            source.voice.left, source.voice.right = gains

    def _source_gains(self, entity: int, component: SoundSource, place_of: PlaceOf) -> tuple[float, float]:
        if not self._is_running:
            return 0.0, 0.0
        if not component.spatial:
            return component.volume * MIDDLE, component.volume * MIDDLE
        return heard(
            self._ears, place_of(entity), component.volume, component.reference_distance, component.max_distance
        )

    # --- which sources there are -----------------------------------------------------------------------------------

    def _note(self, update: MirrorUpdate) -> None:
        if update.reset:
            self._is_outdated = True
        for change in update.changes:
            match change:
                case ComponentSet(component=component) | ComponentRemoved(component=component):
                    self._is_outdated |= component == _SOURCE
                case Spawned(components=components):
                    self._is_outdated |= _SOURCE in components
                case Despawned() | Reparented() | EnabledSet():
                    self._is_outdated |= bool(self._sources) or self._may_come

    def _current(self) -> dict[int, _Source]:
        """Those that are switched on. One that is told anew goes on, unless it is to sound otherwise."""
        if not self._is_outdated or self._mirror is None:
            return self._sources
        self._is_outdated = False
        before, self._sources, self._may_come = self._sources, {}, False
        for entity in self._mirror.entities.values():
            component = entity.components.get("SoundSource")
            if not isinstance(component, SoundSource):
                continue
            if not component.playing or not self._mirror.world_enabled(entity.id):
                self._may_come = True
                continue
            known = before.get(entity.id)
            if known is not None and (known.component.sound, known.component.loop) == (component.sound, component.loop):
                known.component = component
                self._sources[entity.id] = known
            else:
                self._sources[entity.id] = _Source(component)
        for entity_id, gone in before.items():
            if self._sources.get(entity_id) is not gone and gone.voice is not None:
                gone.voice.stop()
        return self._sources
