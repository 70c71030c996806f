"""What is heard: sounds that an entity gives off as long as they are switched on. Single sounds are events, see docs/sound.md."""

from __future__ import annotations

from typing import Annotated, Final

from elys.common.components.declaration import Component, Kind, about, component

BUILT_IN_SOUNDS: Final = ("click", "hit", "chime", "roll", "whoosh")  # made by the viewer itself
LOUDEST: Final = 8.0  # of volumes
SLOWEST_PITCH: Final = 0.1
FASTEST_PITCH: Final = 8.0


@component
class SoundSource(Component, frozen=True):
    """Gives off a sound, heard from where the camera stands."""

    sound: Annotated[
        str, about("click, hit, chime, roll, whoosh, or a file: wav, ogg, flac or mp3.", kind=Kind.ASSET)
    ] = "chime"
    playing: Annotated[bool, about("Sounds; switched on anew it begins anew.")] = True
    loop: Annotated[bool, about("Begins again at its end.")] = True
    volume: Annotated[
        float, about("What it is multiplied with; 1 as recorded.", minimum=0.0, maximum=LOUDEST, step=0.05)
    ] = 1.0
    pitch: Annotated[
        float,
        about("How fast, and so how high; 1 as recorded.", minimum=SLOWEST_PITCH, maximum=FASTEST_PITCH, step=0.05),
    ] = 1.0
    spatial: Annotated[bool, about("Comes from where the entity stands, fainter from farther away.")] = True
    reference_distance: Annotated[
        float, about("Up to here as loud as it is; at twice that half of it.", unit="m", minimum=0.01, step=0.1)
    ] = 2.0
    max_distance: Annotated[
        float, about("From here on not heard at all; 0: heard from anywhere.", unit="m", minimum=0.0, step=1.0)
    ] = 0.0
