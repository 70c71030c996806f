"""Units of quantities that a person types: what each measures, and how many SI units it is.

A dimension is a tuple of exponents of BASES. Angles are one of them, so that 3 Hz is no 3 rad/s and a degree is no plain number.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping
from typing import Final, NamedTuple

BASES: Final = ("m", "kg", "s", "rad", "cd", "lx", "EV")
Dimension = tuple[float, ...]
PLAIN: Final[Dimension] = (0.0,) * len(BASES)


class Unit(NamedTuple):
    """What it measures, and its size in SI."""

    dimension: Dimension
    size: float


def _dimension(**exponents: float) -> Dimension:
    return tuple(float(exponents.get(base, 0.0)) for base in BASES)


_LENGTH, _MASS, _TIME, _ANGLE = _dimension(m=1), _dimension(kg=1), _dimension(s=1), _dimension(rad=1)
_FORCE, _SPEED, _VOLUME = _dimension(kg=1, m=1, s=-2), _dimension(m=1, s=-1), _dimension(m=3)
_FREQUENCY, _TURNING = _dimension(s=-1), _dimension(rad=1, s=-1)
_ENERGY, _POWER = _dimension(kg=1, m=2, s=-2), _dimension(kg=1, m=2, s=-3)

UNITS: Final[Mapping[str, Unit]] = {
    "m": Unit(_LENGTH, 1.0),
    "km": Unit(_LENGTH, 1e3),
    "dm": Unit(_LENGTH, 0.1),
    "cm": Unit(_LENGTH, 0.01),
    "mm": Unit(_LENGTH, 1e-3),
    "um": Unit(_LENGTH, 1e-6),
    "nm": Unit(_LENGTH, 1e-9),
    "in": Unit(_LENGTH, 0.0254),
    "ft": Unit(_LENGTH, 0.3048),
    "yd": Unit(_LENGTH, 0.9144),
    "mi": Unit(_LENGTH, 1609.344),
    "kg": Unit(_MASS, 1.0),
    "g": Unit(_MASS, 1e-3),
    "mg": Unit(_MASS, 1e-6),
    "t": Unit(_MASS, 1e3),
    "lb": Unit(_MASS, 0.45359237),
    "oz": Unit(_MASS, 0.028349523125),
    "s": Unit(_TIME, 1.0),
    "ms": Unit(_TIME, 1e-3),
    "us": Unit(_TIME, 1e-6),
    "min": Unit(_TIME, 60.0),
    "h": Unit(_TIME, 3600.0),
    "d": Unit(_TIME, 86400.0),
    "rad": Unit(_ANGLE, 1.0),
    "mrad": Unit(_ANGLE, 1e-3),
    "deg": Unit(_ANGLE, math.pi / 180.0),
    "°": Unit(_ANGLE, math.pi / 180.0),
    "turn": Unit(_ANGLE, 2.0 * math.pi),
    "rev": Unit(_ANGLE, 2.0 * math.pi),
    "rpm": Unit(_TURNING, 2.0 * math.pi / 60.0),
    "Hz": Unit(_FREQUENCY, 1.0),
    "kHz": Unit(_FREQUENCY, 1e3),
    "mph": Unit(_SPEED, 1609.344 / 3600.0),
    "kph": Unit(_SPEED, 1.0 / 3.6),
    "kn": Unit(_SPEED, 1852.0 / 3600.0),
    "N": Unit(_FORCE, 1.0),
    "kN": Unit(_FORCE, 1e3),
    "MN": Unit(_FORCE, 1e6),
    "lbf": Unit(_FORCE, 4.4482216152605),
    "J": Unit(_ENERGY, 1.0),
    "kJ": Unit(_ENERGY, 1e3),
    "W": Unit(_POWER, 1.0),
    "kW": Unit(_POWER, 1e3),
    "l": Unit(_VOLUME, 1e-3),
    "L": Unit(_VOLUME, 1e-3),
    "ml": Unit(_VOLUME, 1e-6),
    "cd": Unit(_dimension(cd=1), 1.0),
    "lx": Unit(_dimension(lx=1), 1.0),
    "klx": Unit(_dimension(lx=1), 1e3),
    "EV": Unit(_dimension(EV=1), 1.0),
    "%": Unit(PLAIN, 0.01),
}
_NAMES: Final[Mapping[Dimension, str]] = {
    PLAIN: "a plain number",
    _LENGTH: "a length",
    _dimension(m=2): "an area",
    _VOLUME: "a volume",
    _MASS: "a mass",
    _TIME: "a time",
    _ANGLE: "an angle",
    _SPEED: "a speed",
    _dimension(m=1, s=-2): "an acceleration",
    _TURNING: "a turning speed",
    _FREQUENCY: "a rate",
    _FORCE: "a force",
    _ENERGY: "a torque",
    _POWER: "a power",
    _dimension(kg=1, m=-3): "a density",
    _dimension(cd=1): "a luminous intensity",
    _dimension(lx=1): "an illuminance",
    _dimension(EV=1): "a number of stops",
    _dimension(m=-1): "an inverse length",
    _dimension(m=3, s=-2): "an attraction",
}
_FACTOR: Final = re.compile(r"([^\W\d_]+|°|%|1)\^?(-?\d*)")


def units_of(text: str) -> tuple[Unit, ...]:
    """The units that a declaration names, as "kg/m^3" or "rad | m"; none for what measures nothing.

    KeyError for a unit that is not in UNITS.
    """
    return tuple(_unit_of(part.strip()) for part in text.split("|")) if text else ()


def _unit_of(text: str) -> Unit:
    dimension, size, sign = PLAIN, 1.0, 1
    for word in re.split(r"(/)|\s+", text):
        if not word:
            continue
        if word == "/":
            sign = -1
            continue
        found = _FACTOR.fullmatch(word)
        if found is None:
            raise KeyError(word)
        name, power = found[1], sign * int(found[2] or 1)
        if name != "1":
            unit = UNITS[name]
            dimension = tuple(a + power * b for a, b in zip(dimension, unit.dimension, strict=True))
            size *= unit.size**power
    return Unit(dimension, size)


def described(dimension: Dimension) -> str:
    """A dimension in words, with its article."""
    if dimension in _NAMES:
        return _NAMES[dimension]
    factors = [
        base if power == 1.0 else f"{base}^{power:g}" for base, power in zip(BASES, dimension, strict=True) if power
    ]
    return f"something in {' '.join(factors)}"


def similar_names(name: str, dimension: Dimension) -> str:
    """What somebody who typed an unknown unit may have meant: the nearest name, else some that measure the same."""
    close = difflib.get_close_matches(name, list(UNITS), n=1, cutoff=0.6)
    if close:
        return f"did you mean {close[0]}?"
    fitting = [known for known, unit in UNITS.items() if unit.dimension == dimension and known != "%"]
    return f"{described(dimension)} takes {', '.join(fitting[:6])}" if fitting else "this takes no unit"
