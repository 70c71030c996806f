"""The light in pictures against an evaluation of glTF 2.0, appendix B, in numpy, pixel by pixel on flat quads."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore
from elys.common.components import Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.render_node.drawable_assets import DrawableAssets

pytestmark = pytest.mark.gl

SIZE = 48
EYE = np.array((0.4, 2.0, 1.0))
CAMERA = ViewCamera(position=tuple(EYE), rotation=tuple(look_rotation(-EYE).tolist()), field_of_view=0.35)


def seen_points() -> tuple[np.ndarray, np.ndarray]:
    """Where the rays of the pixels' centres (H, W, 3) meet the plane y = 0, and the direction back to the eye."""
    from scipy.spatial.transform import Rotation

    steps = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    x, y = np.meshgrid(steps, -steps)
    tangent = np.tan(CAMERA.field_of_view / 2)
    rays = np.stack((x * tangent, y * tangent, -np.ones_like(x)), axis=-1)
    rays = Rotation.from_quat(CAMERA.rotation).apply(rays.reshape(-1, 3)).reshape(SIZE, SIZE, 3)
    points = EYE + rays * (-EYE[1] / rays[..., 1:2])
    to_eye = EYE - points
    return points, to_eye / np.linalg.norm(to_eye, axis=-1, keepdims=True)


def reflected(normal, to_view, to_light, color, metallic, roughness) -> np.ndarray:
    """f(l, v) * n.l of the layered material, written from the appendix' formulas."""

    def dot(a, b):
        return np.sum(a * b, axis=-1)

    half = to_light + to_view
    half = half / np.linalg.norm(half, axis=-1, keepdims=True)
    nl, nv, nh, vh = dot(normal, to_light), dot(normal, to_view), dot(normal, half), dot(to_view, half)
    alpha2 = roughness**4
    distribution = alpha2 / (np.pi * (nh**2 * (alpha2 - 1) + 1) ** 2)
    masking = (2 * nl * nv) / (
        nv * np.sqrt(alpha2 + (1 - alpha2) * nl**2) + nl * np.sqrt(alpha2 + (1 - alpha2) * nv**2)
    )
    specular = (masking * distribution / (4 * nl * nv))[..., None]
    schlick = ((1 - np.abs(vh)) ** 5)[..., None]
    metal = specular * (color + (1 - color) * schlick)
    dielectric_share = 0.04 + 0.96 * schlick
    dielectric = (1 - dielectric_share) * color / np.pi + dielectric_share * specular
    return ((1 - metallic) * dielectric + metallic * metal) * np.maximum(nl, 0)[..., None]


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("roughness", [0.15, 0.5, 1.0])
def test_sun_and_bulb_follow_appendix_b(stage, renderer, metallic: float, roughness: float) -> None:
    color = np.array((0.8, 0.35, 0.1))
    sun, bulb = np.array((0.3, -1.0, -0.2)), np.array((-0.5, 1.5, -0.8))
    stage.add(
        Transform(scale=(9.0, 1.0, 9.0)),
        MeshRenderer(mesh="plane", cast_shadows=False),
        Material(base_color=tuple(color), metallic=metallic, roughness=roughness),
    )
    stage.add(Transform(rotation=tuple(look_rotation(sun).tolist())), Light(intensity=2.0, color=(1.0, 0.9, 0.8)))
    stage.add(Transform(position=tuple(bulb)), Light(kind="point", intensity=6.0))
    renderer.draw(stage.world(), CAMERA, SIZE, SIZE)
    light = renderer.read_light(SIZE, SIZE)[..., :3]
    points, to_view = seen_points()
    normal = np.broadcast_to((0.0, 1.0, 0.0), points.shape)
    to_sun = np.broadcast_to(-sun / np.linalg.norm(sun), points.shape)
    offset = bulb - points
    distance = np.linalg.norm(offset, axis=-1, keepdims=True)
    expected = reflected(normal, to_view, to_sun, color, metallic, roughness) * 2.0 * np.array((1.0, 0.9, 0.8))
    expected = expected + reflected(normal, to_view, offset / distance, color, metallic, roughness) * 6.0 / distance**2
    # Half floats keep 11 bits; four samples a pixel average over what the oracle evaluates in the middle.
    np.testing.assert_allclose(light, expected, rtol=4e-3, atol=1e-4)


def test_a_spot_has_a_soft_edge_and_a_range(stage, renderer) -> None:
    stage.add(Transform(scale=(9.0, 1.0, 9.0)), MeshRenderer(mesh="plane"), Material(roughness=1.0))
    lamp = Light(kind="spot", intensity=5.0, range=3.0, inner_cone_angle=0.1, outer_cone_angle=0.3)
    stage.add(Transform(position=(0.0, 1.5, 0.0), rotation=tuple(look_rotation((0, -1, 0)).tolist())), lamp)
    renderer.draw(stage.world(), CAMERA, SIZE, SIZE)
    light = renderer.read_light(SIZE, SIZE)[..., :3]
    points, to_view = seen_points()
    offset = np.array((0.0, 1.5, 0.0)) - points
    distance = np.linalg.norm(offset, axis=-1, keepdims=True)
    to_light = offset / distance
    normal = np.broadcast_to((0.0, 1.0, 0.0), points.shape)
    cone = (to_light[..., 1:2] - np.cos(0.3)) / (np.cos(0.1) - np.cos(0.3))
    window = np.clip(1 - (distance / 3.0) ** 4, 0, 1) / distance**2
    expected = reflected(normal, to_view, to_light, np.full(3, 0.8), 0.0, 1.0)
    expected = expected * 5.0 * window * np.clip(cone, 0, 1) ** 2
    np.testing.assert_allclose(light, expected, rtol=2e-2, atol=4e-3)
    assert (expected[..., 0] == 0).any()
    assert (expected[..., 0] > 0.1).any()


def png(*pixels: tuple[int, ...]) -> bytes:
    """A picture of one row."""
    data = io.BytesIO()
    Image.fromarray(np.array([pixels], np.uint8)).save(data, format="PNG")
    return data.getvalue()


def textured(stage, renderer, material_fields: dict[str, bytes], **values) -> np.ndarray:
    """The light of the picture's middle from a quad with these images."""
    store = AssetStore()
    references = {field: store.put(data, kind="image") for field, data in material_fields.items()}
    stage.add(
        Transform(scale=(9.0, 1.0, 9.0)),
        MeshRenderer(mesh="plane", cast_shadows=False),
        Material(**references, **values),
    )
    world = stage.world(DrawableAssets(store.get))
    renderer.settle(world)
    renderer.draw(world, CAMERA, SIZE, SIZE)
    world.assets.close()
    return renderer.read_light(SIZE, SIZE)[SIZE // 2, SIZE // 2, :3]


def test_colour_images_are_srgb_and_others_linear(stage, renderer) -> None:
    light = textured(
        stage,
        renderer,
        {"emissive_texture": png((188, 188, 188)), "occlusion_texture": png((128, 0, 0))},
        emissive=(1.0, 0.5, 0.25),
    )
    # 188 of sRGB is half the light; nothing else shines here.
    np.testing.assert_allclose(light, np.array((1.0, 0.5, 0.25)) * 0.5029, rtol=5e-3)


def test_occlusion_darkens_ambient_light_alone(stage, renderer) -> None:
    from elys.common.scene import SceneSettings

    stage.settings = SceneSettings(background=(0.0, 0.0, 0.0), ambient=(1.0, 1.0, 1.0))
    open_light = textured(stage, renderer, {}, roughness=1.0)
    stage.components.clear()
    stage.parents.clear()
    stage.enabled.clear()
    shaded = textured(stage, renderer, {"occlusion_texture": png((128, 255, 255))}, roughness=1.0)
    np.testing.assert_allclose(shaded, open_light * 128 / 255, rtol=5e-3)


def test_metallic_and_roughness_come_from_blue_and_green(stage, renderer) -> None:
    sun = Light(intensity=3.0)
    stage.add(Transform(rotation=tuple(look_rotation((0.1, -1.0, 0.0)).tolist())), sun)
    light = textured(stage, renderer, {"metallic_roughness_texture": png((0, 128, 255))}, metallic=1.0, roughness=1.0)
    points, to_view = seen_points()
    middle = (slice(SIZE // 2, SIZE // 2 + 1),) * 2
    to_light = np.broadcast_to(np.array((-0.1, 1.0, 0.0)) / np.hypot(0.1, 1.0), points[middle].shape)
    normal = np.broadcast_to((0.0, 1.0, 0.0), points[middle].shape)
    expected = reflected(normal, to_view[middle], to_light, np.full(3, 0.8), 1.0, 128 / 255)[0, 0] * 3.0
    np.testing.assert_allclose(light, expected, rtol=1e-2)


@pytest.mark.parametrize("mesh_has_tangents", [True, False])
def test_normal_maps_tilt_with_and_without_tangents(stage, renderer, mesh_has_tangents: bool) -> None:
    """A map that leans to growing u on a plane leans to growing x."""
    from dataclasses import replace

    from elys.common.assets import encode_mesh, primitive

    store = AssetStore()
    plane = primitive("plane")
    mesh = store.put(encode_mesh(plane if mesh_has_tangents else replace(plane, tangents=None)), kind="mesh")
    lean = np.array((0.6, 0.0, 0.8))  # of the tangent space: x along u, y against v, z outwards
    texel = tuple(np.round((lean * 0.5 + 0.5) * 255).astype(int).tolist())
    image = store.put(png(texel), kind="image")
    stage.add(
        Transform(scale=(9.0, 1.0, 9.0)),
        MeshRenderer(mesh=mesh, cast_shadows=False),
        Material(normal_texture=image, roughness=1.0),
    )
    stage.add(Transform(rotation=tuple(look_rotation((0.0, -1.0, 0.0)).tolist())), Light(intensity=3.0))
    world = stage.world(DrawableAssets(store.get))
    renderer.settle(world)
    renderer.draw(world, CAMERA, SIZE, SIZE)
    world.assets.close()
    light = renderer.read_light(SIZE, SIZE)[SIZE // 2, SIZE // 2, :3]
    points, to_view = seen_points()
    middle = (slice(SIZE // 2, SIZE // 2 + 1),) * 2
    normal = np.broadcast_to((0.6, 0.8, 0.0), points[middle].shape)
    to_light = np.broadcast_to((0.0, 1.0, 0.0), points[middle].shape)
    expected = reflected(normal, to_view[middle], to_light, np.full(3, 0.8), 0.0, 1.0)[0, 0] * 3.0
    np.testing.assert_allclose(light, expected, rtol=2e-2)


def test_a_mask_cuts_holes(stage, renderer) -> None:
    light = textured(
        stage, renderer, {"base_color_texture": png((255, 255, 255, 60))}, alpha_mode="mask", emissive=(1.0, 1.0, 1.0)
    )
    assert not light.any()


def test_the_sun_throws_shadows_where_geometry_says(stage, renderer) -> None:
    stage.add(Transform(scale=(9.0, 1.0, 9.0)), MeshRenderer(mesh="plane"), Material(roughness=1.0))
    stage.add(Transform(position=(0.0, 0.6, 0.0), scale=(0.3, 0.1, 0.3)), MeshRenderer(mesh="box"))
    direction = np.array((0.25, -1.0, -0.15))
    stage.add(Transform(rotation=tuple(look_rotation(direction).tolist())), Light(intensity=3.0))
    renderer.draw(stage.world(), CAMERA, SIZE * 4, SIZE * 4)
    light = renderer.read_light(SIZE * 4, SIZE * 4)[2::4, 2::4, 0]
    points, _ = seen_points()
    # Slabs method of the ray towards the sun against the box, and of the ray from the eye.
    low, high = np.array((-0.15, 0.55, -0.15)), np.array((0.15, 0.65, 0.15))

    def margin(origin, towards):
        a, b = (low - origin) / towards, (high - origin) / towards
        return np.maximum(a, b).min(axis=-1) - np.minimum(a, b).max(axis=-1)

    to_sun = margin(points, -direction)
    to_eye = margin(points, EYE - points)
    clear = (np.abs(to_sun) > 0.06) & (to_eye < -0.05)
    assert ((light > 0.05) == (to_sun < 0))[clear].all()
    assert (to_sun[clear] > 0).sum() > 20


def test_light_units_make_white_white(stage, renderer) -> None:
    """A white surface under pi lx reflects 1: the screen's white, before the tone mapper bends it."""
    stage.add(
        Transform(scale=(9.0, 1.0, 9.0)),
        MeshRenderer(mesh="plane", cast_shadows=False),
        Material(base_color=(1.0, 1.0, 1.0), roughness=1.0),
    )
    stage.add(Transform(rotation=tuple(look_rotation((0.0, -1.0, 0.0)).tolist())), Light(intensity=float(np.pi)))
    renderer.draw(stage.world(), CAMERA, SIZE, SIZE)
    assert renderer.read_light(SIZE, SIZE)[SIZE // 2, SIZE // 2, 1] == pytest.approx(1.0, abs=0.05)
