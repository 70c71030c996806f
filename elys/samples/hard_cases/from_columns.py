"""The cases of plain columns, which peers are measured with as well, each with its answer and a view of it."""

from __future__ import annotations

from typing import Final

from elys.samples.hard_cases.columns import case_of_columns
from elys.samples.rigid_cases import RIGID_CASES

_PARABOLA: Final = "the parabola x + v t + g t^2 / 2"
_PLACES: Final = "every cube stays where it was put; contacts give way by less than a millimetre or two"

COLUMN_CASES: Final = (
    case_of_columns(
        RIGID_CASES["free-flight"],
        answer=_PARABOLA,
        eye=(3.0, 11.0, 13.0),
        target=(2.5, 9.5, 0.0),
        picture_time=0.4,
    ),
    case_of_columns(
        RIGID_CASES["held-20"],
        answer="it stays: tan 20 degrees is 0.36, and friction 0.6",
        eye=(2.5, 2.5, 5.0),
        target=(0.0, 0.2, 0.0),
        picture_time=2.0,
    ),
    case_of_columns(
        RIGID_CASES["sliding-30"],
        answer="g (sin 30 - 0.2 cos 30) t^2 / 2",
        eye=(2.5, 2.5, 6.0),
        target=(-1.0, 0.0, 0.0),
        picture_time=0.7,
    ),
    case_of_columns(
        RIGID_CASES["rolling-20"],
        answer="5/7 g sin 20 t^2 / 2, a full ball's",
        eye=(2.5, 2.5, 6.0),
        target=(-1.0, 0.2, 0.0),
        picture_time=0.8,
    ),
    case_of_columns(
        RIGID_CASES["rebound"],
        answer="0.8^6 of the height it fell from",
        eye=(2.0, 2.2, 6.5),
        target=(0.0, 1.2, 0.0),
        picture_time=1.0,
    ),
    case_of_columns(
        RIGID_CASES["five-balls"],
        answer="the last ball leaves with the speed of the first, all others rest: impacts between pairs, one after the other",
        eye=(1.0, 3.0, 8.0),
        target=(1.0, 0.0, 0.0),
        picture_time=0.9,
    ),
    case_of_columns(
        RIGID_CASES["tumbling"],
        answer="energy and angular momentum kept; flips every 2 K(m) / rate (Landau & Lifshitz, Mechanics, section 37)",
        eye=(1.2, 0.9, 2.2),
        target=(0.0, 0.0, 0.0),
        picture_time=1.0,
    ),
    case_of_columns(
        RIGID_CASES["stack-10"],
        answer=_PLACES,
        eye=(9.0, 7.0, 13.0),
        target=(0.0, 4.8, 0.0),
        picture_time=5.0,
    ),
    case_of_columns(
        RIGID_CASES["stack-30"],
        answer=_PLACES,
        eye=(27.0, 20.0, 42.0),
        target=(0.0, 15.0, 0.0),
        picture_time=5.0,
    ),
    case_of_columns(
        RIGID_CASES["ratio-100"],
        answer="the light cube carries the heavy one",
        eye=(3.0, 2.4, 4.5),
        target=(0.0, 1.0, 0.0),
        picture_time=2.0,
    ),
    case_of_columns(
        RIGID_CASES["ratio-1000"],
        answer="the light cube carries the heavy one",
        eye=(3.0, 2.4, 4.5),
        target=(0.0, 1.0, 0.0),
        picture_time=2.0,
    ),
    case_of_columns(
        RIGID_CASES["pyramid-20"],
        answer=_PLACES,
        eye=(9.0, 13.0, 33.0),
        target=(0.0, 9.8, 0.0),
        picture_time=5.0,
    ),
    case_of_columns(
        RIGID_CASES["pyramid-40-stands"],
        answer=_PLACES,
        eye=(18.0, 25.0, 66.0),
        target=(0.0, 19.5, 0.0),
        picture_time=3.0,
    ),
    case_of_columns(
        RIGID_CASES["stack-far"],
        answer="what the stack at the origin does, to the millimetre",
        eye=(10009.0, 7.0, 13.0),
        target=(10000.0, 4.8, 0.0),
        picture_time=5.0,
    ),
    case_of_columns(
        RIGID_CASES["stack-100-km"],
        answer="what the stack at the origin does, to the millimetre",
        eye=(100009.0, 7.0, 13.0),
        target=(100000.0, 4.8, 0.0),
        picture_time=5.0,
    ),
    case_of_columns(
        RIGID_CASES["bullet-wall"],
        answer="none behind the wall",
        eye=(-2.6, 1.0, -1.4),
        target=(-0.1, 0.0, 1.6),
        picture_time=0.075,
    ),
    case_of_columns(
        RIGID_CASES["bullets-meet"],
        answer="no pair has passed through each other",
        eye=(0.6, 1.0, -2.2),
        target=(0.0, 0.0, 2.5),
        picture_time=0.07,
    ),
)
