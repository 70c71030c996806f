"""A Material component as glTF says it: the inverse of `gltf_materials`. What a .glb cannot hold is left out with a warning."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Final

from elys.common.assets.gltf_writing import GltfModel
from elys.common.assets.images import image_format
from elys.common.assets.texture import Sampling, Texture, parse_texture
from elys.common.components import Material, declaration_of
from elys.common.errors import ElysError

_MEDIA: Final = {"png": "image/png", "jpeg": "image/jpeg", "webp": "image/webp"}
_WRAPS: Final = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
_FILTERS: Final = {
    "nearest": 9728,
    "linear": 9729,
    "nearest-mipmap-nearest": 9984,
    "linear-mipmap-nearest": 9985,
    "nearest-mipmap-linear": 9986,
    "linear-mipmap-linear": 9987,
}
_TEXTURE_FIELDS: Final = tuple(
    field.name for field in declaration_of("Material").fields if field.name.endswith("_texture")
)
_log = logging.getLogger(__name__)


def has_images(material: Material) -> bool:
    """Whether any field names a texture."""
    return any(getattr(material, field) for field in _TEXTURE_FIELDS)


def has_normal_map(material: Material) -> bool:
    """Whether tangents are of use."""
    return bool(material.normal_texture or material.clearcoat_normal_texture)


class MaterialWriting:
    """Adds materials to a model, each once, with the images that `fetch` gives for their references."""

    def __init__(self, model: GltfModel, fetch: Callable[[str], bytes]) -> None:
        self._model = model
        self._fetch = fetch
        self._materials: dict[Material, int] = {}
        self._images: dict[str, tuple[int, str] | None] = {}
        self._textures: dict[tuple[str, Sampling], int] = {}
        self._samplers: dict[Sampling, int] = {}

    def material(self, material: Material) -> int:
        """The number of a material in the model."""
        if material not in self._materials:
            self._materials[material] = self._model.add("materials", self._described(material))
        return self._materials[material]

    def _described(self, material: Material) -> dict[str, Any]:
        surface: dict[str, Any] = {
            "baseColorFactor": [*material.base_color, material.opacity],
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        }
        self._lay(surface, "baseColorTexture", material.base_color_texture)
        self._lay(surface, "metallicRoughnessTexture", material.metallic_roughness_texture)
        described: dict[str, Any] = {"pbrMetallicRoughness": surface, "alphaMode": material.alpha_mode.upper()}
        if material.alpha_mode == "mask":
            described["alphaCutoff"] = material.alpha_cutoff
        if material.double_sided:
            described["doubleSided"] = True
        self._lay(described, "normalTexture", material.normal_texture, scale=material.normal_scale)
        self._lay(described, "occlusionTexture", material.occlusion_texture, strength=material.occlusion_strength)
        self._lay(described, "emissiveTexture", material.emissive_texture)
        brightest = max(material.emissive)
        if brightest > 0.0:
            described["emissiveFactor"] = [channel / max(brightest, 1.0) for channel in material.emissive]
        extensions = self._layers(material)
        if brightest > 1.0:
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": brightest}
        if extensions:
            described["extensions"] = extensions
            for name in extensions:
                self._model.use(name)
        return described

    def _layers(self, material: Material) -> dict[str, Any]:
        """What glTF has in extensions."""
        found: dict[str, Any] = {}
        if material.unlit:
            found["KHR_materials_unlit"] = {}
        if material.ior != 1.5:
            found["KHR_materials_ior"] = {"ior": material.ior if material.ior == 0.0 else max(material.ior, 1.0)}
        specular: dict[str, Any] = {}
        self._lay(specular, "specularTexture", material.specular_texture)
        self._lay(specular, "specularColorTexture", material.specular_color_texture)
        if specular or material.specular != 1.0 or material.specular_color != (1.0, 1.0, 1.0):
            specular |= {"specularFactor": material.specular, "specularColorFactor": list(material.specular_color)}
            found["KHR_materials_specular"] = specular
        if material.clearcoat:
            coat: dict[str, Any] = {
                "clearcoatFactor": material.clearcoat,
                "clearcoatRoughnessFactor": material.clearcoat_roughness,
            }
            self._lay(coat, "clearcoatTexture", material.clearcoat_texture)
            self._lay(coat, "clearcoatRoughnessTexture", material.clearcoat_roughness_texture)
            self._lay(coat, "clearcoatNormalTexture", material.clearcoat_normal_texture)
            found["KHR_materials_clearcoat"] = coat
        return found

    def _lay(self, owner: dict[str, Any], field: str, text: str, **more: float) -> None:
        """Says where a texture lies, if there is one that can be had."""
        if not text:
            return
        try:
            texture = parse_texture(text)
            image = self._image(texture.image)
        except ElysError as error:
            _log.warning("left out of the model: %s", error)
            return
        if image is None:
            return
        info: dict[str, Any] = {"index": self._texture(image, texture)} | more
        if texture.uv:
            info["texCoord"] = texture.uv
        if texture.is_moved:
            moved = {"offset": list(texture.offset), "rotation": texture.rotation, "scale": list(texture.scale)}
            info["extensions"] = {"KHR_texture_transform": moved}
            self._model.use("KHR_texture_transform")
        owner[field] = info

    def _texture(self, image: tuple[int, str], texture: Texture) -> int:
        key = (texture.image, texture.sampling)
        if key not in self._textures:
            number, kind = image
            item: dict[str, Any] = {"sampler": self._sampler(texture.sampling)}
            if kind == "webp":
                item["extensions"] = {"EXT_texture_webp": {"source": number}}
                self._model.use("EXT_texture_webp", required=True)
            else:
                item["source"] = number
            self._textures[key] = self._model.add("textures", item)
        return self._textures[key]

    def _sampler(self, sampling: Sampling) -> int:
        if sampling not in self._samplers:
            item = {
                "wrapS": _WRAPS[sampling.wrap[0]],
                "wrapT": _WRAPS[sampling.wrap[1]],
                "magFilter": _FILTERS[sampling.magnify],
                "minFilter": _FILTERS[sampling.minify],
            }
            self._samplers[sampling] = self._model.add("samplers", item)
        return self._samplers[sampling]

    def _image(self, reference: str) -> tuple[int, str] | None:
        """The number of an image and what kind it is; None where a .glb cannot hold such, said once."""
        if reference not in self._images:
            data = self._fetch(reference)
            kind = image_format(data)
            self._images[reference] = None
            if kind in _MEDIA:
                item = {"bufferView": self._model.view(data), "mimeType": _MEDIA[kind]}
                self._images[reference] = self._model.add("images", item), kind
            else:
                _log.warning(
                    "left out of the model: an image that is %s; a .glb holds PNG, JPEG and WebP", kind or "none"
                )
        return self._images[reference]
