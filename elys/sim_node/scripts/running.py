"""A behaviour on an entity, as the runner knows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from elys.common.errors import ScriptError
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.scripts.library import LoadedScript
from elys.sim_node.scripts.modules import describe, line_in, text_of
from elys.sim_node.scripts.task import Task
from elys.sim_node.scripts.watchdog import reason_of

FAILURE_LENGTH: Final = 1000  # characters


@dataclass(slots=True, kw_only=True)
class Running:
    """A behaviour on an entity.

    Attributes:
        values: what its component said of its fields when it was last looked at.
        failure: why it is off; it stays so until its component changes.
        spent: time that it took in this tick [s].
    """

    entity: int
    source: str
    values: Mapping[str, Any]
    script: LoadedScript | None = None
    itself: Behaviour | None = None
    has_started: bool = False
    is_enabled: bool = True
    failure: str = ""
    tasks: list[Task] = field(default_factory=list)
    spent: float = 0.0

    @property
    def hooks(self) -> frozenset[str]:
        """Those that are called now."""
        is_on = self.is_enabled and not self.failure and self.script is not None
        return self.script.hooks if is_on and self.script is not None else frozenset()

    def forget(self) -> None:
        """Lets go of what it remembers; if it runs again it begins anew."""
        self.itself, self.has_started = None, False


def failure_text(one: Running, error: BaseException) -> str:
    """What went wrong in a script, as it goes over the bus: the line of its files, and what was the matter."""
    places = [] if one.script is None else one.script.modules.places
    where = next((line for place in places if (line := line_in(place, error)) != place), "")
    where = where or getattr(error, "place", "")  # of an async function that was ended between two of its lines
    # What the engine refuses is a sentence already, and says itself where it is about a file.
    what = text_of(error) if isinstance(error, ScriptError) else reason_of(error) or describe(error)
    text = f"{where}: {what}" if where else what
    return text[:FAILURE_LENGTH].encode(errors="backslashreplace").decode()
