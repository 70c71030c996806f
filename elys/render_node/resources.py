"""What pictures share on the card: meshes, images, instances and programs, made when first drawn."""

from __future__ import annotations

from typing import Final

import numpy as np

from elys.common.assets import Mesh
from elys.render_node.gpu import TEXTURE_UNITS, Buffer, Context, Format, Program, ProgramCache, Texture, VertexArray
from elys.render_node.render_world import TEXTURE_FIELDS, Look, RenderWorld

# Fields of Material that name an image: the definition that compiles its use in, and whether it holds colours as eyes see them.
TEXTURE_USES: Final = {
    "base_color_texture": ("BASE_COLOR_TEXTURE", True),
    "metallic_roughness_texture": ("METALLIC_ROUGHNESS_TEXTURE", False),
    "normal_texture": ("NORMAL_TEXTURE", False),
    "occlusion_texture": ("OCCLUSION_TEXTURE", False),
    "emissive_texture": ("EMISSIVE_TEXTURE", True),
}
TANGENTS: Final = "VERTEX_TANGENTS"  # compiled in where a mesh has them and a normal map is laid along them


class Geometry:
    """A mesh on the card, and how each program reads it."""

    def __init__(self, context: Context, mesh: Mesh) -> None:
        self._context = context
        self._attributes = {
            name: Buffer(context, np.ascontiguousarray(array, np.float32))
            for name in ("positions", "normals", "uvs", "colors")
            if (array := getattr(mesh, name)) is not None and len(array)
        }
        # A quarter of a vertex: they come to the card with the first program that reads them.
        self._tangents = mesh.tangents if mesh.tangents is not None and len(mesh.tangents) else None
        self._indices = Buffer(context, np.ascontiguousarray(mesh.indices, np.uint32)) if len(mesh.indices) else None
        self._count = len(mesh.indices)
        self._arrays: dict[Program, VertexArray] = {}
        self.defines = (
            *((TANGENTS,) if self._tangents is not None else ()),
            *(("VERTEX_COLORS",) if "colors" in self._attributes else ()),
        )

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to draw."""
        return self._count == 0

    def vertex_array(self, program: Program) -> VertexArray:
        """How `program` reads it."""
        array = self._arrays.get(program)
        if array is None:
            if self._tangents is not None and program.reads("tangent"):
                self._attributes["tangents"] = Buffer(self._context, np.ascontiguousarray(self._tangents, np.float32))
                self._tangents = None
            array = VertexArray(self._context, program, self._attributes, self._indices, self._count)
            self._arrays[program] = array
        return array


class Resources:
    """Caches of one context. What is still on its way is None, and drawn without."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.instances = Buffer(context, size=1 << 16)
        self.frame = Buffer(context, size=1 << 10)
        self._used_by: tuple[RenderWorld, int] | None = None  # a world and its scene, whose names are in use
        self._geometries: dict[str, Geometry] = {}
        self._textures: dict[tuple[str, bool], Texture] = {}
        self.programs = ProgramCache(context)

    def program(self, vertex: str, fragment: str, defines: tuple[str, ...] = ()) -> Program:
        """The program of two shader files, compiled with `defines` at its first use."""
        return self.programs.program(vertex, fragment, defines)

    def geometry(self, world: RenderWorld, mesh: str) -> Geometry | None:
        """The mesh of that name on the card; None while it is not here, or if it has no triangles."""
        geometry = self._geometries.get(mesh)
        if geometry is None:
            arrays = world.assets.mesh(mesh)
            if arrays is None:
                return None
            geometry = self._geometries[mesh] = Geometry(self.context, arrays)
        return None if geometry.is_empty else geometry

    def bind_textures(self, world: RenderWorld, look: Look) -> tuple[str, ...]:
        """Shows the images of a look to the shaders; returns the definitions for those that are here."""
        defines = []
        for field, reference in zip(TEXTURE_FIELDS, look.textures, strict=True):
            if not reference:
                continue
            define, is_color = TEXTURE_USES[field]
            texture = self._texture(world, reference, is_color)
            if texture is not None:
                texture.use(TEXTURE_UNITS[field])
                defines.append(define)
        return tuple(defines)

    def forget_unused(self, world: RenderWorld) -> None:
        """Frees what the world does not name any more; does nothing while its scene is the same as last time."""
        if self._used_by == (world, world.scene_version):
            return
        self._used_by = (world, world.scene_version)
        named = {reference for batch in world.batches for reference in batch.look.textures}
        self._textures = {key: texture for key, texture in self._textures.items() if key[0] in named}
        meshes = {batch.mesh for batch in world.batches}
        self._geometries = {name: geometry for name, geometry in self._geometries.items() if name in meshes}

    def _texture(self, world: RenderWorld, reference: str, is_color: bool) -> Texture | None:
        key = (reference, is_color)
        if key not in self._textures:
            pixels = world.assets.take_image(reference)
            if pixels is None:
                return None
            height, width = pixels.shape[:2]
            largest = self.context.max_size
            if max(width, height) > largest:
                step = -(-max(width, height) // largest)
                pixels = np.ascontiguousarray(pixels[::step, ::step])
                height, width = pixels.shape[:2]
            form: Format = "srgba8" if is_color else "rgba8"
            self._textures[key] = Texture(self.context, (width, height), form, data=pixels, mipmaps=True, repeat=True)
        return self._textures[key]
