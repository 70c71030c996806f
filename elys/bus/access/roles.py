"""What somebody may do in a session. Each role may do all that those before it may.

Whoever comes in is known by a user name, `{role}-{six letters}`, that a secret or a certificate proves. Nodes carry it in their
ids (`editor-3fa2b1.viewer-k3x9ab`), and so in every key that names a node: the router lets nobody use another user's.
"""

from __future__ import annotations

import enum
from typing import Final

_MARK: Final = "."  # between what a node calls itself and its user: in neither of them


class Role(enum.IntEnum):
    """Viewers look and record, players also send input, editors also change, owners also replace scenes and write files."""

    VIEWER = 1
    PLAYER = 2
    EDITOR = 3
    OWNER = 4
    HOST = 5  # the process that hosts the session: no role that anybody could be given

    @property
    def title(self) -> str:
        """As people read and write it."""
        return self.name.lower()


GIVEN: Final = (Role.VIEWER, Role.PLAYER, Role.EDITOR, Role.OWNER)  # those that keys are made for
PURPOSES: Final = {
    Role.VIEWER: "watches, records and asks for pictures",
    Role.PLAYER: "also sends input to the game",
    Role.EDITOR: "also changes the scene, plays and pauses, and draws for others",
    Role.OWNER: "also puts another scene in its place and has files written on the host",
}


def role_named(text: str) -> Role:
    """The role of that name; ValueError naming those there are."""
    for role in GIVEN:
        if role.title == text:
            return role
    raise ValueError(f"there is no role '{text}': there are {', '.join(role.title for role in GIVEN)}")


def role_of_user(user: str) -> Role:
    """What a user may do. "" is who was not asked for a name: where access is not controlled everybody may do all."""
    return role_named(user.partition("-")[0]) if user else Role.OWNER


def signed_id(node: str, user: str) -> str:
    """The id of a node that is in a session as `user`; one that had another session's keeps what stood before it."""
    name = node.partition(_MARK)[0]
    return f"{name}{_MARK}{user}" if user else name


def user_of(node: str) -> str:
    """The user in a node's id, behind the last mark: only that part is proven. "" if it has none."""
    return node.rpartition(_MARK)[2] if _MARK in node else ""


def role_of_node(node: str) -> Role:
    """What the node of that id may do; what names no role may nothing but watch."""
    try:
        return role_of_user(user_of(node))
    except ValueError:
        return Role.VIEWER


def ids_of(user: str) -> str:
    """The key expression of all node ids of a user."""
    return f"$*{_MARK}{user}" if user else "*"
