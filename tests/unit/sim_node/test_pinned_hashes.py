"""The same bits everywhere: scenes end in the states that are pinned for each level of processors."""

from __future__ import annotations

import pytest

from elys.common.errors import ElysError
from elys.sim_node import cpu_level
from tests import pinned_hashes

CHANGED = "the physics computes other bits than it did: if that was meant, pin them anew with `make pin`"


def test_every_scene_is_pinned_for_every_level():
    names = {scene.__name__ for scene in pinned_hashes.SCENES}
    assert {level: set(pinned_hashes.pinned(level)) for level in pinned_hashes.LEVELS} == {"v3": names, "v2": names}


def test_this_process_reaches_the_pinned_states():
    level = cpu_level.cpu_level().rpartition("-")[2]
    if level not in pinned_hashes.LEVELS:
        pytest.skip(f"nothing is pinned for {cpu_level.cpu_level()}")
    assert pinned_hashes.hashes() == pinned_hashes.pinned(level), CHANGED


@pytest.mark.process
@pytest.mark.parametrize("level", pinned_hashes.LEVELS)
def test_another_process_reaches_the_pinned_states_of_a_level(level, monkeypatch):
    monkeypatch.setenv(cpu_level.LEVEL_VARIABLE, level)
    cpu_level.cpu_level.cache_clear()
    try:
        cpu_level.cpu_level()
    except ElysError as error:
        pytest.skip(str(error))
    finally:
        monkeypatch.undo()
        cpu_level.cpu_level.cache_clear()
    assert pinned_hashes.hashes_in_another_process(level) == pinned_hashes.pinned(level), CHANGED
