"""How long a model takes until it can be drawn, beside how long decoding its images alone takes."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from elys.common.assets import AssetStore
from elys.common.assets.gltf import import_gltf
from elys.common.components import component_from
from elys.render_node.drawable_assets import THREAD_COUNT, DrawableAssets
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.images import decode_image
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import tables_of

MODELS = Path(os.environ.get("ELYS_REAL_MODELS") or Path(__file__).parents[3] / "shared" / "assets")
REPEATS = 11


def measure() -> list[tuple[str, str]]:
    """Rows of the table; none where the folder of real models is not there."""
    model = MODELS / "FlightHelmet" / "FlightHelmet.gltf"
    if not model.is_file():
        return []
    images = [path.read_bytes() for path in sorted(model.parent.glob("*.png"))]
    context = offscreen_context()
    try:
        pairs = [measure_both(context, model, images) for _ in range(REPEATS + 1)][1:]
    finally:
        context.release()
    ratio = statistics.median(ready / alone for alone, ready in pairs)
    alone, ready = (statistics.median(times) * 1e3 for times in zip(*pairs, strict=True))
    what = f"FlightHelmet: its {len(images)} images decoded alone / read and ready to draw, {THREAD_COUNT} threads"
    return [(what, f"{alone:.0f} / {ready:.0f} ms, {ratio:.2f} times")]


def measure_both(context: Context, model: Path, images: list[bytes]) -> tuple[float, float]:
    """Seconds for the images alone and for the model, with a renderer that has seen neither before."""
    renderer = Renderer(context)
    return timed(lambda: decode(images)), timed(lambda: get_ready(renderer, model))


def decode(images: list[bytes]) -> None:
    with ThreadPoolExecutor(THREAD_COUNT) as pool:
        list(pool.map(decode_image, images))


def get_ready(renderer: Renderer, model: Path) -> None:
    """From the file to meshes and images on the card."""
    assets = AssetStore()
    records = import_gltf(model, assets)
    world = RenderWorld(DrawableAssets(assets.get))
    components = [{name: component_from(name, values) for name, values in r.components.items()} for r in records]
    world.set_scene(tables_of(range(1, len(records) + 1), [r.parent + 1 for r in records], components))
    renderer.settle(world)
    renderer.context.gl.finish()
    world.assets.close()


def timed(work: Callable[[], None]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start
