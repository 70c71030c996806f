"""Commands: everything a person or a program may ask of a running session. Each is answered: accepted, or why not."""

from __future__ import annotations

from typing import Any, Final

import msgspec

from elys.bus.access.roles import Role
from elys.common.components import Vec3
from elys.common.scene import EntityRecord, SceneSettings


class SetComponent(msgspec.Struct, frozen=True, kw_only=True, tag="set_component"):
    """Changes fields of a component the entity has; fields not named stay."""

    entity: int
    component: str
    values: dict[str, Any]


class AddComponent(msgspec.Struct, frozen=True, kw_only=True, tag="add_component"):
    """Gives an entity a component it has not."""

    entity: int
    component: str
    values: dict[str, Any] = {}


class RemoveComponent(msgspec.Struct, frozen=True, kw_only=True, tag="remove_component"):
    """Takes a component away."""

    entity: int
    component: str


class Spawn(msgspec.Struct, frozen=True, kw_only=True, tag="spawn"):
    """Makes entities from records (parents first); those without a parent among them go under `parent`, at `index` if it is >= 0.

    The reply carries the new ids in the records' order: those of `entities`, one for each record, if all of them lived before and
    nobody has used their places since (so that what was ended comes back as what it was), and new ones otherwise.
    """

    records: tuple[EntityRecord, ...]
    parent: int = 0
    index: int = -1
    entities: tuple[int, ...] = ()


class Despawn(msgspec.Struct, frozen=True, kw_only=True, tag="despawn"):
    """Ends an entity and all below it."""

    entity: int


class Rename(msgspec.Struct, frozen=True, kw_only=True, tag="rename"):
    """Gives an entity another name."""

    entity: int
    name: str


class Reparent(msgspec.Struct, frozen=True, kw_only=True, tag="reparent"):
    """Moves an entity under `parent` (0: to the roots), at `index` among its children (-1: last)."""

    entity: int
    parent: int
    index: int = -1
    keep_world_pose: bool = True


class SetEnabled(msgspec.Struct, frozen=True, kw_only=True, tag="set_enabled"):
    """Switches an entity, and with it all below it."""

    entity: int
    enabled: bool


class SetSettings(msgspec.Struct, frozen=True, kw_only=True, tag="set_settings"):
    """Changes the scene's settings (gravity, substeps, background, ...)."""

    settings: SceneSettings


class SetPlaying(msgspec.Struct, frozen=True, kw_only=True, tag="set_playing"):
    """Play or pause."""

    playing: bool


class StepTicks(msgspec.Struct, frozen=True, kw_only=True, tag="step_ticks"):
    """While paused: go on by `count` ticks; with a negative count back, as far as a replay or a flight recorder goes."""

    count: int = 1


class Seek(msgspec.Struct, frozen=True, kw_only=True, tag="seek"):
    """Go to a simulation time [s] of a replay, or of what a simulation's flight recorder keeps; that pauses a simulation."""

    time: float


class SetRate(msgspec.Struct, frozen=True, kw_only=True, tag="set_rate"):
    """How many seconds of simulation pass in one second."""

    rate: float


class SetLoop(msgspec.Struct, frozen=True, kw_only=True, tag="set_loop"):
    """Replay only: start again at the end."""

    loop: bool


class SetRange(msgspec.Struct, frozen=True, kw_only=True, tag="set_range"):
    """Replay only: play, and loop, from `start` to `end` [s]; None for the recording's own. Seeking and stepping go beyond."""

    start: float | None = None
    end: float | None = None


Edit = (
    SetComponent | AddComponent | RemoveComponent | Spawn | Despawn | Rename | Reparent | SetEnabled | SetSettings
)  # what changes a scene


class Batch(msgspec.Struct, frozen=True, kw_only=True, tag="batch"):
    """Several edits at one tick's start, in this order: all of them, or none if one is refused.

    The reply carries the new ids of all that is spawned.
    """

    edits: tuple[Edit, ...]


class Undo(msgspec.Struct, frozen=True, kw_only=True, tag="undo"):
    """Takes the author's last edit back; `force` does so though somebody else has changed since what it changed."""

    force: bool = False


class Redo(msgspec.Struct, frozen=True, kw_only=True, tag="redo"):
    """Makes again what the author took back last; `force` as in Undo."""

    force: bool = False


class LoadScene(msgspec.Struct, frozen=True, kw_only=True, tag="load_scene"):
    """Puts another scene in the place of what is there; time goes on, and all that could be undone is forgotten.

    Assets that the records name must be with the host (see `topics.ASSET_OFFER`). `path` is the file it came from, if from one.
    """

    name: str
    records: tuple[EntityRecord, ...]
    settings: SceneSettings = SceneSettings()
    path: str = ""


class NoteSaved(msgspec.Struct, frozen=True, kw_only=True, tag="note_saved"):
    """Says that a file holds the scene as it was edited up to `content` (see `Snapshot.content`)."""

    path: str
    content: int


class Rewind(msgspec.Struct, frozen=True, kw_only=True, tag="rewind"):
    """Simulation only: pause, and go to a tick that the flight recorder keeps."""

    tick: int


class Resume(msgspec.Struct, frozen=True, kw_only=True, tag="resume"):
    """Simulation only: go on from here as a fork. What the flight recorder keeps of later is forgotten."""


class KeepLast(msgspec.Struct, frozen=True, kw_only=True, tag="keep_last"):
    """Simulation only: write the last seconds down as a recording of their own. The event `kept` says where."""


class Grab(msgspec.Struct, frozen=True, kw_only=True, tag="grab"):
    """Simulation only: a hand holds a body at a point of it and pulls it in every tick, until released or its holder is gone.

    The host fills in the holder: whoever asked. Who grabs again moves the hand, or takes another body instead.
    """

    entity: int
    anchor: Vec3  # the point, in the entity's axes from its origin [m]
    target: Vec3  # where in the world it is pulled [m]
    stiffness: float = 100.0  # [N/(m kg)] for each kilogram felt at the point
    holder: str = ""


class Release(msgspec.Struct, frozen=True, kw_only=True, tag="release"):
    """Simulation only: the hand lets go. The host fills in whose."""

    holder: str = ""


class Input(msgspec.Struct, frozen=True, kw_only=True, tag="input"):
    """Simulation only: what a player's keys, buttons, pointer, wheel and sticks did since the last such message, in order.

    Names are those of `elys.common.input_names`. What is held stays so until it is let go, or until who said it is gone; the host
    fills in who: its node.
    """

    player: int
    lets_go: bool = False  # of all that is held, before anything else
    changes: tuple[tuple[str, bool], ...] = ()  # keys and buttons that went down (true) or up, in order
    moved: dict[str, float] = {}  # how far, by MOTIONS
    axes: dict[str, float] = {}  # where sticks stand now, by AXES; those not named stay
    text: str = ""  # that was typed
    bindings: dict[str, str] | None = None  # controls by name, all that the player has chosen himself; None: as before
    source: str = ""
    sequence: int = 0  # of the node's messages for this player, from 1; 0: not told
    seen_time: float = -1.0  # [s] of simulation that the player saw when it was done; below 0: not told
    done_at: float = 0.0  # [s since 1970] by the host's clock, as the sender knows it; 0: not told


class Tell(msgspec.Struct, frozen=True, kw_only=True, tag="tell"):
    """Simulation only: tells scripts an event, those of one entity or (0) all; they hear it in the next step.

    Values are numbers, texts, true, false, null and lists of such; entities are told by their ids. It is refused where a script
    that listens says that they are others.
    """

    kind: str
    entity: int = 0
    values: dict[str, Any] = {}


Hand = Grab | Release  # what changes how a simulation goes on, without being an edit of the scene
Time = (
    SetPlaying | StepTicks | Seek | SetRate | SetLoop | SetRange | Rewind | Resume | KeepLast
)  # what is asked of the clock
Command = Edit | Batch | Undo | Redo | LoadScene | NoteSaved | Time | Hand | Input | Tell


OWNERS_COMMANDS: Final = (LoadScene, KeepLast)  # replace all that is there, or write on the host's disk


def role_for(command: Command) -> Role:
    """What somebody must at least be to ask for it."""
    return Role.OWNER if isinstance(command, OWNERS_COMMANDS) else Role.EDITOR


class CommandRequest(msgspec.Struct, frozen=True, kw_only=True):
    """A command and who asks for it (a node's id).

    Edits of an `author` (see HistoryReply) can be undone by him: they are listed as `label`, and those of one `stroke` (a drag)
    as one. An edit that says which revision of the scene it was made from is refused where somebody else has changed since
    what it changes; -1 says nothing.
    """

    origin: str
    command: Command
    author: str = ""
    label: str = ""
    stroke: str = ""
    made_from: int = -1


class CommandReply(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a command: the tick at whose start it was applied, or why it was refused."""

    accepted: bool
    tick: int
    reason: str = ""
    entities: tuple[int, ...] = ()
    sequence: int = -1  # of the delta that contains it
    content: int = 0  # what names the scene's content after it
    is_conflict: bool = False  # refused because somebody else has changed it since
    new_ids: dict[int, int] = {}  # of entities that an undo or redo could not bring back under the ids they had


class CommandRecord(msgspec.Struct, frozen=True, kw_only=True):
    """A command with its answer, for recordings and for who looks over the shoulder.

    A simulation says in which of its beats the command was applied, so that it can be run again (docs/recording-format.md):
    a beat is commands and then a step, or while time stands still none, and leads from one instant to the next. Of an undo
    the command is what it did.
    """

    tick: int
    origin: str
    command: Command
    accepted: bool
    reason: str = ""
    epoch: int = 0
    number: int = -1  # of the changes of this epoch, from 1; -1: it changed nothing
    beat: int = -1  # the instant that its beat leads to; of what goes on as a fork, the instant from which it does
    previous: int = -1  # the beat of the change before it; -1: it is the first
    steps: bool = False  # whether the beat ends with a step
    fork: int = 0  # how many forks there were
    forked_from: int = -1  # the instant after which this command made another future
    physics_of: int = -1  # after its beat physics was put back to what it was at this instant
    is_broken: bool = False  # it failed in the middle: what it left, only the exact state after it tells
