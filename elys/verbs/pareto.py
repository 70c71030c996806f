"""pareto: a scene's speed against its error, as a table, as JSON, as a page."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

from elys.common.assets.store import AssetStore
from elys.common.errors import DisplayError, ElysError
from elys.common.scene import OpenedScene
from elys.lab.answers import ANSWER
from elys.lab.jobs import workers
from elys.lab.motion import Motion
from elys.lab.observables import require_observables
from elys.lab.pareto import Outcome, PeerOutcome, Progress, Study, study
from elys.lab.peers.running import PACKAGES, require_peers
from elys.lab.report_page import Picture, require_page, write_page
from elys.lab.setting import Setting
from elys.samples.hard_cases import HARD_CASES
from elys.verbs.kernels import compile_with_progress
from elys.verbs.output import print_json, print_table
from elys.verbs.scenes import open_scene_or_sample

PICTURE_SIZE = (480, 300)


def pareto(
    scenes: Sequence[str],
    *,
    seconds: float,
    error: float,
    only: Sequence[str],
    peers: bool,
    page: Path | None,
    json: bool,
    jobs: int,
    cluster: str,
) -> None:
    """Studies each scene and tells what came out."""
    require_budget(error)
    for name in scenes:
        require_observables(only, more=answers_of(name))
    if peers:
        require_peers()
    if page is not None:
        require_page(page)
    studies, motions, pictures = [], [], []
    with contextlib.ExitStack() as stack:
        opened = [(name, open_scene_or_sample(name, assets := AssetStore()), assets) for name in scenes]
        for _, scene, _ in opened:
            compile_with_progress(scene)
        executor = stack.enter_context(workers(processes=jobs, cluster=cluster))
        for name, scene, assets in opened:
            kept: list[Motion] = []
            with counted(f"Running {scene.name}") as progress:
                found = study(
                    scene,
                    assets,
                    executor,
                    duration=seconds,
                    budget=error,
                    only=only,
                    case=case_of(name),
                    peers=tuple(PACKAGES) if peers else (),
                    progress=progress,
                    motions=kept,
                )
            studies.append(found)
            motions.append(kept)
            if not json:
                print_study(found)
            if page is not None:
                pictures.append(worst_moments(found, scene, assets))
    if json:
        print_json(studies[0] if len(studies) == 1 else studies)
    if page is not None:
        write_page(page, studies, motions=motions, pictures=pictures)
        if not json:
            print(f"{page}: curves, table and pictures")


def case_of(scene: str) -> str:
    """The hard case that a scene is named for, "" where it is none."""
    return scene if scene in HARD_CASES and not Path(scene).exists() else ""


def answers_of(scene: str) -> list[str]:
    """Names of the observables that a scene's own answers are judged by."""
    return [ANSWER + measure.name for measure in HARD_CASES[scene].quick.measures] if case_of(scene) else []


def require_budget(error: float) -> None:
    """Raises ElysError for a budget that nothing can keep or everything does."""
    if not 1e-9 < error < 1.0:
        raise ElysError(
            f"an error of {error:g} is no budget: it is a share of what is typical of the scene, for instance 1e-3; "
            "everything keeps within 1, nothing within 1e-9"
        )


@contextlib.contextmanager
def counted(text: str) -> Iterator[Progress]:
    """A bar over runs, of which more may come."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn(text),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda name, done, total: bar.update(task, completed=done, total=total, description=name)


def print_study(found: Study) -> None:
    """A study as a person reads it: the best settings, the scene's own and the chosen one."""
    print(f"{found.scene}: {found.body_count} bodies, {found.duration:g} s, against {found.reference.label}")
    open_ones = [f"{name} ±{value:.0e}" for name, value in found.uncertainty.items() if value > 2e-4]
    if open_ones:
        print(f"  the reference did not converge in {', '.join(open_ones)}: less than twice that decides nothing")
    shown = [outcome for outcome in found.outcomes if outcome.is_best or outcome.setting in (found.own, found.chosen)]
    columns = ("", "setting", "ms/s", "error", "which is mostly", "parted")
    rows = [_row(outcome, found) for outcome in shown]
    rows += [_peer_row(peer, found) for peer in found.peers if peer.outcome is not None]
    print_table(columns, rows)
    for label, reason in {peer.label: peer.reason for peer in found.peers if peer.outcome is None}.items():
        print(f"  {label}: {reason}")
    for label, names in found.untold.items():
        print(f"  {label}: {', '.join(names)} unknown, not counted")
    print(f"  {len(found.outcomes)} settings tried; * nothing is cheaper and more exact, = the scene's own, > chosen")
    if found.chosen is None:
        best = min(outcome.error for outcome in found.outcomes)
        print(f"  none keeps within an error of {found.budget:g}; the most exact has {best:.1e}")


def _peer_row(peer: PeerOutcome, found: Study) -> tuple[str, ...]:
    assert peer.outcome is not None
    return ("", f"{peer.label}, {peer.tick_rate} Hz", *_row(peer.outcome, found)[2:])


def _row(outcome: Outcome, found: Study) -> tuple[str, ...]:
    marks = (
        ("*" if outcome.is_best else "")
        + ("=" if outcome.setting == found.own else "")
        + (">" if outcome.setting == found.chosen else "")
    )
    return (
        marks,
        outcome.setting.label,
        f"{1000.0 * outcome.cost:.2f}",
        f"{outcome.error:.1e}",
        _worst_text(outcome),
        "never" if outcome.horizon is None else f"{outcome.horizon:.2f} s",
    )


def _worst_text(outcome: Outcome) -> str:
    worst = outcome.worst
    by = f", {worst.culprit}" if worst.culprit else ""
    if not worst.is_finite:
        return f"left the numbers{by}"
    return f"{worst.name} {worst.value:.2e} {worst.unit}{by}"


def worst_moments(found: Study, scene: OpenedScene, assets: AssetStore) -> list[Picture]:
    """The moment of the largest error under the chosen setting (else the scene's own), and the same in the reference."""
    setting = found.chosen or found.own
    outcome = found.outcome_of(setting) or found.outcomes[-1]
    worst = outcome.worst
    named = _worst_text(outcome)
    shown = (
        (outcome.setting, f"{outcome.setting.label} at {worst.time:.2f} s: {named}"),
        (found.reference, f"The reference, {found.reference.label}, at the same moment"),
    )
    return [Picture(title, _drawn(setting, scene, assets, worst.time)) for setting, title in shown]


def _drawn(setting: Setting, scene: OpenedScene, assets: AssetStore, time: float) -> bytes:
    from PIL import Image

    from elys.render_node.offline import OfflineRenderer
    from elys.verbs.footage import simulated

    footage = simulated(setting.applied_to(scene), assets, time)
    footage.mirror.keep_frame(next(footage.frames))
    width, height = PICTURE_SIZE
    try:
        with OfflineRenderer(footage.mirror, footage.fetch, width=width, height=height) as renderer:
            pixels = renderer.picture()
    except DisplayError as error:
        raise DisplayError(f"{error}; without --html the study needs no pictures") from error
    file = io.BytesIO()
    Image.fromarray(pixels).convert("RGB").quantize(128).save(file, "PNG", optimize=True)
    return file.getvalue()
