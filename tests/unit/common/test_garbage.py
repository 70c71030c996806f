"""Searches for garbage leave aside what stays, and still find what does not."""

from __future__ import annotations

import gc
import subprocess
import sys
import weakref
from collections.abc import Iterator

import pytest

from elys.common.garbage import ShortSearches


class Knot:
    """Refers to itself: only a search finds that nobody else does."""

    def __init__(self) -> None:
        self.self = self


@pytest.fixture
def searches() -> Iterator[None]:
    gc.collect()
    callback = ShortSearches(few=1)
    gc.callbacks.append(callback)
    yield
    gc.callbacks.remove(callback)
    gc.unfreeze()
    gc.collect()


@pytest.mark.usefixtures("searches")
def test_what_outlives_a_search_is_set_aside_and_what_comes_after_it_is_found() -> None:
    gc.collect()  # more than a few are there: the next one is of all
    gc.collect()
    kept = gc.get_freeze_count()
    assert kept > 10_000 and len(gc.get_objects()) < 0.1 * kept
    knot = Knot()
    end = weakref.ref(knot)
    del knot
    gc.collect()
    assert end() is None


@pytest.mark.usefixtures("searches")
def test_a_knot_that_was_set_aside_is_found_when_as_much_again_has_come() -> None:
    gc.collect()
    knot = Knot()
    end = weakref.ref(knot)
    gc.collect()
    gc.collect()
    del knot
    gc.collect()
    assert end() is not None
    more = [[number] for number in range(2 * gc.get_freeze_count())]
    gc.collect()
    gc.collect()
    assert end() is None and len(more) > 10_000


@pytest.mark.usefixtures("searches")
def test_what_nobody_refers_to_any_more_ends_at_once_as_ever() -> None:
    class Thing:
        pass

    thing = Thing()
    end = weakref.ref(thing)
    gc.collect()
    gc.collect()
    del thing
    assert end() is None


def test_no_interrupt_is_lost_in_a_search() -> None:
    """Each of many that strike while hardly anything but searches goes on is raised, also where asyncio has run meanwhile."""
    program = """
import asyncio, gc, os, signal, sys, threading, time
from elys.common.garbage import keep_searches_short
keep_searches_short()
asyncio.run(asyncio.sleep(0))
searches = interrupts = 0

def wait(is_so):
    end = time.monotonic() + 20.0
    while not is_so():
        if time.monotonic() > end:
            print(f"{interrupts} came", flush=True)
            os._exit(1)
        time.sleep(0.0001)

def strike():
    for number in range(200):
        begun = searches
        wait(lambda: searches > begun + 1)
        os.kill(os.getpid(), signal.SIGINT)
        wait(lambda: interrupts > number)
    os._exit(0)

threading.Thread(target=strike).start()
while True:
    try:
        while True:
            searches += 1
            gc.collect(0)
    except KeyboardInterrupt:
        interrupts += 1
"""
    ended = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True, timeout=120)
    assert (ended.returncode, ended.stdout) == (0, ""), ended.stderr
