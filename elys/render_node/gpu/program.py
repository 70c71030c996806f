"""Shader programs from the files of `elys/render_node/shaders`, with includes, definitions and errors that name file and line."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.errors import ShaderError
from elys.render_node.gpu.context import Context

SHADERS: Final = "elys.render_node.shaders"
# Uniform blocks stand at the same binding in every program.
BLOCK_BINDINGS: Final[Mapping[str, int]] = {"Frame": 0}
# And so do textures.
TEXTURE_UNITS: Final[Mapping[str, int]] = {
    "base_color_texture": 0,
    "metallic_roughness_texture": 1,
    "normal_texture": 2,
    "occlusion_texture": 3,
    "emissive_texture": 4,
    "shadow_map": 5,
    "surroundings": 6,
    "albedo_table": 7,
    "sky_map": 8,
    "depths": 9,
    "lamp_shadow_map": 9,  # what is seen is drawn after the depths were read
    "ambient_openness": 10,
    "specular_texture": 11,
    "specular_color_texture": 12,
    "clearcoat_texture": 13,
    "clearcoat_roughness_texture": 14,
    "clearcoat_normal_texture": 15,
    "pose_texels": 16,
    "morph_texels": 17,
    "mark_texels": 18,
    "positions_now": 19,
    "positions_before": 20,
    "rotations_now": 21,
    "rotations_before": 22,
    "spins_now": 23,
    "spins_before": 24,
    "led_texels": 25,
    "letter_sheet": 0,
    "glyph_sheet": 0,
    "overlay_image": 1,
    "picture": 0,
    "mask": 0,
}
_INCLUDE: Final = re.compile(r'\s*#include\s+"([^"]+)"')
# Mesa 0:12(3): error, NVIDIA 0(12) : error, Apple ERROR: 0:12: cause
_ERROR_LINE: Final = re.compile(r"^\s*(?:ERROR:\s*)?\d+[:(](\d+)\)?(?:\(\d+\))?\s*:?\s*", re.MULTILINE)

Place = tuple[str, int]  # file and line, from 1


class Program:
    """A vertex and a fragment shader, compiled for a set of definitions."""

    def __init__(
        self,
        context: Context,
        vertex: str,
        fragment: str,
        *,
        defines: Sequence[str] = (),
        captured: Sequence[str] = (),
    ) -> None:
        """`captured` are outputs of the vertex shader that a Capture keeps, one behind the other; then there is no fragment
        shader, and `fragment` is empty.

        Raises ShaderError with file, line and source line where the driver does not take a shader.
        """
        vertex_source, vertex_places = expand(vertex, defines)
        fragment_source, fragment_places = expand(fragment, defines) if fragment else ("", [])
        try:
            if captured:
                self.raw = context.gl.program(vertex_shader=vertex_source, varyings=list(captured))
            else:
                self.raw = context.gl.program(vertex_shader=vertex_source, fragment_shader=fragment_source)
        except Exception as error:  # moderngl raises plain Error
            message = str(error)
            places = fragment_places if "fragment_shader" in message else vertex_places
            source = fragment_source if "fragment_shader" in message else vertex_source
            raise ShaderError(_explain(message, source, places)) from error
        self._names = frozenset(self.raw)  # moderngl looks through all of them one by one
        self.files = frozenset(file for file, _ in (*vertex_places, *fragment_places))
        self._finalizer = context.adopt(self, "program", self.raw)
        for name, binding in BLOCK_BINDINGS.items():
            if name in self._names:
                self.raw[name].binding = binding
        for name, unit in TEXTURE_UNITS.items():
            if name in self._names:
                self.raw[name].value = unit

    def set(self, name: str, value: float | tuple[float, ...] | NDArray[np.floating[Any]]) -> None:
        """Sets a uniform; a matrix as rows. One that the compiler found unused is passed over."""
        if name not in self._names:
            return
        if isinstance(value, np.ndarray) and value.ndim == 2:
            self.raw[name].write(np.ascontiguousarray(value.T, np.float32))
        else:
            self.raw[name].value = value

    def reads(self, name: str) -> bool:
        """Whether it makes use of a vertex attribute or uniform of that name."""
        return name in self._names

    def release(self) -> None:
        """Frees it now rather than with this object."""
        self._finalizer()


def expand(name: str, defines: Sequence[str] = ()) -> tuple[str, list[Place]]:
    """The source of a shader file with its includes in place, and for each line where it came from."""
    lines: list[str] = []
    places: list[Place] = []
    _append(name, lines, places, included=())
    head = [f"#define {define}" for define in defines]
    # GLSL wants #version first.
    return "\n".join((lines[0], *head, *lines[1:])) + "\n", [places[0], *((name, 1) for _ in head), *places[1:]]


def files_of(*names: str) -> frozenset[str]:
    """These shader files and all that they include, also what is missing: where to look when something does not compile."""
    found, waiting = set[str](), [name for name in names if name]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found.add(name)
        try:
            text = resources.files(SHADERS).joinpath(name).read_text(encoding="utf-8")
        except OSError:
            continue
        waiting += [include.group(1) for include in map(_INCLUDE.match, text.splitlines()) if include]
    return frozenset(found)


def _append(name: str, lines: list[str], places: list[Place], *, included: tuple[str, ...]) -> None:
    if name in included:
        raise ShaderError(f"the shader {included[-1]} includes {name}, which includes it")
    try:
        text = resources.files(SHADERS).joinpath(name).read_text(encoding="utf-8")
    except OSError as error:
        raise ShaderError(f"the shader {name} is missing from the installation: install ELYS again") from error
    for number, line in enumerate(text.splitlines(), 1):
        include = _INCLUDE.match(line)
        if include:
            _append(include.group(1), lines, places, included=(*included, name))
        else:
            lines.append(line)
            places.append((name, number))


def _explain(message: str, source: str, places: list[Place]) -> str:
    found = _ERROR_LINE.search(message)
    if found is None or not 0 < int(found.group(1)) <= len(places):
        return f"the shader {places[0][0]} was refused by the driver: {message.strip()}"
    line = int(found.group(1))
    file, number = places[line - 1]
    said = message[found.end() :].strip().splitlines()[0]
    return f"the shader {file}, line {number}: {said}\n    {source.splitlines()[line - 1].strip()}"
