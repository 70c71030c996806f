"""The actions of the viewport that keys mean: the camera's sides, places and scene cameras; and what the picture shows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, get_args

from elys.bus.messages.views import Debug, Shows
from elys.editor_node.actions import Action
from elys.editor_node.camera_views import PLACES, SIDES, CameraViews
from elys.editor_node.game_layer import LEAVE, LEAVE_KEYS, GameLayer
from elys.editor_node.view_look import ViewLook

_SIDE_LABELS: Final = {
    "front": ("View from the front", "Keypad 1"),
    "back": ("View from behind", "Ctrl+Keypad 1"),
    "right": ("View from the right", "Keypad 3"),
    "left": ("View from the left", "Ctrl+Keypad 3"),
    "top": ("View from above", "Keypad 7"),
    "bottom": ("View from below", "Ctrl+Keypad 7"),
}
DEBUG_LABELS: Final[dict[Debug, str]] = {
    "aabb": "Boxes along the axes",
    "obb": "Boxes that turn along",
    "contacts": "Contacts",
    "forces": "Forces",
    "joints": "Joints",
    "trajectories": "Trajectories",
    "velocity": "Velocities",
    "axes": "Axes of entities",
    "grid": "Grid of the broad phase",
    "labels": "Names",
    "islands": "Islands",
    "sleeping": "Who sleeps",
    "divergence": "Distances to other runs",
}


def look_actions(look: Callable[[], ViewLook]) -> tuple[Action, ...]:
    """Grid and shading; a switch for each kind of lines, and one for whom they are drawn of. `look` says whose, each time."""

    def show(view: Shows) -> Action:
        return Action(
            name=f"view.{view}",
            label=f"Show {view}",
            run=lambda: setattr(look(), "shows", view),
            is_on=lambda: look().shows == view,
        )

    def switch(kind: Debug) -> Action:
        return Action(
            name=f"debug.{kind}",
            label=DEBUG_LABELS[kind],
            run=lambda: look().switch_debug(kind),
            is_on=lambda: kind in look().debug,
        )

    return (
        Action(
            name="view.grid",
            label="Grid",
            run=lambda: setattr(look(), "shows_grid", not look().shows_grid),
            is_on=lambda: look().shows_grid,
        ),
        *(show(view) for view in get_args(Shows)),
        *(switch(kind) for kind in get_args(Debug)),
        Action(
            name="debug.selection",
            label="Of the selection alone",
            run=lambda: setattr(look(), "debugs_selection", not look().debugs_selection),
            is_on=lambda: look().debugs_selection,
        ),
    )


def game_actions(game: GameLayer) -> tuple[Action, ...]:
    """To play in a viewport, and to come out again; the keys of the latter are heard by the game's layer, above all others."""
    return (
        Action(
            name="game.play",
            label="Play in this viewport",
            keys=("F5",),
            run=game.play,
            is_possible=lambda: game.is_possible,
            is_on=lambda: game.is_on,
        ),
        Action(name=LEAVE, label="Take the keys back", keys=LEAVE_KEYS, run=game.leave, is_possible=lambda: game.is_on),
    )


def camera_actions(views: CameraViews) -> tuple[Action, ...]:
    """All of them."""

    def look(side: str) -> Action:
        label, keys = _SIDE_LABELS[side]
        return Action(name=f"camera.{side}", label=label, keys=(keys,), run=lambda: views.look_from_side(side))

    def keep(digit: str) -> Action:
        return Action(
            name=f"camera.keep_{digit}",
            label=f"Keep view {digit}",
            keys=(f"Ctrl+Alt+{digit}",),
            run=lambda: views.keep_place(digit),
        )

    def go(digit: str) -> Action:
        return Action(
            name=f"camera.go_{digit}",
            label=f"Go to view {digit}",
            keys=(f"Alt+{digit}",),
            run=lambda: views.go_to_place(digit),
            is_possible=lambda: digit in views.places,
        )

    def has_camera() -> bool:
        return views.selected_camera != 0

    return (
        *(look(side) for side in SIDES),
        Action(
            name="camera.parallel",
            label="Parallel view",
            keys=("Keypad 5",),
            run=views.toggle_parallel,
            is_on=lambda: views.is_parallel,
        ),
        Action(
            name="camera.look_through",
            label="Look through the selected camera",
            keys=("Keypad 0",),
            run=views.look_through_selected,
            is_possible=has_camera,
        ),
        Action(
            name="camera.move_here",
            label="Move the selected camera to this view",
            keys=("Ctrl+Alt+Keypad 0",),
            run=views.move_selected_here,
            is_possible=has_camera,
        ),
        *(go(digit) for digit in PLACES),
        *(keep(digit) for digit in PLACES),
    )
