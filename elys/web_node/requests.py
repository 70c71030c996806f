"""What a browser may say. Whatever else comes is refused with a reason, and ends only its own connection."""

from __future__ import annotations

from typing import Annotated, Final, Literal

import msgspec
from msgspec import Meta

from elys.bus.messages.commands import (
    AddComponent,
    Despawn,
    Redo,
    RemoveComponent,
    Rename,
    Resume,
    Seek,
    SetComponent,
    SetEnabled,
    SetLoop,
    SetPlaying,
    SetRate,
    StepTicks,
    Undo,
)
from elys.bus.messages.views import Encoding, ViewCamera
from elys.common.errors import MessageError

MOST_BYTES: Final = 64 << 10  # of a message
MOST_ROWS: Final = 200  # of the tree that are asked for at once
_LONGEST_REASON: Final = 120  # bytes: what a closing frame holds, less its code

Number = Annotated[int, Meta(ge=0, le=2**53 - 1)]
Entity = Annotated[int, Meta(ge=0, le=2**32 - 1)]
Pixels = Annotated[int, Meta(ge=1, le=8192)]
Place = Annotated[int, Meta(ge=0, le=8192)]
Coordinate = Annotated[float, Meta(ge=-1e12, le=1e12)]


class Look(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="look"):
    """What is to be seen from now on; pictures that show it carry its number, or a later one's."""

    number: Number
    camera: ViewCamera | None = None  # none: the scene's own
    framed: bool = False  # instead of the scene's own: all that there is
    width: Pixels
    height: Pixels
    selection: Annotated[tuple[Entity, ...], Meta(max_length=256)] = ()
    encoding: Encoding = "jpeg"
    is_seen: bool = True  # the page is in sight: nothing is drawn for one that is not


class Shown(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="shown"):
    """A picture has been shown, or given up: another may come. `lost`: the stream needs a keyframe."""

    picture: Number
    lost: bool = False


class Pick(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="pick"):
    """What is seen at a pixel of a picture of this camera and size?"""

    id: Number
    camera: ViewCamera
    width: Pixels
    height: Pixels
    x: Place
    y: Place


class Rows(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="rows"):
    """The lines of the tree that are in sight; they are told now and whenever they change."""

    first: Number
    count: Annotated[int, Meta(ge=0, le=MOST_ROWS)]
    search: Annotated[str, Meta(max_length=200)] = ""


class Open(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="open"):
    """Opens or closes a line of the tree; with `all_below` all that is below it too, of 0 everything."""

    entity: Entity
    is_open: bool
    all_below: bool = False


class Reveal(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="reveal"):
    """Opens all above an entity, and asks at which line it stands."""

    entity: Entity


class Inspect(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="inspect"):
    """The entity whose components are told, now and whenever they change; 0 for none."""

    entity: Entity


TimeCommand = SetPlaying | StepTicks | Seek | SetRate | SetLoop | Resume
EditCommand = SetComponent | AddComponent | RemoveComponent | Rename | SetEnabled | Despawn | Undo | Redo


class Ask(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="ask"):
    """A command for the host, and from which revision of the scene it was made."""

    id: Number
    command: TimeCommand | EditCommand
    label: Annotated[str, Meta(max_length=200)] = ""
    stroke: Annotated[str, Meta(max_length=40)] = ""
    made_from: Annotated[int, Meta(ge=-1, le=2**53 - 1)] = -1


class Keys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="keys"):
    """What the keyboard and the mouse did since the last such message, for the game."""

    changes: Annotated[tuple[tuple[Annotated[str, Meta(max_length=32)], bool], ...], Meta(max_length=200)] = ()
    moved: Annotated[dict[Literal["pointer_x", "pointer_y", "wheel_x", "wheel_y"], Coordinate], Meta(max_length=4)] = {}
    text: Annotated[str, Meta(max_length=200)] = ""
    lets_go: bool = False


class Ping(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="ping"):
    """Comes back at once, for the round trip."""

    time: Annotated[float, Meta(ge=0.0, le=1e15)]


Request = Look | Shown | Pick | Rows | Open | Reveal | Inspect | Ask | Keys | Ping
_decoder: Final = msgspec.json.Decoder(Request)


def request_from(text: str) -> Request:
    """What a message says. Raises MessageError with a reason that fits a closing frame."""
    try:
        return _decoder.decode(text)
    except (msgspec.DecodeError, msgspec.ValidationError, UnicodeError, RecursionError) as error:
        raise MessageError(closing_reason(f"this is no request: {error}")) from error


def closing_reason(text: str) -> str:
    """As much of a sentence as a WebSocket's closing frame holds."""
    return text.encode(errors="replace")[:_LONGEST_REASON].decode(errors="ignore")
