"""What players can do in a scene, and which keys, sticks and motions do it until a player chooses others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Final

import msgspec

from elys.common.components.declaration import Component, Values, about, component
from elys.common.errors import ComponentError, InputError
from elys.common.input_controls import Sort, check_name, controls_of
from elys.common.input_response import MOST_DEAD_ZONE

MOST_NAMES: Final = 64  # of each sort
ACTIONS: Final = {
    "jump": "space, pad_a",
    "run": "left_shift, pad_left_thumb",
    "crouch": "left_control, pad_b",
    "use": "e, pad_x",
    "pause": "p, pad_start",
    "restart": "backspace, pad_back",
}
VECTORS: Final = {"move": "a/d/s/w, left/right/down/up, pad_left, pad_dpad", "look": "pointer, pad_right"}


def _check_controls(sort: Sort) -> Callable[[str, dict[str, Any]], None]:
    """Refuses names that are none, and controls that are none of a sort."""

    def check(where: str, values: dict[str, Any]) -> None:
        if len(values) > MOST_NAMES:
            raise ComponentError(f"{where} may have {MOST_NAMES} names, not {len(values)}")
        for name, controls in values.items():
            if not isinstance(controls, str):
                raise ComponentError(f"{where}.{name} must be a text of controls, such as 'space, pad_a'")
            try:
                check_name(name)
                controls_of(sort, controls)
            except InputError as error:
                raise ComponentError(f"{where}.{name}: {error}") from None

    return check


@component
class InputMap(Component, frozen=True):
    """What players can do, and with which controls at first; see docs/playing.md."""

    actions: Annotated[
        Values,
        about("Buttons by name, each with its controls: space, pad_a.", check=_check_controls("action")),
    ] = msgspec.field(default_factory=ACTIONS.copy)
    axes: Annotated[
        Values,
        about("Numbers from -1 to 1 by name: a/d, pad_left_x, wheel_y.", check=_check_controls("axis")),
    ] = {}
    vectors: Annotated[
        Values,
        about("Directions up to 1 long by name: a/d/s/w, pad_left, pointer.", check=_check_controls("vector")),
    ] = msgspec.field(default_factory=VECTORS.copy)
    stick_dead_zone: Annotated[
        float,
        about("Of a stick's way, in all directions alike.", minimum=0.0, maximum=MOST_DEAD_ZONE, step=0.01, dtype="f8"),
    ] = 0.15
    trigger_dead_zone: Annotated[
        float, about("Of a trigger's way.", minimum=0.0, maximum=MOST_DEAD_ZONE, step=0.01, dtype="f8")
    ] = 0.05
    curve: Annotated[
        float, about("Of sticks: 0 straight, 1 fine in the middle.", minimum=0.0, maximum=1.0, step=0.01, dtype="f8")
    ] = 0.0
    pointer_speed: Annotated[
        float, about("At which the pointer is as much as a stick at its end.", unit="1/s", minimum=1.0, dtype="f8")
    ] = 1000.0
    wheel_speed: Annotated[
        float, about("At which the wheel is.", unit="1/s", minimum=0.1, maximum=1000.0, dtype="f8")
    ] = 10.0
