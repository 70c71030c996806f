"""verify: runs a recording again and says whether it comes out the same, with an exit code for scripts."""

from __future__ import annotations

import contextlib
import logging
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from elys.common.components import values_of
from elys.common.errors import ElysError
from elys.common.scene import OpenedScene
from elys.common.scene_document import EntityRecord
from elys.verbs.moments import parse_moment
from elys.verbs.output import print_json

if TYPE_CHECKING:
    from elys.bus.mirror import SceneMirror
    from elys.sim_node.verification import Verdict

EXIT_CODES: Final = {"equal": 0, "altered": 1, "other build": 3, "not deterministic": 4, "incomplete": 5}
UNSUITABLE: Final = 2


def verify(recording: Path, *, start: str, end: str, threads: int, json: bool) -> int:
    """Prints the verdict; returns the exit code."""
    from elys.bus.log import start_logging
    from elys.sim_node.verification import verify as verified

    start_logging()
    logging.getLogger("elys.sim_node.simulation").setLevel(
        logging.CRITICAL
    )  # what physics found was told when it was recorded
    try:
        first, last = parse_moment(start), parse_moment(end, otherwise=math.inf)
        load_kernels(recording, threads=threads)
        with progress_bar("Running again", is_shown=not json) as progress:
            verdict = verified(recording, first=first, last=last, threads=threads, progress=progress)
    except ElysError as error:
        print(f"elys: {error}", file=sys.stderr)
        return UNSUITABLE
    if json:
        print_json(verdict)
    else:
        print(describe(verdict))
    return EXIT_CODES[verdict.cause]


def describe(verdict: Verdict) -> str:
    """A verdict as a person reads it."""
    count = f"{verdict.ticks} ticks"
    if verdict.missing_ticks:
        first, last = verdict.gaps[0]
        where = f"tick {first}" if first == last else f"ticks {first}-{last}"
        are = "1 is" if verdict.missing_ticks == 1 else f"{verdict.missing_ticks} are"
        count = (
            f"{verdict.ticks} of {verdict.ticks + verdict.missing_ticks} ticks compared, {are} missing (first: {where})"
        )
    times = f"{verdict.first_time:.2f} s to {verdict.last_time:.2f} s"
    span = f"{count}; {times}" if verdict.missing_ticks else f"{count} ({times})"
    speed = f"{verdict.realtime_factor:.1f} times real time"
    lines = [f"note: {note}" for note in verdict.notes]
    lines += [f"damaged: {part}" for part in verdict.damage]
    if verdict.lead_ticks:
        older = f"older by {verdict.lead_ticks} tick{'s' if verdict.lead_ticks > 1 else ''}"
        lines.append(f"note: the state from which it was run again is {older} than the first that can be compared")
    if verdict.jumps:
        more = f" and at {len(verdict.jumps) - 1} more" * (len(verdict.jumps) > 1)
        lines.append(
            f"note: at tick {verdict.jumps[0]}{more} it goes on from a state in the file that nothing in it leads to"
        )
    if verdict.difference is None and not verdict.ticks:
        lines.append("nothing was compared: of that time no tick is in the recording")
        return "\n".join(lines)
    if verdict.difference is None:
        lines.append(f"equal: {span}, {speed}")
        if verdict.other:
            lines.append(f"though here is another build or machine: {', '.join(verdict.other)}")
        return "\n".join(lines)
    lines += [f"different: {verdict.difference.text}", f"equal before it: {span}, {speed}"]
    match verdict.cause:
        case "incomplete":
            lines.append("what comes after it cannot be run again: a part of the file is damaged")
        case "other build":
            lines.append(f"recorded by another build or kind of machine: {', '.join(verdict.other)}")
        case "not deterministic":
            lines.append("not deterministic: run once more, it came out as something else again")
        case _:
            lines.append(
                "the same build, and run twice it came out the same: the file was altered, or the machine that recorded it erred"
            )
    return "\n".join(lines)


def load_kernels(recording: Path, *, threads: int) -> None:
    """Loads what the recording's first scene needs, or compiles it with a bar. Raises RecordingError."""
    from elys.bus.recording import opened_to_show
    from elys.verbs.kernels import compile_with_progress

    with opened_to_show(recording) as opened:
        mirror = opened.mirror_at(0)
    compile_with_progress(scene_of(mirror, recording), threads=threads)


def scene_of(mirror: SceneMirror, path: Path) -> OpenedScene:
    """What a mirror shows, as a scene that was opened."""
    entities = mirror.in_order()
    place = {entity.id: number for number, entity in enumerate(entities)}
    records = [
        EntityRecord(
            name=entity.name,
            parent=place.get(entity.parent, -1),
            enabled=entity.enabled,
            components={name: values_of(component) for name, component in entity.components.items()},
        )
        for entity in entities
    ]
    return OpenedScene(name=mirror.scene, path=path, settings=mirror.settings, records=records)


@contextlib.contextmanager
def progress_bar(text: str, *, is_shown: bool = True) -> Iterator[Callable[[float, float], None]]:
    """A bar on stderr, told of what is done and of how much there is, in seconds of simulation."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn(text),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:.1f} s"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
        disable=not is_shown,
    )
    with bar:
        task = bar.add_task(text, total=1.0)
        yield lambda done, total: bar.update(task, completed=done, total=total)
