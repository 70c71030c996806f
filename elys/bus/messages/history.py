"""What can be undone: kept by the host for every author, so that an editor that dies or leaves finds it again."""

from __future__ import annotations

import msgspec


class HistoryRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks for the history of a person's editor: a node's own, that of one of the same person that is gone, or a new one."""

    person: str
    node: str


class HistoryEntry(msgspec.Struct, frozen=True, kw_only=True):
    """An edit that can be taken back or made again, and what names the scene's content when it is made."""

    label: str
    content: int


class HistoryReply(msgspec.Struct, frozen=True, kw_only=True):
    """What an author can undo, the oldest first, and redo, what comes next last; and what is known of the scene's file.

    Attributes:
        author: what commands are to be sent as; empty where nothing can be edited.
        initial: what names the scene's content before the first of these edits.
        saved: what names the content that the file has.
        path: the file, on `machine`; empty if there is none.
    """

    author: str
    undoable: tuple[HistoryEntry, ...] = ()
    redoable: tuple[HistoryEntry, ...] = ()
    initial: int = 0
    saved: int = 0
    path: str = ""
    machine: str = ""
