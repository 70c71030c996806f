"""The same pictures by pygfx (extra `peers`), which draws with wgpu: by what it is off the truth, and what a frame costs.

It needs a Vulkan driver; where there is no card, Mesa's lavapipe draws on the processor, as llvmpipe does for ELYS.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.views import ViewCamera
from elys.common.assets import Mesh, primitive
from elys.render_node.render_world import RenderWorld
from tests.reference.truth_scenes import BULB, COLOR, SIDE, SUN_WAY, fine_ball

SHADOW_MARGIN: Final = 1.1


def missing_peer() -> str | None:
    """Why pygfx cannot draw here, in one sentence; None if it can."""
    try:
        import pygfx  # noqa: F401
        import wgpu
        from wgpu.backends.wgpu_native.extras import set_instance_extras
    except ImportError:
        return "not measured: pip install 'elys[peers]' brings it"
    set_instance_extras(backends=["Vulkan"])  # over OpenGL it would take the context away from ours
    if not wgpu.gpu.enumerate_adapters_sync():
        return "not measured: there is no Vulkan driver (Debian, Ubuntu: apt install mesa-vulkan-drivers)"
    return None


class PeerPicture:
    """A scene of pygfx, a picture's size, and how many samples a pixel has: 1, or 4 by drawing at twice the size."""

    def __init__(self, size: tuple[int, int], camera: ViewCamera, *, samples: int) -> None:
        import pygfx
        from rendercanvas.offscreen import RenderCanvas

        self.gfx = pygfx
        self._canvas = RenderCanvas(size=size, pixel_ratio=1)
        self._renderer = pygfx.WgpuRenderer(self._canvas, pixel_scale=round(math.sqrt(samples)), ppaa="none")
        aspect = size[0] / size[1]
        # pygfx' angle is of the mean of width and height.
        across = 2 * math.atan(math.tan(camera.field_of_view / 2) * (1 + aspect) / 2)
        self._camera = pygfx.PerspectiveCamera(math.degrees(across), aspect, depth_range=(camera.near, camera.far))
        self._camera.world.position = camera.position
        self._camera.world.rotation = camera.rotation
        self.scene = pygfx.Scene()
        self._canvas.request_draw(lambda: self._renderer.render(self.scene, self._camera))

    def add_sun(self, way: tuple[float, float, float], illuminance: float, *, shadow_reach: float = 0.0) -> None:
        """Light that goes along `way` [lx]; it throws shadows if it is told how far from the origin [m] things are."""
        sun = self.gfx.DirectionalLight("#ffffff", illuminance, cast_shadow=shadow_reach > 0)
        unit = np.array(way) / np.linalg.norm(way)
        sun.world.position = tuple(-unit * 2 * max(shadow_reach, 1.0))
        if shadow_reach:
            view = sun.shadow.camera
            view.width = view.height = 2 * shadow_reach
            view.depth_range = (0.5 * shadow_reach, 3.5 * shadow_reach)
        self.scene.add(sun)

    def material(self, color: Any, metallic: float, roughness: float) -> Any:
        """Of a linear colour."""
        linear = self.gfx.Color.from_physical(*(float(channel) for channel in color))
        return self.gfx.MeshStandardMaterial(color=linear, metalness=metallic, roughness=roughness)

    def geometry(self, mesh: Mesh) -> Any:
        """A mesh of ours."""
        return self.gfx.Geometry(
            indices=mesh.indices.reshape(-1, 3).astype(np.uint32),
            positions=mesh.positions.astype(np.float32),
            normals=mesh.normals.astype(np.float32),
        )

    def draw(self) -> NDArray[np.uint8]:
        """Draws and reads back sRGB (H, W, 4)."""
        return np.asarray(self._canvas.draw())


def peer_spheres(size: int) -> NDArray[np.uint8]:
    """The scene `truth_scenes.spheres`, in sRGB (H, W, 4)."""
    camera = ViewCamera(position=(0.0, 0.0, 14.0), rotation=(0.0, 0.0, 0.0, 1.0), field_of_view=0.6)
    picture = PeerPicture((size, size), camera, samples=1)
    ball = picture.geometry(fine_ball())
    for row in range(SIDE):
        for column in range(SIDE):
            material = picture.material(COLOR, row / (SIDE - 1), 0.1 + 0.9 * column / (SIDE - 1))
            mesh = picture.gfx.Mesh(ball, material)
            mesh.world.position = ((column - SIDE // 2) * 1.05, (row - SIDE // 2) * 1.05, 0.0)
            mesh.world.scale = (0.45,) * 3
            picture.scene.add(mesh)
    picture.add_sun(SUN_WAY, 2.0)
    bulb = picture.gfx.PointLight("#ffffff", 60.0, decay=2)
    bulb.world.position = BULB
    picture.scene.add(bulb)
    return picture.draw()


class PeerCubes:
    """The instances of a world of cubes that are all of one material, drawn as one instanced mesh under its sun."""

    def __init__(self, world: RenderWorld, camera: ViewCamera, size: tuple[int, int], *, samples: int) -> None:
        self._picture = PeerPicture(size, camera, samples=samples)
        color, _, (metallic, roughness, _, _) = world.instances.surface[0]
        gfx = self._picture.gfx
        material = self._picture.material(color[:3], float(metallic), float(roughness))
        self._mesh = gfx.InstancedMesh(
            self._picture.geometry(primitive("box")),
            material,
            world.instance_count,
            cast_shadow=True,
            receive_shadow=True,
        )
        self._picture.scene.add(self._mesh)
        self._matrices = np.zeros((world.instance_count, 4, 4), np.float32)
        self._matrices[:, :3, :3] = world.linear.transpose(0, 2, 1)
        self._matrices[:, 3, :3] = world.position
        self._matrices[:, 3, 3] = 1.0
        sun = world.lights()[0]
        reach = float(np.linalg.norm(world.position, axis=1).max()) * SHADOW_MARGIN
        self._picture.add_sun(tuple(sun.direction), sun.light.intensity, shadow_reach=reach)

    def draw(self) -> NDArray[np.uint8]:
        """Moves all and draws; the picture is read back."""
        buffer = self._mesh.instance_buffer
        buffer.data["matrix"] = self._matrices
        buffer.update_full()
        return self._picture.draw()
