"""The actions of the viewport's camera: sides, places it goes back to, and the scene's own cameras."""

from __future__ import annotations

from typing import Final

from elys.editor_node.actions import Action
from elys.editor_node.camera_views import PLACES, SIDES, CameraViews

_SIDE_LABELS: Final = {
    "front": ("View from the front", "Keypad 1"),
    "back": ("View from behind", "Ctrl+Keypad 1"),
    "right": ("View from the right", "Keypad 3"),
    "left": ("View from the left", "Ctrl+Keypad 3"),
    "top": ("View from above", "Keypad 7"),
    "bottom": ("View from below", "Ctrl+Keypad 7"),
}


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
