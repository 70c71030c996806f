"""Something that breaks."""

from typing import Annotated, Any

from elys.common.components import Kind, Material, RigidBody, Transform
from elys.script import Behaviour, Entity, Touch, Vector, about

from .events import Broken, tell
from .signals import body_of, signal


class Breakable(Behaviour):
    """A box that a blow turns into eight shards, which have its speed, its colour and its mass."""

    strength: Annotated[float, about("Blow that it bears.", unit="N s", minimum=0.0)] = 5.0
    shard: Annotated[str, about("Prefab of a shard, of size 1.", kind=Kind.ASSET)] = "shard.prefab.json"
    burst: Annotated[float, about("Speed with which shards fly apart.", unit="m/s", minimum=0.0)] = 1.0
    tells: Annotated[str, about("Name of the signal that it switches on.")] = ""

    def start(self):
        self.is_whole = True

    def on_contact(self, other: Entity, touch: Touch) -> None:
        if self.is_whole and touch.impulse > self.strength:
            self.is_whole = False
            tell(self, Broken(self.entity.id, body_of(other).id, touch.impulse))
            signal(self, self.tells, True)
            self.shatter()
            self.entity.destroy()

    def shatter(self) -> None:
        """Puts the shards where it stands."""
        me = self.entity
        facts, size = me.get(RigidBody), Vector(me.get(Transform).scale)
        part = tuple(0.49 * length for length in size)  # a hair apart, so that nothing pushes
        laid: dict[str, Any] = {
            "Transform": {"scale": part},
            "RigidBody": {"mass": max(facts.mass / 8.0, 1e-6)},
            **({"Material": {"base_color": me.get(Material).base_color}} if me.has(Material) else {}),
        }
        for x in (-1.0, 1.0):
            for y in (-1.0, 1.0):
                for z in (-1.0, 1.0):
                    corner = Vector(x * size.x, y * size.y, z * size.z) * 0.25
                    away = Vector(me.rotation * corner)
                    made = self.world.spawn_prefab(
                        self.shard, position=me.position + away, rotation=me.rotation, components=laid
                    )
                    made.velocity = Vector(facts.linear_velocity) + away.normalized() * self.burst
