"""What scripts import: `from elys.script import Behaviour, about, seconds`. See docs/scripts.md."""

from elys.common import components
from elys.common.components import Quat, Vec3, about
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.scripts.easing import eased
from elys.sim_node.scripts.handles import EntityHandle as Entity
from elys.sim_node.scripts.handles import Hit, Touch
from elys.sim_node.scripts.vector import Rotation, Vector
from elys.sim_node.scripts.waiting import all_of, event, first_of, seconds, ticks, until

__all__ = [
    "Behaviour",
    "Entity",
    "Hit",
    "Quat",
    "Rotation",
    "Touch",
    "Vec3",
    "Vector",
    "about",
    "all_of",
    "components",
    "eased",
    "event",
    "first_of",
    "seconds",
    "ticks",
    "until",
]
