"""make gallery: runs the hard cases, draws a picture of each, and writes docs/hard-cases.md. Look at them before committing."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from elys.common.assets.store import AssetStore
from elys.lab.cases import opened_case
from elys.render_node.offline import OfflineRenderer
from elys.samples.hard_cases import HARD_CASES, HardCase
from elys.verbs.footage import simulated

DOCS = Path(__file__).parents[1] / "docs"
PICTURES = DOCS / "pictures" / "hard-cases"
PAGE = DOCS / "hard-cases.md"
SIZE = (480, 270)
COLORS = 160  # of a picture: half the bytes, and hardly to be told from all
COLUMNS = 3  # of the gallery
_BEGIN, _END = "<!-- figures -->", "<!-- /figures -->"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="draw these alone and run nothing")
    names = parser.parse_args().names
    PICTURES.mkdir(parents=True, exist_ok=True)
    for case in [HARD_CASES[name] for name in names] if names else HARD_CASES.values():
        draw(case, PICTURES / f"{case.name}.png")
    if not names:
        page = PAGE.read_text()
        before, after = page.split(_BEGIN)[0], page.split(_END)[1]
        PAGE.write_text(f"{before}{_BEGIN}\n{figures(measured())}\n{_END}{after}")


def draw(case: HardCase, path: Path) -> None:
    """A case at its picture's time, small enough for a page of fifty."""
    assets = AssetStore()
    footage = simulated(opened_case(case, case.seeds[0]), assets, case.picture_time)
    footage.mirror.keep_frame(next(footage.frames))
    # Drawn twice as large: the average of four pixels has smooth edges.
    with OfflineRenderer(footage.mirror, footage.fetch, width=2 * SIZE[0], height=2 * SIZE[1]) as renderer:
        pixels = np.asarray(renderer.picture())[:, :, :3]
    picture = Image.fromarray(pixels).resize(SIZE, Image.Resampling.BOX)
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path}: {path.stat().st_size} bytes", flush=True)


def measured() -> list[dict[str, Any]]:
    """What `elys cases run --all --json` says."""
    command = [sys.executable, "-m", "elys", "cases", "run", "--all", "--json"]
    run = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, env=os.environ)
    if run.returncode not in (0, 1):  # 1: some bound is missed
        raise SystemExit(f"elys cases ended with {run.returncode}")
    found: list[dict[str, Any]] = json.loads(run.stdout)
    return found


def figures(outcomes: list[dict[str, Any]]) -> str:
    """The gallery, the table of errors and what is known to be missed, as Markdown."""
    errors = [(outcome, error) for outcome in outcomes for error in outcome["errors"]]
    met = sum(error["is_met"] for _, error in errors)
    lines = [f"{met} of {len(errors)} errors of {len(outcomes)} cases are within their bounds.", "", *_gallery(), ""]
    lines += ["| case | error | is | at most | |", "| --- | --- | --- | --- | --- |"]
    for outcome, error in errors:
        verdict = "" if error["is_met"] else "**missed**"
        lines.append(
            f"| [{outcome['case']}](#{outcome['case']}) | {error['name']} | {_figure(error)} | {error['bound']:.3g} | {verdict} |"
        )
    missed = [(outcome, error) for outcome, error in errors if not error["is_met"]]
    lines += ["", "## Known misses", ""]
    lines += [
        f"- **{outcome['case']}**, {error['name']} {_figure(error)} instead of {error['bound']:g}: {error['known_miss']}."
        for outcome, error in missed
    ]
    lines += ["", "## The cases", ""]
    for case in HARD_CASES.values():
        lines += [
            f"### {case.name}",
            "",
            f"{_sentence(case.title)} *Hard:* {_sentence(case.difficulty, capital=False)}",
        ]
        lines += ["", f"*Answer:* {_sentence(case.answer, capital=False)}", ""]
    return "\n".join(lines).rstrip()


def _gallery() -> list[str]:
    cells = [
        f"[![{case.title}](pictures/hard-cases/{case.name}.png)](#{case.name})<br>{case.name}"
        for case in HARD_CASES.values()
    ]
    cells += [""] * (-len(cells) % COLUMNS)
    rows = [cells[start : start + COLUMNS] for start in range(0, len(cells), COLUMNS)]
    head = ["| " + " | ".join([" "] * COLUMNS) + " |", "| " + " | ".join([":---:"] * COLUMNS) + " |"]
    return head + ["| " + " | ".join(row) + " |" for row in rows]


def _figure(error: dict[str, Any]) -> str:
    if error["value"] is None:
        return "not finite"
    figure = f"{error['value']:.0f}" if abs(error["value"]) >= 10.0 else f"{error['value']:.2g}"
    return figure + (f" {error['unit']}" if error["unit"] != "1" else "")


def _sentence(text: str, *, capital: bool = True) -> str:
    return (text[0].upper() if capital else text[0]) + text[1:] + "."


if __name__ == "__main__":
    main()
