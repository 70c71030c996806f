"""What a verdict is worth on the board: a race is proven where all of it was compared, and not by half."""

from __future__ import annotations

import msgspec
import pytest

from elys.game.proof import PROVEN, proof_of
from elys.sim_node.frame_comparison import Difference
from elys.sim_node.verification import Verdict

WHOLE = Verdict(
    recording="race.mcap",
    cause="equal",
    ticks=1890,
    first_time=4.0,
    last_time=35.5,
    wall_time=3.0,
    realtime_factor=10.0,
)


def test_a_race_that_came_out_the_same_is_proven() -> None:
    assert proof_of(WHOLE, began=5.5, ended=34.5) == PROVEN


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"cause": "incomplete", "missing_ticks": 3, "gaps": [(700, 702)]}, "3 of 1893 ticks are not in its recording"),
        ({"jumps": [900]}, "at tick 900 it goes on from a state that nothing in its recording leads to"),
        ({"last_time": 34.4}, "its recording goes from 4.00 s to 34.40 s, and the race went from 5.50 s to 34.50 s"),
        ({"first_time": 6.0}, "its recording goes from 6.00 s"),
        ({"cause": "incomplete", "damage": ["20 bytes cannot be read"]}, "20 bytes cannot be read"),
        ({"cause": "incomplete"}, "not whole"),
        ({"cause": "altered", "difference": Difference(tick=3, time=0.05, text="tick 3: else")}, "tick 3: else"),
    ],
)
def test_what_lacks_a_part_of_it_is_not(changes: dict[str, object], expected: str) -> None:
    found = proof_of(msgspec.structs.replace(WHOLE, **changes), began=5.5, ended=34.5)
    assert found != PROVEN and expected in found


def test_a_verdict_is_the_same_from_another_process() -> None:
    told = msgspec.structs.replace(WHOLE, cause="incomplete", missing_ticks=3, gaps=[(700, 702)], damage=["x"])
    assert msgspec.json.decode(msgspec.json.encode(told), type=Verdict) == told
