"""Instances of four vertices that shaders make from texels: lines, letters and overlays."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.render_node.gpu import TEXTURE_UNITS, Program, Texture, VertexArray
from elys.render_node.resources import Resources

COLUMNS: Final = 768  # texels of a row of the texture of marks, as the shaders have it


class Strips:
    """Instances of four vertices each, made from texels that the shader reads by their numbers."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._texels: Texture | None = None
        self._strips: dict[Program, VertexArray] = {}

    def write(self, texels: NDArray[np.float32]) -> None:
        """Takes texels (N, 4)."""
        rows = -(-len(texels) // COLUMNS)
        has_room = self._texels is not None and rows <= self._texels.size[1] <= 4 * rows + 8
        height = self._texels.size[1] if has_room and self._texels is not None else rows + rows // 2
        whole = np.zeros((height, COLUMNS, 4), np.float32)
        whole.reshape(-1, 4)[: len(texels)] = texels
        if has_room and self._texels is not None:
            self._texels.write(whole)
        else:
            self._texels = Texture(self._resources.context, (COLUMNS, height), "rgba32f", data=whole, smooth=False)

    def program(self, name: tuple[str, str, tuple[str, ...]]) -> Program:
        """The program of two shaders and definitions."""
        return self._resources.program(*name)

    def draw(self, name: tuple[str, str, tuple[str, ...]], count: int) -> None:
        """Draws so many instances of what was written."""
        assert self._texels is not None
        program = self.program(name)
        if program not in self._strips:
            self._strips[program] = VertexArray(self._resources.context, program, {}, None, 4, mode="triangle_strip")
        self._texels.use(TEXTURE_UNITS["mark_texels"])
        self._strips[program].draw(count)
