"""keys: who may come into this user's sessions: show, make, hand out, renew, revoke."""

from __future__ import annotations

import time
from pathlib import Path

import msgspec

from elys.bus.access.credentials import SUFFIX
from elys.bus.access.keyring import (
    Key,
    Keyring,
    changed_keyring,
    key_file,
    keyring_path,
    new_key,
    required_keyring,
    write_private,
)
from elys.bus.access.listening import keyring_with_authority, renewed_authority
from elys.bus.access.roles import GIVEN, PURPOSES, role_named
from elys.common.errors import AccessError
from elys.verbs.output import print_json, print_table


def listed(*, json: bool) -> None:
    """Prints who there is, without secrets."""
    keys = required_keyring().keys
    if json:
        print_json(
            [
                {"user": k.user, "role": k.role.title, "name": name_of(k), "made": k.made, "may": PURPOSES[k.role]}
                for k in keys
            ]
        )
        return
    rows = [
        (name_of(k), k.role.title, k.user, time.strftime("%Y-%m-%d", time.localtime(k.made)), PURPOSES[k.role])
        for k in sorted(keys, key=lambda k: k.role)
    ]
    print_table(("key", "role", "user", "made", "what it may"), rows)
    print(
        f"\nThey are kept in {keyring_path()}. `elys keys show NAME` prints a secret, `elys keys export NAME` makes a file."
    )


def show(name: str) -> None:
    """Prints one secret, as --secret and ELYS_SECRET take it."""
    key = required_keyring().named(name)
    print(f"{key.user}:{key.secret}")


def make(role: str, name: str) -> None:
    """A key of its own for somebody, so that it can be revoked alone."""
    try:
        chosen = role_named(role)
    except ValueError as error:
        raise AccessError(str(error)) from error
    if name in {given.title for given in GIVEN} or not name.strip():
        raise AccessError(f"'{name}' cannot be whom a key is for: give a person's or a machine's name")
    with changed_keyring() as keyring:
        if any(key.name == name for key in keyring.keys):
            raise AccessError(f"there is a key for '{name}' already: `elys keys renew {name}`, or choose another name")
        keyring.keys.append(new_key(chosen, name))
    print(f"{name} may come in as {chosen.title}: `elys keys show {name}` or `elys keys export {name}`")
    _say_when()


def export(name: str, output: Path | None, *, days: float) -> None:
    """Writes a file with secret and certificates, to be carried to another machine."""
    keyring = keyring_with_authority()
    key = keyring.named(name)
    path = output or Path(f"{name_of(key)}{SUFFIX}")
    write_private(path, msgspec.json.format(msgspec.json.encode(key_file(keyring, key, days=days)), indent=1))
    print(
        f"{path}: comes in as {key.role.title} for {days:g} days. Carry it over safely (scp), then: elys view --key {path.name}"
    )


def renew(name: str) -> None:
    """Gives a key, or all of them, another secret: what was handed out is worth nothing from then on."""
    with changed_keyring() as keyring:
        if name == "all":
            keyring.keys = [new_key(key.role, key.name) for key in keyring.keys]
            keyring.authority = renewed_authority()
        else:
            key = keyring.named(name)
            keyring.keys[keyring.keys.index(key)] = new_key(key.role, key.name)
    print(
        f"{'all keys have' if name == 'all' else f'{name} has'} another secret; files handed out before open nothing more"
    )
    _say_when()


def revoke(name: str) -> None:
    """Takes a key away."""
    with changed_keyring() as keyring:
        key = keyring.named(name)
        _check_revocable(keyring, key)
        keyring.keys.remove(key)
    print(f"{name} comes in no more")
    _say_when()


def name_of(key: Key) -> str:
    """What a key is called: whom it is for, or its role."""
    return key.name or key.role.title


def _check_revocable(keyring: Keyring, key: Key) -> None:
    if key == keyring.named("owner"):
        raise AccessError("the owner's key opens your own sessions to you: renew it instead (`elys keys renew owner`)")


def _say_when() -> None:
    from elys.bus.discovery import find_sessions

    if running := [record.name for record in find_sessions()]:
        print(f"Sessions that run go on as they are until they are started anew: {', '.join(running)}")
