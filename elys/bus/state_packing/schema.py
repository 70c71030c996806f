"""The JSON Schema of a state frame, with the layout of its bytes, as it stands in a recording beside the frames."""

from __future__ import annotations

from typing import Any, Final

import msgspec

from elys.bus.messages.state_frame import COLUMNS, HEADER, LOCAL_COLUMNS, TAIL_HEADER, WEIGHT_COLUMNS
from elys.bus.state_packing import compact
from elys.bus.state_packing.frames import HEAD_SIZE, STATE_ENCODING

_HEADER: Final = (
    "epoch",
    "tick",
    "simulation_time",
    "published_at",
    "delta_sequence",
    "state_hash",
    "body_count",
    "flags",
)
_TEXTS: Final = {
    "epoch": "which run of the host made it",
    "simulation_time": "s",
    "published_at": "ns, wall clock",
    "delta_sequence": "the deltas that must have been applied before",
    "state_hash": "of the exact state, also where the frame is compact",
    "flags": "1 playing, 2 a tail follows, 4 told again, 8 of a fork; bits 4 to 31: the instant that it shows, plus 1",
    "position": "m, world",
    "rotation": "x y z w, world",
    "linear_velocity": "m/s",
    "angular_velocity": "rad/s",
    "local_position": "m, relative to the parent",
    "local_rotation": "x y z w, relative to the parent",
}


def state_schema() -> bytes:
    """JSON Schema of a frame as it is on the bus; `layout` says how it becomes bytes there, and what precedes them in a file."""
    properties: dict[str, Any] = {
        name: _described(name, {"type": "number" if name == "simulation_time" else "integer"}) for name in _HEADER
    }
    for name, dtype, width in (*COLUMNS, *LOCAL_COLUMNS, *WEIGHT_COLUMNS):
        number: dict[str, Any] = {"type": "integer" if dtype[1] == "u" else "number"}
        row = {"type": "array", "items": number, "minItems": width, "maxItems": width} if width > 1 else number
        properties[name] = _described(name, {"type": "array", "items": row})
    return msgspec.json.encode(
        {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": "elys.StateFrame",
            "description": "where every moving body is at one tick",
            "type": "object",
            "properties": properties,
            "required": [*_HEADER, *(name for name, _, _ in COLUMNS)],
            "layout": _layout(),
        }
    )


def _described(name: str, schema: dict[str, Any]) -> dict[str, Any]:
    return {**schema, "description": _TEXTS[name]} if name in _TEXTS else schema


def _layout() -> dict[str, Any]:
    def columns(rows: str, listed: tuple[tuple[str, str, int], ...]) -> list[dict[str, Any]]:
        return [{"name": name, "dtype": dtype, "width": width, "rows": rows} for name, dtype, width in listed]

    return {
        "frame": {
            "description": "little-endian, no padding: the header, then one column after the other",
            "header": {"format": HEADER.format, "names": _HEADER, "bytes": HEADER.size},
            "columns": columns("body_count", COLUMNS),
            "tail": {
                "header": {
                    "format": TAIL_HEADER.format,
                    "names": ("local_count", "weight_count"),
                    "bytes": TAIL_HEADER.size,
                },
                "columns": columns("local_count", LOCAL_COLUMNS) + columns("weight_count", WEIGHT_COLUMNS),
            },
        },
        "stored": {
            "encoding": STATE_ENCODING,
            "description": "the header as it is, then what follows at 56, see docs/recording-format.md of ELYS",
            "head": {
                "format": "<BBHII",
                "names": ("kind", "told", "zero", "number", "base"),
                "offset": HEADER.size,
                "end": HEAD_SIZE,
            },
            "kinds": {"1": "key", "2": "refresh", "3": "difference", "4": "verbatim", "+128": "compact"},
            "told": {"1": "entity ids", "2": "rows", "4": "which rows", "8": "tail"},
            "compact": {
                "position": {"steps": compact.POSITION_STEPS, "largest_error": compact.POSITION_ERROR, "unit": "m"},
                "rotation": {
                    "steps": compact.ROTATION_STEPS,
                    "largest_error": compact.ROTATION_ERROR,
                    "unit": "degrees",
                },
                "linear_velocity": {
                    "steps": compact.LINEAR_STEPS,
                    "largest_error": compact.LINEAR_ERROR,
                    "unit": "m/s",
                },
                "angular_velocity": {
                    "steps": compact.ANGULAR_STEPS,
                    "largest_error": compact.ANGULAR_ERROR,
                    "unit": "rad/s",
                },
            },
        },
    }
