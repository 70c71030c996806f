"""Memory of the graphics card, and meshes laid out in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from elys.render_node.gpu.context import Context
from elys.render_node.gpu.program import Program

Mode = Literal[
    "triangles", "triangle_strip", "lines", "points"
]  # what vertices make; lines and points are one pixel wide

# Where every vertex shader expects what, and as what: location, floats.
VERTEX_ATTRIBUTES: Final[Mapping[str, tuple[int, int]]] = {
    "positions": (0, 3),
    "normals": (1, 3),
    "uvs": (2, 2),
    "tangents": (3, 4),
    "colors": (4, 4),
    "second_uvs": (12, 2),
    "joints": (13, 4),
    "weights": (14, 4),
}
# One row an instance: three rows of relative_from_local, its material's numbers (see `instance.glsl`), the entity, whose bits
# travel as they are, and where what bends and morphs it stands among `RenderWorld.pose_texels`.
INSTANCE_DTYPE: Final = np.dtype(
    [
        ("affine", "<f4", (3, 4)),
        ("base_color", "<f4", (4,)),
        ("reflection", "<f4", (2,)),
        ("emissive", "<f4", (4,)),
        ("entity", "<u4"),
        ("pose", "<i4", (2,)),
    ]
)
# How rows begin, which is all of them where nothing glows, has holes or bends and nobody is asked for.
PLAIN_INSTANCE_DTYPE: Final = np.dtype(
    [(name, INSTANCE_DTYPE[name]) for name in ("affine", "base_color", "reflection")]
)
_AFFINE_LOCATION: Final = 5
# Other fields: location, whether they are integers, and as what they are read.
_FIELDS: Final[Mapping[str, tuple[int, str, str]]] = {
    "base_color": (8, "f", "4f4"),
    "emissive": (9, "f", "4f4"),
    "reflection": (10, "f", "2f4"),
    "entity": (11, "i", "1u4"),
    "pose": (15, "i", "2i4"),
}


class Buffer:
    """Bytes on the card, growing as needed. Raises DisplayError where it has no room."""

    def __init__(self, context: Context, data: NDArray[Any] | bytes | None = None, *, size: int = 0) -> None:
        self._context = context
        self.raw = context.gl.buffer(
            data if data is not None else None, reserve=0 if data is not None else max(size, 16)
        )
        self._finalizer = context.adopt(self, "buffer", self.raw)
        context.check(f"making a buffer of {self.size} bytes")

    @property
    def size(self) -> int:
        """[bytes]"""
        return int(self.raw.size)

    def write(self, data: NDArray[Any]) -> None:
        """Replaces the content from the start; what is on its way to the screen keeps the old one."""
        if data.nbytes > self.size:
            self.raw.orphan(max(data.nbytes, 2 * self.size))
            self._context.check(f"making a buffer of {self.size} bytes")
        else:
            self.raw.orphan()
        if data.nbytes:
            self.raw.write(data)

    def write_part(self, data: NDArray[Any], offset: int) -> None:
        """Replaces the content from `offset` [bytes] on, as far as the data goes, which must be within."""
        self.raw.write(data, offset=offset)

    def reserve(self, size: int) -> None:
        """Makes room for so many bytes; the content is lost where there was less."""
        if size > self.size:
            self.raw.orphan(max(size, 2 * self.size))
            self._context.check(f"making a buffer of {self.size} bytes")

    def bind_block(self, binding: int, *, offset: int = 0, size: int = -1) -> None:
        """Shows `size` bytes from `offset` on to shaders as the uniform block of that binding."""
        self.raw.bind_to_uniform_block(binding, offset, size)

    def release(self) -> None:
        """Frees the memory now rather than with this object."""
        self._finalizer()


class VertexArray:
    """A mesh as one program reads it, with instances from a buffer."""

    def __init__(
        self,
        context: Context,
        program: Program,
        attributes: Mapping[str, Buffer],
        indices: Buffer | None,
        count: int,
        *,
        mode: Mode = "triangles",
    ) -> None:
        """`attributes` by their names in VERTEX_ATTRIBUTES; `count` indices, or vertices when there are none."""
        self._kept = (program, dict(attributes), indices)  # what the card reads while this lives
        self._count = count
        self._fields = tuple(name for name in _FIELDS if program.reads(name))
        drawn = getattr(context.gl, mode.upper())
        self.raw = context.gl.vertex_array(program.raw, [], None if indices is None else indices.raw, mode=drawn)
        self._finalizer = context.adopt(self, "vertex array", self.raw)
        for name, buffer in attributes.items():
            location, width = VERTEX_ATTRIBUTES[name]
            self.raw.bind(location, "f", buffer.raw, f"{width}f4", 0, 4 * width, 0)

    def use_instances(self, buffer: Buffer, first: int, layout: np.dtype[np.void]) -> None:
        """Takes instances from row `first` of a buffer of INSTANCE_DTYPE, or of PLAIN_INSTANCE_DTYPE, on."""
        stride = layout.itemsize
        offset = first * stride
        for row in range(3):
            self.raw.bind(_AFFINE_LOCATION + row, "f", buffer.raw, "4f4", offset + 16 * row, stride, 1)
        for name in self._fields:
            location, kind, form = _FIELDS[name]
            self.raw.bind(location, kind, buffer.raw, form, offset + _offset_in(layout, name), stride, 1)

    def draw(self, instance_count: int = 1) -> None:
        """Draws the mesh so many times."""
        self.raw.render(vertices=self._count, instances=instance_count)

    def release(self) -> None:
        """Frees it now rather than with this object."""
        self._finalizer()


def _offset_in(layout: np.dtype[np.void], name: str) -> int:
    """[bytes]"""
    fields = layout.fields
    assert fields is not None
    return fields[name][1]
