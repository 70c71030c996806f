"""A behaviour on an entity, as the runner knows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.scripts.library import LoadedScript
from elys.sim_node.scripts.task import Task


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
