"""Where a host listens, and whom it lets in there: by default this user of this machine, elsewhere who shows a secret."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Final

from elys.bus.access.addresses import own_names
from elys.bus.access.certificates import Authority
from elys.bus.access.host import HostAccess
from elys.bus.access.keyring import Keyring, changed_keyring, required_keyring
from elys.common.errors import AccessError

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Listening:
    """What the options of a verb that hosts say."""

    endpoint: str | None = None  # a whole one, tcp/… or tls/…; None: the first free port of loopback
    insecure: bool = False  # asks nobody who he is
    addresses: tuple[str, ...] = ()  # under which others reach this machine besides those that it knows of

    @property
    def host(self) -> str:
        """The name or address of the endpoint."""
        return (self.endpoint or "tcp/127.0.0.1:0").partition("/")[2].rpartition(":")[0].strip("[]")

    @property
    def speaks_tls(self) -> bool:
        """Whether all is encrypted, and certificates are shown instead of secrets."""
        return (self.endpoint or "").startswith("tls/")

    @property
    def is_local(self) -> bool:
        """Whether nobody on another machine can reach it."""
        return self.host == "localhost" or self.host == "::1" or self.host.startswith("127.")

    def words(self) -> list[str]:
        """What to add to the command of a node that is to listen so, beside --listen."""
        return ["--insecure"] * self.insecure + [word for a in self.addresses for word in ("--address", a)]


LOOPBACK: Final = Listening()


def access_of(listening: Listening) -> HostAccess | None:
    """Whom to let in; None: everybody. The user's keys are made if there are none yet.

    Raises AccessError where they cannot be kept and others could come in.
    """
    if listening.insecure:
        return None
    try:
        if listening.speaks_tls:
            return HostAccess.with_certificates(keyring_with_authority(), own_names(listening.addresses))
        return HostAccess.of(required_keyring())
    except AccessError as error:
        if not listening.is_local or listening.speaks_tls:
            raise
        _log.warning("all users of this machine can come into this session: %s", error)
        return None


def keyring_with_authority() -> Keyring:
    """This user's keys, with an authority that signs certificates. Raises AccessError."""
    if (keyring := required_keyring()).authority.certificate:
        return keyring
    with changed_keyring() as keyring:
        keyring.authority.ensure()
        return keyring


def renewed_authority() -> Authority:
    """Another authority: what the one before it signed is worth nothing to it."""
    authority = Authority()
    authority.ensure()
    return authority
