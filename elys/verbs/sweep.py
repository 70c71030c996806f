"""sweep: a scene many times over, with other values each time, as a table of observables."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from elys.common.assets.store import AssetStore
from elys.common.errors import ElysError
from elys.lab.sweep import Row, require_table, rows, write_rows
from elys.lab.variation import combinations, parse_variation, varied
from elys.verbs.kernels import compile_with_progress
from elys.verbs.pareto import counted
from elys.verbs.scenes import open_scene_or_sample


def sweep(
    scene: str,
    *,
    vary: Sequence[str],
    output: Path,
    seconds: float,
    jitter: float,
    jobs: int,
    cluster: str,
) -> None:
    """Runs every combination and writes the table; interrupted, it writes the rows that are there."""
    require_table(output)
    if not vary:
        raise ElysError(
            "nothing is varied: say what with --vary, for instance --vary seed=0..99 --vary gravity=1.62,9.81"
        )
    asked = combinations([parse_variation(text) for text in vary])
    assets = AssetStore()
    opened = open_scene_or_sample(scene, assets)
    varied(opened, asked[0], jitter=jitter)  # a name that is not known is said before anything is run
    compile_with_progress(opened)
    found: dict[int, Row] = {}
    try:
        with counted(f"Running {opened.name}") as progress:
            progress("", 0, len(asked))
            done = rows(opened, assets, asked, duration=seconds, jitter=jitter, processes=jobs, cluster=cluster)
            for place, row in done:
                found[place] = row
                progress("", len(found), len(asked))
    except KeyboardInterrupt:
        sys.stderr.write(f"interrupted after {len(found)} of {len(asked)} runs\n")
    if not found:
        raise ElysError("no run came to its end; nothing was written")
    write_rows(output, [found[place] for place in sorted(found)])
    failed = [row["problem"] for row in found.values() if row["problem"]]
    print(f"{output}: {len(found)} runs of {seconds:g} s")
    if failed:
        print(f"  {len(failed)} could not be run to their end (column problem); the first: {failed[0]}")
