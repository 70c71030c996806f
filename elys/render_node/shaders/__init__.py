"""GLSL files, read by `elys.render_node.gpu.program`."""
