"""A spawner of prefabs."""

from typing import Annotated

from elys.common.components import Kind, RigidBody
from elys.script import Entity, Vec3, Vector, about

from .events import Spawned, tell
from .signals import Switched


class Spawner(Switched):
    """Makes a prefab again and again, spread by chance that is the same in each run."""

    prefab: Annotated[str, about("What it makes.", kind=Kind.ASSET)] = "crate.prefab.json"
    interval: Annotated[float, about("From one to the next.", unit="s", minimum=0.02)] = 2.0
    limit: Annotated[int, about("How many may be there at once; 0 for any number.", minimum=0)] = 5
    total: Annotated[int, about("How many it makes in all; 0 for no end.", minimum=0)] = 0
    spread: Annotated[Vec3, about("How far from its place they appear at most, to either side.", unit="m")] = (
        0.0,
        0.0,
        0.0,
    )
    velocity: Annotated[Vec3, about("With which they come, along the spawner's axes.", unit="m/s")] = (0.0, 0.0, 0.0)
    lifetime: Annotated[float, about("After which one is taken away; 0: never.", unit="s", minimum=0.0)] = 0.0

    def start(self):
        super().start()
        self.alive: list[Entity] = []
        self.born: list[float] = []
        self.count = 0
        self.every(self.interval, self.make)

    def fixed_update(self, dt: float) -> None:
        ends = self.world.time - self.lifetime
        while self.lifetime and self.born and self.born[0] <= ends:
            self.alive.pop(0).destroy()
            self.born.pop(0)

    def make(self):
        """One more, unless there are enough."""
        kept = [(one, born) for one, born in zip(self.alive, self.born, strict=True) if one.is_alive]
        self.alive, self.born = [one for one, _ in kept], [born for _, born in kept]
        if not self.is_on or (self.limit and len(self.alive) >= self.limit):
            return None
        turn = self.entity.rotation
        offset = Vector(*(self.random.uniform(-part, part) for part in self.spread))
        made = self.world.spawn_prefab(
            self.prefab, position=self.entity.position + Vector(turn * offset), rotation=turn
        )
        if made.has(RigidBody) and any(self.velocity):
            made.velocity = turn * self.velocity
        self.count += 1
        self.alive.append(made)
        self.born.append(self.world.time)
        tell(self, Spawned(self.entity.id, made.id, self.count))
        return not (self.total and self.count >= self.total)
