"""What can be undone, by whom: the edits of every author with what takes them back, and who changed what last.

    perform ─> all edits of a command, or none ─> an entry on the author's list
    undo    ─> the entry's inverse, an edit like others ─> an entry on the list of what can be redone, and back

It lives with the scene and not in an editor: an editor that dies has lost nothing that was accepted, and who comes back, or
another editor of the same person, goes on with the same list.

Every part of the scene (`elys.bus.edit_parts`) that was ever edited has a stamp: `content`, a number that names its value (undo
brings the former number back with the former value), and by which edit and whom it was written last. An edit made from
revision N is refused where somebody else wrote after N. An undo is refused unless what it takes back is still there: the
contents that the entry left.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple, Protocol

from elys.bus.edit_parts import PLACE, Part, edits_of, parts_of
from elys.bus.messages.commands import Batch, Command, Despawn, Edit, Spawn
from elys.bus.messages.history import HistoryEntry, HistoryReply
from elys.common.errors import EditConflict, RequestError
from elys.sim_node.edit_renaming import target_of, with_new_ids

ENTRY_LIMIT: Final = 500  # for each author
AUTHOR_LIMIT: Final = 100
LABEL_LENGTH: Final = 200  # characters


class EditedScene(Protocol):
    """The scene that is edited."""

    def apply(self, edits: tuple[Edit, ...]) -> tuple[tuple[int, ...], tuple[Edit, ...]]:
        """All edits, or none and an ElysError: the new entities, and the edits that take it back."""

    def named(self, entity: int) -> str:
        """An entity as sentences call it."""

    def below(self, entity: int) -> Iterable[int]:
        """An entity and all below it; none where it does not live."""

    def edited(self, part: Part) -> Any:
        """What is remembered of a part beside its value: see EditedValues.of."""

    def recall(self, part: Part, memory: Any) -> None:
        """Remembers again what `edited` gave."""


class _Stamp(NamedTuple):
    content: int
    edit: int  # the number of the edit that wrote it last
    author: str


@dataclass(slots=True, kw_only=True)
class _Entry:
    """An edit that can be taken back by `edits` (or made again: the same the other way round)."""

    label: str
    stroke: str
    edits: tuple[Edit, ...]
    number: int  # of the edit that it takes back
    after: dict[Part, int]  # contents that must still be there
    before: dict[Part, int]  # contents that it brings back
    memories: dict[Part, Any]
    scene_after: int
    scene_before: int | None  # None: no content that ever was


@dataclass(slots=True)
class _Lists:
    person: str
    node: str
    undoable: list[_Entry] = field(default_factory=list)
    redoable: list[_Entry] = field(default_factory=list)

    def end_stroke(self) -> None:
        """What comes next is an entry of its own."""
        if self.undoable:
            self.undoable[-1].stroke = ""


class Done(NamedTuple):
    """What came of a command: the entities that came to be, the command as it can be repeated without any history."""

    entities: tuple[int, ...]
    command: Command
    new_ids: dict[int, int]


class EditHistory:
    """Of one scene. `revision` counts its edits, `content` names what they have made of it, `saved` what its file has."""

    def __init__(self, scene: EditedScene) -> None:
        self._scene = scene
        self._stamps: dict[int, dict[str, _Stamp]] = {}
        self._writer_of: dict[int, str] = {}  # of a content
        self._authors: dict[str, _Lists] = {}
        self.revision = 0
        self.content = 0
        self.saved = 0

    # --- who ---------------------------------------------------------------------------------------------------------

    def attach(self, person: str, node: str, *, alive: Iterable[str]) -> str:
        """The author that a node is: what it was, what a node of the same person was that is gone, or a new one."""
        there = set(alive)
        for author, lists in self._authors.items():
            if lists.node == node:
                return author
        for author, lists in reversed(self._authors.items()):
            if lists.person == person and lists.node not in there:
                lists.node = node
                return author
        if len(self._authors) >= AUTHOR_LIMIT:
            raise RequestError(
                f"{AUTHOR_LIMIT} people have edited this session already; close an editor that is not needed"
            )
        number = 1 + sum(lists.person == person for lists in self._authors.values())
        author = person if number == 1 else f"{person} ({number})"
        self._authors[author] = _Lists(person, node)
        return author

    def told_to(self, author: str) -> HistoryReply:
        """What an author can undo and redo."""
        lists = self._authors[author]
        entries = [(entry.label, entry.scene_after) for entry in lists.undoable]
        first = lists.undoable[0].scene_before if lists.undoable else self.content
        again = [(entry.label, -1 if entry.scene_before is None else entry.scene_before) for entry in lists.redoable]
        return HistoryReply(
            author=author,
            undoable=tuple(HistoryEntry(label=label, content=content) for label, content in entries),
            redoable=tuple(HistoryEntry(label=label, content=content) for label, content in again),
            initial=-1 if first is None else first,
            saved=self.saved,
        )

    def forget(self) -> None:
        """Another scene: nothing of what was done can be undone."""
        self._stamps.clear()
        self._writer_of.clear()
        for lists in self._authors.values():
            lists.undoable.clear()
            lists.redoable.clear()
        self.revision += 1
        self.content = self.saved = self.revision

    def forget_older(self) -> None:
        """An earlier instant is the newest again: only the edit made there, if any, can be undone."""
        self._stamps = {
            entity: kept
            for entity, stamps in self._stamps.items()
            if (kept := {part: stamp for part, stamp in stamps.items() if stamp.edit == self.revision})
        }
        for lists in self._authors.values():
            lists.undoable = [entry for entry in lists.undoable if entry.number == self.revision]
            lists.redoable.clear()

    # --- doing, undoing, redoing -------------------------------------------------------------------------------------

    def perform(self, command: Command, *, author: str, writer: str, label: str, stroke: str, made_from: int) -> Done:
        """Makes the edits of a command. They can be undone by `author`, if he is attached; `writer` is who sentences name.

        Raises:
            EditConflict: somebody else has changed since `made_from` what they change.
            ElysError: one of them is wrong. Nothing has changed then.
        """
        edits = edits_of(command)
        parts = parts_of(edits)
        if made_from >= 0:
            self._require_unchanged(parts, edits, since=made_from, by_other_than=writer)
        before = {part: self._content(part) for part in parts}
        memories = {part: self._scene.edited(part) for part in parts}
        entities, inverse = self._scene.apply(edits)
        self.revision += 1
        number, scene_before, self.content = self.revision, self.content, self.revision
        self._writer_of[number] = writer
        for entity, part in parts:
            self._stamp(entity, part, _Stamp(number, number, writer))
        for top in _tops(edits, entities):
            self._stamp(top, PLACE, _Stamp(number, number, writer))
        if author in self._authors:
            entry = _Entry(
                label=label[:LABEL_LENGTH] or "Edit",
                stroke=stroke,
                edits=inverse,
                number=number,
                after=dict.fromkeys(parts, number),
                before=before,
                memories=memories,
                scene_after=number,
                scene_before=scene_before,
            )
            self._remember(self._authors[author], entry)
        return Done(entities, command, {})

    def undo(self, author: str, *, force: bool = False) -> Done:
        """Takes an author's last edit back.

        Raises:
            RequestError: there is none.
            EditConflict: somebody else has changed since what it changed; with `force` it is taken back all the same.
            ElysError: it cannot be taken back, as what it changed is gone. Nothing has changed then, it stays listed.
        """
        lists = self._authors.get(author)
        if lists is None or not lists.undoable:
            raise RequestError("there is nothing to undo")
        done, entry = self._turn(lists.undoable[-1], author, force=force)
        lists.undoable.pop()
        lists.redoable.append(entry)
        lists.end_stroke()
        return done

    def redo(self, author: str, *, force: bool = False) -> Done:
        """Makes again what an author took back last; raises as `undo`."""
        lists = self._authors.get(author)
        if lists is None or not lists.redoable:
            raise RequestError("there is nothing to redo")
        done, entry = self._turn(lists.redoable[-1], author, force=force)
        lists.redoable.pop()
        lists.undoable.append(entry)
        lists.end_stroke()
        return done

    # --- inside ------------------------------------------------------------------------------------------------------

    def _turn(self, entry: _Entry, author: str, *, force: bool) -> tuple[Done, _Entry]:
        """Does what an entry says; and the entry that takes that back."""
        if not force:
            self._require_left(entry, author)
        was = {part: self._content(part) for part in entry.after}
        memories = {part: self._scene.edited(part) for part in entry.after}
        entities, inverse = self._scene.apply(entry.edits)
        self.revision += 1
        number = self.revision
        self._writer_of[number] = author
        is_whole = all(was[part] == content for part, content in entry.after.items())
        for (entity, part), content in entry.before.items():
            self._stamp(entity, part, _Stamp(content if is_whole else number, number, author))
            self._scene.recall((entity, part), entry.memories[entity, part])
        scene_was = self.content
        is_same = is_whole and scene_was == entry.scene_after and entry.scene_before is not None
        self.content = entry.scene_before if is_same and entry.scene_before is not None else number
        turned = _Entry(
            label=entry.label,
            stroke="",
            edits=inverse,
            number=number,
            after={part: self._content(part) for part in entry.after},
            before=was,
            memories=memories,
            scene_after=self.content,
            scene_before=scene_was,
        )
        new_ids = _new_ids(entry.edits, entities)
        if new_ids:
            self._follow(new_ids, turned)
        command = entry.edits[0] if len(entry.edits) == 1 else Batch(edits=entry.edits)
        return Done(entities, command, new_ids), turned

    def _remember(self, lists: _Lists, entry: _Entry) -> None:
        lists.redoable.clear()
        last = lists.undoable[-1] if lists.undoable else None
        if last is None or not entry.stroke or last.stroke != entry.stroke:
            lists.undoable.append(entry)
            del lists.undoable[:-ENTRY_LIMIT]
            return
        # The values from before the stroke are the ones to return to; only targets that are new to it are added.
        known = {target_of(edit) for edit in last.edits}
        last.edits = tuple(edit for edit in entry.edits if target_of(edit) not in known) + last.edits
        last.scene_before = last.scene_before if entry.scene_before == last.scene_after else None
        last.number, last.scene_after = entry.number, entry.scene_after
        last.after |= entry.after
        last.before = entry.before | last.before
        last.memories = entry.memories | last.memories

    def _require_unchanged(
        self, parts: Iterable[Part], edits: Iterable[Edit], *, since: int, by_other_than: str
    ) -> None:
        """Refuses what was made from an older scene than somebody else has made of it."""
        for entity, part in (*parts, *self._doomed(edits)):
            stamp = self._stamps.get(entity, {}).get(part)
            if stamp is not None and stamp.edit > since and stamp.author != by_other_than:
                raise EditConflict(self._sentence(entity, part, stamp.author, "look and try again"))

    def _require_left(self, entry: _Entry, author: str) -> None:
        for (entity, part), content in entry.after.items():
            if self._content((entity, part)) != content:
                who = self._writer_of.get(self._content((entity, part)), "somebody")
                raise EditConflict(self._sentence(entity, part, who, "its earlier value was not put back over that"))
        for entity, part in self._doomed(entry.edits):
            stamp = self._stamps[entity][part]
            if stamp.edit > entry.number and stamp.author != author:
                raise EditConflict(self._sentence(entity, part, stamp.author, "it was not ended with that"))

    def _doomed(self, edits: Iterable[Edit]) -> Iterable[Part]:
        """What has a stamp of the entities that edits end."""
        for edit in edits if self._stamps else ():
            if isinstance(edit, Despawn):
                for entity in self._scene.below(edit.entity):
                    for part in self._stamps.get(entity, ()):
                        yield entity, part

    def _sentence(self, entity: int, part: str, who: str, rest: str) -> str:
        whose = f"{self._scene.named(entity)}'s" if entity else "the scene's"
        return f"{whose} {part} {'were' if part.endswith('ings') else 'was'} changed by {who} meanwhile: {rest}"

    def _content(self, part: Part) -> int:
        stamp = self._stamps.get(part[0], {}).get(part[1])
        return stamp.content if stamp is not None else 0

    def _stamp(self, entity: int, part: str, stamp: _Stamp) -> None:
        self._stamps.setdefault(entity, {})[part] = stamp

    def _follow(self, new_ids: Mapping[int, int], turned: _Entry) -> None:
        """Renames entities in all that is remembered."""
        for old, new in new_ids.items():
            if old in self._stamps:
                self._stamps[new] = self._stamps.pop(old)
        entries = [entry for lists in self._authors.values() for entry in (*lists.undoable, *lists.redoable)]
        for entry in (*entries, turned):
            entry.edits = tuple(with_new_ids(edit, new_ids) for edit in entry.edits)
            entry.after, entry.before, entry.memories = (
                {(new_ids.get(entity, entity), part): value for (entity, part), value in values.items()}
                for values in (entry.after, entry.before, entry.memories)
            )


def _tops(edits: Iterable[Edit], entities: tuple[int, ...]) -> list[int]:
    """The topmost of the entities that edits made."""
    made, tops = iter(entities), []
    for edit in edits:
        if isinstance(edit, Spawn):
            tops += [entity for record, entity in zip(edit.records, made, strict=False) if record.parent < 0]
    return tops


def _new_ids(edits: Iterable[Edit], entities: tuple[int, ...]) -> dict[int, int]:
    """By the ids they had, the ids of those that came back under others."""
    had = [entity for edit in edits if isinstance(edit, Spawn) for entity in edit.entities]
    return {old: new for old, new in zip(had, entities, strict=False) if old != new}
