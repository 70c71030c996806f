"""plan: what a scene makes the engine do, why the rest is switched off, and what that saves."""

from __future__ import annotations

from typing import Final

import msgspec

from elys.common.assets.store import AssetStore
from elys.common.errors import DisplayError
from elys.common.scene import OpenedScene
from elys.lab.plan_report import PlanReport, Saving, advance, forcible, kernels_of, report
from elys.sim_node.simulation import Simulation
from elys.verbs.kernels import compile_with_progress, load_with_progress
from elys.verbs.output import print_json, print_table, size_text
from elys.verbs.pareto import counted
from elys.verbs.scenes import open_scene_or_sample

PICTURE_SIZE: Final = (1280, 720)
NOISE: Final = 3.0  # standard errors within which a difference is none


class PictureStage(msgspec.Struct, frozen=True, kw_only=True):
    """A pass of a picture, or a part of one, as the scene's camera sees it."""

    name: str
    is_on: bool
    why: str


class BusStage(msgspec.Struct, frozen=True, kw_only=True):
    """What a host says on the bus."""

    name: str
    when: str


class ScenePlan(msgspec.Struct, frozen=True, kw_only=True):
    """All of it."""

    physics: PlanReport
    pictures: tuple[PictureStage, ...]
    pictures_missing: str  # why nothing is said of pictures, where nothing is
    bus: tuple[BusStage, ...]


BUS: Final = (
    BusStage(name="view/frame", when="a picture only while a viewer asks for one: without a render node none is drawn"),
    BusStage(name="state, profile, diagnostics", when="made each tick, only while somebody listens or records"),
    BusStage(name="debug_lines", when="made only while somebody listens"),
    BusStage(name="contacts, events, delta", when="only for ticks in which something began, ended or changed"),
    BusStage(name="status", when="at changes and 4 times a second"),
)


def plan(scene: str, *, at: float, seconds: float, threads: int, json: bool) -> None:
    """Tells the plan of a scene after `at` seconds, measured over `seconds` (0: not measured)."""
    assets = AssetStore()
    opened = open_scene_or_sample(scene, assets)
    compile_with_progress(opened, threads=threads)
    simulation = Simulation.load(opened, assets, threads=threads)
    advance(simulation, at)
    if seconds:
        load_with_progress(kernels_of(forcible(simulation)))
    with counted(f"Measuring {opened.name}") as progress:
        measured = report(simulation, seconds=seconds, progress=progress)
    pictures, missing = _pictures(opened, assets, at)
    found = ScenePlan(physics=measured, pictures=pictures, pictures_missing=missing, bus=BUS)
    if json:
        print_json(found)
    else:
        print_plan(found)


def print_plan(found: ScenePlan) -> None:
    """A plan as a person reads it."""
    physics = found.physics
    measured = f"; measured over {physics.ticks} ticks" if physics.ticks else ""
    print(f"{physics.scene} at {physics.moment:g} s: {physics.body_count} bodies{measured}\n")
    print_table(("physics", "", "why"), [(stage.name, _switch(stage.is_on), stage.why) for stage in physics.stages])
    print()
    if physics.ticks:
        print_table(("what it takes", "ms a tick"), _spent_rows(physics))
        print()
        print_table(
            ("what is saved", "ms a tick", "code", "tables", "if it were on"),
            [_saved_row(stage.name, stage.proof, stage.saving) for stage in physics.stages if stage.saving is not None],
        )
        print()
    if found.pictures_missing:
        print(f"pictures: {found.pictures_missing}")
    else:
        print_table(
            ("pictures", "", "why"), [(stage.name, _switch(stage.is_on), stage.why) for stage in found.pictures]
        )
    print()
    print_table(("bus", "when"), [(stage.name, stage.when) for stage in found.bus])


def _spent_rows(physics: PlanReport) -> list[tuple[str, str]]:
    """The dearest first, and what they make together."""
    spent = {stage.name: stage.time for stage in physics.stages if stage.time} | physics.other_stages
    rows = sorted(spent.items(), key=lambda row: -row[1])
    return [(name, f"{time:.4f}") for name, time in (*rows, ("a whole tick", physics.tick_time))]


def _saved_row(name: str, proof: str, saving: Saving) -> tuple[str, ...]:
    doubt = NOISE * saving.noise
    saved = "none" if abs(saving.time) <= doubt else f"{saving.time:.4f}"
    after = "same bits" if saving.is_same else f"{proof}: {saving.difference:.1e} m apart in the end"
    return (
        name,
        f"{saved} ±{doubt:.4f}",
        size_text(saving.code) if saving.code else "",
        _tables_text(saving.tables),
        after,
    )


def _tables_text(size: int) -> str:
    """Of arrays; a stage that is off may need more of them than it would on."""
    return ("" if size > 0 else "-") + size_text(abs(size)) if size else ""


def _switch(is_on: bool) -> str:
    return "on" if is_on else "off"


def _pictures(scene: OpenedScene, assets: AssetStore, at: float) -> tuple[tuple[PictureStage, ...], str]:
    """What a picture by the scene's camera consists of, or why that cannot be said here."""
    try:
        from elys.render_node.pass_plan import scene_passes
    except ImportError as error:
        return (), f"{error.name} is not installed: pip install 'elys[render]'"
    from elys.verbs.footage import simulated

    footage = simulated(scene, assets, at)
    footage.mirror.keep_frame(next(footage.frames))
    try:
        told = scene_passes(footage.mirror, footage.fetch, *PICTURE_SIZE)
    except DisplayError as error:
        return (), str(error)
    return tuple(PictureStage(name=name, is_on=is_on, why=why) for name, is_on, why in told), ""
