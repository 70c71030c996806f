"""Extensions of materials in pictures, against their specifications' formulas in numpy, and how textures are laid."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore, Mesh, encode_mesh
from elys.common.assets.texture import Sampling, Texture, texture_text
from elys.common.components import Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.look import look_of

pytestmark = pytest.mark.gl

SIZE = 48
EYE = np.array((0.3, 2.0, 0.9))
SLANTED = ViewCamera(position=tuple(EYE), rotation=tuple(look_rotation(-EYE).tolist()), field_of_view=0.35)
# Straight down onto the square from -1 to 1, which fills the picture.
ABOVE = ViewCamera(
    position=(0.0, 5.0, 0.0), rotation=tuple(look_rotation((0, -1, 0), (0, 0, -1)).tolist()), ortho_height=2.0
)
UP = np.array((0.0, 1.0, 0.0))


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1, keepdims=True)


def specular_brdf(normal, to_view, to_light, half, alpha: float) -> np.ndarray:
    """glTF 2.0, B.3.2, with the masking of both directions."""
    nl, nv, nh = dot(normal, to_light), dot(normal, to_view), dot(normal, half)
    distribution = alpha**2 / (np.pi * (nh**2 * (alpha**2 - 1) + 1) ** 2)
    visibility = 0.5 / (
        nl * np.sqrt(alpha**2 + (1 - alpha**2) * nv**2) + nv * np.sqrt(alpha**2 + (1 - alpha**2) * nl**2)
    )
    return distribution * visibility


def expected_light(material: Material, to_view: np.ndarray, to_light: np.ndarray) -> np.ndarray:
    """What a flat floor sends to the eye for 1 lx from `to_light`: the layers as the extensions word them."""
    half = (to_light + to_view) / np.linalg.norm(to_light + to_view, axis=-1, keepdims=True)
    color, grazing = np.array(material.base_color), (1 - np.abs(dot(to_view, half))) ** 5
    base_alpha = material.roughness**2
    layer = specular_brdf(UP, to_view, to_light, half, base_alpha)
    # KHR_materials_specular: fresnel_mix, with its weight and its colour on F0, and KHR_materials_ior's F0.
    f0 = np.minimum(((material.ior - 1) / (material.ior + 1)) ** 2 * np.array(material.specular_color), 1.0)
    fresnel = f0 + (1 - f0) * grazing
    weight = material.specular
    dielectric = (1 - weight * fresnel.max(axis=-1, keepdims=True)) * color / np.pi + weight * fresnel * layer
    metal = layer * (color + (1 - color) * grazing)
    surface = (1 - material.metallic) * dielectric + material.metallic * metal
    # KHR_materials_clearcoat: fresnel_coat of an index of 1.5.
    coat = material.clearcoat * (0.04 + 0.96 * (1 - np.abs(dot(UP, to_view))) ** 5)
    varnish = specular_brdf(UP, to_view, to_light, half, max(material.clearcoat_roughness, 0.0) ** 2)
    return ((1 - coat) * surface + coat * varnish) * np.maximum(dot(UP, to_light), 0)


@pytest.mark.parametrize(
    "material",
    [
        Material(base_color=(0.5, 0.2, 0.1), roughness=0.4, ior=2.2),
        Material(base_color=(0.5, 0.2, 0.1), roughness=0.4, ior=1.0),
        Material(base_color=(0.5, 0.2, 0.1), roughness=0.4, specular=0.3, specular_color=(1.0, 0.2, 3.0)),
        Material(base_color=(0.5, 0.2, 0.1), roughness=0.4, metallic=0.5, specular=0.0),
        Material(base_color=(0.5, 0.2, 0.1), roughness=0.8, clearcoat=0.7, clearcoat_roughness=0.3),
        Material(
            base_color=(0.5, 0.2, 0.1), roughness=0.8, metallic=1.0, clearcoat=1.0, clearcoat_roughness=0.5, ior=1.7
        ),
    ],
)
def test_layers_follow_their_specifications(stage, renderer, material: Material) -> None:
    from scipy.spatial.transform import Rotation

    sun = np.array((0.25, -1.0, 0.4))
    stage.add(Transform(scale=(9.0, 1.0, 9.0)), MeshRenderer(mesh="plane", cast_shadows=False), material)
    stage.add(Transform(rotation=tuple(look_rotation(sun).tolist())), Light(intensity=1.0))
    renderer.draw(stage.world(), SLANTED, SIZE, SIZE)
    light = renderer.read_light(SIZE, SIZE)[..., :3]
    steps = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    x, y = np.meshgrid(steps, -steps)
    tangent = np.tan(SLANTED.field_of_view / 2)
    rays = np.stack((x * tangent, y * tangent, -np.ones_like(x)), axis=-1).reshape(-1, 3)
    to_view = -Rotation.from_quat(SLANTED.rotation).apply(rays).reshape(SIZE, SIZE, 3)
    to_view /= np.linalg.norm(to_view, axis=-1, keepdims=True)
    to_sun = np.broadcast_to(-sun / np.linalg.norm(sun), to_view.shape)
    np.testing.assert_allclose(light, expected_light(material, to_view, to_sun), rtol=5e-3, atol=2e-4)


def head_on(stage, renderer, store: AssetStore, material: Material) -> np.ndarray:
    """The light (3,) of a floor under a sun, seen from straight above."""
    stage.add(Transform(scale=(9.0, 1.0, 9.0)), MeshRenderer(mesh="plane", cast_shadows=False), material)
    stage.add(Transform(rotation=tuple(look_rotation((0.1, -1.0, 0.0)).tolist())), Light(intensity=3.0))
    world = stage.world(DrawableAssets(store.get))
    renderer.settle(world)
    renderer.draw(world, ABOVE, 8, 8)
    world.assets.close()
    return renderer.read_light(8, 8)[4, 4, :3]


@pytest.mark.parametrize(
    "pixel, field, values, plain",
    [
        # The channel that counts, per the extension, and what the same factor gives without an image.
        ((9, 9, 9, 102), "specular_texture", {"specular": 0.5}, {"specular": 0.2}),
        (
            (255, 0, 188, 255),
            "specular_color_texture",
            {"ior": 2.0},
            {"ior": 2.0, "specular_color": (1.0, 0.0, 0.50289)},
        ),
        ((102, 9, 9, 255), "clearcoat_texture", {"clearcoat": 0.5}, {"clearcoat": 0.2}),
        (
            (9, 102, 9, 255),
            "clearcoat_roughness_texture",
            {"clearcoat": 1.0, "clearcoat_roughness": 0.5},
            {"clearcoat": 1.0, "clearcoat_roughness": 0.2},
        ),
    ],
)
def test_images_of_layers_multiply_their_factors(stage, renderer, pixel, field: str, values, plain) -> None:
    store = AssetStore()
    image = store.put(png(np.full((2, 2, 4), pixel, np.uint8)), kind="image")
    surface = {"base_color": (0.2, 0.1, 0.05), "roughness": 0.3}
    if "clearcoat" in values:
        values, plain = {"clearcoat_roughness": 0.4} | values, {"clearcoat_roughness": 0.4} | plain
    with_image = head_on(stage, renderer, store, Material(**surface, **values, **{field: image}))
    same = head_on(type(stage)(), renderer, store, Material(**surface, **plain))
    other = head_on(type(stage)(), renderer, store, Material(**surface, **values))
    np.testing.assert_allclose(with_image, same, rtol=3e-3)
    assert np.abs(other - same).max() > 0.02 * same.max()


def chessboard(size: int = 4) -> np.ndarray:
    """Pixels (size, size, 3), no two alike in their row or column."""
    rows, columns = np.indices((size, size))
    return np.stack((rows * 60 + 20, columns * 60 + 20, (rows + columns) % 2 * 255), axis=-1).astype(np.uint8)


def png(pixels: np.ndarray) -> bytes:
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, format="PNG")
    return data.getvalue()


def linear(srgb: np.ndarray) -> np.ndarray:
    value = srgb / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def square(uvs: np.ndarray, second: np.ndarray | None = None) -> Mesh:
    corners = np.float32(((-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)))
    return Mesh(
        positions=corners,
        normals=np.tile(np.float32(UP), (4, 1)),
        uvs=uvs.astype(np.float32),
        second_uvs=None if second is None else second.astype(np.float32),
        indices=np.array((0, 1, 2, 0, 2, 3), np.uint32),
    )


UVS = np.array(((0, 0), (0, 1), (1, 1), (1, 0)))  # the image upright, seen from above


def drawn(stage, renderer, texture: Texture, mesh: Mesh, size: int = 64) -> np.ndarray:
    """Linear colours of an unlit square."""
    store = AssetStore()
    image = store.put(png(chessboard()), kind="image")
    text = texture_text(texture._replace(image=image))
    name = store.put(encode_mesh(mesh), kind="mesh")
    stage.add(
        Transform(),
        MeshRenderer(mesh=name),
        Material(base_color=(1.0, 1.0, 1.0), unlit=True, base_color_texture=text),
    )
    world = stage.world(DrawableAssets(store.get))
    renderer.settle(world)
    world.place()
    renderer.draw(world, ABOVE, size, size)
    world.assets.close()
    return renderer.read_light(size, size)[..., :3]


def looked_up(texture: Texture, size: int = 64) -> np.ndarray:
    """The same by numpy: the nearest texel of each pixel's middle."""
    steps = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(steps, steps)
    u, v = u * texture.scale[0], v * texture.scale[1]
    turn = texture.rotation
    u, v = u * np.cos(turn) + v * np.sin(turn), v * np.cos(turn) - u * np.sin(turn)
    places = []
    for coordinate, move, wrap in zip((u, v), texture.offset, texture.sampling.wrap, strict=True):
        texel = np.floor((coordinate + move) * 4).astype(int)
        if wrap == "repeat":
            texel %= 4
        elif wrap == "clamp":
            texel = np.clip(texel, 0, 3)
        else:
            texel = np.where(texel % 8 < 4, texel % 8, 7 - texel % 8)
        places.append(texel)
    return linear(chessboard()[places[1], places[0]])


@pytest.mark.parametrize("wrap", [("repeat", "repeat"), ("clamp", "mirror"), ("mirror", "clamp"), ("mirror", "mirror")])
@pytest.mark.parametrize(
    "placing",
    [
        {},
        {"scale": (3.0, 2.0)},
        {"offset": (0.3, -0.7), "scale": (-2.0, 2.5)},
        {"rotation": 0.4, "scale": (2.0, 2.0), "offset": (-0.5, -0.25)},
    ],
)
def test_textures_are_placed_and_wrapped_as_gl_does(stage, renderer, wrap, placing) -> None:
    texture = Texture("", sampling=Sampling(wrap, "nearest", "nearest"), **placing)
    picture = drawn(stage, renderer, texture, square(UVS))
    differs = np.abs(picture - looked_up(texture)).max(axis=-1) > 2e-3
    # Four samples a pixel mix colours where texels meet: only pixels away from edges are to agree.
    inner = np.abs(np.diff(looked_up(texture), axis=0, append=0)).max(-1) + np.abs(
        np.diff(looked_up(texture), axis=1, append=0)
    ).max(-1)
    edge = inner > 0
    edge[1:] |= edge[:-1].copy()
    edge[:, 1:] |= edge[:, :-1].copy()
    edge[:, :-1] |= edge[:, 1:].copy()
    assert not (differs & ~edge).any()
    assert (~edge).mean() > 0.25


def test_the_second_uv_set(stage, renderer) -> None:
    turned = UVS[:, ::-1]
    texture = Texture("", uv=1, sampling=Sampling(magnify="nearest", minify="nearest"))
    picture = drawn(stage, renderer, texture, square(np.zeros((4, 2)), turned))
    np.testing.assert_allclose(picture[8, 56], linear(chessboard()[3, 0]), atol=2e-3)
    np.testing.assert_allclose(picture[56, 8], linear(chessboard()[0, 3]), atol=2e-3)


def test_smooth_and_nearest_differ(stage, renderer) -> None:
    smooth = drawn(stage, renderer, Texture(""), square(UVS))
    sharp = drawn(type(stage)(), renderer, Texture("", sampling=Sampling(magnify="nearest")), square(UVS))
    assert len(np.unique(sharp[8].round(3), axis=0)) < 8 < len(np.unique(smooth[8].round(3), axis=0))


def test_normal_scale_and_occlusion_strength(stage, renderer) -> None:
    store = AssetStore()
    bump = store.put(png(np.full((2, 2, 3), (200, 128, 220), np.uint8)), kind="image")
    shade = store.put(png(np.full((2, 2, 3), (0, 0, 0), np.uint8)), kind="image")
    stage.settings = type(stage.settings)(background=(0.0, 0.0, 0.0), ambient=(1.0, 1.0, 1.0))
    pictures = {}
    for strength in (0.0, 0.5, 1.0):
        world_stage = type(stage)()
        world_stage.settings = stage.settings
        material = Material(roughness=1.0, occlusion_texture=shade, occlusion_strength=strength)
        world_stage.add(Transform(scale=(9.0, 1.0, 9.0)), MeshRenderer(mesh="plane"), material)
        world = world_stage.world(DrawableAssets(store.get))
        renderer.settle(world)
        renderer.draw(world, ABOVE, 8, 8)
        pictures[strength] = renderer.read_light(8, 8)[4, 4, :3]
    np.testing.assert_allclose(pictures[0.5], pictures[0.0] / 2, rtol=2e-3)
    assert not pictures[1.0].any()
    sun = np.array((0.6, -0.8, 0.0))
    seen = []
    for scale in (0.0, 1.0, 2.0):
        world_stage = type(stage)()
        material = Material(roughness=1.0, specular=0.0, normal_texture=bump, normal_scale=scale)
        world_stage.add(Transform(scale=(9.0, 1.0, 9.0)), MeshRenderer(mesh="plane", cast_shadows=False), material)
        world_stage.add(Transform(rotation=tuple(look_rotation(sun).tolist())), Light(intensity=np.pi))
        world = world_stage.world(DrawableAssets(store.get))
        renderer.settle(world)
        renderer.draw(world, ABOVE, 8, 8)
        seen.append(renderer.read_light(8, 8)[4, 4, 0] / 0.8)
    # The map leans the normal along +u, which is +x; glTF 2.0, 3.9.3: scale * xy, then normalised.
    for scale, cosine in zip((0.0, 1.0, 2.0), seen, strict=True):
        normal = np.array((200, 128, 220)) / 255 * 2 - 1
        normal[:2] *= scale
        normal /= np.linalg.norm(normal)
        assert cosine == pytest.approx(max(normal[0] * -0.6 + normal[2] * 0.8, 0.0), abs=0.01)


def test_unlit_shows_its_colour_without_any_light(stage, renderer) -> None:
    stage.add(
        Transform(scale=(9.0, 1.0, 9.0)), MeshRenderer(mesh="plane"), Material(base_color=(0.2, 0.4, 0.6), unlit=True)
    )
    renderer.draw(stage.world(), ABOVE, 8, 8)
    np.testing.assert_allclose(renderer.read_light(8, 8)[4, 4, :3], (0.2, 0.4, 0.6), rtol=1e-3)


def test_a_parallel_view_shows_sizes_as_they_are_and_picks_them(stage, renderer) -> None:
    near = stage.add(Transform(position=(-2.0, 3.0, 0.0)), MeshRenderer(mesh="box"), Material(unlit=True))
    far = stage.add(Transform(position=(2.0, -9.0, 0.0)), MeshRenderer(mesh="box"), Material(unlit=True))
    world = stage.world()
    camera = ViewCamera(position=(0.0, 5.0, 0.0), rotation=ABOVE.rotation, ortho_height=8.0)
    renderer.draw(world, camera, 64, 64)
    seen = renderer.read_light(64, 64)[..., 0] > 0.5
    assert seen[:, :32].sum() == seen[:, 32:].sum() == 8 * 8
    assert renderer.pick(world, camera, 64, 64, 16, 32) == (near, pytest.approx((-2.0, 3.5, 0.0), abs=0.07))
    assert renderer.pick(world, camera, 64, 64, 48, 32) == (far, pytest.approx((2.0, -8.5, 0.0), abs=0.07))


def test_a_parallel_view_has_shadows_where_the_sun_throws_them(stage, renderer) -> None:
    stage.add(Transform(scale=(40.0, 1.0, 40.0)), MeshRenderer(mesh="plane"), Material(roughness=1.0))
    stage.add(Transform(position=(0.0, 2.0, 0.0), scale=(1.0, 0.1, 1.0)), MeshRenderer(mesh="box"))
    stage.add(Transform(rotation=tuple(look_rotation((1.0, -1.0, 0.0)).tolist())), Light(intensity=3.0))
    camera = ViewCamera(position=(0.0, 9.0, 0.0), rotation=ABOVE.rotation, ortho_height=8.0)
    renderer.draw(stage.world(), camera, 80, 80)
    light = renderer.read_light(80, 80)[..., 0]  # ten pixels a metre, the box in the middle
    assert light[40, 60] < 0.02 * light[40, 10]  # 2 m to the right of it, as it is 2 m high
    assert light[40, 70] > 0.9 * light[40, 10]
    dark = np.argwhere(light < 0.02 * light[40, 10])
    np.testing.assert_allclose(dark.mean(axis=0), (39.5, 59.5), atol=1.0)


def test_a_texture_with_a_wrong_option_is_a_checker(stage, renderer) -> None:
    material = Material(base_color=(1.0, 1.0, 1.0), unlit=True, base_color_texture="blake2b:" + "0" * 32 + "?tiles=4")
    stage.add(Transform(scale=(2.0, 1.0, 2.0)), MeshRenderer(mesh="plane"), material)
    world = stage.world()
    renderer.settle(world)
    renderer.draw(world, ABOVE, 64, 64)
    light = renderer.read_light(64, 64)[..., :3]
    assert 0.3 < ((light[..., 0] > 0.9) & (light[..., 1] < 0.05)).mean() < 0.6


def test_a_colour_that_cannot_be_had_is_a_checker(stage, renderer) -> None:
    store = AssetStore()
    damaged = store.put(png(chessboard())[:40], kind="image")
    material = Material(base_color=(1.0, 1.0, 1.0), unlit=True, base_color_texture=damaged)
    stage.add(Transform(scale=(2.0, 1.0, 2.0)), MeshRenderer(mesh="plane"), material)
    world = stage.world(DrawableAssets(store.get))
    renderer.settle(world)
    renderer.draw(world, ABOVE, 64, 64)
    light = renderer.read_light(64, 64)[..., :3]
    magenta = (light[..., 0] > 0.9) & (light[..., 1] < 0.05)
    assert 0.3 < magenta.mean() < 0.6
    assert "cannot be read" in world.assets.failed[damaged]


def test_tangents_are_computed_where_a_normal_map_asks_for_them_alone() -> None:
    bumpy = Material(normal_texture="bumps.png?uv=1")
    assert look_of(bumpy, False, "vertices").tangent_uvs == 1
    assert look_of(bumpy, False, "pixels").tangent_uvs is None
    assert look_of(bumpy, False).tangent_uvs is None
    assert look_of(Material(), False, "vertices") == look_of(Material(), False)  # parts no batch


@pytest.mark.parametrize("tangents", ["vertices", "pixels"])
@pytest.mark.parametrize(
    "uvs, along_u, along_rise",  # where growing u and falling v point in the world
    [
        (UVS, (1, 0, 0), (0, 0, -1)),
        (np.array(((1, 0), (1, 1), (0, 1), (0, 0))), (-1, 0, 0), (0, 0, -1)),  # mirrored
        (np.array(((0, 1), (1, 1), (1, 0), (0, 0))), (0, 0, 1), (1, 0, 0)),  # turned
    ],
)
def test_normal_maps_lie_along_tangents_however_they_are_had(
    stage, renderer, tangents, uvs, along_u, along_rise
) -> None:
    store = AssetStore()
    lean = np.array((190, 160, 220)) / 255 * 2 - 1
    bump = store.put(png(np.full((2, 2, 3), (190, 160, 220), np.uint8)), kind="image")
    name = store.put(encode_mesh(square(uvs)), kind="mesh")
    sun = np.array((0.5, -0.8, 0.3)) / np.linalg.norm((0.5, -0.8, 0.3))
    material = Material(roughness=1.0, specular=0.0, normal_texture=bump)
    stage.add(Transform(), MeshRenderer(mesh=name, cast_shadows=False, tangents=tangents), material)
    stage.add(Transform(rotation=tuple(look_rotation(sun).tolist())), Light(intensity=np.pi))
    world = stage.world(DrawableAssets(store.get))
    renderer.settle(world)
    renderer.draw(world, ABOVE, 16, 16)
    normal = lean[0] * np.array(along_u) + lean[1] * np.array(along_rise) + lean[2] * UP
    cosine = -(normal / np.linalg.norm(normal)) @ sun
    np.testing.assert_allclose(renderer.read_light(16, 16)[2:14, 2:14, 0] / 0.8, cosine, atol=0.01)
    world.assets.close()
