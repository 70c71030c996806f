"""What a material makes of a shader: which images it samples and how, and the numbers that hold for a whole draw call.

What differs from the standard is compiled in and set for those draw calls alone: a scene of plain materials pays for nothing.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.texture import Texture, parse_texture
from elys.common.components import Material
from elys.common.errors import AssetError

# Fields of Material that name an image, and whether it holds colours as eyes see them.
TEXTURE_FIELDS: Final = {
    "base_color_texture": True,
    "metallic_roughness_texture": False,
    "normal_texture": False,
    "occlusion_texture": False,
    "emissive_texture": True,
    "specular_texture": False,
    "specular_color_texture": True,
    "clearcoat_texture": False,
    "clearcoat_roughness_texture": False,
    "clearcoat_normal_texture": False,
}
SKINNED, MORPHED = "SKINNED", "MORPHED"
SECOND_UVS: Final = "SECOND_UVS"  # compiled in where a texture lies on the second set

Uniform = tuple[str, "float | tuple[float, ...] | NDArray[np.float64]"]


class Finish(NamedTuple):
    """Numbers of a material that few differ in: they are the same for all instances of a batch."""

    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    ior: float = 1.5
    specular: float = 1.0
    specular_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0


PLAIN_FINISH: Final = Finish()


class Look(NamedTuple):
    """What instances must have in common to be drawn together: all of a material but its numbers, and the handedness."""

    alpha_mode: Literal["opaque", "mask", "blend"]
    textures: tuple[str, ...]  # in the order of TEXTURE_FIELDS, "" for none
    is_double_sided: bool
    is_mirrored: bool  # an odd number of negative scales turns the triangles over
    is_unlit: bool = False
    finish: Finish = PLAIN_FINISH
    tangents: Literal["auto", "vertices", "pixels"] = "auto"  # where there is a normal map
    is_skinned: bool = False
    is_morphed: bool = False

    @property
    def tangent_uvs(self) -> int | None:
        """The uv set along which a mesh without tangents gets some; None where it gets none."""
        normal_map = texture_of(self.textures[2] or self.textures[9])
        return normal_map.uv if self.tangents == "vertices" and normal_map is not None else None

    @property
    def deformation(self) -> tuple[str, ...]:
        """Definitions for vertices that move within the mesh."""
        return (*((SKINNED,) if self.is_skinned else ()), *((MORPHED,) if self.is_morphed else ()))

    @property
    def surface(self) -> tuple[str, ...]:
        """Definitions for which fragments there are, and which way they look."""
        masked = ("MASKED",) if self.alpha_mode == "mask" else ()
        return (*masked, *(("DOUBLE_SIDED",) if self.is_double_sided else ()))

    @property
    def has_normal_map(self) -> bool:
        """Whether tangents are needed: only a normal map is laid along them."""
        return bool(self.textures[2] or self.textures[9])

    @property
    def is_plain(self) -> bool:
        """Whether it needs nothing compiled in and nothing bound."""
        return self.finish is PLAIN_FINISH and not (self.is_unlit or self.deformation or any(self.textures))

    @property
    def is_textured(self) -> bool:
        """Whether it names an image at all."""
        return any(self.textures)


@lru_cache(maxsize=4096)
def look_of(material: Material, mirrored: bool, tangents: Literal["auto", "vertices", "pixels"] = "auto") -> Look:
    """What a material looks like on a thing of that handedness, whose normal map lies along such tangents."""
    textures = tuple(getattr(material, field) for field in TEXTURE_FIELDS)
    finish = _finish(material, textures)
    look = Look(material.alpha_mode, textures, material.double_sided, mirrored, material.unlit, finish)
    return look._replace(tangents=tangents) if look.has_normal_map else look


def _finish(material: Material, textures: tuple[str, ...]) -> Finish:
    """Without what has no effect, so that it parts no batch."""
    finish = Finish(*(getattr(material, field) for field in Finish._fields))
    if material.unlit:
        return PLAIN_FINISH
    if not finish.clearcoat:
        finish = finish._replace(clearcoat_roughness=0.0)
    if not textures[2]:
        finish = finish._replace(normal_scale=1.0)
    if not textures[3]:
        finish = finish._replace(occlusion_strength=1.0)
    return PLAIN_FINISH if finish == PLAIN_FINISH else finish


def texture_of(text: str) -> Texture | None:
    """The texture that a field of a Material says; None for none. What is wrong is kept as a name that nobody has: it is told of
    and seen like any image that cannot be had.
    """
    try:
        return parse_texture(text) if text else None
    except AssetError:
        return Texture(text)


@lru_cache(maxsize=4096)
def variant_of(look: Look, present: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[Uniform, ...]]:
    """Definitions and uniforms for a look of whose textures those in the fields `present` are here."""
    defines: list[str] = []
    uniforms: list[Uniform] = []
    for field, text in zip(TEXTURE_FIELDS, look.textures, strict=True):
        texture = texture_of(text)
        if field not in present or texture is None:
            continue
        name = field.removesuffix("_texture")
        defines.append(field.upper())
        place = _place(name, texture, uniforms)
        if place:
            defines.append(f"{name.upper()}_UV {place}")
        if texture.uv and SECOND_UVS not in defines:
            defines.append(SECOND_UVS)
    defines += look.deformation
    if look.is_unlit:
        defines.append("UNLIT")
    finish = look.finish
    if finish.normal_scale != 1.0 and "NORMAL_TEXTURE" in defines:
        defines.append("NORMAL_SCALE")
        uniforms.append(("normal_scale", finish.normal_scale))
    if finish.occlusion_strength != 1.0 and "OCCLUSION_TEXTURE" in defines:
        defines.append("OCCLUSION_STRENGTH")
        uniforms.append(("occlusion_strength", finish.occlusion_strength))
    _add_layers(finish, defines, uniforms)
    return tuple(defines), tuple(uniforms)


def _place(name: str, texture: Texture, uniforms: list[Uniform]) -> str:
    """The expression for where a texture is looked up; "" for the first uv set as it is."""
    place = "vertex_second_uv" if texture.uv else "vertex_uv"
    plain = place
    if texture.is_moved:
        uniforms.append((f"{name}_from_mesh", texture.image_from_mesh))
        place = f"({name}_from_mesh * vec3({place}, 1.0))"
    mirrored = [wrap == "mirror" for wrap in texture.sampling.wrap]
    if any(mirrored):  # moderngl's textures repeat or clamp; a triangle wave folds coordinates as GL does
        place = f"folded({place}, bvec2({str(mirrored[0]).lower()}, {str(mirrored[1]).lower()}))"
    return "" if place == plain == "vertex_uv" else place


def _add_layers(finish: Finish, defines: list[str], uniforms: list[Uniform]) -> None:
    """What KHR_materials_ior, _specular and _clearcoat add to the standard's surface."""
    has_images = "SPECULAR_TEXTURE" in defines or "SPECULAR_COLOR_TEXTURE" in defines
    if has_images or (finish.ior, finish.specular, finish.specular_color) != (1.5, 1.0, (1.0, 1.0, 1.0)):
        defines.append("SPECULAR_LAYER")
        f0 = ((finish.ior - 1.0) / (finish.ior + 1.0)) ** 2
        uniforms.append(("specular_tint", (*(f0 * channel for channel in finish.specular_color), finish.specular)))
    if finish.clearcoat:
        defines.append("CLEARCOAT_LAYER")
        uniforms.append(("clearcoat_share", (finish.clearcoat, finish.clearcoat_roughness)))
