"""How fluent an editor stays beside a slow simulation, and what it costs: real processes, pictures from a render node.

Somebody looks around all the time, so that every frame is wanted: at an editor of 1280 x 720 without a display, while the yard is
played at a twentieth of real time, and while a pile is simulated that is so heavy that it comes to about that.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from elys.bus import topics
from elys.bus.messages.commands import CommandRequest, SetPlaying, SetRate, Time
from elys.bus.messages.session import SessionStatus
from elys.common.scene import EntityNode, SceneDocument, write_scene
from elys.samples.pile import pile
from elys.verbs.nodes import joined
from tests.benchmarks.editor_people import Person, people
from tests.benchmarks.processes import environment, running

SECONDS: Final = 8.0
SLOW: Final = 0.05  # of real time
HEAVY_BODIES: Final = 3000
HEAVY_TICK_RATE: Final = 2000  # [Hz] a tick of so many bodies takes longer by far
CROWD: Final = 50_000
Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    return [*_slow(), *_heavy(), *_idle()]


def _slow() -> list[Row]:
    with _session("yard", port=17660) as (endpoint, person):
        asyncio.run(_tell(endpoint, SetRate(rate=SLOW)))
        looking = _look_around(person)
        asyncio.run(_tell(endpoint, SetRate(rate=1.0)))
        person.do("rest")
        playing = _watch(person)
    return [
        (f"frames of an editor while time goes at {SLOW:.0%}, mean; longest pause", _pace(looking)),
        ("an editor that watches the yard play: frames, main thread, whole process", _load(playing)),
    ]


def _heavy() -> list[Row]:
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "heavy.scene.json"
        document = pile(HEAVY_BODIES)
        settings = msgspec.structs.replace(document.settings, tick_rate=HEAVY_TICK_RATE)
        write_scene(msgspec.structs.replace(document, settings=settings), path)
        with _session(str(path), port=17661) as (endpoint, person):
            looking = _look_around(person)
            factor = asyncio.run(_factor(endpoint))
    return [(f"the same beside a simulation that comes to {factor:.0%} of real time", _pace(looking))]


def _idle() -> list[Row]:
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "crowd.scene.json"
        nodes = [EntityNode(name=f"Box {n}", components={"Transform": {}}) for n in range(CROWD)]
        write_scene(SceneDocument(name="Crowd", entities=nodes), path)
        with _session(str(path), port=17662, draws=False) as (endpoint, person):
            asyncio.run(_tell(endpoint, SetPlaying(playing=False)))
            time.sleep(3.0)
            idle = _watch(person)
    assert idle["entities"] == CROWD
    return [(f"an idle editor on {CROWD:,} entities: frames, main thread, whole process", _load(idle))]


@contextlib.contextmanager
def _session(scene: str, *, port: int, draws: bool = True) -> Iterator[tuple[str, Person]]:
    """A simulation, a render node if wanted, and somebody at an editor that is attached."""
    endpoint = f"tcp/127.0.0.1:{port}"
    elys = (sys.executable, "-m", "elys")
    with contextlib.ExitStack() as stack:
        env = stack.enter_context(environment())
        words = (*elys, "run", scene, "--headless", "--realtime", "--listen", endpoint)
        stack.enter_context(running(words, env=env, wait_for="simulating"))
        if draws:
            stack.enter_context(
                running((*elys, "node", "render", "--connect", endpoint), env=env, wait_for="drawing views")
            )
        (person,) = stack.enter_context(people(1))
        person.do("attach", endpoint)
        yield endpoint, person


def _look_around(person: Person) -> dict[str, Any]:
    person.do("turn")
    time.sleep(2.0)
    return _watch(person)


def _watch(person: Person) -> dict[str, Any]:
    person.do("begin")
    time.sleep(SECONDS)
    found: dict[str, Any] = person.do("report")
    return found


def _pace(found: dict[str, Any]) -> str:
    pauses = np.diff(found["frames"])
    return f"{len(found['frames']) / found['seconds']:.0f} a second; {1e3 * pauses.max():.0f} ms"


def _load(found: dict[str, Any]) -> str:
    frames, seconds = len(found["frames"]), found["seconds"]
    main, whole = (100.0 * found[which] / seconds for which in ("main_thread", "process"))
    return f"{frames / seconds:.1f} a second, {main:.1f} %, {whole:.1f} % of a core"


async def _tell(endpoint: str, command: Time) -> None:
    async with joined(endpoint, kind="tool") as session:
        await session.request(topics.COMMAND, CommandRequest(origin="bench", command=command), timeout=20.0)


async def _factor(endpoint: str) -> float:
    async with joined(endpoint, kind="tool") as session:
        told: asyncio.Queue[SessionStatus] = asyncio.Queue()
        session.subscribe(topics.STATUS, lambda status, _: told.put_nowait(status))
        return (await asyncio.wait_for(told.get(), 20.0)).realtime_factor
