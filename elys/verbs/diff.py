"""diff: when, where and by how much two recorded runs part; in words, as JSON, or as a plot."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from elys.common.errors import ElysError
from elys.verbs.output import print_json, print_table
from elys.verbs.verify import progress_bar

if TYPE_CHECKING:
    from elys.bus.run_comparison import Comparison

_ROWS: Final = 20
_CURVES: Final = 5
_LEAST: Final = 1e-12  # [m] a logarithm has no 0
DIFFERENT, UNREADABLE = 1, 2


def diff(a: Path, b: Path, *, plot: Path | None, view: bool = False, json: bool) -> int:
    """Prints what two recordings differ in, and shows both where a `view` is wanted; returns the exit code."""
    from elys.bus.log import start_logging
    from elys.bus.run_comparison import compare

    start_logging()
    try:
        if plot is not None:
            _require_plot(plot)
        if view:
            from elys.render_node.window import probe_display

            probe_display()
        with progress_bar("Comparing", is_shown=not json) as progress:
            found = compare(a, b, curves=_CURVES if plot is not None else 0, progress=progress)
        if plot is not None:
            write_plot(found, plot)
    except ElysError as error:
        print(f"elys: {error}", file=sys.stderr)
        return UNREADABLE
    if json:
        print_json(found)
    else:
        _print(found)
        if plot is not None:
            print(f"\n{plot}")
    if view:
        from elys.verbs.run import start

        start("compare", {"recording": str(a), "ghost": str(b)}, endpoint=None)
    return DIFFERENT if found.differs else 0


def write_plot(found: Comparison, path: Path) -> None:
    """Draws how far bodies are off over time, as .png or as .html that needs no network."""
    import vl_convert

    from elys.common.assets.store import replace_file

    spec = plot_spec(found)
    if path.suffix == ".png":
        data = bytes(vl_convert.vegalite_to_png(spec, scale=2))
    else:
        data = str(vl_convert.vegalite_to_html(spec, bundle=True)).encode()
    try:
        replace_file(path, data)
    except OSError as error:
        raise ElysError(f"{path} cannot be written: {error.strerror}") from error


def plot_spec(found: Comparison) -> dict[str, Any]:
    """The plot as a Vega-Lite specification."""
    values = [
        {"body": curve.name, "time": time, "distance": max(distance, _LEAST)}
        for curve in found.curves
        for time, distance in zip(curve.time, curve.distance, strict=True)
        if distance > 0.0
    ]
    rules = [{"distance": horizon.distance} for horizon in found.horizons]
    time = {"field": "time", "type": "quantitative", "title": "simulation time [s]", "scale": {"zero": False}}
    distance = {"field": "distance", "type": "quantitative", "title": "distance [m]", "scale": {"type": "log"}}
    order = [curve.name for curve in found.curves]
    return {
        "title": f"How far bodies of {Path(found.a).name} and {Path(found.b).name} are from one another",
        "width": 640,
        "height": 360,
        "layer": [
            {
                "data": {"values": rules},
                "mark": {"type": "rule", "color": "#bbb", "strokeDash": [4, 4]},
                "encoding": {"y": distance},
            },
            {
                "data": {"values": values},
                "mark": {"type": "line"},
                "encoding": {
                    "x": {**time, "axis": {"format": "~g"}},
                    "y": {**distance, "axis": {"format": "~g"}},
                    "color": {"field": "body", "type": "nominal", "sort": order, "title": None},
                },
            },
        ],
    }


def _print(found: Comparison) -> None:
    span = f"{found.instants} instants from {found.first_time:.3f} s to {found.last_time:.3f} s"
    if not found.differs:
        print(f"equal: {span}")
        return
    print(
        f"they part at tick {found.first_tick} ({found.first_difference:.3f} s), in {found.first_of}; compared: {span}"
    )
    for horizon in found.horizons:
        when = (
            "never" if math.isnan(horizon.time) else f"at {horizon.time:.3f} s, {horizon.after:.3f} s after they part"
        )
        print(f"farther apart than {1000.0 * horizon.distance:g} mm: {when}")
    if found.bodies:
        print()
        rows = [
            (
                body.name or body.entity,
                body.first_tick,
                _length(body.largest),
                f"{body.largest_time:.3f}",
                _length(body.final),
            )
            for body in found.bodies[:_ROWS]
        ]
        print_table(("body", "first tick", "farthest, m", "at, s", "at the end, m"), rows)
        if len(found.bodies) > _ROWS:
            print(f"and {len(found.bodies) - _ROWS} more: --json tells of all")
    for lone in found.lone[:_ROWS]:
        print(f"{lone.name or lone.entity} is in {lone.only_in} alone, from tick {lone.tick} ({lone.time:.3f} s) on")
    if len(found.lone) > _ROWS:
        print(f"and {len(found.lone) - _ROWS} more bodies are in one alone")


def _length(metres: float) -> str:
    return f"{metres:.3g}"


def _require_plot(path: Path) -> None:
    if path.suffix not in (".png", ".html"):
        raise ElysError(f"{path} is no place for a plot: give it the suffix .png or .html")
    if not path.absolute().parent.is_dir():
        raise ElysError(f"{path} cannot be written: there is no folder {path.absolute().parent}")
