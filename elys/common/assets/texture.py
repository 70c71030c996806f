"""A texture as a Material names it: an image, and how it is laid over a mesh.

    brick.png                                    on the first uv set, repeated, smooth
    brick.png?scale=4,4                          four times along u and v
    decal.png?uv=1&wrap=clamp                    on the second uv set, its edges drawn out
    tile.png?offset=0.5,0&rotation=0.7854&wrap=mirror,repeat&magnify=nearest

The image is a file or a content reference; what follows the question mark holds only what differs from the defaults, in the
order of `Texture`'s fields. So a texture is one text wherever it goes: file, column, message, batch.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.errors import AssetError

WRAPS: Final = ("repeat", "mirror", "clamp")
MAGNIFIERS: Final = ("linear", "nearest")
MINIFIERS: Final = (
    "linear",
    "nearest",
    "linear-mipmap-linear",
    "linear-mipmap-nearest",
    "nearest-mipmap-linear",
    "nearest-mipmap-nearest",
)
UV_SETS: Final = 2
MAX_NUMBER: Final = 1e6  # of an offset or scale


class Sampling(NamedTuple):
    """How texels become a colour: what happens outside of 0..1 along u and v, and which texels are asked."""

    wrap: tuple[str, str] = ("repeat", "repeat")  # of WRAPS
    magnify: str = "linear"  # of MAGNIFIERS
    minify: str = "linear-mipmap-linear"  # of MINIFIERS: within a mipmap level, then between levels


class Texture(NamedTuple):
    """An image, which uv coordinates it lies on, and how they are changed: rotation * (scale * uv) + offset.

    The rotation is in rad, counter-clockwise for who looks at the uv plane with v downwards, as in KHR_texture_transform.
    """

    image: str
    uv: int = 0
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    sampling: Sampling = Sampling()

    @property
    def is_moved(self) -> bool:
        """Whether uv coordinates are changed before they are looked up."""
        return (self.offset, self.rotation, self.scale) != ((0.0, 0.0), 0.0, (1.0, 1.0))

    @property
    def image_from_mesh(self) -> NDArray[np.float64]:
        """The change of uv coordinates (2, 3). KHR_texture_transform: translation * rotation * scale."""
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        (x, y), (u, v) = self.scale, self.offset
        return np.array(((cosine * x, sine * y, u), (-sine * x, cosine * y, v)))


def split_texture(text: str) -> tuple[str, str]:
    """The image in a texture's text, and the rest with its question mark ("" for none)."""
    image, mark, options = text.rpartition("?")
    return (image, mark + options) if mark and "=" in options else (text, "")


def texture_text(texture: Texture) -> str:
    """A texture as one text."""
    plain, sampling = Texture(""), texture.sampling
    options = {
        "uv": (str(texture.uv), texture.uv != plain.uv),
        "offset": (_pair(texture.offset), texture.offset != plain.offset),
        "rotation": (_number(texture.rotation), texture.rotation != plain.rotation),
        "scale": (_pair(texture.scale), texture.scale != plain.scale),
        "wrap": (",".join(dict.fromkeys(sampling.wrap)), sampling.wrap != plain.sampling.wrap),
        "magnify": (sampling.magnify, sampling.magnify != plain.sampling.magnify),
        "minify": (sampling.minify, sampling.minify != plain.sampling.minify),
    }
    written = "&".join(f"{key}={value}" for key, (value, differs) in options.items() if differs)
    return f"{texture.image}?{written}" if written else texture.image


@lru_cache(maxsize=4096)
def parse_texture(text: str) -> Texture:
    """The texture in its text; raises AssetError with one sentence about what is wrong in it."""
    image, options = split_texture(text)
    texture = Texture(image)
    for option in options.removeprefix("?").split("&") if options else ():
        key, _, value = option.partition("=")
        reader = _READERS.get(key)
        if reader is None:
            raise AssetError(
                f"the texture {_short(text)} has no option {key[:20]!r}; options are {', '.join(_READERS)}"
            )
        try:
            texture = reader(texture, value)
        except ValueError as error:
            raise AssetError(f"the texture {_short(text)} says {option[:60]}: {error}") from None
    return texture


def _read_uv(texture: Texture, value: str) -> Texture:
    if value not in ("0", "1"):
        raise ValueError(f"a mesh has {UV_SETS} uv sets, 0 and 1")
    return texture._replace(uv=int(value))


def _read_wrap(texture: Texture, value: str) -> Texture:
    names = value.split(",")
    if len(names) > 2 or not set(names) <= set(WRAPS):
        raise ValueError(f"expected one of {', '.join(WRAPS)}, or two for u and v")
    return texture._replace(sampling=texture.sampling._replace(wrap=(names[0], names[-1])))


def _read_filter(key: str, choices: tuple[str, ...]) -> Callable[[Texture, str], Texture]:
    def read(texture: Texture, value: str) -> Texture:
        if value not in choices:
            raise ValueError(f"expected one of {', '.join(choices)}")
        changed: dict[str, Any] = {key: value}
        return texture._replace(sampling=texture.sampling._replace(**changed))

    return read


def _numbers(text: str, count: int) -> list[float]:
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(abs(number) <= MAX_NUMBER for number in numbers):
        raise ValueError(f"expected {count} number{'s' * (count > 1)} up to {MAX_NUMBER:g}")
    return numbers


def _two(text: str) -> tuple[float, float]:
    u, v = _numbers(text, 2)
    return u, v


_READERS: Final[dict[str, Callable[[Texture, str], Texture]]] = {
    "uv": _read_uv,
    "offset": lambda texture, value: texture._replace(offset=_two(value)),
    "rotation": lambda texture, value: texture._replace(rotation=_numbers(value, 1)[0]),
    "scale": lambda texture, value: texture._replace(scale=_two(value)),
    "wrap": _read_wrap,
    "magnify": _read_filter("magnify", MAGNIFIERS),
    "minify": _read_filter("minify", MINIFIERS),
}


def _number(value: float) -> str:
    return str(int(value)) if value == int(value) else repr(value)


def _pair(values: tuple[float, float]) -> str:
    return ",".join(map(_number, values))


def _short(text: str) -> str:
    return repr(text if len(text) <= 80 else f"{text[:77]}...")
