"""A glTF material as the fields of a Material component."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.gltf_accessors import pick
from elys.common.assets.gltf_schema import (
    Clearcoat,
    Document,
    Material,
    MetallicRoughness,
    Sampler,
    Specular,
    SpecularGlossiness,
    TextureInfo,
    TextureTransform,
)
from elys.common.assets.texture import UV_SETS, Sampling, Texture, texture_text
from elys.common.errors import AssetError

logger = logging.getLogger(__name__)

_DIELECTRIC: Final = 0.04  # what every dielectric reflects head-on in the metallic-roughness model
# GL's numbers. Where a sampler does not say, smooth with mipmaps.
_WRAPS: Final = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_MAGNIFIERS: Final = {None: "linear", 9728: "nearest", 9729: "linear"}
_MINIFIERS: Final = {
    None: "linear-mipmap-linear",
    9728: "nearest",
    9729: "linear",
    9984: "nearest-mipmap-nearest",
    9985: "linear-mipmap-nearest",
    9986: "nearest-mipmap-linear",
    9987: "linear-mipmap-linear",
}


def material_values(
    document: Document, index: int | None, image_of_texture: Callable[[int], str | None]
) -> dict[str, Any]:
    """The fields of a Material for `materials[index]` (None: glTF's default one); images come from `image_of_texture`.

    Raises AssetError if a texture does not exist.
    """
    material = Material() if index is None else document.materials[index]
    where = f"materials[{index}]"
    surface = material.pbr_metallic_roughness
    more = material.extensions
    if more.specular_glossiness is not None:
        surface = _converted(more.specular_glossiness, where)
    glow = 1.0 if more.emissive_strength is None else more.emissive_strength.emissive_strength
    specular, coat = more.specular or Specular(), more.clearcoat or Clearcoat()
    values: dict[str, Any] = {
        "base_color": surface.base_color_factor[:3],
        "opacity": surface.base_color_factor[3],
        "metallic": surface.metallic_factor,
        "roughness": surface.roughness_factor,
        "emissive": tuple(channel * glow for channel in material.emissive_factor),
        "alpha_mode": material.alpha_mode.lower(),
        "alpha_cutoff": min(material.alpha_cutoff, 1.0),
        "double_sided": material.double_sided,
        "unlit": more.unlit is not None,
        "ior": 1.5 if more.refraction is None else more.refraction.ior,
        "specular": specular.specular_factor,
        "specular_color": specular.specular_color_factor,
        "clearcoat": coat.clearcoat_factor,
        "clearcoat_roughness": coat.clearcoat_roughness_factor,
    }
    textures = {
        "base_color_texture": surface.base_color_texture,
        "metallic_roughness_texture": surface.metallic_roughness_texture,
        "normal_texture": material.normal_texture,
        "occlusion_texture": material.occlusion_texture,
        "emissive_texture": material.emissive_texture,
        "specular_texture": specular.specular_texture,
        "specular_color_texture": specular.specular_color_texture,
        "clearcoat_texture": coat.clearcoat_texture,
        "clearcoat_roughness_texture": coat.clearcoat_roughness_texture,
        "clearcoat_normal_texture": coat.clearcoat_normal_texture,
    }
    for name, info in textures.items():
        if info is not None:
            values[name] = _texture(document, info, f"{where}.{name}", image_of_texture)
    if material.normal_texture is not None:
        values["normal_scale"] = material.normal_texture.scale
    if material.occlusion_texture is not None:
        values["occlusion_strength"] = material.occlusion_texture.strength
    return values


def _converted(old: SpecularGlossiness, where: str) -> MetallicRoughness:
    """The metallic-roughness surface that looks like an older specular-glossiness one.

    The formulas are those of Khronos' converter (KHR_materials_pbrSpecularGlossiness, examples): metallic is what makes both
    models reflect and scatter equally bright, the base colour is then blended from what either needs.
    """
    if old.specular_glossiness_texture is not None:
        logger.warning("%s has a specular-glossiness texture, which is left out", where)
    diffuse, specular = np.array(old.diffuse_factor[:3]), np.array(old.specular_factor)
    scattered = 1.0 - float(specular.max())
    metallic = _metallic(_brightness(diffuse), _brightness(specular), scattered)
    from_diffuse = diffuse * scattered / (1.0 - _DIELECTRIC) / max(1.0 - metallic, 1e-6)
    from_specular = (specular - _DIELECTRIC * (1.0 - metallic)) / max(metallic, 1e-6)
    red, green, blue = np.clip(from_diffuse + (from_specular - from_diffuse) * metallic**2, 0.0, 1.0).tolist()
    return MetallicRoughness(
        base_color_factor=(red, green, blue, old.diffuse_factor[3]),
        base_color_texture=old.diffuse_texture,
        metallic_factor=metallic,
        roughness_factor=1.0 - old.glossiness_factor,
    )


def _metallic(diffuse: float, specular: float, scattered: float) -> float:
    if specular < _DIELECTRIC:
        return 0.0
    b = diffuse * scattered / (1.0 - _DIELECTRIC) + specular - 2.0 * _DIELECTRIC
    discriminant = max(b * b - 4.0 * _DIELECTRIC * (_DIELECTRIC - specular), 0.0)
    return min(max((-b + math.sqrt(discriminant)) / (2.0 * _DIELECTRIC), 0.0), 1.0)


def _brightness(color: NDArray[np.float64]) -> float:
    return math.sqrt(float(color**2 @ (0.299, 0.587, 0.114)))


def _texture(document: Document, info: TextureInfo, where: str, image_of_texture: Callable[[int], str | None]) -> str:
    """What a Material's field says of a texture."""
    texture = pick(document.textures, info.index, where, "texture")
    image = image_of_texture(info.index)
    if image is None:
        raise AssetError(f"{where}: texture {info.index} has no image")
    sampler = Sampler()
    if texture.sampler is not None:
        sampler = pick(document.samplers, texture.sampler, f"textures[{info.index}]", "sampler")
    transform = info.extensions.transform or TextureTransform()
    uv = info.tex_coord if transform.tex_coord is None else transform.tex_coord
    if uv >= UV_SETS:
        logger.warning("%s lies on TEXCOORD_%d; ELYS has two sets of uv coordinates, the first is taken", where, uv)
        uv = 0
    return texture_text(
        Texture(
            image,
            uv=uv,
            offset=transform.offset,
            rotation=transform.rotation,
            scale=transform.scale,
            sampling=Sampling(
                wrap=(_WRAPS[sampler.wrap_s], _WRAPS[sampler.wrap_t]),
                magnify=_MAGNIFIERS[sampler.mag_filter],
                minify=_MINIFIERS[sampler.min_filter],
            ),
        )
    )
