"""What one viewport shows beside its point of view: surfaces or their data, the grid, and lines over the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

from elys.bus.messages.views import Debug, Shows


@dataclass(slots=True)
class ViewLook:
    """Each viewport has its own."""

    shows_grid: bool = True
    shows: Shows = "shaded"
    debug: tuple[Debug, ...] = ()  # lines and letters over the picture
    debugs_selection: bool = False  # of what is selected alone

    def lines(self, selection: tuple[int, ...], held: int) -> tuple[tuple[Debug, ...], tuple[int, ...]]:
        """Which kinds are drawn over the picture, and of whom, none for everybody. While a body is dragged they are of it alone,
        what pushes it among them. Of a selection of nothing nothing is drawn, and not everything.
        """
        if held:
            return tuple(known for known in get_args(Debug) if known in self.debug or known == "forces"), (held,)
        if self.debugs_selection:
            return (self.debug, selection) if selection else ((), ())
        return self.debug, ()

    def switch_debug(self, kind: Debug) -> None:
        """Draws lines of a kind, or draws them no more; they keep the order of `Debug`."""
        wanted = set(self.debug) ^ {kind}
        self.debug = tuple(known for known in get_args(Debug) if known in wanted)
