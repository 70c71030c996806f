"""A motion to compare with: the scene with ever shorter ticks, until its observables agree, and how well they do."""

from __future__ import annotations

import math
from typing import Final

import msgspec

from elys.common.errors import ElysError
from elys.lab.motion import Motion
from elys.lab.observables import OBSERVABLES, errors_of, scales_of

TOLERANCE: Final = 2e-4  # relative difference of two refinements below which they agree


class Reference(msgspec.Struct, frozen=True):
    """The finest motion, and how far each observable still changed with the last halving of the tick."""

    motion: Motion
    uncertainty: dict[str, float]  # by observable, relative; infinite where nothing is known
    is_converged: bool  # all of them agree

    @property
    def open(self) -> list[str]:
        """The observables that did not converge."""
        return [name for name, value in self.uncertainty.items() if not value <= TOLERANCE]


def agree(coarse: Motion, fine: Motion) -> Reference:
    """The finer of two motions as a reference, as sure as the other one is near.

    What is 0 in every exact solution needs none and is sure.

    Raises:
        ElysError: the motion left the numbers.
    """
    if not (coarse.is_finite and fine.is_finite):
        raise ElysError(
            f"there is nothing to compare with: at {fine.setting.label} the scene explodes; see what `elys run` says of it"
        )
    scales = scales_of(fine)
    needs = {observable.name: observable.needs_reference for observable in OBSERVABLES}
    uncertainty = {
        error.name: error.relative if needs[error.name] else 0.0 for error in errors_of(coarse, fine, scales)
    }
    return Reference(fine, uncertainty, all(value <= TOLERANCE for value in uncertainty.values()))


def is_better(new: Reference, old: Reference) -> bool:
    """Whether another halving helped: chaos ends that, however short the tick."""
    return _total(new) < 0.8 * _total(old)


def _total(reference: Reference) -> float:
    return math.fsum(min(value, 1.0) for value in reference.uncertainty.values())
