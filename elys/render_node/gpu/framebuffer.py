"""Where passes draw into: any mix of colour, integer and depth attachments, with one or several samples a pixel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.errors import DisplayError
from elys.render_node.gpu.context import Context
from elys.render_node.gpu.texture import FORMATS, Format, Texture

_DTYPES: Final = {"f1": np.uint8, "f2": np.float16, "f4": np.float32, "u4": np.uint32}


class Framebuffer:
    """A set of images of one size to draw into. With one sample they are textures: `colors` and `depth`."""

    def __init__(
        self,
        context: Context,
        width: int,
        height: int,
        colors: Sequence[Format] = ("rgba8",),
        *,
        depth: bool = False,
        samples: int = 0,
        smooth: bool = True,
        compare: bool = False,
    ) -> None:
        """`samples` of 0 is one sample a pixel; more cannot be read by shaders, only resolved. Raises DisplayError."""
        context.check_size("a framebuffer", width, height)
        self.width, self.height, self.samples = width, height, samples
        self._context = context
        self._forms = tuple(colors)
        size = (width, height)
        self.colors: tuple[Texture, ...] = ()
        self.depth: Texture | None = None
        self._finalizers = []
        if samples:
            raw_colors = [self._renderbuffer(size, form) for form in colors]
            raw_depth = (
                self._adopted("renderbuffer", context.gl.depth_renderbuffer(size, samples=samples)) if depth else None
            )
        else:
            self.colors = tuple(Texture(context, size, form, smooth=smooth) for form in colors)
            self.depth = Texture(context, size, "depth", compare=compare) if depth else None
            raw_colors = [texture.raw for texture in self.colors]
            raw_depth = self.depth.raw if self.depth is not None else None
        what = f"making a framebuffer of {width} x {height} pixels"
        context.check(what)
        try:
            self.raw = context.gl.framebuffer(raw_colors, raw_depth)
        except Exception as error:  # moderngl raises plain Error, as where an attachment has got no memory
            context.check(what)
            raise DisplayError(f"{what} failed: {error}") from error
        self._finalizers.append(context.adopt(self, "framebuffer", self.raw))

    @classmethod
    def of_window(cls, context: Context, width: int, height: int) -> Framebuffer:
        """The picture of the window that is current, `width` by `height` of its pixels."""
        framebuffer = cls.__new__(cls)
        framebuffer.width, framebuffer.height, framebuffer.samples = width, height, 0
        framebuffer._context, framebuffer._forms = context, ("rgba8",)
        framebuffer.colors, framebuffer.depth, framebuffer._finalizers = (), None, []
        framebuffer.raw = context.gl.screen
        return framebuffer

    def use(self, *, depth_write: bool = True, region: tuple[int, int, int, int] | None = None) -> None:
        """Draws go here from now on, or into `region` of it: x, y, width, height from the lower left."""
        self.raw.use()
        self.raw.viewport = region or (0, 0, self.width, self.height)
        self.raw.scissor = None
        self.raw.depth_mask = depth_write

    def clear(
        self,
        color: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
        *,
        region: tuple[int, int, int, int] | None = None,
    ) -> None:
        """Makes every pixel, or those of `region`, `color` and as far away as can be.

        Integer attachments take only zeros (GL writes float bits).
        """
        self.raw.depth_mask = True
        self.raw.scissor = None
        self.raw.clear(*color, depth=1.0, viewport=region or (0, 0, self.width, self.height))

    def resolve_into(self, target: Framebuffer) -> None:
        """Averages the samples of each pixel into a framebuffer of the same size."""
        self._context.gl.copy_framebuffer(target.raw, self.raw)

    def read(self, attachment: int = 0, *, region: tuple[int, int, int, int] | None = None) -> NDArray[Any]:
        """Pixels (H, W, components) of an attachment, the bottom row first, as GL has them."""
        components, dtype, _ = FORMATS[self._forms[attachment]]
        x, y, width, height = region or (0, 0, self.width, self.height)
        data = self.raw.read((x, y, width, height), components, attachment=attachment, alignment=1, dtype=dtype)
        return np.frombuffer(data, _DTYPES[dtype]).reshape(height, width, components)

    def read_into(self, target: memoryview | NDArray[np.uint8]) -> None:
        """Puts the first attachment's pixels, the bottom row first, straight into memory."""
        components, dtype, _ = FORMATS[self._forms[0]]
        self.raw.read_into(target, (0, 0, self.width, self.height), components, alignment=1, dtype=dtype)

    def release(self) -> None:
        """Frees it and its attachments now rather than with this object."""
        for finalizer in reversed(self._finalizers):
            finalizer()
        for texture in (*self.colors, *((self.depth,) if self.depth else ())):
            texture.release()

    def _renderbuffer(self, size: tuple[int, int], form: Format) -> Any:
        components, dtype, _ = FORMATS[form]
        return self._adopted(
            "renderbuffer", self._context.gl.renderbuffer(size, components, samples=self.samples, dtype=dtype)
        )

    def _adopted(self, kind: str, raw: Any) -> Any:
        self._finalizers.append(self._context.adopt(self, kind, raw))
        return raw
