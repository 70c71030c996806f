"""The cheapest settings that keep a scene within an error, as settings with their evidence."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

import msgspec

import elys
from elys.common.errors import ElysError
from elys.common.scene_document import Calibration, SceneSettings
from elys.lab.pareto import Study
from elys.lab.report_page import machine


class CalibrationError(ElysError):
    """Nothing keeps within the error, or nobody can tell."""


def calibrated(settings: SceneSettings, found: Study) -> SceneSettings:
    """A scene's settings with the ones that a study chose, and why.

    Raises:
        CalibrationError: the study chose none, or its reference is not sure enough of what was to be judged.
    """
    require_sure(found)
    chosen = found.outcome_of(found.chosen) if found.chosen is not None else None
    if chosen is None:
        raise CalibrationError(_impossible(found))
    before = found.outcome_of(found.own)
    assert before is not None  # the ladder holds the scene's own setting
    evidence = Calibration(
        budget=found.budget,
        error=_rounded(chosen.error),
        dominant=chosen.dominant,
        observables=tuple(judged(found)),
        duration=found.duration,
        reference=found.reference.label,
        cost=_rounded(1000.0 * chosen.cost),
        cost_before=_rounded(1000.0 * before.cost),
        error_before=_rounded(before.error),
        date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        version=elys.__version__,
        processor=machine(),
    )
    return msgspec.structs.replace(chosen.setting.applied_to_settings(settings), calibration=evidence)


def judged(found: Study) -> Sequence[str]:
    """The observables that a study counts."""
    return found.only or [error.name for error in found.outcomes[0].errors]


def require_sure(found: Study) -> None:
    """Raises CalibrationError where the reference is less sure of a judged observable than the budget is large."""
    known = {name: found.uncertainty.get(name, 0.0) for name in judged(found)}  # answers are sure
    unsure = {name: value for name, value in known.items() if not value <= found.budget}
    if not unsure:
        return
    told = ", ".join(f"{name} (±{value:.0e})" for name, value in unsure.items())
    sure = [name for name in judged(found) if name not in unsure]
    raise CalibrationError(
        f"{found.scene} cannot be judged within {found.budget:g}: however short its ticks, it does not agree with itself in "
        f"{told}, as is usual where many bodies meet. Name what counts, for instance "
        + " ".join(f"--only '{name}'" for name in sure if name in ("overlap", "energy gain", "drift at rest"))
        + f", or allow an error above {max(unsure.values()):.0e}"
    )


def _impossible(found: Study) -> str:
    best = min(found.outcomes, key=lambda outcome: outcome.error)
    worst = best.worst
    by = f", by {worst.culprit}" if worst.culprit else ""
    return (
        f"no setting of {found.scene} keeps within {found.budget:g}: the most exact, {best.setting.label}, has {best.error:.1e}, "
        f"which is {worst.name} of {worst.value:.2g} {worst.unit}{by}. Allow that much with --error, or leave it out with --only"
    )


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
