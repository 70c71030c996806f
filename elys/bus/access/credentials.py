"""Who somebody is to a host: a user and a secret, or a certificate, out of an option, the environment or a file.

viewer-k3x9:m4wq…     what is typed, or stands in ELYS_SECRET or in a file: user and secret
viewer.elyskey        the same with certificates for TLS, as JSON: what is carried to another machine (`elys keys export`)
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import msgspec

from elys.bus.access.roles import Role, role_of_user
from elys.common.errors import AccessError

SECRET_VARIABLE: Final = "ELYS_SECRET"
KEY_VARIABLE: Final = "ELYS_KEY"
OWN_KEYS: Final = "this user's own keys"  # where credentials come from that nobody named
SUFFIX: Final = ".elyskey"
_SECRET: Final = re.compile(r"(?P<user>[a-z]+-[a-z0-9-]{2,40}):(?P<secret>[A-Za-z0-9_-]{16,200})")
_log = logging.getLogger(__name__)


class KeyFile(msgspec.Struct, frozen=True, kw_only=True):
    """What an .elyskey file holds."""

    user: str
    secret: str = ""
    authority: str = ""  # PEM of the certificate that signs the host's
    certificate: str = ""  # PEM
    private_key: str = ""  # PEM

    def __repr__(self) -> str:
        """Without what must stay secret."""
        return f"KeyFile({self.user})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Credentials:
    """What a client shows; what must stay secret is in no repr, and so in no log."""

    user: str
    secret: str = field(default="", repr=False)
    authority: str = field(default="", repr=False)
    certificate: str = field(default="", repr=False)
    private_key: str = field(default="", repr=False)
    source: str = ""  # where they come from, for sentences

    @property
    def role(self) -> Role:
        """What they let somebody do."""
        return role_of_user(self.user)

    @property
    def has_certificate(self) -> bool:
        """Whether they are of use for TLS."""
        return bool(self.authority and self.certificate and self.private_key)

    @classmethod
    def from_secret(cls, text: str, *, source: str = "--secret") -> Credentials:
        """USER:SECRET, or @FILE for a file with that in it. Raises AccessError for what is neither."""
        if text.startswith("@"):
            return cls.from_file(Path(text[1:]).expanduser())
        found = _SECRET.fullmatch(text.strip())
        if found is None:
            raise AccessError(
                f"what {source} gives is no secret: it is USER:LETTERS as `elys keys show` prints it, or @FILE with that in it"
            )
        return cls(user=_checked_user(found["user"], source), secret=found["secret"], source=source)

    @classmethod
    def from_file(cls, path: Path) -> Credentials:
        """An .elyskey file, or one with USER:SECRET in it. Raises AccessError if it cannot be read or is neither."""
        try:
            text = path.read_text()
            is_private = not path.stat().st_mode & 0o077
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is no text"
            raise AccessError(f"the key {path} cannot be read ({reason}): give an {SUFFIX} file") from error
        if not is_private:
            _log.warning("%s can be read by other users of this machine: chmod 600 %s", path, path)
        if not text.lstrip().startswith("{"):
            return cls.from_secret(text.strip().removeprefix("@"), source=str(path))
        try:
            key = msgspec.json.decode(text, type=KeyFile)
        except msgspec.DecodeError as error:
            raise AccessError(f"{path} is no key ({error}): make one with `elys keys export`") from error
        return cls(
            user=_checked_user(key.user, str(path)),
            secret=key.secret,
            authority=key.authority,
            certificate=key.certificate,
            private_key=key.private_key,
            source=str(path),
        )

    @classmethod
    def from_environment(cls, environment: MutableMapping[str, str] = os.environ) -> Credentials | None:
        """What ELYS_KEY (a file) or ELYS_SECRET names; None if neither is set. Raises AccessError for what is wrong."""
        if path := environment.get(KEY_VARIABLE):
            return cls.from_file(Path(path).expanduser())
        if secret := environment.get(SECRET_VARIABLE):
            return cls.from_secret(secret, source=SECRET_VARIABLE)
        return None

    def in_environment(self, environment: Mapping[str, str]) -> dict[str, str]:
        """An environment in which a process shows these: a certificate by the file that it stands in."""
        others = {name: value for name, value in environment.items() if name not in (SECRET_VARIABLE, KEY_VARIABLE)}
        if self.has_certificate:
            return {**others, KEY_VARIABLE: str(Path(self.source).resolve())}
        return {**others, SECRET_VARIABLE: f"{self.user}:{self.secret}"}


def remember(
    *, secret: str = "", key_file: Path | None = None, environment: MutableMapping[str, str] = os.environ
) -> None:
    """Has this process, and those that it starts, show what was given on the command line, by way of the environment, which
    other users cannot see. Raises AccessError for what is none.
    """
    if secret and key_file is not None:
        raise AccessError("--secret and --key say who this is twice: give one of them")
    if secret:
        credentials = Credentials.from_secret(secret)
        if secret.startswith("@"):
            key_file = Path(secret[1:])
        else:
            environment[SECRET_VARIABLE] = f"{credentials.user}:{credentials.secret}"
            environment.pop(KEY_VARIABLE, None)
    if key_file is not None:
        Credentials.from_file(key_file.expanduser())
        environment[KEY_VARIABLE] = str(key_file.expanduser().resolve())
        environment.pop(SECRET_VARIABLE, None)


def _checked_user(user: str, source: str) -> str:
    try:
        role_of_user(user)
    except ValueError as error:
        raise AccessError(f"the user '{user}' of {source} is none: {error}") from error
    return user
