"""Streams over true links: how old and how exact what a viewer holds is, against what the simulation recorded of itself."""

from __future__ import annotations

import time

import numpy as np
import pytest

from tests.network.streams import watch

pytestmark = [pytest.mark.process, pytest.mark.usefixtures("machine_to_itself")]


def test_what_a_lossy_link_brings_is_as_exact_as_it_claims(lab, tmp_path):
    seen = watch(lab, tmp_path, bodies=200, seconds=6.0, delay=0.05, loss=0.02)
    off, turned, claimed, claimed_turn = seen.errors[:, :4].T
    assert len(off) > 5
    assert (off <= claimed).all() and (turned <= claimed_turn + 1e-5).all()
    assert seen.states[-1, 5] == 200
    assert np.isfinite(seen.ages).all() and seen.states[-1, 2] > seen.states[0, 2]
    assert (np.diff(seen.states[:, 2]) >= 0).all()  # nothing old is shown after something newer


def test_a_stream_comes_back_after_an_outage(lab, tmp_path):
    healed = []

    def spoil(link):
        time.sleep(2.0)
        link.cut()
        time.sleep(3.0)
        link.heal()
        healed.append(time.time())

    seen = watch(lab, tmp_path, bodies=200, seconds=10.0, during=spoil, delay=0.05, loss=0.02)
    fresh = seen.states[seen.states[:, 1] > healed[0]]
    before = seen.states[seen.states[:, 1] < healed[0] - 3.5]
    # Right as before: all bodies, none farther off than they were claimed to be then, which is held against the recording above.
    is_right = (fresh[:, 5] == 200) & (fresh[:, 3] <= max(0.01, 2.0 * float(np.median(before[len(before) // 2 :, 3]))))
    assert is_right.any(), fresh[:, 3]
    first, right = (float(fresh[row, 0]) - healed[0] for row in (0, int(np.argmax(is_right))))
    print(
        f"the first new state {first:.2f} s after the line was whole, all of the view right after {right:.2f} s",
        end="; ",
    )
    assert right < 1.0


def test_full_frames_come_where_they_are_asked_for(lab, tmp_path):
    seen = watch(lab, tmp_path, bodies=50, seconds=3.0, variables={"ELYS_STATES": "full"}, delay=0.001)
    off, turned, *_ = seen.errors.T
    assert len(off) and (off == 0.0).all() and (turned < 1e-6).all()
