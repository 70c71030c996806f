"""The user's keys: a secret for each role, and the authority that signs certificates, in one file of the configuration directory.

$ELYS_CONFIG_DIR or the user's configuration directory / keys.json, readable by this user alone

Hosts let in whom it names; whoever can read it is an owner of every session of this user. It is made when it is first needed.
"""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import secrets
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import msgspec
import platformdirs

from elys.bus.access.certificates import Authority
from elys.bus.access.credentials import Credentials, KeyFile
from elys.bus.access.roles import GIVEN, Role, role_of_user
from elys.common.errors import AccessError

_LETTERS: Final = "abcdefghijkmnpqrstuvwxyz23456789"  # none that look like one another
_SECRET_BYTES: Final = 24
_log = logging.getLogger(__name__)


class Key(msgspec.Struct, frozen=True, kw_only=True):
    """Somebody who may come in."""

    user: str
    secret: str
    made: float  # [s] since 1970
    name: str = ""  # of the person; "" for the one that goes with the role

    @property
    def role(self) -> Role:
        """What it lets somebody do."""
        return role_of_user(self.user)

    def __repr__(self) -> str:
        """Without the secret."""
        return f"Key({self.user})"


class Keyring(msgspec.Struct, kw_only=True):
    """What stands in the file."""

    version: int = 1
    keys: list[Key] = []
    authority: Authority = msgspec.field(default_factory=Authority)

    def named(self, name: str) -> Key:
        """The key of a role, a person or a user; AccessError naming those there are."""
        for key in self.keys:
            if name in (key.user, key.name or key.role.title):
                return key
        known = ", ".join(key.name or key.role.title for key in self.keys)
        raise AccessError(f"there is no key '{name}': there are {known}")

    def credentials(self, key: Key) -> Credentials:
        """What its holder shows; certificates are added by `exported`."""
        return Credentials(user=key.user, secret=key.secret, source=str(keyring_path()))


def configuration_directory() -> Path:
    """Where this user's settings and keys are; ELYS_CONFIG_DIR names another place."""
    directory = os.environ.get("ELYS_CONFIG_DIR")
    return Path(directory) if directory else platformdirs.user_config_path("elys")


def keyring_path() -> Path:
    """Where the keys are."""
    return configuration_directory() / "keys.json"


def load_keyring() -> Keyring | None:
    """The keys of this user, None where none were made yet. Raises AccessError if the file cannot be read or is none."""
    path = keyring_path()
    try:
        data = path.read_bytes()
        mode = path.stat().st_mode
    except FileNotFoundError:
        return None
    except OSError as error:
        raise AccessError(
            f"the keys {path} cannot be read ({error.strerror}): set ELYS_CONFIG_DIR to a directory of yours"
        ) from error
    if mode & 0o077:
        _log.warning("%s could be read by other users: it is closed now; make others with `elys keys renew all`", path)
        path.chmod(0o600)
    try:
        return msgspec.json.decode(data, type=Keyring)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise AccessError(f"{path} holds no keys ({error}): move it away, and others are made") from error


def required_keyring() -> Keyring:
    """The keys of this user, made if there are none. Raises AccessError if they cannot be read or written."""
    if (found := load_keyring()) is not None:
        return found
    with changed_keyring() as keyring:
        return keyring


@contextlib.contextmanager
def changed_keyring() -> Iterator[Keyring]:
    """The keys, written back at the end; nobody else changes them meanwhile. Raises AccessError."""
    path = keyring_path()
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        lock = os.open(path.with_suffix(".lock"), os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise AccessError(
            f"keys cannot be kept in {path.parent} ({error.strerror}): set ELYS_CONFIG_DIR to a directory of yours"
        ) from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        keyring = load_keyring() or Keyring(keys=[new_key(role) for role in GIVEN])
        yield keyring
        write_private(path, msgspec.json.format(msgspec.json.encode(keyring), indent=1))
    finally:
        os.close(lock)


def new_key(role: Role, name: str = "") -> Key:
    """A key that nobody had before."""
    mark = "".join(secrets.choice(_LETTERS) for _ in range(6))
    return Key(
        user=f"{role.title}-{mark}",
        secret=secrets.token_urlsafe(_SECRET_BYTES),
        made=time.time(),
        name=name,
    )


def key_file(keyring: Keyring, key: Key, *, days: float) -> KeyFile:
    """What is carried to another machine: the secret, and a certificate that is good for so many days."""
    certificate, private_key = keyring.authority.client(key.user, days=days)
    return KeyFile(
        user=key.user,
        secret=key.secret,
        authority=keyring.authority.certificate,
        certificate=certificate,
        private_key=private_key,
    )


def write_private(path: Path, data: bytes) -> None:
    """Writes a file that nobody else can read. Raises AccessError."""
    temporary = ""
    try:
        descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")  # of mode 0600
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            os.fsync(file.fileno())
        Path(temporary).replace(path)
    except OSError as error:
        if temporary:
            Path(temporary).unlink(missing_ok=True)
        raise AccessError(f"{path} cannot be written: {error.strerror}") from error
