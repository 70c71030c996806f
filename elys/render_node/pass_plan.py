"""Which passes a picture of a scene needs, and why: the passes' own answers, in words, without drawing anything."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from elys.bus.mirror import SceneMirror
from elys.render_node.camera import View
from elys.render_node.draw_calls import DrawCall
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.overlays import OverlayBoard
from elys.render_node.passes.backdrop import GridPass, SkyPass
from elys.render_node.passes.bloom import BloomPass
from elys.render_node.passes.finishing import FxaaPass, OutlinePass
from elys.render_node.passes.ghosts import GhostPass
from elys.render_node.passes.marks import LetterPass, LinePass
from elys.render_node.passes.occlusion import OcclusionPass
from elys.render_node.passes.overlay import OverlayPass
from elys.render_node.passes.shading import OpaquePass, TransparentPass
from elys.render_node.passes.shadow import LampShadowPass, ShadowPass
from elys.render_node.picture_plan import PicturePlan, plan_picture
from elys.render_node.quality import FULL
from elys.render_node.render_world import RenderWorld
from elys.render_node.scene_reader import SceneReader


class PlannedPass(NamedTuple):
    """A pass, or a part of one."""

    name: str
    is_on: bool
    why: str


def scene_passes(
    mirror: SceneMirror, fetch: Callable[[str], bytes] | None, width: int, height: int
) -> tuple[PlannedPass, ...]:
    """The passes of a picture of a mirror's scene by its own camera, as its newest frame stands."""
    world = RenderWorld(DrawableAssets(fetch))
    reader = SceneReader(mirror)
    try:
        world.read_scene(reader)
        newest = mirror.latest_frame
        if newest is not None:
            world.take_state(newest)
        for batch in world.batches:
            world.assets.mesh(batch.mesh)
        world.assets.settle()
        world.place()
        view = View.of(world.camera(width / height), width, height)
        plan = plan_picture(
            world, view, shadow_size=FULL.shadow_size, long_views=True, lamp_shadow_size=FULL.lamp_shadow_size
        )
        return told_passes(replace(plan, overlays=OverlayBoard(mirror).shown(world)))
    finally:
        reader.close()
        world.assets.close()


def told_passes(plan: PicturePlan) -> tuple[PlannedPass, ...]:
    """Every pass of a picture in the order in which they run."""
    shown = [*plan.opaque, *plan.transparent]
    around, picture = plan.surroundings, plan.picture
    mapped = [call for call in shown if call.batch.look.has_normal_map]
    return (
        PlannedPass("environment", around.gives_light or around.is_seen, _why_environment(plan)),
        PlannedPass("lights", plan.sun is not None or bool(plan.lamps), _why_lights(plan)),
        PlannedPass("shadow", ShadowPass.is_needed(plan), _why_shadow(plan)),
        PlannedPass("lamp shadows", LampShadowPass.is_needed(plan), _why_lamp_shadows(plan)),
        PlannedPass("occlusion", OcclusionPass.is_needed(plan), _why_occlusion(plan)),
        PlannedPass("opaque", OpaquePass.is_needed(plan), _why_seen(plan.opaque, "solid thing")),
        PlannedPass(
            "tangents",
            bool(mapped),
            _why_seen(mapped, "thing with a normal map") if mapped else "no normal map is seen",
        ),
        PlannedPass(
            "sky",
            SkyPass.is_needed(plan),
            "something is behind everything" if SkyPass.is_needed(plan) else "nothing is behind everything",
        ),
        PlannedPass("grid", GridPass.is_needed(plan), "for who edits" if plan.grid else "nobody edits"),
        PlannedPass("transparent", TransparentPass.is_needed(plan), _why_seen(plan.transparent, "see-through thing")),
        PlannedPass("ghosts", GhostPass.is_needed(plan), _why_ghosts(plan)),
        PlannedPass(
            "fog",
            picture.fog_density > 0.0,
            _why_set(picture.fog_density, "fog_density", "surfaces and sky are dimmed"),
        ),
        PlannedPass("bloom", BloomPass.is_needed(plan), _why_set(picture.bloom, "bloom", "bright light spreads")),
        PlannedPass("fxaa", FxaaPass.is_needed(plan), _why_set(picture.fxaa, "fxaa", "edges are smoothed")),
        PlannedPass("debug lines", LinePass.is_needed(plan), _why_marked(len(plan.marks.lines), "line")),
        PlannedPass("outline", OutlinePass.is_needed(plan), _why_seen(plan.selected, "selected thing")),
        PlannedPass("overlays", OverlayPass.is_needed(plan), _why_overlays(plan)),
        PlannedPass("letters", LetterPass.is_needed(plan), _why_marked(len(plan.marks.labels), "label")),
        PlannedPass("tonemap", True, f"always: light becomes what a screen shows, by {picture.tone_mapping}"),
    )


def _why_seen(calls: list[DrawCall], noun: str) -> str:
    count = sum(call.instance_count for call in calls)
    if not count:
        return f"no {noun} is seen"
    plural = noun if count == 1 else noun.replace("thing", "things", 1)
    return f"{count} {plural} seen, in {len(calls)} draw call{'s' if len(calls) != 1 else ''}"


def _why_ghosts(plan: PicturePlan) -> str:
    calls = [call for ghost in plan.ghosts for call in (*ghost.plan.opaque, *ghost.plan.transparent)]
    if not calls:
        return "no other run is shown, or none has parted from this one in view"
    return f"of other runs {_why_seen(calls, 'thing')}"


def _why_marked(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' if count != 1 else ''} of debug drawing" if count else "nobody asked for debug drawing"


def _why_overlays(plan: PicturePlan) -> str:
    count = len(plan.overlays.nodes)
    if not count:
        return "the scene has no overlays"
    return "1 entity is drawn over the picture" if count == 1 else f"{count} entities are drawn over the picture"


def _why_set(value: float, name: str, effect: str) -> str:
    return f"{effect}: picture.{name} is {value:g}" if value else f"picture.{name} is 0"


def _why_environment(plan: PicturePlan) -> str:
    around = plan.surroundings
    if not (around.gives_light or around.is_seen):
        return "all around is black"
    what = {"colors": "the scene's colours", "color": "a colour", "sky": "a clear sky", "image": "a picture"}[
        around.key[0]
    ]
    return (
        f"made once of {what}, and kept while that stays"
        if around.gives_light
        else f"{what} is seen and gives no light"
    )


def _why_lights(plan: PicturePlan) -> str:
    suns, lamps = (plan.sun is not None) + len(plan.further_suns), len(plan.lamps)
    if not (suns or lamps):
        return "no sun and no lamp shines"
    if any(plan.left_out):
        all_suns, all_lamps = suns + plan.left_out.suns, lamps + plan.left_out.lamps
        return f"suns: {suns} of {all_suns}, lamps: {lamps} of {all_lamps}; left out is what gives the eye least light"
    if plan.further_suns:
        return f"suns: {suns}, and one of them throws shadows at most, lamps: {lamps}"
    return f"suns: {suns}, lamps: {lamps}"


def _why_lamp_shadows(plan: PicturePlan) -> str:
    if not plan.lamps:
        return "no bulbs and no spots"
    if plan.lamp_shadows is None:
        return "no bulb and no spot throws a shadow"
    count = sum(first >= 0 for first in plan.lamp_shadows.first)
    return f"{count} lamp{'s throw' if count > 1 else ' throws'} shadows, in {len(plan.lamp_shadows.place)} squares"


def _why_occlusion(plan: PicturePlan) -> str:
    if plan.picture.ambient_occlusion == 0.0:
        return "picture.ambient_occlusion is 0"
    if not plan.surroundings.gives_light:
        return "no light from around to keep out"
    return "corners get less light from around" if plan.opaque else "no solid thing is seen"


def _why_shadow(plan: PicturePlan) -> str:
    if plan.sun is None:
        return "no sun"
    if not plan.sun.light.cast_shadows:
        return "the sun casts no shadows"
    if not plan.cascades:
        return "nothing that throws a shadow is in view"
    if not plan.stale_cascades:
        return "what was drawn for the last picture still holds"
    finer = len(plan.cascades) - 1
    more = f", and {finer} finer map{'s' if finer > 1 else ''} around the eye for the long view" if finer else ""
    return f"{sum(call.instance_count for call in plan.casters[-1])} things throw shadows{more}"
