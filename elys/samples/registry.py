"""The scenes by name: the samples, each with the check that tells whether it ended as it should, and the hard cases."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from elys.common.errors import SceneError
from elys.common.scene import SceneDocument, write_scene
from elys.samples.bridge import bridge, check_bridge
from elys.samples.carillon import carillon
from elys.samples.dance import FIGURE, check_dance, dance
from elys.samples.empty import empty
from elys.samples.game.levels import LEVELS
from elys.samples.hard_cases import HARD_CASES
from elys.samples.pieces import check_pieces, pieces
from elys.samples.pile import pile
from elys.samples.playground import check_playground, playground
from elys.samples.stack import check_stack, stack
from elys.samples.yard import check_yard, yard

# Takes the final world positions [m] by entity name and says what is wrong with them, "" for nothing.
CheckFinal = Callable[[Mapping[str, Sequence[float]]], str]


FOLDER: Final = Path(__file__).parent  # relative to which samples name files


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A scene that ELYS can make by itself; `files` of FOLDER are those that it names."""

    name: str
    title: str
    build: Callable[[], SceneDocument]
    check_final: CheckFinal | None = None
    files: tuple[str, ...] = ()


SAMPLES: Final[Mapping[str, Sample]] = {
    sample.name: sample
    for sample in (
        Sample(name="yard", title="200 boxes and spheres rain into a yard", build=yard, check_final=check_yard),
        Sample(name="stack", title="A tower of ten cubes", build=stack, check_final=check_stack),
        Sample(name="bridge", title="A cart drives over a hanging bridge", build=bridge, check_final=check_bridge),
        Sample(name="pile", title="A thousand cubes in a bin", build=pile),
        Sample(name="carillon", title="Bars that ring, under a board that shows which", build=carillon),
        Sample(
            name="playground",
            title="A playground to walk, jump, climb and push in",
            build=playground,
            check_final=check_playground,
        ),
        Sample(
            name="dance",
            title="People dance, and others walk around them",
            build=dance,
            check_final=check_dance,
            files=(FIGURE,),
        ),
        Sample(
            name="pieces",
            title="Doors, belts, wind, coins: all gameplay pieces",
            build=pieces,
            check_final=check_pieces,
        ),
        Sample(name="empty", title="A ground, a sun and a camera", build=empty),
    )
}


def is_sample(name: str) -> bool:
    """Whether a sample or a hard case has this name."""
    return name in SAMPLES or name in HARD_CASES


def sample(name: str) -> Sample:
    """The sample, or the hard case as one, of this name; raises SceneError, with the nearest name, where there is none."""
    if name in SAMPLES:
        return SAMPLES[name]
    if name in HARD_CASES:
        case = HARD_CASES[name]
        return Sample(name=name, title=case.title, build=partial(case.build, case.seeds[0]))
    close = difflib.get_close_matches(name, [*SAMPLES, *HARD_CASES, *LEVELS], n=1)
    remedy = (
        f"did you mean '{close[0]}'?" if close else f"there are {', '.join(SAMPLES)} and the hard cases (elys samples)"
    )
    raise SceneError(f"there is no sample scene '{name}'; {remedy}")


def write_sample(name: str, path: str | Path) -> None:
    """Writes a sample's scene file, and beside it what it names.

    Raises:
        SceneError: there is none of this name, or a file cannot be written.
    """
    write_scene(sample(name).build(), path)
    copy_files(name, Path(path).parent)


def copy_files(name: str, folder: Path) -> None:
    """Puts the files that a sample names into a folder; SceneError where that fails."""
    for file in sample(name).files:
        try:
            (folder / file).write_bytes((FOLDER / file).read_bytes())
        except OSError as error:
            raise SceneError(f"{file}, which {name} names, cannot be written to {folder}: {error}") from error
