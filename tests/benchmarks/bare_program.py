"""A program that draws moving cubes under a sun and nothing else: what such a picture costs at the least.

It draws what ELYS draws at the same quality: the same light, surfaces, shadow map, looks into it, samples, tone mapping. What it
lacks is all that ELYS could draw as well, and everything that decides what a picture needs: its cubes were put into the best
order, nearest first, before it starts.
"""

from __future__ import annotations

from typing import Any, Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.views import ViewCamera
from elys.common.assets import primitive
from elys.render_node.camera import View
from elys.render_node.frame_block import NORMAL_OFFSET
from elys.render_node.gpu import Context
from elys.render_node.passes.shadow import SLOPE_OFFSET
from elys.render_node.quality import Quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.shadow_fit import fit_shadow

MAP_FROM_CLIP: Final = np.array([(0.5, 0, 0, 0.5), (0, 0.5, 0, 0.5), (0, 0, 0.5, 0.5), (0, 0, 0, 1.0)])


class BareProgram:
    """Of cubes that are no metals, do not glow and are scaled evenly."""

    def __init__(
        self, context: Context, world: RenderWorld, camera: ViewCamera, size: tuple[int, int], *, quality: Quality
    ) -> None:
        self._gl = context.gl
        self._size, self._quality = size, quality
        view = View.of(camera, *size)
        sun = world.lights()[0]
        fit = fit_shadow(world, view, sun.direction, map_size=quality.shadow_size)
        assert fit is not None
        self._rows = np.empty((world.instance_count, 4, 4), np.float32)
        self._rows[:, :3, :3] = world.linear
        self._rows[:, :3, 3] = world.position - view.eye
        self._rows[:, 3, :3] = world.instances.surface[:, 0, :3]
        self._rows[:, 3, 3] = world.instances.surface[:, 2, 1]
        depth = self._rows[:, :3, 3] @ -view.world_from_view[:, 2].astype(np.float32)
        self._rows = self._rows[np.argsort(depth, kind="stable")]
        self._make_targets()
        self._make_programs()
        _set(self._depth, target=fit.map_from_relative)
        map_from_relative = MAP_FROM_CLIP @ fit.map_from_relative
        _set(self._shade, target=view.clip_from_relative, map_from_relative=map_from_relative)
        self._shade["to_sun"].value = tuple((-sun.direction).tolist())
        self._shade["illuminance"].value = tuple((np.array(sun.light.color) * sun.light.intensity).tolist())
        self._shade["lift"].value = fit.texel * NORMAL_OFFSET
        if not quality.single_shadow_tap:
            self._shade["half_texel"].value = 0.5 / fit.map_size

    def draw(self) -> Any:
        """One picture; returns the framebuffer that holds it."""
        count = len(self._rows)
        self._instances.orphan()
        self._instances.write(self._rows)
        self._gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._map_target.use()
        self._map_target.clear(depth=1.0)
        self._gl.polygon_offset = SLOPE_OFFSET
        self._casters.render(instances=count)
        self._gl.polygon_offset = (0.0, 0.0)
        self._drawn.use()
        self._drawn.clear(depth=1.0)
        self._map.use(0)
        self._cubes.render(instances=count)
        if self._light is None:
            return self._drawn
        self._gl.copy_framebuffer(self._light, self._drawn)
        self._gl.enable_only(moderngl.NOTHING)
        self._picture.use()
        self._light.color_attachments[0].use(0)
        self._screen.render(vertices=3)
        return self._picture

    def release(self) -> None:
        """Frees all it made."""
        for owned in reversed(self._owned):
            owned.release()

    def _make_targets(self) -> None:
        gl, quality, size = self._gl, self._quality, self._size
        self._map = gl.depth_texture((quality.shadow_size,) * 2)
        self._map.compare_func = "<="
        self._map.repeat_x = self._map.repeat_y = False
        self._map_target = gl.framebuffer(depth_attachment=self._map)
        self._owned = [self._map, self._map_target]
        plain = gl.texture(size, 4)
        self._light = None
        if quality.to_screen:
            depth = gl.depth_renderbuffer(size)
            self._drawn = gl.framebuffer([plain], depth)
            self._owned += [plain, depth, self._drawn]
            return
        color = gl.renderbuffer(size, 4, samples=quality.samples, dtype="f2")
        depth = gl.depth_renderbuffer(size, samples=quality.samples)
        averaged = gl.texture(size, 4, dtype="f2")
        self._drawn = gl.framebuffer([color], depth)
        self._light, self._picture = gl.framebuffer([averaged]), gl.framebuffer([plain])
        self._owned += [color, depth, averaged, plain, self._drawn, self._light, self._picture]

    def _make_programs(self) -> None:
        gl, cube = self._gl, primitive("box")
        to_screen = self._quality.to_screen
        fragment = [_TONES if to_screen else "", _TAP if self._quality.single_shadow_tap else _TAPS, _FRAGMENT]
        shown = "shown_of(light)" if to_screen else "light"
        self._depth = gl.program(vertex_shader=_HEAD + _DEPTH_VERTEX, fragment_shader=_HEAD + "void main() {}")
        self._shade = gl.program(
            vertex_shader=_HEAD + _VERTEX, fragment_shader=_HEAD + "".join(fragment).replace("SHOWN", shown)
        )
        vertices = gl.buffer(np.concatenate([cube.positions, cube.normals], axis=1).astype(np.float32))
        indices = gl.buffer(cube.indices.astype(np.uint32))
        self._instances = gl.buffer(reserve=self._rows.nbytes)
        places = (self._instances, "4f4 4f4 4f4 4x4 /i", "row_x", "row_y", "row_z")
        rows = (self._instances, "4f4 4f4 4f4 4f4 /i", "row_x", "row_y", "row_z", "surface")
        self._casters = gl.vertex_array(self._depth, [(vertices, "3f4 3x4", "position"), places], indices)
        self._cubes = gl.vertex_array(self._shade, [(vertices, "3f4 3f4", "position", "normal"), rows], indices)
        self._owned += [self._depth, self._shade, vertices, indices, self._instances, self._casters, self._cubes]
        if not to_screen:
            program = gl.program(vertex_shader=_HEAD + _SCREEN_VERTEX, fragment_shader=_HEAD + _TONES + _SCREEN)
            self._screen = gl.vertex_array(program, [])
            self._owned += [program, self._screen]


def _set(program: Any, **matrices: NDArray[np.float64]) -> None:
    for name, matrix in matrices.items():
        program[name].write(np.ascontiguousarray(matrix.T, np.float32))


_HEAD = "#version 330 core\n"
_PLACE = """in vec3 position; in vec4 row_x; in vec4 row_y; in vec4 row_z;
uniform mat4 target;
vec3 place() { vec4 p = vec4(position, 1.0); return vec3(dot(row_x, p), dot(row_y, p), dot(row_z, p)); }
"""
_DEPTH_VERTEX = _PLACE + "void main() { gl_Position = target * vec4(place(), 1.0); }"
_VERTEX = (
    _PLACE
    + """in vec3 normal; in vec4 surface;
out vec3 relative; out vec3 turned; flat out vec4 seen_surface;
void main() {
    relative = place(); seen_surface = surface;
    turned = vec3(dot(row_x.xyz, normal), dot(row_y.xyz, normal), dot(row_z.xyz, normal));
    gl_Position = target * vec4(relative, 1.0);
}"""
)
_TAP = """uniform sampler2DShadow map;
float lit_at(vec3 place) { return texture(map, place); }
"""
_TAPS = """uniform sampler2DShadow map; uniform float half_texel;
float lit_at(vec3 place) {
    vec2 h = vec2(half_texel, -half_texel);
    float sum = texture(map, place + vec3(h.yy, 0.0)) + texture(map, place + vec3(h.xy, 0.0));
    return 0.25 * (sum + texture(map, place + vec3(h.yx, 0.0)) + texture(map, place + vec3(h.xx, 0.0)));
}
"""
# Khronos PBR Neutral, then sRGB.
_TONES = """vec3 shown_of(vec3 light) {
    float least = min(light.r, min(light.g, light.b));
    light -= least < 0.08 ? least - 6.25 * least * least : 0.04;
    float peak = max(light.r, max(light.g, light.b));
    if (peak >= 0.76) {
        float lower = 1.0 - 0.0576 / (peak + 0.24 - 0.76);
        light = mix(light * (lower / peak), vec3(lower), 1.0 - 1.0 / (0.15 * (peak - lower) + 1.0));
    }
    light = min(light, vec3(1.0));
    return mix(1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, light * 12.92, lessThanEqual(light, vec3(0.0031308)));
}
"""
# Lambert below GGX, glTF 2.0, appendix B.
_FRAGMENT = """in vec3 relative; in vec3 turned; flat in vec4 seen_surface;
uniform vec3 to_sun; uniform vec3 illuminance; uniform mat4 map_from_relative; uniform float lift;
out vec4 shown;
void main() {
    vec3 n = normalize(turned), v = -normalize(relative), h = normalize(v + to_sun);
    float nl = max(dot(n, to_sun), 0.0), nv = max(dot(n, v), 1e-4), nh = min(dot(n, h), 1.0), vh = 1.0 - dot(v, h);
    float a = seen_surface.w * seen_surface.w, a2 = a * a;
    float f = nh * nh * (a2 - 1.0) + 1.0, d = a2 / (3.14159265 * f * f);
    float g = 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2));
    float fresnel = 0.04 + 0.96 * (vh * vh) * (vh * vh) * vh;
    vec3 raised = relative + n * (lift * (0.4 + sqrt(max(1.0 - nl * nl, 0.0))));
    float lit = lit_at((map_from_relative * vec4(raised, 1.0)).xyz);
    vec3 light = ((1.0 - fresnel) * seen_surface.rgb / 3.14159265 + fresnel * d * g) * nl * illuminance * lit;
    shown = vec4(SHOWN, 1.0);
}"""
_SCREEN_VERTEX = """void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}"""
_SCREEN = """uniform sampler2D light; out vec4 shown;
void main() { shown = vec4(shown_of(texelFetch(light, ivec2(gl_FragCoord.xy), 0).rgb), 1.0); }"""
