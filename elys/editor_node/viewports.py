"""The viewports that are open: one at least, four at most, each with a stream of pictures, a camera and a look of its own.

Keys mean the viewport under the pointer; where it is over none, and for menus, the one that was used last.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from elys.bus.session import Session
from elys.editor_node.camera import OrbitCamera
from elys.editor_node.camera_views import SIDES
from elys.editor_node.gpu import WindowContext
from elys.editor_node.panels.viewport import ViewportPanel
from elys.editor_node.preferences import ViewState
from elys.editor_node.ui import Ui
from elys.editor_node.view_look import ViewLook
from elys.editor_node.view_stream import ViewStream

MOST_VIEWPORTS: Final = 4
FOUR_SIDES: Final = {2: "top", 3: "front", 4: "right"}  # by the viewport's number; the first one looks in perspective


class Viewports:
    """Opens and closes them, and knows whose turn it is. The first is always there, though it may be hidden."""

    def __init__(self, session: Session, context: WindowContext, *, on_frame: Callable[[], None]) -> None:
        self._session = session
        self._context = context
        self._on_frame = on_frame
        self.on_open: Callable[[ViewportPanel], None] = lambda panel: None  # before it is drawn first
        self.take_drop: Callable[[Ui, ViewportPanel], None] = lambda ui, panel: None  # what is let go over a picture
        self.look_from: Callable[[tuple[float, float, float]], None] = lambda direction: None  # what a cube was asked
        self._panels: dict[int, ViewportPanel] = {}
        self._left: list[ViewportPanel] = []  # closed, and perhaps still in a draw list that is not drawn yet
        self._used = self._make(1)

    def __iter__(self) -> Iterator[ViewportPanel]:
        """In the order of their numbers."""
        return iter([self._panels[number] for number in sorted(self._panels)])

    def __len__(self) -> int:
        return len(self._panels)

    def __contains__(self, panel: ViewportPanel) -> bool:
        return self._panels.get(panel.number) is panel

    @property
    def first(self) -> ViewportPanel:
        """The one that is always there."""
        return self._panels[1]

    @property
    def hovered(self) -> ViewportPanel | None:
        """The one under the pointer."""
        return next((panel for panel in self._panels.values() if panel.is_hovered), None)

    @property
    def takes_mouse(self) -> bool:
        """Whether what the pointer does belongs to a scene and not to a widget."""
        hovered = self.hovered
        return hovered is not None and hovered.takes_mouse

    @property
    def used(self) -> ViewportPanel:
        """The one that was used last; another that is seen, where that one is not."""
        seen = [panel for panel in self if panel.is_seen]
        return self._used if self._used.is_seen or not seen else seen[0]

    @property
    def current(self) -> ViewportPanel:
        """The one that keys and menus mean."""
        return self.hovered or self.used

    def use(self, panel: ViewportPanel) -> None:
        """A hand has taken hold of this one."""
        self._used = panel

    @property
    def free_number(self) -> int:
        """Of the next one to be opened; 0 if there are enough."""
        return next((number for number in range(2, MOST_VIEWPORTS + 1) if number not in self._panels), 0)

    def open(self, number: int) -> ViewportPanel:
        """Opens one that looks as the one used last does; the one of that number if it is open already.

        Raises:
            ValueError: there is no viewport of that number.
        """
        if not 1 <= number <= MOST_VIEWPORTS:
            raise ValueError(f"viewports are numbered from 1 to {MOST_VIEWPORTS}, {number} is none")
        if number in self._panels:
            return self._panels[number]
        like = self.used
        panel = self._make(number)
        panel.camera.pose, panel.look = like.camera.pose, replace(like.look)
        self.on_open(panel)
        return panel

    def close(self, panel: ViewportPanel) -> None:
        """Ends one; the first is only hidden, by whoever draws them."""
        if panel is not self.first and self._panels.get(panel.number) is panel:
            del self._panels[panel.number]
            panel.stream.close()
            self._left.append(panel)
            if self._used is panel:
                self._used = self.first

    def draw(self, ui: Ui, *, hides_first: bool) -> None:
        """Draws all that are open; those that are not seen ask for no pictures."""
        self._release_left()
        is_alone = len(self._panels) == 1
        for panel in self:
            if panel.number == 1 and hides_first:
                panel.rest()
            else:
                panel.draw(ui, may_close=not is_alone, take_drop=self.take_drop)
            if panel.was_focused:
                self._used = panel
        is_one_of_several = sum(panel.is_seen for panel in self) > 1
        for panel in self:
            panel.is_marked = is_one_of_several and panel is self.used
        x, y, z = self.used.camera.target.tolist()
        ui.focus = (x, y, z)

    def rest(self) -> None:
        """None is seen: none asks for pictures."""
        for panel in self:
            panel.rest()

    def forget(self) -> None:
        """Another session: no picture of it has come yet."""
        for panel in self:
            panel.stream.forget()

    def refresh(self) -> None:
        """Another run of the host: all pictures are asked for anew."""
        for panel in self:
            panel.stream.refresh()

    @property
    def next_deadline(self) -> float:
        """When, by the monotonic clock, a frame should be drawn at the latest."""
        return min((panel.stream.next_deadline for panel in self), default=math.inf)

    def look_four_ways(self) -> None:
        """Opens all four: in perspective, from above, from the front and from the right, at what the first one looks at."""
        first = self.first
        first.camera.is_parallel = False
        for number, side in FOUR_SIDES.items():
            panel = self.open(number)
            pose = first.camera.pose
            panel.camera.pose = pose
            panel.camera.yaw, panel.camera.pitch = SIDES[side]
            panel.camera.is_parallel = True

    def states(self) -> tuple[ViewState, ...]:
        """What is kept of each."""
        return tuple(
            ViewState(
                number=panel.number,
                camera=panel.camera.pose,
                shows_grid=panel.look.shows_grid,
                shows=panel.look.shows,
                debug=panel.look.debug,
                debugs_selection=panel.look.debugs_selection,
            )
            for panel in self
        )

    def restore(self, states: tuple[ViewState, ...]) -> None:
        """Opens those that were, and looks with each as it looked; without any the first alone is open."""
        kept = {state.number: state for state in states if 1 <= state.number <= MOST_VIEWPORTS}
        for panel in self:
            if panel.number not in kept:
                self.close(panel)
        for number, state in sorted(kept.items()):
            panel = self.open(number)
            panel.camera.pose = state.camera
            panel.look = ViewLook(state.shows_grid, state.shows, state.debug, state.debugs_selection)

    def keep_open(self, numbers: tuple[int, ...]) -> None:
        """Opens these where they are not, and closes all others."""
        for panel in self:
            if panel.number not in numbers:
                self.close(panel)
        for number in numbers:
            if 1 <= number <= MOST_VIEWPORTS:
                self.open(number)

    def release(self) -> None:
        """Ends all of them; the window's context must still be current."""
        for panel in self:
            panel.stream.close()
        self._left += self._panels.values()
        self._release_left()

    def _release_left(self) -> None:
        for panel in self._left:
            panel.picture.release()
        self._left.clear()

    def _make(self, number: int) -> ViewportPanel:
        own = self._session.node.id
        name = own if number == 1 else f"{own}.{number}"
        stream = ViewStream(self._session, on_frame=self._on_frame, name=name)
        panel = ViewportPanel(stream, self._context.picture(), OrbitCamera(), number=number)
        self._panels[number] = panel
        return panel
