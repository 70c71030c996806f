"""Who may do what: roles, the secrets that open them, and the cookies that remember it.

A secret is given once and answered with a cookie: role, end and an HMAC of both under the role's secret. Nothing is remembered of
who has one, a node that starts anew with the same secrets knows its cookies again, and another secret makes all of them void.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import secrets
import time
from collections.abc import Callable, Mapping
from typing import Final

from elys.bus.access.keyring import Keyring
from elys.bus.access.roles import GIVEN, Role

COOKIE_LIFE: Final = 12 * 3600.0  # [s]


def new_secrets() -> dict[Role, str]:
    """A fresh one for each role."""
    return {role: secrets.token_urlsafe(24) for role in GIVEN}


def secrets_of(keyring: Keyring) -> dict[Role, str]:
    """One for each role that follows from the user's key of that role, without telling it: the same until that key is renewed."""
    known = {}
    for key in keyring.keys:
        if not key.name:
            seal = hmac.new(key.secret.encode(), b"elys web", hashlib.sha256).digest()
            known[key.role] = base64.urlsafe_b64encode(seal[:24]).decode()
    return known


class Doorkeeper:
    """Knows the secrets of roles; without any, everybody comes in as `guest`."""

    def __init__(
        self,
        known: Mapping[Role, str],
        *,
        most: Role = Role.OWNER,
        guest: Role | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        """`most` is what anybody may at most. With `guest` nobody is asked for a secret."""
        self._known = dict(known)
        self._most = most
        self._guest = guest
        self._clock = clock

    @property
    def is_open(self) -> bool:
        """Whether nobody is asked for a secret."""
        return self._guest is not None

    def role_of_secret(self, given: str) -> Role | None:
        """The highest role that a secret opens; takes the same time for any."""
        opened: Role | None = None
        for role in GIVEN:
            if role in self._known and hmac.compare_digest(_digest(given), _digest(self._known[role])):
                opened = role
        return None if opened is None else min(opened, self._most)

    def role_of_cookie(self, value: str) -> Role | None:
        """The role that a cookie remembers; None for one that is none, has ended or was made under another secret."""
        if self._guest is not None:
            return min(self._guest, self._most)
        role, _, rest = value.partition(".")
        end, _, given = rest.partition(".")
        known = next((one for one in self._known if one.title == role), None)
        if known is None or not end.isascii() or not end.isdecimal() or len(end) > 12:
            return None
        if not hmac.compare_digest(given.encode(), self._seal(known, end).encode()) or int(end) < self._clock():
            return None
        return min(known, self._most)

    def cookie(self, role: Role) -> str:
        """The cookie of who has given the secret of a role."""
        end = str(int(self._clock() + COOKIE_LIFE))
        return f"{role.title}.{end}.{self._seal(role, end)}"

    def _seal(self, role: Role, end: str) -> str:
        return hmac.new(self._known[role].encode(), f"elys web {role.title} {end}".encode(), hashlib.sha256).hexdigest()


class LoginLimit:
    """So many wrong secrets in a while, of one address and of all; who goes on has to wait."""

    EACH: Final = 5
    ALL: Final = 60
    WHILE: Final = 30.0  # [s]
    MOST_ADDRESSES: Final = 1000  # that are told apart

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._failed: dict[str, list[float]] = {}

    def wait(self, address: str) -> float:
        """How long [s] an address has to wait before it may try again; 0 for now."""
        now = self._clock()
        self._forget(now)
        own = self._failed.get(address, [])
        every = sorted(at for failed in self._failed.values() for at in failed)
        waits = [own[-self.EACH] + self.WHILE - now] if len(own) >= self.EACH else []
        waits += [every[-self.ALL] + self.WHILE - now] if len(every) >= self.ALL else []
        return max(waits, default=0.0)

    def failed(self, address: str) -> None:
        """A wrong secret came from there."""
        if address not in self._failed and len(self._failed) >= self.MOST_ADDRESSES:
            del self._failed[next(iter(self._failed))]
        self._failed.setdefault(address, []).append(self._clock())

    def _forget(self, now: float) -> None:
        kept = {address: [at for at in failed if now - at < self.WHILE] for address, failed in self._failed.items()}
        self._failed = {address: failed for address, failed in kept.items() if failed}


def _digest(text: str) -> bytes:
    return hashlib.sha256(text.encode(errors="surrogatepass")).digest()
