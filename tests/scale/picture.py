"""The curves of docs/scale.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import vl_convert

from tests.scale.model import Outcome


def draw(path: Path, outcomes: Mapping[str, Sequence[Outcome]], check: Sequence[Mapping[str, Any]]) -> None:
    """Writes an SVG: ages and routers over viewers, and predicted beside measured costs."""
    ages = [
        {"viewers": found.viewers, "age": found.age(percentile), "what": f"{name}, p{percentile}"}
        for name, several in outcomes.items()
        for found in several
        for percentile in (50, 99)
    ]
    routers = [
        {"viewers": found.viewers, "routers": sum(load.nodes for load in found.levels[1:]), "what": name}
        for name, several in outcomes.items()
        for found in several
    ]
    costs = [
        {"viewers": row["viewers"], "cost": 1e3 * row[key], "what": f"{row['size'] / 1000:.1f} kB, {label}"}
        for row in check
        for key, label in (("predicted", "model"), ("router", "measured"))
    ]
    spec = {
        "$schema": "https://vega.github.io/schema/vega-lite/v5.json",
        "hconcat": [
            _curves(costs, "cost", "a router's processor time in a tick [ms]", scale="log"),
            _curves(ages, "age", "age of a state at a viewer [ms]", scale="linear"),
            _curves(routers, "routers", "routers", scale="log"),
        ],
        "config": {"background": "white", "legend": {"orient": "bottom", "columns": 1, "labelLimit": 300}},
        "resolve": {"scale": {"color": "independent"}},
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(vl_convert.vegalite_to_svg(spec))


def _curves(rows: list[dict[str, Any]], field: str, title: str, *, scale: str) -> dict[str, Any]:
    return {
        "width": 260,
        "height": 220,
        "data": {"values": rows},
        "mark": {"type": "line", "point": True},
        "encoding": {
            "x": {"field": "viewers", "type": "quantitative", "scale": {"type": "log"}, "title": "viewers"},
            "y": {"field": field, "type": "quantitative", "scale": {"type": scale}, "title": title},
            "color": {"field": "what", "type": "nominal", "title": None},
        },
    }
