"""The layer under the widgets that steers the cameras of viewports and picks in them.

Alt and the left button orbit, the middle one pans, the wheel zooms, the right one with W A S D flies. The left button alone
picks, or drags a rectangle that selects: Shift adds what is in it, Ctrl turns it about. A drag belongs to the viewport that it
began in, wherever the pointer goes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal

import numpy as np

from elys.bus.messages.views import PickReply
from elys.common.errors import BusError
from elys.common.math import quaternion
from elys.editor_node.body_hand import BodyHand
from elys.editor_node.box_selection import entities_in_box
from elys.editor_node.camera import project
from elys.editor_node.events import (
    Event,
    KeyPressed,
    KeyReleased,
    Modifiers,
    MouseButton,
    MouseMoved,
    MousePressed,
    MouseReleased,
    MouseScrolled,
    WindowFocused,
)
from elys.editor_node.keys import Key
from elys.editor_node.language import tr
from elys.editor_node.model import EditorModel
from elys.editor_node.viewports import Viewports

CLICK_DISTANCE: Final = 4.0  # [pixels] the pointer may move between down and up
_FLY_KEYS: Final = {
    Key.W: (0.0, 0.0, 1.0),
    Key.S: (0.0, 0.0, -1.0),
    Key.A: (-1.0, 0.0, 0.0),
    Key.D: (1.0, 0.0, 0.0),
    Key.Q: (0.0, -1.0, 0.0),
    Key.E: (0.0, 1.0, 0.0),
}
_Action = Literal["", "click", "box", "cube", "hold", "orbit", "pan", "fly"]


class ViewportLayer:
    """Hears of the mouse only where ImGui has no widget, and consumes what it uses."""

    def __init__(
        self, model: EditorModel, viewports: Viewports, *, hold_pointer: Callable[[bool], None] = lambda is_held: None
    ) -> None:
        self._model = model
        self._viewports = viewports
        self._panel = viewports.first  # the one that the button went down in last
        self.hand = BodyHand(model)
        self.grabs: Callable[[], bool] = lambda: False  # whether the tool in hand drags bodies
        self._action: _Action = ""
        self._button = -1
        self._pointer = (0.0, 0.0)
        self._pressed_at = (0.0, 0.0)
        self._modifiers = Modifiers.NONE
        self._held: set[int] = set()
        self._hold_pointer = hold_pointer
        self.is_placed = False  # whether the camera was put where the scene wants it

    @property
    def is_flying(self) -> bool:
        """Whether the letters steer the camera."""
        return self._action == "fly"

    def on_event(self, event: Event) -> bool:
        """Steers and picks."""
        match event:
            case MouseMoved(x, y):
                return self._move(x, y)
            case MousePressed(button, modifiers) if not self._action:
                return self._press(button, modifiers)
            case MouseReleased(button) if self._action and button == self._button:
                return self._release()
            case MouseScrolled(_, notches):
                return self._scroll(notches)
            case KeyPressed(key):
                self._held.add(key)
                return self.is_flying and key in _FLY_KEYS
            case KeyReleased(key):
                self._held.discard(key)
            case WindowFocused(False):
                self._held.clear()
                self._release()
        return False

    def update(self, elapsed: float) -> None:
        """Flies on while keys are held; looks at a scene as its own camera does when it comes into sight first."""
        if not self.is_placed and self._model.scene.is_known:
            self.is_placed = True
            self._look_as_the_scene_does()
        for panel in self._viewports:
            if panel.camera.is_gliding:
                panel.camera.advance(elapsed)
                self._model.request_redraw(0.0)
        if self._action and self._panel not in self._viewports:
            self._release()
        for panel in self._viewports:
            is_pulling = panel is self._panel
            panel.hand_line = self._hand_line() if is_pulling else None
            panel.held = self.hand.held if is_pulling else 0
        if not self.is_flying:
            return
        steps = [step for key, step in _FLY_KEYS.items() if key in self._held]
        if steps:
            right, up, forward = (sum(step[axis] for step in steps) for axis in range(3))
            fast = bool({Key.LEFT_SHIFT, Key.RIGHT_SHIFT} & self._held)
            self._panel.camera.fly(right, up, forward, elapsed, fast=fast)
            self._model.request_redraw(0.0)

    def frame_selection(self) -> None:
        """Looks at what is selected; at everything when nothing is."""
        scene = self._model.scene
        chosen = list(self._model.selection) or list(scene.mirror.entities)[:2000]
        below = [entity for top in chosen if scene.exists(top) for entity in scene.mirror.descendants(top)[:500]]
        ball = self._model.bounds_of(dict.fromkeys(below))
        if ball is not None:
            self._viewports.current.camera.frame(*ball)
            self._model.request_redraw(0.0)

    def _look_as_the_scene_does(self) -> None:
        scene = self._model.scene
        cameras = [e for e in scene.mirror.entities if scene.echo_of(e, "Camera") and scene.is_world_enabled(e)]
        if not cameras:
            self.frame_selection()
            return
        first = max(cameras, key=lambda entity: getattr(scene.echo_of(entity, "Camera"), "priority", 0))
        pose = scene.world_pose(first)
        forward = quaternion.rotate(np.array(pose.rotation), (0.0, 0.0, -1.0))
        # To turn about: where the line of sight comes through the ground, if that is within reach.
        height, fall = pose.position[1], -float(forward[1])
        distance = height / fall if fall > 1e-3 and 0.0 < height / fall < 200.0 else 10.0
        self._viewports.first.camera.look_from(pose.position, forward, distance)

    def _press(self, button: int, modifiers: Modifiers) -> bool:
        hovered = self._viewports.hovered
        if hovered is None or not hovered.takes_mouse:
            return False
        self._panel = hovered
        self._viewports.use(hovered)
        if button == MouseButton.LEFT and self._panel.cube.is_hovered:
            self._action, self._button, self._pressed_at = "cube", button, self._pointer
            return True
        actions: dict[int, _Action] = {MouseButton.MIDDLE: "pan", MouseButton.RIGHT: "fly"}
        if button == MouseButton.LEFT:
            self._action = "orbit" if modifiers & Modifiers.ALT else "hold" if self.grabs() else "click"
        else:
            self._action = actions.get(button, "")
        self._button, self._modifiers, self._pressed_at = button, modifiers, self._pointer
        if self._action == "hold":
            self._model.session.start(self._take_hold())
        if self._action == "fly":
            self._panel.camera.is_parallel = False  # where going forward would change nothing
            self._hold_pointer(True)  # else the edge of the screen would end the turn
        return bool(self._action)

    def _move(self, x: float, y: float) -> bool:
        step = (x - self._pointer[0], y - self._pointer[1])
        self._pointer = (x, y)
        camera = self._panel.camera
        match self._action:
            case "orbit":
                camera.orbit(*step)
            case "cube" if self._has_moved:
                self._action = "orbit"
            case "pan":
                camera.pan(*step, height=int(self._panel.rectangle[3]))
            case "fly":
                camera.look(*step)
            case "hold":
                self._drag_body()
            case "click" if self._has_moved:
                self._action = "box"
        if self._action == "box":
            self._panel.selection_box = (*self._pressed_at, x, y)
        return self._action not in ("", "click")

    @property
    def _has_moved(self) -> bool:
        """Whether the pointer is too far from where the button went down for a click."""
        return max(abs(self._pointer[axis] - self._pressed_at[axis]) for axis in (0, 1)) >= CLICK_DISTANCE

    def _release(self) -> bool:
        action, self._action = self._action, ""
        if action == "fly":
            self._hold_pointer(False)
        if action == "click" and not self._has_moved:
            self._model.session.start(self._pick(self._modifiers))
        elif action == "hold":
            self.hand.let_go()
        elif action == "cube" and self._panel.cube.pointed_at is not None:
            self._viewports.look_from(self._panel.cube.pointed_at)
        elif action == "box":
            self._select_box(self._modifiers)
        self._panel.selection_box = None
        return True

    def _select_box(self, modifiers: Modifiers) -> None:
        """Selects what the picture shows between where the button went down and where it came up."""
        shown, selection = self._panel.stream.shown, self._model.selection
        if shown is None:
            return
        x, y, width, height = self._panel.rectangle
        ends = np.array((self._pressed_at, self._pointer))
        across = np.sort(2.0 * (ends[:, 0] - x) / width - 1.0)
        up = np.sort(1.0 - 2.0 * (ends[:, 1] - y) / height)
        box = (float(across[0]), float(up[0]), float(across[1]), float(up[1]))
        found = entities_in_box(self._model.scene, shown.camera, width / height, box)
        if modifiers & Modifiers.CTRL:
            kept = [entity for entity in selection if entity not in set(found)]
            selection.replace((*kept, *(entity for entity in found if entity not in selection)))
        elif modifiers & Modifiers.SHIFT:
            selection.add(found)
        else:
            selection.replace(found)
        self._model.request_redraw(0.0)

    def _scroll(self, notches: float) -> bool:
        panel = self._panel if self.is_flying else self._viewports.hovered
        if panel is None:
            return False
        camera = panel.camera
        if self.is_flying:
            camera.fly_speed = min(max(camera.fly_speed * 1.2**notches, 0.1), 1000.0)
            return True
        x, y, width, height = panel.rectangle
        toward = (2.0 * (self._pointer[0] - x) / width - 1.0, 1.0 - 2.0 * (self._pointer[1] - y) / height)
        camera.zoom(notches, toward, panel.aspect)
        return True

    async def _take_hold(self) -> None:
        """Takes the body where the button went down, if it is still held then."""
        reply = await self._seen_at_press()
        if reply is None or not reply.entity or self._action != "hold":
            return
        if self.hand.take(reply.entity, np.array(reply.position, dtype=np.float64)):
            self._drag_body()

    def _drag_body(self) -> None:
        shown = self._panel.stream.shown
        if shown is not None:
            x, y, width, height = self._panel.rectangle
            at = (2.0 * (self._pointer[0] - x) / width - 1.0, 1.0 - 2.0 * (self._pointer[1] - y) / height)
            self.hand.drag(shown.camera, width / height, at)

    def _hand_line(self) -> tuple[float, float, float, float] | None:
        """From the held point to where it is pulled, in the window; None where nothing is held, or it is behind the camera."""
        shown, held, target = self._panel.stream.shown, self.hand.held_point, self.hand.target
        if shown is None or held is None or target is None:
            return None
        x, y, width, height = self._panel.rectangle
        ends = [project(shown.camera, width / height, point) for point in (held, target)]
        if ends[0] is None or ends[1] is None:
            return None
        (a, b), (c, d) = ends[0], ends[1]
        return (
            x + (1 + a) / 2 * width,
            y + (1 - b) / 2 * height,
            x + (1 + c) / 2 * width,
            y + (1 - d) / 2 * height,
        )

    async def _pick(self, modifiers: Modifiers) -> None:
        """Selects what is seen where the button went down."""
        reply = await self._seen_at_press()
        if reply is not None:
            self._select(reply, modifiers)
            self._model.request_redraw(0.0)

    async def _seen_at_press(self) -> PickReply | None:
        """Asks the render node what is seen where the button went down; None, and a line that says why, if it does not answer."""
        shown = self._panel.stream.shown
        if shown is None:
            return None
        x, y, width, height = self._panel.rectangle
        pixel_x = int((self._pressed_at[0] - x) / width * shown.width)
        pixel_y = int((self._pressed_at[1] - y) / height * shown.height)
        try:
            marks = self._model.scene.marks
            passed_over = (*marks.own("locked"), *marks.own("hidden"))
            return await self._panel.stream.pick(pixel_x, pixel_y, passed_over=passed_over)
        except BusError as error:
            self._model.say("error", tr("What is under the pointer is not known: {error}", error=error))
            return None

    def _select(self, reply: PickReply, modifiers: Modifiers) -> None:
        selection, scene = self._model.selection, self._model.scene
        # Locked after it was asked for, or by a render node that knows nothing of locks.
        is_free = not scene.marks.is_marked("locked", reply.entity)
        if not scene.exists(reply.entity) or not is_free:
            if not modifiers & (Modifiers.CTRL | Modifiers.SHIFT):
                selection.clear()
        elif modifiers & (Modifiers.CTRL | Modifiers.SHIFT):
            selection.toggle(reply.entity)
        else:
            selection.replace((reply.entity,))
