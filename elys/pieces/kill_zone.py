"""A zone that nobody survives."""

from typing import Annotated

from elys.common.components import RigidBody
from elys.script import Behaviour, Entity, about

from .events import Killed, tell
from .signals import body_of


class KillZone(Behaviour):
    """A trigger that kills: what has a script with `respawn` comes back by that, and all else is taken away."""

    destroys: Annotated[bool, about("Whether what cannot come back is taken away.")] = True

    def on_trigger_enter(self, other: Entity) -> None:
        body = body_of(other)
        comes_back = self._comes_back(body)
        if not comes_back and body.has(RigidBody) and body.get(RigidBody).motion != "dynamic":
            return  # platforms and the like pass
        tell(self, Killed(self.entity.id, body.id))
        if self.destroys and not comes_back:
            body.destroy()

    def _comes_back(self, body: Entity) -> bool:
        try:
            return hasattr(body.script(Behaviour), "respawn")
        except LookupError:
            return False
