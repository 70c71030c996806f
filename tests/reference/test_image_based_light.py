"""Light from all around against integrals by chance, and against furnaces, in which what keeps all energy cannot be seen."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore
from elys.common.components import Environment, Light, Material, MeshRenderer, Transform
from elys.common.errors import DisplayError
from elys.common.math.matrix import look_rotation
from elys.common.scene import PictureSettings, SceneSettings
from elys.render_node.directional_albedo import diffuse_loss, lobe_share, specular_albedo
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.quality import EXACT
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_tables import tables_of
from elys.render_node.sky_models import (
    clear_sky,
    gradient_sky,
    harmonic_basis,
    irradiance_harmonics,
    level_irradiance,
    map_directions,
    mean_radiance,
    solid_angles,
)
from tests.reference.light_integrals import directions_by_cosine, reflected_radiance
from tests.reference.traced_pictures import Surface, unit

ANGLES = (5.0, 35.0, 60.0, 75.0)  # [degrees] from the normal
WHITE = SceneSettings(background=(0.0, 0.0, 0.0), ambient=(1.0, 1.0, 1.0))


@pytest.fixture(scope="module")
def context() -> Iterator[Context]:
    try:
        made = offscreen_context()
    except DisplayError as error:
        pytest.skip(str(error))
    yield made
    made.release()


def toward(angle: float) -> np.ndarray:
    """A direction so far from the normal +y."""
    return np.array((np.sin(np.radians(angle)), np.cos(np.radians(angle)), 0.0))


def level_light(renderer: Renderer, material: Material, settings: SceneSettings, angle: float, **around) -> np.ndarray:
    """What the renderer shows (3,) of a level square, seen from that angle; `around` are more entities."""
    eye = toward(angle) * 3.0
    things = [(Transform(scale=(8.0, 1.0, 8.0)), MeshRenderer(mesh="plane", cast_shadows=False), material)]
    things += list(around.values())
    world = RenderWorld()
    components = [{type(value).__name__: value for value in found} for found in things]
    count = len(things)
    world.set_scene(tables_of(range(1, count + 1), [0] * count, components, settings=settings))
    camera = ViewCamera(position=tuple(eye), rotation=tuple(look_rotation(-eye).tolist()), field_of_view=0.02)
    renderer.draw(world, camera, 5, 5)
    return renderer.read_light(5, 5)[2, 2, :3].astype(float)


@pytest.mark.parametrize("roughness", [0.03, 0.2, 0.5, 0.8, 1.0])
def test_the_split_sum_is_what_chance_finds(roughness: float) -> None:
    cos_view = np.cos(np.radians((5, 35, 60, 75, 85)))
    ours = specular_albedo(cos_view, roughness)
    lost = diffuse_loss(cos_view)
    for cosine, (scale, bias), loss in zip(cos_view, ours, lost, strict=True):
        to_view = (np.sqrt(1 - cosine**2), cosine, 0.0)
        metals = [
            reflected_radiance(to_view, Surface(np.full(3, f0), 1.0, roughness), np.ones_like)[0] for f0 in (0.0, 1.0)
        ]
        # f0 = 0 leaves the bias alone, f0 = 1 adds the scale.
        assert bias == pytest.approx(metals[0], abs=4e-3)
        assert scale + bias == pytest.approx(metals[1], rel=1e-2)
        # The dielectric is 0.04 of the one, and what it lets through of white below.
        dielectric = reflected_radiance(to_view, Surface(np.ones(3), 0.0, roughness), np.ones_like)[0]
        assert 0.04 * scale + bias + 0.96 * (1 - loss) == pytest.approx(dielectric, rel=1e-2)


@pytest.mark.parametrize("roughness", [0.2, 0.5, 0.8, 1.0])
def test_lobes_point_where_chance_finds_their_light(roughness: float) -> None:
    """The mean direction of what a metal mirrors is the integral of the direction itself."""
    for angle in (5, 35, 60, 75):
        to_view = toward(angle)
        moment = reflected_radiance(to_view, Surface(np.ones(3), 1.0, roughness), lambda lights: lights)
        share = lobe_share(np.array([to_view[1]]), roughness)[0]
        ours = (1.0 - share) * np.array((0.0, 1.0, 0.0)) + share * to_view * (-1.0, 1.0, -1.0)
        assert np.degrees(np.arccos(min(unit(ours) @ unit(moment), 1.0))) < 1.0


@pytest.mark.gl
@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.6, 1.0])
def test_in_even_light_surfaces_look_as_chance_finds(context: Context, metallic: float, roughness: float) -> None:
    renderer = Renderer(context, quality=EXACT)
    color = np.array((0.9, 0.5, 0.2))
    for angle in ANGLES:
        material = Material(base_color=tuple(color), metallic=metallic, roughness=roughness)
        # Chance never meets a perfect mirror's one direction: nearly one.
        surface = Surface(color, metallic, max(roughness, 0.04))
        expected = reflected_radiance(toward(angle), surface, np.ones_like)
        np.testing.assert_allclose(level_light(renderer, material, WHITE, angle), expected, rtol=2e-2)


def test_irradiance_of_the_sky_is_what_chance_finds() -> None:
    """For every normal; harmonics of second order leave out what the sky has of higher ones."""
    sky = gradient_sky((0.3, 0.42, 0.6))
    harmonics = irradiance_harmonics(sky, np.eye(3))
    height = len(sky)
    for normal in unit([(0, 1, 0), (0, -1, 0), (1, 0, 0), (1, 1, 0.3), (-0.2, -1, 1)]):
        turned = Rotation.align_vectors([normal], [(0.0, 1.0, 0.0)])[0].apply(directions_by_cosine(200_000, 3))
        row = np.clip((np.arccos(turned[:, 1]) / np.pi * height).astype(int), 0, height - 1)
        expected = sky[row, 0].mean(axis=0)
        ours = polynomial(normal) @ harmonics
        np.testing.assert_allclose(ours, expected, atol=3e-2 * sky.mean())


def polynomial(n: np.ndarray) -> np.ndarray:
    """What irradiance.glsl evaluates."""
    x, y, z = n
    return np.array((1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y))


def test_maps_weigh_directions_by_their_solid_angle() -> None:
    assert (solid_angles(16) * np.ones((1, 32))).sum() == pytest.approx(4 * np.pi)
    basis = harmonic_basis(map_directions(64))
    gram = np.einsum("hwi,hwj,hw->ij", basis, basis, solid_angles(64) * np.ones((1, 128)))
    np.testing.assert_allclose(gram, np.eye(9), atol=2e-3)
    np.testing.assert_allclose(mean_radiance(np.ones((8, 16, 3), np.float32)), 1.0, rtol=1e-6)


@pytest.mark.parametrize("turbidity", [2.0, 5.0])
@pytest.mark.parametrize("height", [0.05, 0.4, 0.95])
def test_a_clear_sky_is_bright_around_the_sun_and_gives_as_much_light_as_it_is_told(
    turbidity: float, height: float
) -> None:
    to_sun = np.array((np.sqrt(1 - height**2), height, 0.0))
    sky = clear_sky(to_sun, turbidity, (0.3, 0.3, 0.3))
    assert np.isfinite(sky).all() and (sky >= 0).all()
    luminance = sky @ (0.2126, 0.7152, 0.0722)
    at_sun, across = (
        luminance[np.unravel_index((map_directions(len(sky)) @ direction).argmax(), luminance.shape)]
        for direction in (to_sun, to_sun * (-1, 1, 1))
    )
    assert at_sun > 1.2 * across
    assert level_irradiance(sky) @ (0.2126, 0.7152, 0.0722) == pytest.approx(1.0, rel=2e-2)
    if height > 0.3:  # blue away from the sun
        zenith_side = map_directions(len(sky)) @ (-to_sun[0], to_sun[0] + 0.5, 0.0)
        away = sky[np.unravel_index(zenith_side.argmax(), luminance.shape)]
        assert away[2] > away[0]


@pytest.mark.gl
def test_ambient_light_has_the_mean_that_the_settings_say(context: Context) -> None:
    """A white rough surface that faces up and one that faces down take in twice the ambient light together, but for what the sky
    has of even orders."""
    settings = msgspec.structs.replace(SceneSettings(), background=(0.3, 0.42, 0.6), ambient=(0.2, 0.3, 0.4))
    sky = gradient_sky(settings.background)
    up = level_irradiance(sky) / mean_radiance(sky) * settings.ambient
    material = Material(base_color=(1.0, 1.0, 1.0), roughness=1.0)
    light = level_light(Renderer(context, quality=EXACT), material, settings, 5.0)
    np.testing.assert_allclose(
        light, up * reflected_radiance(toward(5.0), Surface(np.ones(3), 0.0, 1.0), np.ones_like), rtol=3e-2
    )


def sunny_map(directions: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) that differs in every direction: a broad glow, a small bright one, colours by axis."""
    glow = np.exp(6.0 * (directions @ unit((0.5, 0.7, -0.4)) - 1.0))[:, None] * (3.0, 2.0, 1.0)
    small = np.exp(60.0 * (directions @ unit((-0.7, 0.5, 0.3)) - 1.0))[:, None] * (2.0, 4.0, 8.0)
    return 0.2 + 0.1 * directions + glow + small


def flat_hdr(radiance: np.ndarray) -> bytes:
    """A Radiance file without runs, by its documentation: mantissas of 8 bits and their shared exponent."""
    mantissa, exponent = np.frexp(radiance.max(axis=-1))
    scaled = (
        radiance * (np.where(mantissa > 0, mantissa * 256 / np.maximum(radiance.max(axis=-1), 1e-30), 0))[..., None]
    )
    pixels = np.concatenate([scaled.astype(np.uint8), (exponent + 128).astype(np.uint8)[..., None]], axis=-1)
    height, width = radiance.shape[:2]
    return f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode() + pixels.tobytes()


class MappedSky:
    """Level white squares under a picture of light that is turned, seen from a side; and what chance finds of them."""

    def __init__(self, context: Context, *, sampled: bool) -> None:
        self.renderer = Renderer(context, quality=EXACT)
        self.settings = SceneSettings(picture=PictureSettings(sampled_surroundings=sampled))
        self.turn = Rotation.from_euler("yx", (0.7, 0.4))
        self.store = AssetStore()
        height = 256
        radiance = sunny_map(map_directions(height).reshape(-1, 3)).reshape(height, 2 * height, 3)
        self.image = self.store.put(flat_hdr(radiance), kind="image")

    def error(self, normal: np.ndarray, azimuth: float, angle: float, metallic: float, roughness: float) -> float:
        """The largest of the three primaries', as a share."""
        up = Rotation.align_vectors([normal], [(0.0, 1.0, 0.0)])[0] * Rotation.from_euler("y", azimuth)
        white = Material(base_color=(1.0, 1.0, 1.0), metallic=metallic, roughness=roughness)
        square = Transform(rotation=tuple(up.as_quat().tolist()), scale=(8.0, 1.0, 8.0))
        sky = Transform(rotation=tuple(self.turn.as_quat().tolist()))
        things = [
            (square, MeshRenderer(mesh="plane"), white),
            (sky, Environment(kind="image", image=self.image)),
        ]
        components = [{type(value).__name__: value for value in found} for found in things]
        world = RenderWorld(DrawableAssets(self.store.get))
        world.set_scene(tables_of([1, 2], [0, 0], components, settings=self.settings))
        self.renderer.settle(world)
        eye = up.apply(toward(angle))
        camera = ViewCamera(position=tuple(3.0 * eye), rotation=tuple(look_rotation(-eye).tolist()), field_of_view=0.02)
        self.renderer.draw(world, camera, 5, 5)
        world.assets.close()
        light = self.renderer.read_light(5, 5)[2, 2, :3]

        def light_from(lights: np.ndarray) -> np.ndarray:
            return sunny_map(self.turn.inv().apply(up.apply(lights)))

        surface = Surface(np.ones(3), metallic, max(roughness, 0.04))
        expected = reflected_radiance(toward(angle), surface, light_from, count=400_000)
        return float(np.max(np.abs(light - expected) / expected))


@pytest.mark.gl
@pytest.mark.parametrize("roughness", [0.0, 0.4, 0.65, 1.0])
def test_metals_mirror_a_picture_as_chance_finds(context: Context, roughness: float) -> None:
    """Seen along the normal, where nothing is approximated but between roughnesses. The entity is turned, its picture too."""
    sky = MappedSky(context, sampled=False)
    for normal in unit([(0.3, 0.9, 0.2), (-0.6, 0.5, 0.4), (0.1, -0.9, 0.3), (0.9, 0.1, -0.3)]):
        assert sky.error(normal, 0.0, 0.0, 1.0, roughness) < 3e-2


@pytest.mark.gl
@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.1, 0.4, 0.6, 1.0])
def test_sampled_light_is_what_chance_finds_from_every_side(
    context: Context, metallic: float, roughness: float
) -> None:
    sky = MappedSky(context, sampled=True)
    for number, normal in enumerate(unit(np.random.default_rng(5).normal(size=(5, 3)))):
        for angle in (0.0, 60.0, 85.0) if number < 2 else (35.0 + 6 * number,):
            assert sky.error(normal, float(number), angle, metallic, roughness) < 2e-2


@pytest.mark.gl
def test_sampled_light_keeps_what_materials_and_furnaces_ask_for(context: Context) -> None:
    """Colours, mixtures, layers of glTF and the light of many bounces: as the split sum has them in even light."""
    renderer = Renderer(context, quality=EXACT)
    materials = [
        Material(base_color=(0.9, 0.5, 0.2), metallic=metallic, roughness=roughness, **layers)
        for metallic in (0.0, 0.5, 1.0)
        for roughness in (0.2, 0.6, 1.0)
        for layers in ({}, {"specular": 0.5, "specular_color": (0.9, 0.7, 1.0), "ior": 1.8})
    ]
    for many in (False, True):
        lit = [
            msgspec.structs.replace(
                WHITE, picture=PictureSettings(multiple_scattering=many, sampled_surroundings=sampled)
            )
            for sampled in (False, True)
        ]
        for material in materials:
            for angle in ANGLES:
                split, sampled = (level_light(renderer, material, settings, angle) for settings in lit)
                np.testing.assert_allclose(sampled, split, rtol=1.5e-2)


@pytest.mark.gl
@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_white_things_vanish_in_a_white_furnace(context: Context, metallic: float) -> None:
    """With the light of many bounces nothing is lost, at any roughness and from any side."""
    renderer = Renderer(context, quality=EXACT)
    furnace = msgspec.structs.replace(WHITE, picture=PictureSettings(multiple_scattering=True))
    for roughness in (0.0, 0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 1.0):
        for angle in ANGLES:
            material = Material(base_color=(1.0, 1.0, 1.0), metallic=metallic, roughness=roughness)
            np.testing.assert_allclose(level_light(renderer, material, furnace, angle), 1.0, atol=1e-2)


@pytest.mark.gl
def test_a_single_bounce_loses_what_chance_says(context: Context) -> None:
    """So that the furnace above is not white by whatever is drawn."""
    renderer = Renderer(context, quality=EXACT)
    material = Material(base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=1.0)
    assert level_light(renderer, material, WHITE, 35.0).max() < 0.7


@pytest.mark.gl
@pytest.mark.parametrize("roughness", [0.3, 0.7, 1.0])
def test_lamps_lose_nothing_either(context: Context, roughness: float) -> None:
    """Suns from everywhere, one after the other, add up to the furnace: their light is weighed by the same gain."""
    rng = np.random.default_rng(4)
    to_view = toward(35.0)
    expected = reflected_radiance(to_view, Surface(np.ones(3), 1.0, roughness), np.ones_like)
    renderer = Renderer(context, quality=EXACT)
    plain, gained = [], []
    material = Material(base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=roughness)
    for _ in range(6):
        way = unit(rng.normal(size=3)) * (1, 0, 1) + (0, -0.8, 0)
        for found, many in ((plain, False), (gained, True)):
            black = SceneSettings(
                background=(0.0,) * 3, ambient=(0.0,) * 3, picture=PictureSettings(multiple_scattering=many)
            )
            sun = {"sun": (Transform(rotation=tuple(look_rotation(way).tolist())), Light())}
            found.append(level_light(renderer, material, black, 35.0, **sun))
    np.testing.assert_allclose(np.array(gained) * expected, plain, rtol=1.5e-2)
