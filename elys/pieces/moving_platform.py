"""A platform that goes along a path and carries what stands on it."""

from typing import Annotated, Literal

from elys.script import Entity, Vec3, Vector, about, seconds, until

from .events import PlatformArrived, tell
from .signals import Switched


class MovingPlatform(Switched):
    """Goes from point to point; a kinematic body carries. Its points are those below `path`, or else an entity called Path
    beside it; without one, where it stands and `travel` from there. Switched off, it stops at the next point.
    """

    path: Annotated[Entity | None, about("What its points stand under, in their order.")] = None
    travel: Annotated[Vec3, about("Where the other point is, without a path.", unit="m")] = (0.0, 0.0, 0.0)
    speed: Annotated[float, about("On the way from point to point, on average.", unit="m/s", minimum=0.01)] = 2.0
    mode: Annotated[Literal["ping_pong", "loop", "once"], about("Back the same way, round, or to the end.")] = (
        "ping_pong"
    )
    ease: Annotated[Literal["smooth", "linear"], about("Slow at both ends of a leg, or even.")] = "smooth"
    pause: Annotated[float, about("At each point.", unit="s", minimum=0.0)] = 0.5

    def start(self):
        super().start()
        self.points = self._found_points()
        self.begin(self.travel_on())

    def _found_points(self) -> list[Vector]:
        path = self.path
        if path is None and self.entity.parent is not None:
            path = next((child for child in self.entity.parent.children if child.name == "Path"), None)
        if path is not None and len(path.children) > 1:
            return [point.position for point in path.children]
        return [self.entity.position, self.entity.position + self.travel]

    async def travel_on(self):
        place, step = 0, 1
        self.entity.position = self.points[0]
        while True:
            await until(lambda: self.is_on)
            if place + step == len(self.points) and self.mode == "loop":
                place = -1
            elif not 0 <= place + step < len(self.points):
                if self.mode == "once":
                    return
                step = -step
            place += step
            goal = self.points[place]
            duration = max(self.entity.position.distance(goal) / self.speed, self.world.dt)
            await self.entity.move_to(goal, duration=duration, ease=self.ease)
            tell(self, PlatformArrived(self.entity.id, place))
            if self.pause:
                await seconds(self.pause)
