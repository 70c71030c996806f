"""What the verdict on a race's recording is worth on the board.

Ticks that are missing hide nothing of the states after them, which come out of the same commands. Still a race counts as proven
only where nothing is missing at all: the whole way from the countdown to behind the finish was compared, and it was run again
from the beginning, not from a state that somebody put into the file on the way.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from elys.sim_node.verification import Verdict

PROVEN: Final = "equal"
_HAIR: Final = 1e-3  # [s] to which times on the board are rounded, and more


def proof_of(verdict: Verdict, *, began: float, ended: float) -> str:
    """PROVEN for a recording that proves a race which `began` and `ended` then [s], pauses included; else why it does not."""
    if verdict.difference is not None:
        return verdict.difference.text
    if verdict.missing_ticks:
        return f"{verdict.missing_ticks} of {verdict.ticks + verdict.missing_ticks} ticks are not in its recording"
    if verdict.jumps:
        return f"at tick {verdict.jumps[0]} it goes on from a state that nothing in its recording leads to"
    if verdict.first_time > began + _HAIR or verdict.last_time < ended - _HAIR:
        return (
            f"its recording goes from {verdict.first_time:.2f} s to {verdict.last_time:.2f} s, and the race went from "
            f"{began:.2f} s to {ended:.2f} s"
        )
    return PROVEN if verdict.cause == "equal" else (verdict.damage or ["its recording is not whole"])[0]
