"""The hard cases by name."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Final

from elys.common.errors import SceneError
from elys.samples.hard_cases.carried import CARRIED_CASES
from elys.samples.hard_cases.case import HardCase
from elys.samples.hard_cases.crowded import CROWDED_CASES
from elys.samples.hard_cases.driven import DRIVEN_CASES
from elys.samples.hard_cases.from_columns import COLUMN_CASES
from elys.samples.hard_cases.jointed import JOINTED_CASES
from elys.samples.hard_cases.masonry import MASONRY_CASES
from elys.samples.hard_cases.moving import MOVING_CASES
from elys.samples.hard_cases.spinning import SPINNING_CASES
from elys.samples.hard_cases.standing import STANDING_CASES
from elys.samples.hard_cases.struck import STRUCK_CASES

_ALL: Final = (
    *COLUMN_CASES,
    *MOVING_CASES,
    *CARRIED_CASES,
    *MASONRY_CASES,
    *STANDING_CASES,
    *SPINNING_CASES,
    *JOINTED_CASES,
    *DRIVEN_CASES,
    *STRUCK_CASES,
    *CROWDED_CASES,
)
HARD_CASES: Final[Mapping[str, HardCase]] = {case.name: case for case in _ALL}


def hard_case(name: str) -> HardCase:
    """The hard case of this name; raises SceneError with the nearest one where there is none."""
    try:
        return HARD_CASES[name]
    except KeyError:
        close = difflib.get_close_matches(name, HARD_CASES, n=1)
        remedy = f"did you mean '{close[0]}'?" if close else "elys cases list shows all"
        raise SceneError(f"there is no hard case '{name}'; {remedy}") from None
