"""Images on the card."""

from __future__ import annotations

from typing import Any, Final, Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from elys.render_node.gpu.context import Context

Format = Literal["r8", "rgba8", "srgba8", "r16f", "rgba16f", "r32f", "rgba32f", "r32ui", "rg32ui", "rgb32f", "depth"]

# Components, element type and, where GL cannot guess it, the internal format.
FORMATS: Final[dict[str, tuple[int, str, int]]] = {
    "r8": (1, "f1", 0),
    "rgba8": (4, "f1", 0),
    "srgba8": (4, "f1", 0x8C43),  # GL_SRGB8_ALPHA8: the card turns it linear before it filters
    "r16f": (1, "f2", 0),
    "rgba16f": (4, "f2", 0),
    "r32f": (1, "f4", 0),
    "rgba32f": (4, "f4", 0),
    "r32ui": (1, "u4", 0),
    "rg32ui": (2, "u4", 0),
    "rgb32f": (3, "f4", 0),
}
_FILTERS: Final = {
    "nearest": moderngl.NEAREST,
    "linear": moderngl.LINEAR,
    "nearest-mipmap-nearest": moderngl.NEAREST_MIPMAP_NEAREST,
    "linear-mipmap-nearest": moderngl.LINEAR_MIPMAP_NEAREST,
    "nearest-mipmap-linear": moderngl.NEAREST_MIPMAP_LINEAR,
    "linear-mipmap-linear": moderngl.LINEAR_MIPMAP_LINEAR,
}
ANISOTROPY: Final = 4.0  # enough for floors; too dear where the processor draws


class Texture:
    """An image that shaders read or passes draw into. Row 0 of `data` is at v = 0."""

    def __init__(
        self,
        context: Context,
        size: tuple[int, int],
        form: Format,
        *,
        data: NDArray[Any] | None = None,
        smooth: bool = True,
        mipmaps: bool = False,
        repeat: bool = False,
        compare: bool = False,
    ) -> None:
        """`compare` makes a depth texture answer "is this nearer?" instead of its value, as shadow samplers want it.

        Raises DisplayError where the driver cannot hold it.
        """
        context.check_size("a texture", *size)
        self.size = size
        self.form = form
        payload = None if data is None else np.ascontiguousarray(data)
        if form == "depth":
            self.raw = context.gl.depth_texture(size, payload)
            self.raw.compare_func = "<=" if compare else ""
        else:
            components, dtype, internal = FORMATS[form]
            self.raw = context.gl.texture(size, components, payload, dtype=dtype, internal_format=internal or None)
        self._finalizer = context.adopt(self, "texture", self.raw)
        self._context = context
        self._has_mipmaps = mipmaps
        self._check()
        if mipmaps:
            self.raw.build_mipmaps()
            self._check()
            self.raw.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            self.raw.anisotropy = 1.0 if context.is_software else ANISOTROPY
        else:
            nearest = not smooth or form in ("r32ui", "rg32ui")
            self.raw.filter = (moderngl.NEAREST, moderngl.NEAREST) if nearest else (moderngl.LINEAR, moderngl.LINEAR)
        self.raw.repeat_x = self.raw.repeat_y = repeat

    def sample(self, *, repeat: tuple[bool, bool], magnify: str, minify: str) -> None:
        """Sets what happens outside of 0..1 along u and v, and how texels are looked up, by the words of Material textures.

        Raises DisplayError where there is no room for the smaller pictures that this takes.
        """
        self.raw.repeat_x, self.raw.repeat_y = repeat
        if "mipmap" in minify and not self._has_mipmaps:
            self.raw.build_mipmaps()
            self._check()
            self._has_mipmaps = True
        self.raw.filter = (_FILTERS[minify], _FILTERS[magnify])
        smooth = minify == "linear-mipmap-linear" and magnify == "linear" and not self._context.is_software
        self.raw.anisotropy = ANISOTROPY if smooth else 1.0

    def _check(self) -> None:
        self._context.check(f"making a texture of {self.size[0]} x {self.size[1]} pixels")

    def wrap_around(self) -> None:
        """Lets its left and right edges meet, as a map of all directions does."""
        self.raw.repeat_x = True

    def write(self, data: NDArray[Any]) -> None:
        """Replaces all texels."""
        self.raw.write(np.ascontiguousarray(data))

    def write_first(self, data: NDArray[Any]) -> None:
        """Replaces as many texels (N, C), row by row, as there are in `data`."""
        width = self.size[0]
        whole = len(data) // width
        if whole:
            self.raw.write(data[: whole * width], viewport=(0, 0, width, whole))
        if len(data) > whole * width:
            self.raw.write(data[whole * width :], viewport=(0, whole, len(data) - whole * width, 1))

    def use(self, unit: int) -> None:
        """Shows it to the sampler of that unit."""
        self.raw.use(unit)

    def release(self) -> None:
        """Frees it now rather than with this object."""
        self._finalizer()
