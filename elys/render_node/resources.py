"""What pictures share on the card: meshes, images, instances and programs, made when first drawn."""

from __future__ import annotations

import logging
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets import Mesh
from elys.common.assets.images import placeholder_image
from elys.common.assets.tangents import with_tangents
from elys.common.assets.texture import Sampling, split_texture
from elys.common.errors import DisplayError
from elys.render_node.gpu import TEXTURE_UNITS, Buffer, Context, Format, Program, ProgramCache, Texture, VertexArray
from elys.render_node.images import decode_image, shrunk
from elys.render_node.instance_placing import InstancePlacing
from elys.render_node.instances import Batch
from elys.render_node.look import TEXTURE_FIELDS, Look, texture_of, variant_of
from elys.render_node.overlay_images import OverlayImages
from elys.render_node.render_world import RenderWorld
from elys.render_node.welding import welded

_log = logging.getLogger(__name__)
TANGENTS: Final = "VERTEX_TANGENTS"  # compiled in where a mesh has them and a normal map is laid along them

POSE_WIDTH: Final = 1024  # texels of a row of the texture of poses, as `deform.glsl` has it
MORPH_WIDTH: Final = 2048  # likewise of morph targets

_SELDOM_READ: Final = {
    "tangent": "tangents",
    "second_uv": "second_uvs",
    "joints": "joints",
    "joint_weights": "weights",
}  # by the name that shaders have for them
# What differs, or may differ, between vertices at the same place; `pose` is read by programs that know vertices by their number.
_PER_CORNER: Final = ("normal", "uv", "second_uv", "tangent", "color", "joints", "pose")


class Geometry:
    """A mesh on the card, and how each program reads it."""

    def __init__(self, context: Context, mesh: Mesh) -> None:
        self._context = context
        self._attributes = {
            name: Buffer(context, np.ascontiguousarray(array, np.float32))
            for name in ("positions", "normals", "uvs", "colors")
            if (array := getattr(mesh, name)) is not None and len(array)
        }
        # Much of a vertex, and seldom read: they come to the card with the first program that reads them.
        self._waiting = {
            attribute: (name, array)
            for attribute, name in _SELDOM_READ.items()
            if (array := getattr(mesh, name)) is not None and len(array)
        }
        self._indices = Buffer(context, np.ascontiguousarray(mesh.indices, np.uint32)) if len(mesh.indices) else None
        self._count = len(mesh.indices)
        self._topology = mesh.topology
        self.is_surface = mesh.is_surface
        self._corners: tuple[NDArray[np.float32], NDArray[np.uint32]] | None = (mesh.positions, mesh.indices)
        self._welded: tuple[Buffer, ...] = ()  # places and indices for programs that read nothing else, once one came
        self._arrays: dict[Program, VertexArray] = {}
        self.defines = (
            *((TANGENTS,) if "tangent" in self._waiting else ()),
            *(("VERTEX_COLORS",) if "colors" in self._attributes else ()),
        )

        self._morph_arrays = (mesh.target_positions, mesh.target_normals)
        self._morph_texels: Texture | None = None
        self._vertex_count, self._target_count = mesh.vertex_count, mesh.target_count

    def use_targets(self, program: Program) -> None:
        """Shows the offsets of its morph targets to a program."""
        if self._morph_texels is None:
            positions, normals = self._morph_arrays
            assert positions is not None
            assert normals is not None
            offsets = np.zeros((self._target_count * self._vertex_count, 2, 4), np.float32)
            offsets[:, 0, :3], offsets[:, 1, :3] = positions.reshape(-1, 3), normals.reshape(-1, 3)
            self._morph_texels = _texels(self._context, offsets.reshape(-1, 4), MORPH_WIDTH)
        self._morph_texels.use(TEXTURE_UNITS["morph_texels"])
        program.set("vertex_count", self._vertex_count)
        program.set("target_count", self._target_count)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to draw."""
        return self._count == 0

    def vertex_array(self, program: Program) -> VertexArray:
        """How `program` reads it."""
        array = self._arrays.get(program)
        if array is None:
            array = self._arrays[program] = self._array_for(program)
        return array

    def _array_for(self, program: Program) -> VertexArray:
        if not any(map(program.reads, _PER_CORNER)):
            if self._corners is not None:
                found, self._corners = welded(*self._corners), None
                self._welded = tuple(Buffer(self._context, array) for array in found) if found else ()
            if self._welded:
                positions, indices = self._welded
                return VertexArray(
                    self._context, program, {"positions": positions}, indices, self._count, mode=self._topology
                )
        for attribute in [waiting for waiting in self._waiting if program.reads(waiting)]:
            name, values = self._waiting.pop(attribute)
            self._attributes[name] = Buffer(self._context, np.ascontiguousarray(values, np.float32))
        return VertexArray(self._context, program, self._attributes, self._indices, self._count, mode=self._topology)


class Resources:
    """Caches of one context. What is still on its way is None, and drawn without."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.frame = Buffer(context, size=1 << 10)
        self._used_by: tuple[RenderWorld, int] | None = None  # a world and its scene, whose names are in use
        self._poses: Texture | None = None
        self._posed: tuple[RenderWorld, int, int] | None = None
        self._geometries: dict[tuple[str, int | None], Geometry] = {}  # by mesh and uv set of computed tangents
        self._textures: dict[tuple[str, bool, Sampling], Texture] = {}
        self._checker: Texture | None = None
        self.overlay_images = OverlayImages(context)
        self.programs = ProgramCache(context)
        self.placing = InstancePlacing(context, self.programs)

    def program(self, vertex: str, fragment: str, defines: tuple[str, ...] = ()) -> Program:
        """The program of two shader files, compiled with `defines` at its first use."""
        return self.programs.program(vertex, fragment, defines)

    def geometry(self, world: RenderWorld, batch: Batch) -> Geometry | None:
        """The mesh of a batch on the card; None while it is not here, or if it has nothing to draw."""
        key = (batch.mesh, batch.look.tangent_uvs)
        geometry = self._geometries.get(key)
        if geometry is None:
            arrays = world.assets.mesh(batch.mesh)
            if arrays is None:
                return None
            if arrays.tangents is None and key[1] is not None and arrays.is_surface:
                arrays = with_tangents(arrays, uv_set=key[1])
            try:
                geometry = self._geometries[key] = Geometry(self.context, arrays)
            except DisplayError as error:
                world.assets.give_up(batch.mesh, str(error))
                return None
        return None if geometry.is_empty else geometry

    def show_poses(self, world: RenderWorld) -> None:
        """Shows to the shaders what bends and morphs the world's meshes, as it is placed now."""
        texels = world.pose_texels
        if not len(texels):
            return
        posed = (world, world.scene_version, world.pose_version)
        if self._posed != posed:
            self._posed = posed
            rows = -(-len(texels) // POSE_WIDTH)
            if self._poses is not None and self._poses.size[1] == rows:
                self._poses.write(_padded(texels, POSE_WIDTH))
            else:
                self._poses = _texels(self.context, texels, POSE_WIDTH)
        assert self._poses is not None
        self._poses.use(TEXTURE_UNITS["pose_texels"])

    def bind_textures(self, world: RenderWorld, look: Look) -> tuple[str, ...]:
        """Shows the images of a look to the shaders; returns the definitions for those that are here, and for the rest of it."""
        if look.is_plain:
            return ()
        return variant_of(look, self._present(world, look) if look.is_textured else ())[0]

    def takes_textures(self, world: RenderWorld, look: Look) -> bool:
        """Puts the images of a look that have come onto the card; whether all are there that can be had."""
        present = self._present(world, look)
        missing = [
            named.image
            for field, text in zip(TEXTURE_FIELDS, look.textures, strict=True)
            if field not in present and (named := texture_of(text)) is not None
        ]
        return all(image in world.assets.failed for image in missing)

    def set_look(self, program: Program, look: Look, defines: tuple[str, ...]) -> None:
        """Gives a program the numbers of a look that was bound, with the definitions that came of it."""
        if not defines:
            return
        present = tuple(field for field in TEXTURE_FIELDS if field.upper() in defines)
        for name, value in variant_of(look, present)[1]:
            program.set(name, value)

    def _present(self, world: RenderWorld, look: Look) -> tuple[str, ...]:
        present = []
        for (field, is_color), text in zip(TEXTURE_FIELDS.items(), look.textures, strict=True):
            named = texture_of(text)
            if named is None:
                continue
            texture = self._texture(world, named.image, is_color, named.sampling)
            if texture is not None:
                texture.use(TEXTURE_UNITS[field])
                present.append(field)
        return tuple(present)

    def forget_unused(self, world: RenderWorld) -> None:
        """Frees what the world does not name any more; does nothing while its scene is the same as last time."""
        if self._used_by == (world, world.scene_version):
            return
        self._used_by = (world, world.scene_version)
        named = {split_texture(text)[0] for batch in world.batches for text in batch.look.textures}
        self._textures = {key: texture for key, texture in self._textures.items() if key[0] in named}
        meshes = {(batch.mesh, batch.look.tangent_uvs) for batch in world.batches}
        self._geometries = {key: geometry for key, geometry in self._geometries.items() if key in meshes}

    def _texture(self, world: RenderWorld, reference: str, is_color: bool, sampling: Sampling) -> Texture | None:
        """An image on the card; a checker for a colour that cannot be had, None for what is on its way or holds no colour."""
        key = (reference, is_color, sampling)
        if key not in self._textures:
            pixels = world.assets.take_image(reference)
            if pixels is None:
                return self._placeholder() if is_color and reference in world.assets.failed else None
            pixels = self._fitting(world, reference, pixels, is_color=is_color)
            height, width = pixels.shape[:2]
            form: Format = "srgba8" if is_color else "rgba8"
            repeat = (sampling.wrap[0] == "repeat", sampling.wrap[1] == "repeat")
            try:
                texture = Texture(self.context, (width, height), form, data=pixels)
                texture.sample(repeat=repeat, magnify=sampling.magnify, minify=sampling.minify)
            except DisplayError as error:
                world.assets.give_up(reference, str(error))
                return self._placeholder() if is_color else None
            self._textures[key] = texture
        return self._textures[key]

    def _fitting(
        self, world: RenderWorld, reference: str, pixels: NDArray[np.uint8], *, is_color: bool
    ) -> NDArray[np.uint8]:
        """The pixels as large as the card takes them; says so where that is not as they are."""
        largest = self.context.max_size
        if max(pixels.shape[:2]) <= largest:
            return pixels
        made = shrunk(pixels, largest, is_color=is_color)
        _log.warning(
            "%s, %s, of %d x %d pixels is drawn with %d x %d: this card takes edges up to %d",
            world.assets.told(reference),
            _use_of(world, reference),
            *pixels.shape[1::-1],
            *made.shape[1::-1],
            largest,
        )
        return made

    def _placeholder(self) -> Texture:
        if self._checker is None:
            pixels = decode_image(placeholder_image())
            self._checker = Texture(self.context, pixels.shape[1::-1], "srgba8", data=pixels, mipmaps=True, repeat=True)
        return self._checker


def _use_of(world: RenderWorld, reference: str) -> str:
    """What a scene needs an image for, in words."""
    for batch in world.batches:
        for field, text in zip(TEXTURE_FIELDS, batch.look.textures, strict=True):
            if text and split_texture(text)[0] == reference:
                return f"the {field} of entity {world.entity[batch.first]}"
    return "an image"


def _texels(context: Context, texels: NDArray[np.float32], width: int) -> Texture:
    """A texture of (N, 4) numbers, row by row."""
    rows = _padded(texels, width)
    return Texture(context, (width, len(rows)), "rgba32f", data=rows, smooth=False)


def _padded(texels: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """(rows, width, 4)"""
    rows = np.zeros((-(-len(texels) // width), width, 4), np.float32)
    rows.reshape(-1, 4)[: len(texels)] = texels
    return rows
