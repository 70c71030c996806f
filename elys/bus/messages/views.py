"""Views: pictures that a render node draws for somebody else."""

from __future__ import annotations

from typing import Annotated, Final, Literal

import msgspec

from elys.common.components import Quat, Vec3
from elys.common.scene import EntityRecord, SceneSettings

# What a picture says of the surfaces seen: the light they send, or their data. See docs/picture-output.md.
Shows = Literal["shaded", "normals", "albedo", "roughness", "depth", "entity", "segmentation", "wireframe", "overdraw"]
# What can be drawn over it in lines and letters. See docs/picture-output.md.
Debug = Literal[
    "aabb",
    "obb",
    "contacts",
    "forces",
    "joints",
    "trajectories",
    "velocity",
    "axes",
    "grid",
    "labels",
    "islands",
    "sleeping",
    "divergence",
]


Encoding = Literal["jpeg", "h264"]
FRAMED: Final = -1  # instead of an entity with a camera


class ViewCamera(msgspec.Struct, frozen=True, kw_only=True):
    """A point of view: looks along its local -z, y up."""

    position: Vec3
    rotation: Quat
    field_of_view: float = 0.9  # [rad] vertical
    ortho_height: float = 0.0  # [m] seen from below to above in a parallel view; 0 for one in perspective
    near: float = 0.05  # [m]
    far: float = 500.0  # [m]


class SharedRing(msgspec.Struct, frozen=True, kw_only=True):
    """Where pictures may be put without sending them: a memory file of the asking process, reachable on the same machine.

    A render node opens /proc/{process}/fd/{descriptor} if `machine` is its own boot id; where it cannot it sends JPEG.
    """

    machine: str
    process: int
    descriptor: int
    slot_count: int
    slot_size: int  # [bytes]


class ViewRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Draw this, please: sent whenever camera, size or selection change or the last picture has arrived; newest wins."""

    view: str
    sequence: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]  # comes back with the picture
    camera: ViewCamera | None = None  # none: through a camera of the scene, see `through`
    width: int
    height: int
    selection: tuple[int, ...] = ()
    hidden: tuple[int, ...] = ()  # these and all below them are not drawn
    grid: bool = True
    shows: Shows = "shaded"  # anything else is drawn without grid, outlines, lines and letters
    debug: tuple[Debug, ...] = ()
    debug_entities: tuple[int, ...] = ()  # of whom and of all below them; none for everybody
    ring: SharedRing | None = None
    through: int = (
        0  # the entity whose camera looks; 0: the scene's first, if it has any; FRAMED: none, all is to be seen
    )
    encoding: Encoding = "jpeg"  # of what is not put into a ring
    bit_rate: float = 0.0  # [bit/s] that H.264 may take; 0: as much as it needs
    keyframe: bool = False  # a picture of the stream that can be seen without those before it, as after a loss
    player: int = 1  # whose overlays are seen, with those of everybody
    newer_than_tick: int = -1  # the picture may wait until there is a later tick than this (or the scene changed)


class ViewFrame(msgspec.Struct, frozen=True, kw_only=True):
    """A picture, stamped with what it shows: draw overlays with THIS camera. In ring slot `slot`, as JPEG or as H.264.

    H.264 is a stream of its view: Annex B, one picture a message, without B frames, edges rounded up to even numbers. Picture
    `number` can be seen after `number` - 1, or by itself if it is a keyframe.
    """

    view: str
    sequence: int
    tick: int
    state_published_at: int  # [ns] wall clock of the state it shows, for the latency
    camera: ViewCamera
    width: int
    height: int
    slot: int = -1
    jpeg: bytes = b""
    h264: bytes = b""
    number: int = 0
    keyframe: bool = False
    render_time: float = 0.0  # [ms]
    simulation_time: float = 0.0  # [s] of the tick
    answer_time: float = 0.0  # [ms] from the request's arrival until this was sent: the rest is the way's


class PickRequest(msgspec.Struct, frozen=True, kw_only=True):
    """What is seen at pixel x, y (from the top left) of a view of this camera and size?"""

    camera: ViewCamera
    width: int
    height: int
    x: int
    y: int
    passed_over: tuple[int, ...] = ()  # what is seen behind these, and all below them, counts


class PickReply(msgspec.Struct, frozen=True, kw_only=True):
    """The entity seen there (0: none) and the point in world space that was hit."""

    entity: int
    position: Vec3 = (0.0, 0.0, 0.0)
    tick: int = -1
    name: str = ""  # of the entity


class ThumbnailRequest(msgspec.Struct, frozen=True, kw_only=True):
    """What do these entities look like, which are in no scene? They are seen through the camera that is among them.

    `contents` are the meshes and images that they name, by reference; what is missing is drawn without. Who asks may make
    images smaller than what the references name: nobody keeps them.
    """

    records: tuple[EntityRecord, ...]
    contents: dict[str, bytes] = {}
    settings: SceneSettings = SceneSettings()
    size: int = 128  # [pixels] of an edge


class Thumbnail(msgspec.Struct, frozen=True, kw_only=True):
    """A small square picture."""

    jpeg: bytes
