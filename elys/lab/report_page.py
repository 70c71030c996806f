"""A study as one page that needs no network: curves, a table, pictures of the moments of largest error.

The curves are Vega-Lite specifications (https://vega.github.io/vega-lite/docs/); its scripts are put into the page.
"""

from __future__ import annotations

import base64
import datetime
import html
import importlib.util
import json
import math
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

import elys
from elys.common.assets.store import replace_file
from elys.common.errors import ElysError
from elys.lab.motion import Motion
from elys.lab.observables import OBSERVABLES
from elys.lab.pareto import Outcome, Study

LEAST: Final = 1e-7  # relative errors below are drawn there: a logarithm has no 0

Spec = dict[str, Any]

_COST: Final[Spec] = {
    "field": "cost",
    "type": "quantitative",
    "scale": {"type": "log", "nice": False, "padding": 20},
    "title": "processor time [ms per s]",
}
_ERROR: Final[Spec] = {
    "field": "error",
    "type": "quantitative",
    "scale": {"type": "log"},
    "title": "relative error",
    "axis": {"format": ".0e"},
}


class Picture(msgspec.Struct, frozen=True):
    """What a moment looked like."""

    title: str
    data: bytes  # PNG


def write_page(
    path: Path, studies: Sequence[Study], *, motions: Sequence[Sequence[Motion]], pictures: Sequence[Sequence[Picture]]
) -> None:
    """Writes the page; `motions` and `pictures` have a row for each study, the motions with the reference first.

    Raises:
        ElysError: the file cannot be written. ImportError: the package that draws is missing (`require_page` says so).
    """
    parts = [
        _section(number, study, own_motions, own_pictures)
        for number, (study, own_motions, own_pictures) in enumerate(zip(studies, motions, pictures, strict=True))
    ]
    specs = {f"{name}{number}": spec for number, part in enumerate(parts) for name, spec in part[1].items()}
    calls = "".join(f"vegaEmbed('#{place}', specs['{place}'], {{actions: false, renderer: 'svg'}});" for place in specs)
    title = "Speed against error: " + ", ".join(study.scene for study in studies)
    today = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    page = (
        f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{html.escape(title)}</title><style>{_STYLE}</style>"
        f"<body><h1>{html.escape(title)}</h1><p>ELYS {elys.__version__}, {today}, {html.escape(machine())}. "
        "Time is processor time of the simulation alone; an error is told as a share of what is typical of the scene.</p>"
        + "".join(part[0] for part in parts)
        + f"<script type='module'>const specs = {_embedded(specs)};\n"
        + _scripts(calls)
        + "</script></body></html>\n"
    )
    try:
        replace_file(path, page.encode())
    except OSError as error:
        raise ElysError(f"{path} cannot be written: {error.strerror}") from error


def require_page(path: Path) -> None:
    """Raises ElysError where no page can be written, before anything is run for it."""
    if not path.absolute().parent.is_dir():
        raise ElysError(f"{path} cannot be written: there is no folder {path.parent}")
    if importlib.util.find_spec("vl_convert") is None:
        raise ElysError("pages need vl-convert-python: pip install 'elys[lab]'")


def machine() -> str:
    """This machine's processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _embedded(specs: dict[str, Spec]) -> str:
    """As JSON within a script, which no text in it may end."""
    return json.dumps(specs).replace("</", "<\\/")


def _scripts(calls: str) -> str:
    import vl_convert

    # The end of a script inside a text would end this one.
    return str(vl_convert.javascript_bundle(calls)).replace("</script", "<\\/script")


def _section(
    number: int, study: Study, motions: Sequence[Motion], pictures: Sequence[Picture]
) -> tuple[str, dict[str, Spec]]:
    sure = (
        f"The reference ({study.reference.label}) has converged."
        if study.is_converged
        else f"The reference ({study.reference.label}) did not converge in "
        + ", ".join(f"{name} (±{value:.1g})" for name, value in study.uncertainty.items() if value > 2e-4)
        + ": less than twice that decides nothing."
    )
    chosen = (
        f"Cheapest within an error of {study.budget:g}: <b>{study.chosen.label}</b>."
        if study.chosen
        else f"No setting keeps within an error of {study.budget:g}."
    )
    figures = "".join(
        f"<figure><img src='data:image/png;base64,{base64.b64encode(picture.data).decode()}' alt=''>"
        f"<figcaption>{html.escape(picture.title)}</figcaption></figure>"
        for picture in pictures
    )
    text = (
        f"<h2>{html.escape(study.scene)}</h2><p>{study.body_count} bodies, {study.duration:g} s. {sure} {chosen}</p>"
        f"<div class='row'><div id='front{number}'></div><div id='parts{number}'></div><div id='energy{number}'></div></div>"
        f"<div class='row'>{figures}</div>{_table(study)}"
    )
    return text, {
        "front": front_spec(study),
        "parts": parts_spec(study),
        "energy": energy_spec(study, motions),
    }


def _table(study: Study) -> str:
    head = "".join(f"<th>{name}</th>" for name in ("setting", "ms/s", "error", "dominant", "by", "parted after"))
    rows = []
    for outcome in study.outcomes:
        worst = outcome.worst
        mark = " class='chosen'" if outcome.setting == study.chosen else " class='best'" if outcome.is_best else ""
        cells = (
            outcome.setting.label,
            f"{1000.0 * outcome.cost:.2f}",
            f"{outcome.error:.1e}",
            f"{worst.name}: {worst.value:.2e} {worst.unit} at {worst.time:.2f} s",
            worst.culprit,
            "never" if outcome.horizon is None else f"{outcome.horizon:.2f} s",
        )
        rows.append(f"<tr{mark}>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
    for peer in study.peers:
        if peer.outcome is None:
            continue
        worst = peer.outcome.worst
        cells = (
            f"{peer.label}, {peer.tick_rate} Hz",
            f"{1000.0 * peer.outcome.cost:.2f}",
            f"{peer.outcome.error:.1e}",
            f"{worst.name}: {worst.value:.2e} {worst.unit} at {worst.time:.2f} s",
            worst.culprit,
            "never" if peer.outcome.horizon is None else f"{peer.outcome.horizon:.2f} s",
        )
        rows.append("<tr class='peer'>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
    untold = "".join(
        f"<p>{html.escape(label)}: {html.escape(', '.join(names))} unknown, not counted.</p>"
        for label, names in study.untold.items()
    )
    return f"<table><tr>{head}</tr>{''.join(rows)}</table>{untold}"


def front_spec(study: Study) -> Spec:
    """Cost against the dominant error, every setting a point and the best of them on a line."""
    values = [_point(outcome, study) for outcome in study.outcomes]
    x = {
        "field": "cost",
        "type": "quantitative",
        "scale": {"type": "log", "nice": False, "padding": 20},
        "title": "processor time [ms per s]",
    }
    y = {
        "field": "error",
        "type": "quantitative",
        "scale": {"type": "log"},
        "title": "relative error",
        "axis": {"format": ".0e"},
    }
    tooltip = [{"field": name} for name in ("setting", "cost", "error", "dominant", "value", "by")]
    return {
        "title": "Speed against error",
        "width": 420,
        "height": 300,
        "data": {"values": values},
        "layer": [
            {
                "transform": [{"filter": "datum.best"}],
                "mark": {"type": "line", "interpolate": "step-after", "color": "#888"},
                "encoding": {"x": x, "y": y},
            },
            {
                "mark": {"type": "point", "filled": True, "size": 60},
                "encoding": {
                    "x": x,
                    "y": y,
                    "color": {"field": "tick rate", "type": "ordinal", "scale": {"scheme": "viridis"}},
                    "shape": {"field": "islands", "type": "nominal"},
                    "tooltip": tooltip,
                },
            },
            {
                "transform": [{"filter": "datum.chosen"}],
                "mark": {"type": "point", "size": 300, "color": "#d33"},
                "encoding": {"x": x, "y": y},
            },
        ],
    }


def parts_spec(study: Study) -> Spec:
    """What each observable says of the best settings."""
    values = [
        {"cost": 1000.0 * outcome.cost, "error": max(_drawn(error.relative), LEAST), "observable": error.name}
        for outcome in study.outcomes
        if outcome.is_best
        for error in outcome.errors
    ]
    return {
        "title": "The best, by observable",
        "width": 420,
        "height": 300,
        "data": {"values": values},
        "mark": {"type": "line", "point": True},
        "encoding": {
            "x": {
                "field": "cost",
                "type": "quantitative",
                "scale": {"type": "log", "nice": False, "padding": 20},
                "title": "processor time [ms per s]",
            },
            "y": {
                "field": "error",
                "type": "quantitative",
                "scale": {"type": "log"},
                "title": "relative error",
                "axis": {"format": ".0e"},
            },
            "color": {"field": "observable", "type": "nominal", "sort": [o.name for o in OBSERVABLES]},
        },
    }


def energy_spec(study: Study, motions: Sequence[Motion]) -> Spec:
    """The sum of energy over time: of the reference, the scene's own setting, the chosen and the cheapest."""
    wanted = {study.reference, study.own, study.outcomes[0].setting, *([study.chosen] if study.chosen else [])}
    values = [
        {"time": float(time), "energy": float(energy), "setting": motion.setting.label}
        for motion in motions
        if motion.setting in wanted and motion.is_finite
        for time, energy in zip(motion.time, motion.energy, strict=True)
    ]
    return {
        "title": "Energy",
        "width": 420,
        "height": 300,
        "data": {"values": values},
        "mark": "line",
        "encoding": {
            "x": {"field": "time", "type": "quantitative", "title": "time [s]"},
            "y": {
                "field": "energy",
                "type": "quantitative",
                "title": "kinetic and potential energy [J]",
                "scale": {"zero": False},
            },
            "color": {"field": "setting", "type": "nominal"},
        },
    }


def _point(outcome: Outcome, study: Study) -> dict[str, Any]:
    return {
        "cost": 1000.0 * outcome.cost,
        "error": max(_drawn(outcome.error), LEAST),
        "setting": outcome.setting.label,
        "tick rate": outcome.setting.tick_rate,
        "islands": "hard ones get more" if outcome.setting.strengths > 1 else "all the same",
        "dominant": outcome.dominant,
        "value": f"{outcome.worst.value:.3g} {outcome.worst.unit}",
        "by": outcome.worst.culprit,
        "best": outcome.is_best,
        "chosen": outcome.setting == study.chosen,
    }


def _drawn(error: float) -> float:
    return error if math.isfinite(error) else 1e3


_STYLE: Final = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1440px; margin: 2em auto; padding: 0 1em; color: #222; }
.row { display: flex; flex-wrap: wrap; gap: 1.5em; }
table { border-collapse: collapse; margin: 1em 0; font-variant-numeric: tabular-nums; }
td, th { padding: 0.15em 0.8em; text-align: left; border-bottom: 1px solid #ddd; }
tr.best { background: #eef5ff; } tr.chosen { background: #ffe9e6; }
figure { margin: 0; } figcaption { color: #555; } img { max-width: 480px; }
"""
