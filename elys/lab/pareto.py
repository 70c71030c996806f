"""Speed against error: a scene at a ladder of settings, each judged against a reference that converged by itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import Any, Final, TypeVar

import msgspec

from elys.common.assets.store import AssetStore
from elys.common.scene import OpenedScene
from elys.lab.answers import Answer, AnswerJob, as_errors, run_answer
from elys.lab.motion import Job, Motion, run_job
from elys.lab.observables import ObservableError, Scales, divergence_time, errors_of, scales_of
from elys.lab.peers.running import PeerJob, run_peer, version_of
from elys.lab.reference import Reference, agree, is_better
from elys.lab.setting import Setting, common_rate, ladder, refined, setting_of

FIRST_REFINEMENT: Final = 2  # halvings of the scene's tick that the reference begins with
MOST_REFINEMENTS: Final = 5
REFERENCE_SUBSTEPS: Final = 4  # at least; a short tick needs few
PEER_FACTORS: Final = (1, 4)  # of the scene's tick rate, that peers are run at
DOUBT: Final = 2.0  # an error must be so many times the reference's own uncertainty to count
SAMPLE_RATE: Final = 60  # [Hz] at most, at which motions are compared

R = TypeVar("R")
Progress = Callable[[str, int, int], None]  # what is done, how many runs are, how many there will be


class Outcome(msgspec.Struct, frozen=True):
    """How a setting did."""

    setting: Setting
    cost: float  # [s] of processor time for a second of simulation
    errors: tuple[ObservableError, ...]
    error: float  # relative, of the dominant observable
    dominant: str  # the observable with the largest relative error
    horizon: float | None  # [s] when trajectories part from the reference; None if they never do
    is_best: bool = False  # nothing is both cheaper and more exact

    @property
    def unknown(self) -> tuple[str, ...]:
        """Observables that this run tells nothing of; they do not count."""
        return tuple(error.name for error in self.errors if not error.is_known)

    @property
    def worst(self) -> ObservableError:
        """The dominant error."""
        return next(error for error in self.errors if error.name == self.dominant)


class PeerOutcome(msgspec.Struct, frozen=True):
    """How another engine did with its default parameters, or why it could not."""

    label: str
    tick_rate: int  # [Hz]
    outcome: Outcome | None
    reason: str = ""


class Study(msgspec.Struct, frozen=True):
    """What a scene's runs say."""

    scene: str
    duration: float  # [s]
    body_count: int
    scales: Scales
    reference: Setting
    uncertainty: dict[str, float]  # of the reference, relative, by observable
    is_converged: bool
    outcomes: tuple[Outcome, ...]  # from cheap to dear
    chosen: Setting | None  # the cheapest whose error is within the budget
    budget: float  # relative
    own: Setting  # the scene's own
    only: tuple[str, ...] = ()  # the observables that count; all where none are named
    peers: tuple[PeerOutcome, ...] = ()

    @property
    def untold(self) -> dict[str, tuple[str, ...]]:
        """Observables that are unknown of other engines, by their names; there they do not count."""
        return {peer.label: peer.outcome.unknown for peer in self.peers if peer.outcome and peer.outcome.unknown}

    def outcome_of(self, setting: Setting) -> Outcome | None:
        """How a setting did, or the stronger one that moved everything as it does; None where neither was tried."""
        same = [
            outcome
            for outcome in self.outcomes
            if (outcome.setting.tick_rate, outcome.setting.substeps) == (setting.tick_rate, setting.substeps)
            and outcome.setting.strengths >= setting.strengths
        ]
        return min(same, key=lambda outcome: outcome.setting.strengths, default=None)


class Judge(msgspec.Struct, frozen=True):
    """What motions are judged by."""

    reference: Reference
    scales: Scales
    only: tuple[str, ...] = ()  # the observables that count; all where none are named

    def outcome(self, motion: Motion, answers: Sequence[ObservableError] = ()) -> Outcome:
        """How a motion did. What the reference itself is not sure of decides nothing."""
        errors = [*errors_of(motion, self.reference.motion, self.scales), *answers]
        counted = [error for error in errors if error.is_known and (not self.only or error.name in self.only)]
        known = {error.name: self.known(error) for error in counted}
        dominant = max(known, key=lambda name: known[name])
        horizon = divergence_time(motion, self.reference.motion, self.scales) if motion.is_finite else 0.0
        return Outcome(
            motion.setting,
            motion.cost / motion.duration,
            tuple(errors),
            known[dominant],
            dominant,
            horizon if math.isfinite(horizon) else None,
        )

    def known(self, error: ObservableError) -> float:
        """An error as far as it is beyond doubt: 0 where the reference itself is hardly better."""
        uncertainty = self.reference.uncertainty.get(error.name, 0.0)
        return error.relative if error.relative > DOUBT * uncertainty else 0.0


def study(
    scene: OpenedScene,
    assets: AssetStore,
    executor: Executor,
    *,
    duration: float,
    budget: float,
    settings: Sequence[Setting] = (),
    only: Sequence[str] = (),
    peers: Sequence[str] = (),
    case: str = "",
    progress: Progress | None = None,
    motions: list[Motion] | None = None,
) -> Study:
    """Runs a scene at each of `settings` (the ladder, where none are given) and judges each.

    Args:
        duration: of each run [s].
        budget: relative error up to which a setting is good enough.
        only: names of the observables that count; all where none are named.
        case: the hard case that the scene is, whose answers are judged too.
        peers: other engines that run the scene too, where it can be built in them.
        motions: takes the runs themselves, the reference first, where somebody wants to look at them.

    Raises:
        SceneError: nothing in the scene can move. ElysError: there is no reference, since the motion leaves the numbers.
    """
    tried = list(settings) or ladder(scene.settings)
    runs = _Runs(scene, assets, executor, duration, common_rate(tried), progress)
    waiting = [runs.start(setting) for setting in tried]
    answering = {setting: runs.start_answer(case, setting) for setting in tried} if case else {}
    others = [(peer, rate, runs.start_peer(peer, rate)) for peer in peers for rate in _peer_rates(scene)]
    reference = _converged(runs, scene)
    judge = Judge(reference, scales_of(reference.motion), tuple(only))
    done = distinct([runs.result(future) for future in waiting])
    beside = [_beside(judge, peer, rate, runs.result(future)) for peer, rate, future in others]
    if motions is not None:
        motions += [reference.motion, *done]
    answers = {setting: as_errors(runs.result(future), judge.scales) for setting, future in answering.items()}
    judged = [judge.outcome(motion, answers.get(motion.setting, ())) for motion in done]
    outcomes = with_front(sorted(judged, key=lambda outcome: outcome.cost))
    return Study(
        scene=scene.name,
        duration=duration,
        body_count=len(reference.motion.names),
        scales=judge.scales,
        reference=reference.motion.setting,
        uncertainty=reference.uncertainty,
        is_converged=reference.is_converged,
        outcomes=tuple(outcomes),
        chosen=cheapest(outcomes, budget),
        budget=budget,
        own=setting_of(scene.settings),
        only=tuple(only),
        peers=tuple(beside),
    )


def _peer_rates(scene: OpenedScene) -> tuple[int, ...]:
    return tuple(scene.settings.tick_rate * factor for factor in PEER_FACTORS)


def _beside(judge: Judge, peer: str, rate: int, found: Motion | str) -> PeerOutcome:
    label = version_of(peer)
    if isinstance(found, str):
        return PeerOutcome(label, rate, None, found)
    told = {error.name for error in errors_of(found, judge.reference.motion, judge.scales) if error.is_known}
    if judge.only and not told & set(judge.only):
        return PeerOutcome(label, rate, None, f"tells nothing of {' or '.join(judge.only)}")
    return PeerOutcome(label, rate, judge.outcome(found))


def distinct(motions: Sequence[Motion]) -> list[Motion]:
    """Of settings that differ in the solver's strength alone and move everything the same, the one that may do more."""
    last = {
        (motion.setting.tick_rate, motion.setting.substeps, motion.state_hash): motion
        for motion in sorted(motions, key=lambda motion: motion.setting)
    }
    return list(last.values())


def with_front(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Marks those that nothing beats in both; `outcomes` are sorted by cost."""
    least = math.inf
    marked = []
    for outcome in outcomes:
        is_best = outcome.error < least
        least = min(least, outcome.error)
        marked.append(msgspec.structs.replace(outcome, is_best=is_best))
    return marked


def cheapest(outcomes: Sequence[Outcome], budget: float) -> Setting | None:
    """The cheapest setting within the budget; None where none is."""
    good = [outcome for outcome in outcomes if outcome.error <= budget]
    return min(good, key=lambda outcome: outcome.cost).setting if good else None


class _Runs:
    """Runs of one scene, started and awaited."""

    def __init__(
        self,
        scene: OpenedScene,
        assets: AssetStore,
        executor: Executor,
        duration: float,
        rate: int,
        progress: Progress | None,
    ) -> None:
        self._scene = scene
        self._assets = physical(assets)
        self._executor = executor
        self._duration = duration
        self._rate = sample_rate(rate)
        self._progress = progress
        self._pending: set[Future[Any]] = set()
        self._started = 0
        self._label: dict[Future[Any], str] = {}

    def start(self, setting: Setting) -> Future[Motion]:
        job = Job(setting.applied_to(self._scene), self._assets, self._duration, self._rate)
        return self._submitted(self._executor.submit(run_job, job), setting.label)

    def start_peer(self, peer: str, rate: int) -> Future[Motion | str]:
        scene = msgspec.structs.replace(
            self._scene, settings=msgspec.structs.replace(self._scene.settings, tick_rate=rate)
        )
        job = PeerJob(peer, scene, self._assets, self._duration, self._rate)
        return self._submitted(self._executor.submit(run_peer, job), peer)

    def start_answer(self, case: str, setting: Setting) -> Future[list[Answer]]:
        return self._submitted(self._executor.submit(run_answer, AnswerJob(case, setting)), f"answers, {setting.label}")

    def _submitted(self, future: Future[R], label: str) -> Future[R]:
        self._pending.add(future)
        self._started += 1
        self._label[future] = label
        return future

    def result(self, future: Future[R]) -> R:
        """What a run came to; while it is awaited progress is told of all others too."""
        while not future.done():
            self._tell(wait(self._pending, return_when=FIRST_COMPLETED).done)
        self._tell({future} & self._pending)
        return future.result()

    def _tell(self, done: set[Future[Any]]) -> None:
        self._pending -= done
        for future in done:
            if future.exception() is not None:
                self._cancel()
                future.result()
            if self._progress is not None:
                self._progress(self._label[future], self._started - len(self._pending), self._started)

    def _cancel(self) -> None:
        for future in self._pending:
            future.cancel()


def _converged(runs: _Runs, scene: OpenedScene) -> Reference:
    own = setting_of(scene.settings)
    base = msgspec.structs.replace(own, substeps=max(own.substeps, REFERENCE_SUBSTEPS))
    first, second = (runs.start(refined(base, FIRST_REFINEMENT + k)) for k in range(2))
    best = agree(runs.result(first), runs.result(second))
    for doublings in range(FIRST_REFINEMENT + 2, MOST_REFINEMENTS + 1):
        if best.is_converged:
            break
        finer = runs.result(runs.start(refined(base, doublings)))
        new = agree(best.motion, finer)
        if not is_better(new, best):
            break
        best = new
    return best


def sample_rate(tick_rate: int) -> int:
    """How often the motion of a scene is kept [Hz]: at most at each 60th of a second, and always at a tick."""
    return max(divisor for divisor in range(1, SAMPLE_RATE + 1) if tick_rate % divisor == 0)


def physical(assets: AssetStore) -> AssetStore:
    """What physics needs of the assets of a scene: images stay at home."""
    chosen = AssetStore()
    for reference in assets.references():
        kind = assets.kind(reference)
        if kind in ("mesh", "heights"):
            chosen.put(assets.get(reference), kind=kind)
    return chosen
