"""A timer that switches a signal."""

from typing import Annotated

from elys.script import about, seconds, ticks, until

from .events import TimerRang, tell
from .signals import Switched, signal


class Timer(Switched):
    """Begins at once, or when its signal comes; when it is over it switches its own signal, on and, after `rings`, off.

    Its signal going off takes it back to its beginning.
    """

    duration: Annotated[float, about("Until it rings.", unit="s", minimum=0.02)] = 3.0
    rings: Annotated[float, about("How long its signal is on; 0: from then on.", unit="s", minimum=0.0)] = 0.5
    repeats: Annotated[bool, about("Whether it begins again when it has rung.")] = True
    tells: Annotated[str, about("Name of the signal that it switches.")] = ""

    def start(self):
        super().start()
        self.count = 0
        self.due = -1.0
        self.begin(self.work())

    def switched(self) -> None:
        self.due = self.world.time + self.duration if self.is_on else -1.0

    async def work(self):
        self.switched()
        while True:
            await until(lambda: 0.0 <= self.due <= self.world.time + 1e-9)
            self.due = self.world.time + self.duration if self.repeats else -1.0
            self.count += 1
            tell(self, TimerRang(self.entity.id, self.count))
            signal(self, self.tells, True)
            if self.rings:
                await seconds(self.rings)
                signal(self, self.tells, False)
            else:
                await ticks(1)
