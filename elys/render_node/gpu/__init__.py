"""OpenGL, wrapped: the only place that calls it. Everything is released when its owner goes.

Context ── makes and counts ──> Buffer, Texture, Framebuffer, Program, VertexArray
"""

from elys.render_node.gpu.buffer import INSTANCE_DTYPE, PLAIN_INSTANCE_DTYPE, VERTEX_ATTRIBUTES, Buffer, VertexArray
from elys.render_node.gpu.capture import Capture, Field
from elys.render_node.gpu.context import Context, offscreen_context, window_context
from elys.render_node.gpu.framebuffer import Framebuffer
from elys.render_node.gpu.program import BLOCK_BINDINGS, TEXTURE_UNITS, Program
from elys.render_node.gpu.program_cache import ProgramCache
from elys.render_node.gpu.texture import Format, Texture

__all__ = [
    "BLOCK_BINDINGS",
    "INSTANCE_DTYPE",
    "PLAIN_INSTANCE_DTYPE",
    "TEXTURE_UNITS",
    "VERTEX_ATTRIBUTES",
    "Buffer",
    "Capture",
    "Context",
    "Field",
    "Format",
    "Framebuffer",
    "Program",
    "ProgramCache",
    "Texture",
    "VertexArray",
    "offscreen_context",
    "window_context",
]
