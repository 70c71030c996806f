"""game: the ball time trial, with a window, or hosted for others, or driven by nobody."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from elys.bus.access.listening import Listening
from elys.common.assets.store import AssetStore
from elys.common.errors import ElysError
from elys.verbs.output import print_json, print_table

if TYPE_CHECKING:
    from elys.game.board import Entry
    from elys.game.referee import AnyLevel

FIRST: Final = "meadow"


def level_named(name: str, assets: AssetStore) -> AnyLevel:
    """A level by its name, or of a scene's file; ElysError naming those there are."""
    from elys.game.scene_level import SceneLevel
    from elys.samples.game.levels import LEVELS

    if name in LEVELS:
        return LEVELS[name]
    if name.endswith(".json"):
        return SceneLevel.read(Path(name), assets)
    raise ElysError(
        f"there is no level '{name}': there are {', '.join(LEVELS)}, and scene files (NAME.scene.json) that were made of them"
    )


def play(level: str, *, players: int, person: str, ghosts: bool, listen: Listening) -> None:
    """A window on a race that this machine hosts."""
    from elys.render_node.window import probe_display
    from elys.verbs.run import start
    from elys.verbs.trusting import ask_about_scripts

    assets = AssetStore()
    chosen = level_named(level, assets)
    opened, _ = chosen.open(assets, players=players)
    probe_display()
    ask_about_scripts(opened.records, assets)
    words = [*listen.words(), "--players", str(players)]
    words += ["--name", person] if person else []
    words += [] if ghosts else ["--no-ghosts"]
    where = str(Path(level).absolute()) if level.endswith(".json") else level
    sys.exit(start("game", {"level": where}, endpoint=listen.endpoint, extra={"race": words}))


def host(
    level: str,
    *,
    players: int,
    person: str,
    ghosts: bool,
    listen: Listening,
    bot: bool,
    races: int,
    realtime: bool,
    has_menu: bool = False,
    json: bool = False,
) -> None:
    """Races in a session of this process, until `races` were finished or for ever; with `bot` nobody need play."""
    from elys.bus.log import start_logging
    from elys.game.scene_level import SceneLevel
    from elys.verbs.nodes import run_until_asked

    assets = AssetStore()
    chosen = level_named(level, assets)
    if bot and isinstance(chosen, SceneLevel):
        raise ElysError(f"nobody knows the way through {level}: --bot drives along the lines of ELYS's own levels")
    start_logging()
    run_until_asked(
        _host(
            chosen,
            assets,
            players=players,
            person=person or ("bot" if bot else ""),
            ghosts=ghosts,
            listen=listen,
            bot=bot,
            races=races,
            realtime=realtime,
            has_menu=has_menu,
        )
    )
    if json:
        print_json(times_of(chosen, players))


async def _host(
    level: AnyLevel,
    assets: AssetStore,
    *,
    players: int,
    person: str,
    ghosts: bool,
    listen: Listening,
    bot: bool,
    races: int,
    realtime: bool,
    has_menu: bool,
) -> None:
    from elys.common.scene import OpenedScene
    from elys.game.bot import Bot
    from elys.game.referee import Referee
    from elys.samples.game.levels import LEVELS
    from elys.sim_node.node import SimulationNode
    from elys.sim_node.simulation import Simulation
    from elys.verbs.host_facts import facts_of
    from elys.verbs.kernels import compile_with_progress
    from elys.verbs.nodes import hosted
    from elys.verbs.recording_child import RecordingChild
    from elys.verbs.trusting import ask_about_scripts, asks_about_scripts

    opened, layout = level.open(assets, players=players)
    ask_about_scripts(opened.records, assets)
    await asyncio.to_thread(compile_with_progress, opened)
    simulation = Simulation.load(opened, assets)
    bots = [Bot(simulation, layout, player=number + 1) for number in range(players)] if bot and layout else []

    def reopened(chosen: AnyLevel, count: int, values: Mapping[str, Mapping[str, Any]]) -> OpenedScene:
        opened, layout = chosen.open(assets, players=count, values=values)
        if layout is not None:
            for one in bots:
                one.drive(layout)
        return opened

    async with hosted(listen, name="game", kind="simulation", scene=level.title, epoch=time.time_ns()) as (session, _):
        node = SimulationNode(simulation, session, realtime=realtime)
        node.players += bots
        session.host_facts = facts_of(node)

        def record(path: Path) -> RecordingChild:
            recorder = RecordingChild(path)
            recorder.attach(session, node, assets, lossless=not realtime)
            return recorder

        referee = Referee(
            node,
            session,
            level=level,
            levels={**LEVELS, level.name: level},
            players=players,
            person=person,
            record=record,
            open_level=reopened,
            prove=partial(
                proof_of, trusts=not asks_about_scripts(opened.records, assets), niceness=5 if realtime else 0
            ),
            race_limit=races,
            has_ghosts=ghosts,
            has_menu=has_menu,
        )
        ticking = asyncio.create_task(node.run())
        judging = asyncio.create_task(referee.run())
        try:
            await asyncio.wait((ticking, judging), return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in (judging, ticking):
                task.cancel()
            for outcome in await asyncio.gather(judging, ticking, return_exceptions=True):
                if isinstance(outcome, Exception):
                    raise outcome
        await referee.prove()


async def proof_of(recording: Path, entry: Entry, *, trusts: bool = True, niceness: int = 0) -> str:
    """What `elys verify` says of an entry's recording, asked of another process, which leaves the processor to the game beside it
    if it is nice.

    It `trusts` the scripts in the recording where all of them ran in the race; else none runs but ELYS's own.
    """
    import msgspec

    from elys.game import proof
    from elys.sim_node.verification import Verdict

    process = await asyncio.create_subprocess_exec(
        *("nice", "-n", str(niceness), sys.executable, "-m", "elys", "verify", str(recording), "--json"),
        *(("--trust",) if trusts else ()),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    said, complained = await process.communicate()
    try:
        verdict = msgspec.json.decode(said, type=Verdict)
    except msgspec.DecodeError:  # it could not be run again
        lines = complained.decode(errors="replace").strip().splitlines()
        return lines[-1][:200] if lines else "not proven"
    return proof.proof_of(verdict, began=entry.began, ended=entry.ended)


def times_of(level: AnyLevel, players: int = 1) -> list[dict[str, object]]:
    """The board of a level, for programs."""
    from elys.game.board import Board

    board = Board(level.board, players=players)
    return [
        {
            "place": place,
            "player": entry.player,
            "time": entry.time,
            "medal": entry.medal,
            "proof": entry.proof,
            "date": entry.date,
            "recording": str(board.path_of(entry)),
        }
        for place, entry in enumerate(board.entries, 1)
    ]


def times(level: str, *, players: int, json: bool) -> None:
    """Prints the best times of one level, or of all, in races of so many players."""
    from elys.samples.game.levels import LEVELS

    chosen = [level_named(level, AssetStore())] if level else list(LEVELS.values())
    if json:
        print_json({one.name: times_of(one, players) for one in chosen})
        return
    for one in chosen:
        medals = one.medals
        together = f" for {players} players" if players > 1 else ""
        print(f"{one.title}{together}  gold {medals.gold:g} s, silver {medals.silver:g} s, bronze {medals.bronze:g} s")
        rows = [
            (str(row["place"]), str(row["player"]), f"{row['time']:.3f} s", str(row["medal"]), str(row["proof"] or "-"))
            for row in times_of(one, players)
        ]
        if rows:
            print_table(("", "player", "time", "medal", "verified"), rows)
        else:
            print("  nobody has finished it yet")
