"""Pictures: how far they are from rays cast at exact shapes, and what a frame costs beside a bare program that draws the same."""

from __future__ import annotations

import time
from typing import Any, Final

import moderngl
import numpy as np

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore, primitive
from elys.common.components import Component, Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import View
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.quality import FAST, FULL
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.shadow_fit import fit_shadow
from tests.reference.traced_pictures import relative_errors, wrong_shadow_reach
from tests.reference.truth_scenes import counted, drawn_light, facing, hard_shadow, spheres, staged

Row = tuple[str, str]

TRUTH_SIZE: Final = 720
SIZE: Final = (1280, 720)
FRAMES: Final = 15
SUN_WAY: Final = (-0.4, -1.0, -0.6)
MAP_SIZE: Final = 2048


def measure() -> list[Row]:
    """Rows of the table."""
    context = offscreen_context()
    try:
        rows = truth_rows(context)
        for count in (1000, 10_000):
            rows += frame_rows(context, count)
        return rows
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


def encoded(light: Any) -> Any:
    """sRGB 0..1 of linear light."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


def frame_rows(context: Context, count: int) -> list[Row]:
    """Frames of moving cubes with the sun's shadow, ours and the bare program's taken in turns."""
    world, camera = cubes(count)
    renderers = {"full": Renderer(context, quality=FULL), "fast": Renderer(context, quality=FAST)}
    floor = BareFloor(context, world, camera)
    taken: dict[str, list[float]] = {name: [] for name in ("floor", *renderers)}
    for frame in range(FRAMES + 3):
        for name in taken:
            world.pose_version += 1  # as if all had moved: no shadow map is kept
            start = time.process_time()  # of all threads of a software driver; others' work does not count
            if name == "floor":
                floor.draw()
            else:
                renderers[name].draw(world, camera, *SIZE)
            context.finish()
            if frame >= 3:
                taken[name].append((time.process_time() - start) * 1e3)
    floor.release()
    middle = {name: float(np.median(values)) for name, values in taken.items()}
    ratio = {name: middle[name] / middle["floor"] for name in renderers}
    return [
        (f"{count} moving cubes with shadow, bare program, processor time", f"{middle['floor']:.1f} ms"),
        (
            f"{count} moving cubes with shadow, as software draws",
            f"{middle['fast']:.1f} ms ({ratio['fast']:.2f} of bare)",
        ),
        (f"{count} moving cubes with shadow, full quality", f"{middle['full']:.1f} ms ({ratio['full']:.2f} of bare)"),
    ]


def cubes(count: int) -> tuple[RenderWorld, ViewCamera]:
    """Cubes in a loose block, and who looks at them."""
    side = round(count ** (1 / 3))
    side += side**3 < count
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[:count]
    places = (grid - side / 2) * 2.0
    things: list[tuple[Component, ...]] = [
        (
            Transform(position=tuple(place.tolist())),
            MeshRenderer(),
            Material(base_color=(0.3 + 0.6 * (i % 7) / 6, 0.5, 0.4), roughness=0.3 + 0.1 * (i % 5)),
        )
        for i, place in enumerate(places)
    ]
    things.append((Transform(rotation=facing(SUN_WAY)), Light()))
    away = np.array((1.6, 1.2, 2.2)) * side
    rotation = tuple(look_rotation(-away).tolist())
    return staged(things, AssetStore()), ViewCamera(position=tuple(away.tolist()), rotation=rotation, far=50.0 * side)


class BareFloor:
    """What the same picture costs at the least: one instanced draw into a shadow map, one into the picture."""

    def __init__(self, context: Context, world: RenderWorld, camera: ViewCamera) -> None:
        gl = context.gl
        view = View.of(camera, *SIZE)
        fit = fit_shadow(world, view, np.array(SUN_WAY) / np.linalg.norm(SUN_WAY), map_size=MAP_SIZE)
        assert fit is not None
        cube = primitive("box")
        self._gl = gl
        self._affine = np.zeros((world.instance_count, 3, 5), np.float32)
        self._affine[:, :, :3] = world.linear
        self._affine[:, :, 3] = world.position - view.eye
        self._affine[:, :, 4] = world.surface[:, 0, :3]
        self._instances = gl.buffer(reserve=self._affine.nbytes)
        vertices = gl.buffer(np.concatenate([cube.positions, cube.normals], axis=1).astype(np.float32))
        indices = gl.buffer(cube.indices.astype(np.uint32))
        self._map = gl.depth_texture((MAP_SIZE, MAP_SIZE))
        self._map.compare_func = "<="
        self._map_target = gl.framebuffer(depth_attachment=self._map)
        self._picture = gl.framebuffer([gl.texture(SIZE, 4)], gl.depth_renderbuffer(SIZE))
        self._depth = gl.program(vertex_shader=_DEPTH_VERTEX, fragment_shader=_NOTHING)
        self._shade = gl.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        self._depth["target"].write(fit.map_from_relative.T.astype(np.float32).tobytes())
        self._shade["target"].write(view.clip_from_relative.T.astype(np.float32).tobytes())
        self._shade["map_target"].write(fit.map_from_relative.T.astype(np.float32).tobytes())
        self._shade["to_sun"].value = tuple(-np.array(SUN_WAY) / np.linalg.norm(SUN_WAY))
        rows = "4f4 f4 4f4 f4 4f4 f4 /i"
        self._draws = [
            gl.vertex_array(
                self._depth,
                [
                    (vertices, "3f4 3x4", "position"),
                    (self._instances, "4f4 x4 4f4 x4 4f4 x4 /i", "row_x", "row_y", "row_z"),
                ],
                indices,
            ),
            gl.vertex_array(
                self._shade,
                [
                    (vertices, "3f4 3f4", "position", "normal"),
                    (self._instances, rows, "row_x", "red", "row_y", "green", "row_z", "blue"),
                ],
                indices,
            ),
        ]

    def draw(self) -> None:
        """One picture."""
        count = len(self._affine)
        self._instances.orphan()
        self._instances.write(self._affine)
        self._gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._map_target.use()
        self._map_target.clear(depth=1.0)
        self._gl.polygon_offset = (1.5, 3.0)
        self._draws[0].render(instances=count)
        self._gl.polygon_offset = (0.0, 0.0)
        self._picture.use()
        self._picture.clear(0.3, 0.4, 0.6, depth=1.0)
        self._map.use(0)
        self._draws[1].render(instances=count)

    def release(self) -> None:
        """Frees the large things."""
        for owned in (*self._draws, self._map_target, self._picture, self._map, self._instances):
            owned.release()


_PLACE = """#version 330 core
in vec3 position; in vec4 row_x; in vec4 row_y; in vec4 row_z;
uniform mat4 target;
vec3 place() { vec4 p = vec4(position, 1.0); return vec3(dot(row_x, p), dot(row_y, p), dot(row_z, p)); }
"""
_DEPTH_VERTEX = f"{_PLACE} void main() {{ gl_Position = target * vec4(place(), 1.0); }}"
_NOTHING = "#version 330 core\nvoid main() {}"
_VERTEX = (
    _PLACE
    + """in vec3 normal; in float red; in float green; in float blue;
out vec3 to_eye; out vec3 turned; flat out vec3 color;
void main() {
    vec3 p = place();
    to_eye = -p; color = vec3(red, green, blue);
    turned = vec3(dot(row_x.xyz, normal), dot(row_y.xyz, normal), dot(row_z.xyz, normal));
    gl_Position = target * vec4(p, 1.0);
}"""
)
_FRAGMENT = """#version 330 core
in vec3 to_eye; in vec3 turned; flat in vec3 color;
uniform vec3 to_sun; uniform mat4 map_target; uniform sampler2DShadow map;
out vec4 shown;
void main() {
    vec3 n = normalize(turned), v = normalize(to_eye), h = normalize(v + to_sun);
    float nl = max(dot(n, to_sun), 0.0), nv = max(dot(n, v), 1e-4), nh = dot(n, h), a2 = 0.1;
    float f = nh * nh * (a2 - 1.0) + 1.0, d = a2 / (3.14159 * f * f);
    float g = 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2));
    vec4 m = map_target * vec4(-to_eye + n * 0.02, 1.0);
    float lit = texture(map, m.xyz * 0.5 + 0.5);
    vec3 light = (color / 3.14159 + 0.04 * d * g) * nl * 3.0 * lit + color * 0.25;
    shown = vec4(pow(light, vec3(1.0 / 2.2)), 1.0);
}"""
