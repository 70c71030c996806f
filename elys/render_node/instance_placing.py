"""Puts instances where they are seen, on the card: columns of state frames go there as they came, once each, and a vertex shader
(`instance_place.vert`) works out the rows that passes read.

The 64 bits of a position are taken apart there, and differences to the eye made of both halves (Cozzi and Ring, 3D Engine Design
for Virtual Globes, 2011, chapter 5): what is near the eye is as exact as on the processor.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.render_node.gpu import (
    INSTANCE_DTYPE,
    TEXTURE_UNITS,
    Buffer,
    Capture,
    Context,
    Field,
    Program,
    ProgramCache,
    Texture,
)
from elys.render_node.instance_rows import ITEM_DTYPE, InstanceRows
from elys.render_node.picture_plan import PicturePlan
from elys.render_node.render_world import RenderWorld
from elys.render_node.timeline import Timeline

BODIES_A_ROW: Final = 512  # of a texture of poses; as instance_place.vert has it
LED_WIDTH: Final = 1024  # texels of a row; likewise
MOST_PARTS: Final = 64  # that are written by themselves; what is scattered more is written as a whole
_FIELDS: Final = {
    "local_x": (0, "f", "4f4", "affine", 0),
    "local_y": (1, "f", "4f4", "affine", 16),
    "local_z": (2, "f", "4f4", "affine", 32),
    "low": (3, "f", "3f4", "low", 0),
    "body": (4, "i", "2i4", "body", 0),
    "base_color": (5, "f", "4f4", "base_color", 0),
    "reflection": (6, "f", "2f4", "reflection", 0),
    "emissive": (7, "f", "4f4", "emissive", 0),
    "entity": (8, "i", "1u4", "entity", 0),
    "pose": (9, "i", "2i4", "pose", 0),
}
_PLAIN: Final = ("row_x", "row_y", "row_z", "row_base", "row_reflection")  # of PLAIN_INSTANCE_DTYPE
_WHOLE: Final = (*_PLAIN, "row_emissive", "row_entity", "row_pose")  # of INSTANCE_DTYPE


class InstancePlacing:
    """Of one context. The rows it writes stay in `rows` until the next picture.

    What frames told is kept for one world at a time: who draws several in turns sends it again for each.
    """

    def __init__(self, context: Context, programs: ProgramCache) -> None:
        self._context, self._programs = context, programs
        self.rows = Buffer(context, size=1 << 16)
        self._items, self._order = Buffer(context, size=1 << 12), Buffer(context, size=1 << 12)
        self._captures: dict[Program, Capture] = {}
        self._poses = [_FramePoses(context), _FramePoses(context)]
        self._led: Texture | None = None
        self._world: RenderWorld | None = None
        self._item_version = -1
        self._led_version = -1
        self._ordered: NDArray[np.uint32] | None = None
        self._done: tuple[object, ...] = ()

    def place(self, plan: PicturePlan) -> None:
        """Writes the rows of a plan; does nothing where they stand there already."""
        world, rows = plan.world, plan.rows
        items = world.standing.card_rows()
        done = (items.version, world.pose_version, plan.view.eye.tobytes(), plan.layout.itemsize)
        if self._world is not world:
            self._world, self._done, self._item_version, self._led_version = world, (), -1, -1
        if (self._done == done and self._ordered is rows) or not len(rows):
            return
        if self._item_version != items.version:
            self._write(items)
        if self._ordered is not rows:
            self._ordered = rows
            self._order.write(rows)
        self.rows.reserve(len(rows) * plan.layout.itemsize)
        program = self._program(plan, rides=items.rides)
        self._show(program, plan)
        capture = self._captures.get(program)
        if capture is None:
            self._captures = {known: kept for known, kept in self._captures.items() if known in self._programs}
            capture = self._captures[program] = Capture(
                self._context, program, self._items, ITEM_DTYPE, self._order, _fields()
            )
        capture.run(self.rows, len(rows))
        self._done = done

    def _write(self, rows: InstanceRows) -> None:
        """Brings what the card knows of the instances up to date."""
        changed = rows.changed_since(self._item_version)
        self._item_version, items = rows.version, rows.items
        parts = [] if changed is None else np.split(changed, np.flatnonzero(np.diff(changed) > 1) + 1)
        if changed is None or len(parts) > MOST_PARTS:
            self._items.write(items)
            return
        for part in parts:
            first, last = part[0], part[-1]
            self._items.write_part(items[first : last + 1], int(first) * ITEM_DTYPE.itemsize)

    def _program(self, plan: PicturePlan, *, rides: bool) -> Program:
        is_whole = plan.layout is INSTANCE_DTYPE
        terms = {
            "WHOLE_ROWS": is_whole,
            "RIDING": rides,
            "SPUN": rides and plan.world.timeline.spins,
            "LED": plan.world.standing.is_leading,
        }
        defines = tuple(term for term, holds in terms.items() if holds)
        return self._programs.program("instance_place.vert", "", defines, captured=_WHOLE if is_whole else _PLAIN)

    def _show(self, program: Program, plan: PicturePlan) -> None:
        """Gives the program what it needs besides the rows."""
        world, eye = plan.world, plan.view.eye
        high = eye.astype(np.float32)
        program.set("eye_high", tuple(high.tolist()))
        program.set("eye_low", tuple((eye - high).tolist()))
        if world.standing.is_leading:
            self._show_led(world)
        if program.reads("positions_now"):
            self._show_bodies(program, world.timeline, world.standing.fraction)

    def _show_bodies(self, program: Program, timeline: Timeline, fraction: float) -> None:
        newest, before = timeline.newest, timeline.previous
        assert newest is not None
        is_between = before is not None and fraction != 1.0 and len(before.entity) > 0
        program.set("behind", 1.0 - fraction if is_between else 0.0)
        spins = program.reads("spins_now")
        self._poses_of(newest, (before,)).use("now", spins=spins)
        self._poses_of(before if is_between and before is not None else newest, (newest,)).use("before", spins=spins)
        if spins:
            program.set("half_gap", timeline.gap / 2.0)

    def _poses_of(self, frame: StateFrame, kept: tuple[StateFrame | None, ...]) -> _FramePoses:
        """Textures that hold a frame; those of the `kept` frames stay as they are."""
        for poses in self._poses:
            if poses.frame is frame:
                return poses
        free = next(poses for poses in self._poses if poses.frame is None or all(poses.frame is not k for k in kept))
        free.hold(frame)
        return free

    def _show_led(self, world: RenderWorld) -> None:
        if self._led_version != world.pose_version:
            self._led_version = world.pose_version
            texels = world.standing.led_texels
            height = -(-len(texels) // LED_WIDTH)
            if self._led is None or self._led.size[1] < height:
                self._led = Texture(self._context, (LED_WIDTH, height), "rgba32f", smooth=False)
            self._led.write_first(texels)
        assert self._led is not None
        self._led.use(TEXTURE_UNITS["led_texels"])


class _FramePoses:
    """The columns of one state frame as textures."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self.frame: StateFrame | None = None
        self._height = 0
        self._has_spins = False

    def hold(self, frame: StateFrame) -> None:
        """Takes another frame."""
        height = -(-len(frame.entity) // BODIES_A_ROW)
        if height > self._height:
            self._height = height
            self._positions = Texture(self._context, (3 * BODIES_A_ROW, height), "rg32ui", smooth=False)
            self._rotations = Texture(self._context, (BODIES_A_ROW, height), "rgba32f", smooth=False)
            self._spins = Texture(self._context, (BODIES_A_ROW, height), "rgb32f", smooth=False)
        self.frame, self._has_spins = frame, False
        words = np.ascontiguousarray(frame.position, "<f8").reshape(-1, 1).view(np.uint32)
        self._positions.write_first(words)
        self._rotations.write_first(np.ascontiguousarray(frame.rotation, np.float32))

    def use(self, when: str, *, spins: bool) -> None:
        """Shows them to the samplers of the frame that is `now` or `before`."""
        self._positions.use(TEXTURE_UNITS[f"positions_{when}"])
        self._rotations.use(TEXTURE_UNITS[f"rotations_{when}"])
        if spins:
            if not self._has_spins:
                assert self.frame is not None
                self._has_spins = True
                self._spins.write_first(np.ascontiguousarray(self.frame.angular_velocity, np.float32))
            self._spins.use(TEXTURE_UNITS[f"spins_{when}"])


def _fields() -> dict[str, Field]:
    fields = ITEM_DTYPE.fields
    assert fields is not None
    return {
        name: Field(location, kind, form, fields[column][1] + offset)
        for name, (location, kind, form, column, offset) in _FIELDS.items()
    }
