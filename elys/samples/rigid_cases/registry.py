"""The cases by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from elys.samples.rigid_cases.bullets import BULLET_CASES
from elys.samples.rigid_cases.case import RigidCase
from elys.samples.rigid_cases.motion import MOTION_CASES
from elys.samples.rigid_cases.standing import STANDING_CASES

RIGID_CASES: Final[Mapping[str, RigidCase]] = {
    case.name: case for case in (*MOTION_CASES, *STANDING_CASES, *BULLET_CASES)
}
