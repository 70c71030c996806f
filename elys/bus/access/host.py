"""Whom a host lets in, as settings of its zenoh session: users with their secrets or certificates, and what each may do."""

from __future__ import annotations

import base64
import contextlib
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from elys.bus.access.certificates import CLIENT_DAYS, Authority
from elys.bus.access.credentials import OWN_KEYS, Credentials
from elys.bus.access.keyring import Key, Keyring
from elys.bus.access.rules import access_control


@dataclass(frozen=True, slots=True, kw_only=True)
class HostAccess:
    """Who may come in; `certificate` and its key are the host's own, for endpoints that speak TLS."""

    users: tuple[tuple[str, str], ...] = field(repr=False)  # with their secrets
    authority: str = field(default="", repr=False)
    certificate: str = field(default="", repr=False)
    private_key: str = field(default="", repr=False)

    @classmethod
    def of(cls, keyring: Keyring) -> HostAccess:
        """For those in the ring, by secret."""
        return cls(users=users_of(keyring.keys))

    @classmethod
    def with_certificates(cls, keyring: Keyring, names: tuple[str, ...]) -> HostAccess:
        """For those in the ring, by certificate; the host is reached under these names and addresses."""
        certificate, private_key = keyring.authority.host(names)
        return cls(
            users=users_of(keyring.keys),
            authority=keyring.authority.certificate,
            certificate=certificate,
            private_key=private_key,
        )

    @contextlib.contextmanager
    def settings(self) -> Iterator[dict[str, Any]]:
        """What zenoh is opened with inside this block: it reads secrets from a file, which is gone afterwards."""
        chosen: dict[str, Any] = {"access_control": access_control(user for user, _ in self.users)}
        if self.certificate:
            chosen["transport/link/tls"] = {
                "root_ca_certificate_base64": encoded(self.authority),
                "listen_certificate_base64": encoded(self.certificate),
                "listen_private_key_base64": encoded(self.private_key),
                "enable_mtls": True,
                "close_link_on_expiration": True,
            }
            yield chosen
            return
        descriptor, name = tempfile.mkstemp(prefix="elys-")  # of mode 0600
        try:
            with os.fdopen(descriptor, "w") as file:
                file.writelines(f"{user}:{secret}\n" for user, secret in self.users)
            yield chosen | {"transport/auth/usrpwd/dictionary_file": name}
        finally:
            Path(name).unlink(missing_ok=True)


def users_of(keys: list[Key]) -> tuple[tuple[str, str], ...]:
    """User and secret of each key."""
    return tuple((key.user, key.secret) for key in keys)


def client_settings(credentials: Credentials | None, *, by_certificate: bool) -> dict[str, Any]:
    """What zenoh is opened with to show credentials: a certificate where TLS is spoken, else a secret."""
    if credentials is None:
        return {}
    if by_certificate:
        return {
            "transport/link/tls": {
                "root_ca_certificate_base64": encoded(credentials.authority),
                "connect_certificate_base64": encoded(credentials.certificate),
                "connect_private_key_base64": encoded(credentials.private_key),
                "enable_mtls": True,
                "verify_name_on_connect": True,
                "close_link_on_expiration": True,
            }
        }
    return {"transport/auth/usrpwd": {"user": credentials.user, "password": credentials.secret}}


def own_credentials(keyring: Keyring) -> Credentials:
    """What the user whose keys these are shows hosts of his own: the owner's, with a certificate if there is an authority."""
    owner = keyring.named("owner")
    if not keyring.authority.certificate:
        return Credentials(user=owner.user, secret=owner.secret, source=OWN_KEYS)
    return with_certificate(owner, keyring.authority)


def with_certificate(key: Key, authority: Authority, *, days: float = CLIENT_DAYS) -> Credentials:
    """A key's credentials with a certificate that is good for some days."""
    certificate, private_key = authority.client(key.user, days=days)
    return Credentials(
        user=key.user,
        secret=key.secret,
        authority=authority.certificate,
        certificate=certificate,
        private_key=private_key,
        source=OWN_KEYS,
    )


def encoded(text: str) -> str:
    """As zenoh takes certificates that stand in no file."""
    return base64.b64encode(text.encode()).decode()
