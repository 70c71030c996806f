"""Pictures: how far they are from rays cast at exact shapes, and what a frame costs beside a bare program that draws the same."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore
from elys.common.components import Component, Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.quality import FAST, FULL, Quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from tests.benchmarks import picture_python
from tests.benchmarks.bare_program import BareProgram
from tests.benchmarks.picture_peers import PeerCubes, missing_peer, peer_spheres
from tests.reference.traced_pictures import relative_errors, wrong_shadow_reach
from tests.reference.truth_scenes import counted, drawn_light, facing, hard_shadow, spheres, staged

Row = tuple[str, str]
Picture = NDArray[np.uint8]  # (H, W, 4) sRGB, the upper row first

TRUTH_SIZE: Final = 720
SIZE: Final = (1280, 720)
COUNTS: Final = (1000, 10_000)
FRAMES: Final = 15
PEER_FRAMES: Final = 7  # which take seconds
WARMING: Final = 3  # frames before those that count
QUALITIES: Final = {"as software draws": FAST, "full quality": FULL}
SUN_WAY: Final = (-0.4, -1.0, -0.6)


def measure() -> list[Row]:
    """Rows of the table."""
    context = offscreen_context()
    try:
        rows = truth_rows(context)
        for count in COUNTS:
            rows += frame_rows(context, count)
        return rows + picture_python.measure() + peer_rows(context)
    finally:
        context.release()


def truth_rows(context: Context) -> list[Row]:
    """Errors of the linear picture."""
    scene = spheres(TRUTH_SIZE)
    light = drawn_light(context, scene, TRUTH_SIZE)
    errors = relative_errors(light, scene.truth.light, counted(scene.truth)) * 100
    middle, worst = np.percentile(errors, (50, 99))
    rows = [("49 spheres against cast rays, error p50 / p99", f"{middle:.3f} / {worst:.2f} %")]
    difference = flip(light, scene.truth.light)
    if difference is not None:
        rows.append(("49 spheres against cast rays, FLIP", f"{difference:.4f}"))
    shadow = hard_shadow(TRUTH_SIZE)
    reach = wrong_shadow_reach(drawn_light(context, shadow, TRUTH_SIZE), shadow.truth, ground=0)
    rows.append(("hard shadow, farthest wrong pixel from its edge", f"{reach} px"))
    return rows


def flip(light: Any, truth: Any) -> float | None:
    """Mean FLIP of two linear pictures as a screen shows them; None without flip-evaluator (the extra `peers`)."""
    try:
        import flip_evaluator
    except ImportError:
        return None
    shown = [encoded(picture).astype(np.float32) for picture in (truth, light)]
    return float(flip_evaluator.evaluate(*shown, "LDR")[1])


def decoded(picture: Picture) -> Any:
    """Linear light of sRGB of 8 bits."""
    share = picture / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def encoded(light: Any) -> Any:
    """sRGB 0..1 of linear light."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


def frame_rows(context: Context, count: int) -> list[Row]:
    """Frames of moving cubes with the sun's shadow, ours and those of a bare program that draws the same taken in turns."""
    world, camera = cubes(count)
    rows: list[Row] = []
    for words, quality in QUALITIES.items():
        bare = BareProgram(context, world, camera, SIZE, quality=quality)
        spent, shown = in_turns({"ours": drawn_and_finished(context, world, camera, quality), "bare": drawn_bare(bare)})
        apart = np.abs(shown["bare"].astype(int) - shown["ours"]).max(axis=-1)
        bare.release()
        rows += [
            (
                f"{count} cubes whose shadow is drawn anew, {words}, ELYS / bare program, processor time",
                f"{spent['ours']:.1f} / {spent['bare']:.1f} ms ({spent['ours'] / spent['bare']:.2f})",
            ),
            (
                f"{count} cubes whose shadow is drawn anew, {words}, the two pictures are apart by",
                f"{apart.mean():.4f} of 255, at most {apart.max()}",
            ),
        ]
    return rows


def peer_rows(context: Context) -> list[Row]:
    """The same of pygfx: its error, and frames of cubes of one material, ours and its taken in turns; both are read back."""
    why = missing_peer()
    if why is not None:
        return [("pygfx", why)]
    scene = spheres(TRUTH_SIZE)
    light = decoded(peer_spheres(TRUTH_SIZE)[..., :3])
    middle, worst = np.percentile(relative_errors(light, scene.truth.light, counted(scene.truth)) * 100, (50, 99))
    rows = [("pygfx: 49 spheres against cast rays, error p50 / p99, of 8 bits", f"{middle:.3f} / {worst:.2f} %")]
    difference = flip(light, scene.truth.light)
    if difference is not None:
        rows.append(("pygfx: 49 spheres against cast rays, FLIP", f"{difference:.4f}"))
    for count in COUNTS:
        world, camera = cubes(count, varied=False)
        for words, quality in QUALITIES.items():
            peer = PeerCubes(world, camera, SIZE, samples=max(quality.samples, 1))
            spent, _ = in_turns(
                {"ours": drawn_and_finished(context, world, camera, quality), "peer": peer.draw}, frames=PEER_FRAMES
            )
            rows.append(
                (
                    f"{count} cubes whose shadow is drawn anew, {words}, ELYS / pygfx, processor time",
                    f"{spent['ours']:.1f} / {spent['peer']:.1f} ms ({spent['ours'] / spent['peer']:.2f})",
                )
            )
    return rows


def in_turns(
    programs: dict[str, Callable[[], Picture]], *, frames: int = FRAMES
) -> tuple[dict[str, float], dict[str, Picture]]:
    """Median processor time [ms] of each one's frames, and what its last one shows."""
    spent: dict[str, list[float]] = {name: [] for name in programs}
    shown: dict[str, Picture] = {}
    for frame in range(frames + WARMING):
        for name, draw in programs.items():
            start = time.process_time()  # of all threads of a software driver; others' work does not count
            shown[name] = draw()
            if frame >= WARMING:
                spent[name].append((time.process_time() - start) * 1e3)
    return {name: float(np.median(values)) for name, values in spent.items()}, shown


def drawn_and_finished(
    context: Context, world: RenderWorld, camera: ViewCamera, quality: Quality
) -> Callable[[], Picture]:
    """Draws a frame of ELYS and reads it back."""
    renderer = Renderer(context, quality=quality)

    def draw() -> Picture:
        world.pose_version += 1  # as if all had moved: no shadow map is kept
        return renderer.read_pixels(renderer.draw(world, camera, *SIZE))

    return draw


def drawn_bare(bare: BareProgram) -> Callable[[], Picture]:
    """The same of the bare program."""

    def draw() -> Picture:
        pixels = np.frombuffer(bare.draw().read(components=4), np.uint8)
        return np.ascontiguousarray(pixels.reshape(*SIZE[::-1], 4)[::-1])

    return draw


def cubes(count: int, *, varied: bool = True) -> tuple[RenderWorld, ViewCamera]:
    """Cubes in a loose block, of many colours or of one, and who looks at them."""
    side = round(count ** (1 / 3))
    side += side**3 < count
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[:count]
    places = (grid - side / 2) * 2.0
    plain = Material(base_color=(0.6, 0.5, 0.4), roughness=0.5)
    things: list[tuple[Component, ...]] = [
        (
            Transform(position=tuple(place.tolist())),
            MeshRenderer(),
            Material(base_color=(0.3 + 0.6 * (i % 7) / 6, 0.5, 0.4), roughness=0.3 + 0.1 * (i % 5))
            if varied
            else plain,
        )
        for i, place in enumerate(places)
    ]
    things.append((Transform(rotation=facing(SUN_WAY)), Light()))
    away = np.array((1.6, 1.2, 2.2)) * side
    rotation = tuple(look_rotation(-away).tolist())
    return staged(things, AssetStore()), ViewCamera(position=tuple(away.tolist()), rotation=rotation, far=50.0 * side)
