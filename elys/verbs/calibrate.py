"""calibrate: the cheapest settings within an error, measured and written into the scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from elys.common.assets.store import AssetStore
from elys.common.errors import SceneError
from elys.common.scene import SceneDocument, read_scene, write_scene
from elys.common.scene_document import Calibration
from elys.lab.calibrate import calibrated
from elys.lab.jobs import workers
from elys.lab.observables import require_observables
from elys.lab.pareto import study
from elys.lab.setting import Setting, ladder
from elys.samples.registry import copy_files, is_sample, sample
from elys.verbs.kernels import compile_with_progress
from elys.verbs.output import print_json
from elys.verbs.pareto import answers_of, case_of, counted, require_budget
from elys.verbs.scenes import open_scene_or_sample


def calibrate(
    scene: str,
    *,
    output: Path | None,
    seconds: float,
    error: float,
    only: Sequence[str],
    keep_tick_rate: bool,
    json: bool,
    jobs: int,
    cluster: str,
) -> None:
    """Studies the scene and writes the chosen settings, with their evidence, into its file or into `output`."""
    require_budget(error)
    require_observables(only, more=answers_of(scene))
    document, target = _document(scene, output)
    assets = AssetStore()
    opened = open_scene_or_sample(scene, assets)
    compile_with_progress(opened)
    settings: list[Setting] = ladder(opened.settings, factors=(1.0,)) if keep_tick_rate else []
    with workers(processes=jobs, cluster=cluster) as executor, counted(f"Running {opened.name}") as progress:
        found = study(
            opened,
            assets,
            executor,
            duration=seconds,
            budget=error,
            settings=settings,
            only=only,
            case=case_of(scene),
            progress=progress,
        )
    document.settings = calibrated(document.settings, found)
    write_scene(document, target)
    if is_sample(scene) and not Path(scene).exists():
        copy_files(scene, target.parent)
    evidence = document.settings.calibration
    assert evidence is not None and found.chosen is not None
    if json:
        print_json({"file": str(target), "setting": found.chosen, "calibration": evidence})
    else:
        print(_told(target, found.own, found.chosen, evidence))


def _document(scene: str, output: Path | None) -> tuple[SceneDocument, Path]:
    path = Path(scene)
    if path.exists() and path.suffix == ".json":
        return read_scene(path), output or path
    if is_sample(scene) and not path.exists():
        if output is None:
            raise SceneError(
                f"{scene} is a sample and has no file: write the calibrated scene with -o {scene}.scene.json"
            )
        return sample(scene).build(), output
    if path.suffix in (".gltf", ".glb"):
        raise SceneError(f"{path} is a model and has no settings: calibrate a scene that holds it")
    open_scene_or_sample(scene)  # says what is wrong
    raise SceneError(f"{scene} has no settings to be calibrated")


def _told(target: Path, own: Setting, chosen: Setting, evidence: Calibration) -> str:
    if chosen == own:
        change = f"stays at {chosen.label}"
    else:
        change = f"{own.label} -> {chosen.label}"
    saved = evidence.cost_before / evidence.cost if evidence.cost else 1.0
    return (
        f"{target}: {change}; {evidence.cost_before:g} -> {evidence.cost:g} ms per s ({saved:.1f} times as fast), "
        f"error {evidence.error_before:.1e} -> {evidence.error:.1e} of {evidence.budget:g} allowed, mostly {evidence.dominant}"
    )
