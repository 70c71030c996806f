"""The texts by which components of movement name several clips: mixes of them, and instants in them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from elys.common.errors import ComponentError

MOST_CLIPS: Final = 32  # of a mix
MOST_MARKERS: Final = 256


class Marker(NamedTuple):
    """An instant of a clip [s]; `clip` is empty where it holds for all."""

    clip: str
    name: str
    time: float


def mix_of(text: str) -> dict[str, float]:
    """Clips with their numbers, in the order of the text: `Idle 0, Walk 1.4, Run 4`. A name may have spaces, not commas.

    Raises:
        ComponentError: a clip has no number or stands there twice, or there are too many.
    """
    found: dict[str, float] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, _, number = part.rpartition(" ")
        value = _number(number)
        if not name or value is None:
            raise ComponentError(f"a mix is clips with numbers, as 'Walk 0.3, Run 0.7', not {part[:60]!r}")
        name = name.strip()
        if name in found:
            raise ComponentError(f"the clip {name!r} stands twice in the mix")
        found[name] = value
    if len(found) > MOST_CLIPS:
        raise ComponentError(f"a mix has at most {MOST_CLIPS} clips, not {len(found)}")
    return found


def mix_text(mix: Mapping[str, float]) -> str:
    """The text that `mix_of` reads; ComponentError for a name that cannot stand in one."""
    for name in mix:
        if "," in name or not name.strip():
            raise ComponentError(f"a clip called {name!r} cannot stand in a mix: its name may have no comma")
    text = ", ".join(f"{name} {float(number):.9g}" for name, number in mix.items())
    mix_of(text)
    return text


def mix_with(text: str, name: str, *, by_value: bool) -> str:
    """The text of a mix with another clip at its end: with the weight 1, or at the next value above those of the others.

    What is wrong with the text stays, to be mended.

    Raises:
        ComponentError: the mix has the clip already or all it may have, or the name cannot stand in one.
    """
    parts = [part.strip().rpartition(" ") for part in text.split(",") if part.strip()]
    if name in (known.strip() for known, _, _ in parts):
        raise ComponentError(f"the clip {name!r} stands in the mix already")
    if name != name.strip():
        raise ComponentError(f"a clip called {name!r} cannot stand in a mix: its name begins or ends with a space")
    if len(parts) >= MOST_CLIPS:
        raise ComponentError(f"a mix has at most {MOST_CLIPS} clips")
    values = [value for _, _, number in parts if (value := _number(number)) is not None]
    # Of clips at the same value only the first is heard.
    number = max(values, default=-1.0) + 1.0 if by_value else 1.0
    written, added = text.strip().rstrip(", "), mix_text({name: number})
    return f"{written}, {added}" if written else added


def markers_with(text: str, name: str) -> str:
    """The text of markers with another clip at its end, which has none yet; what is wrong with the text stays.

    Raises:
        ComponentError: the clip stands there already, or the name cannot stand in markers.
    """
    if ";" in name or name != name.strip():
        raise ComponentError(f"a clip called {name!r} cannot have markers")
    if name in (part.rpartition(":")[0].strip() for part in text.split(";")):
        raise ComponentError(f"the clip {name!r} has its markers already")
    written = text.strip().rstrip("; ")
    return f"{written}; {name}:" if written else f"{name}:"


def markers_of(text: str) -> tuple[Marker, ...]:
    """Instants by clip: `Walk: step 0.1 0.6, breathe 0.3; Jump: land 0.8`. Without a clip they are those of every clip.

    Raises:
        ComponentError: a name is none, or a time is none or below 0.
    """
    found: list[Marker] = []
    for part in filter(None, (part.strip() for part in text.split(";"))):
        clip, _, markers = part.rpartition(":")
        for several in filter(None, (several.strip() for several in markers.split(","))):
            name, *words = several.split()
            times = [_number(word) for word in words]
            if _number(name) is not None or not times or any(time is None or time < 0.0 for time in times):
                raise ComponentError(f"markers are a name and its times, as 'Walk: step 0.1 0.6', not {several[:60]!r}")
            found += [Marker(clip.strip(), name, time) for time in times if time is not None]
    if len(found) > MOST_MARKERS:
        raise ComponentError(f"there may be {MOST_MARKERS} markers, not {len(found)}")
    return tuple(found)


def _number(word: str) -> float | None:
    try:
        number = float(word)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
