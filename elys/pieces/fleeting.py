"""Something that is there for a while."""

from typing import Annotated

from elys.script import Behaviour, about, seconds


class Fleeting(Behaviour):
    """Is taken away after a time, with all below it."""

    lifetime: Annotated[float, about("How long it is there.", unit="s", minimum=0.0)] = 5.0

    async def start(self):
        await seconds(self.lifetime)
        self.entity.destroy()
