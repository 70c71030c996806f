"""What a vertex shader makes of chosen rows of a buffer, kept in another buffer instead of being drawn (transform feedback)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from elys.render_node.gpu.buffer import Buffer
from elys.render_node.gpu.context import Context
from elys.render_node.gpu.framebuffer import Framebuffer
from elys.render_node.gpu.program import Program


class Field(NamedTuple):
    """Where a vertex shader expects a field of a row: its location, whether it is an integer ("i") or not ("f"), its form."""

    location: int
    kind: str
    form: str
    offset: int  # [bytes] in the row


class Capture:
    """Runs one program, which says what it captures, over rows in any order."""

    def __init__(
        self,
        context: Context,
        program: Program,
        rows: Buffer,
        layout: np.dtype[np.void],
        order: Buffer,
        fields: Mapping[str, Field],
    ) -> None:
        """`fields` by the attributes of the program, of `rows` of `layout`; `order` holds the numbers of rows, u32."""
        self._kept = (program, rows, order)  # what the card reads while this lives
        self._raw = context.gl.vertex_array(program.raw, [], order.raw, mode=context.gl.POINTS)
        self._finalizer = context.adopt(self, "vertex array", self._raw)
        # Without a whole framebuffer drivers refuse to run anything, though nothing is drawn.
        self._nowhere = Framebuffer(context, 1, 1, ("rgba8",))
        for name, (location, kind, form, offset) in fields.items():
            if program.reads(name):
                self._raw.bind(location, kind, rows.raw, form, offset, layout.itemsize, 0)

    def run(self, target: Buffer, count: int) -> None:
        """Writes what comes of the first `count` rows of the order to the start of `target`, which has room for it."""
        self._nowhere.use()
        self._raw.transform(target.raw, vertices=count)
