"""Why a host did not let somebody in, in a sentence: zenoh says only that it could not connect, and late.

A short conversation of one's own tells: what zenoh would say first, once as it is and once inside TLS. A router answers it with
an InitAck (anybody may come in) or Close (only who shows who he is); a port that speaks TLS answers plain text with an alert.
"""

from __future__ import annotations

import contextlib
import datetime
import os
import re
import secrets
import socket
import ssl
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

from elys.bus.access.certificates import expiry
from elys.bus.access.credentials import OWN_KEYS, Credentials

_PATIENCE: Final = 3.0  # [s] for each answer
_INIT, _CLOSE, _KIND_MASK = 0x01, 0x03, 0x1F  # of zenoh's transport messages
_ZENOH_VERSION: Final = 0x09
_CLIENT: Final = 0b10
_TLS_ALERT: Final = b"\x15\x03"
_ENDPOINT: Final = re.compile(r"(?P<protocol>[a-z0-9-]+)/(?P<host>\[[^\]]+\]|[^:]+):(?P<port>\d+)")
_HOW: Final = "`elys keys show viewer` on the host's machine prints one: give it as --secret, --key or in ELYS_SECRET"


class Refusal(NamedTuple):
    """Why somebody was not let in. `is_sure` is False where nothing was answered: the host may have died, or the line been cut,
    while it was asked, and knocking again may help.
    """

    sentence: str  # "" where nobody listens, or where nothing speaks against being let in
    is_sure: bool = True
    is_of_credentials: bool = False  # the host asks for a secret; whether it is this one, only showing it tells


def is_open(endpoint: str) -> bool:
    """Whether a host answers there that asks nobody who he is."""
    place = _place(endpoint)
    if place is None or place[0] != "tcp":
        return False
    try:
        return _kind(_say_plainly(*place[1:])) == _INIT
    except OSError:
        return False


def why_refused(endpoint: str, credentials: Credentials | None) -> Refusal:
    """Asks a host, with a conversation of its own."""
    place = _place(endpoint)
    if place is None:
        return Refusal("")
    protocol, host, port = place
    try:
        if protocol == "tls":
            return _why_not_by_tls(endpoint, host, port, credentials)
        return _why_not_plainly(endpoint, _say_plainly(host, port), credentials)
    except OSError:
        return Refusal("")  # nobody there: that is said elsewhere


def _why_not_plainly(endpoint: str, answer: bytes, credentials: Credentials | None) -> Refusal:
    if not answer:
        return Refusal(_silent(endpoint), is_sure=False)
    asks = _kind(answer) == _CLOSE and credentials is not None
    return Refusal(_what_was_answered(endpoint, answer, credentials), is_of_credentials=asks)


def _what_was_answered(endpoint: str, answer: bytes, credentials: Credentials | None) -> str:
    if answer.startswith(_TLS_ALERT):
        return f"{endpoint} speaks TLS: connect with {endpoint.replace('tcp/', 'tls/', 1)} and --key FILE.elyskey"
    kind = _kind(answer)
    if kind == _CLOSE:
        if credentials is None:
            return f"the session at {endpoint} lets in only who shows a secret: {_HOW}"
        if credentials.source == OWN_KEYS:
            return f"the session at {endpoint} does not take this user's own keys, so it is of another user or machine: {_HOW}"
        return (
            f"the session at {endpoint} does not take the secret of {credentials.user} (from {credentials.source}): it was "
            f"renewed or revoked, or is of another machine or user; {_HOW}"
        )
    if kind == _INIT:
        return ""
    return _foreign(endpoint)


def _why_not_by_tls(endpoint: str, host: str, port: int, credentials: Credentials | None) -> Refusal:
    if (reason := _why_nothing_is_shown(endpoint, host, port, credentials)) or credentials is None:
        return Refusal(reason)
    try:
        answer = _say_by_tls(host, port, credentials)
    except ssl.SSLCertVerificationError as error:
        return Refusal(_why_host_is_not_trusted(endpoint, host, credentials, error))
    except (ssl.SSLError, TimeoutError, ConnectionResetError) as error:
        with contextlib.suppress(OSError):
            if _kind(_say_plainly(host, port)) in (_INIT, _CLOSE):
                return Refusal(_no_tls(endpoint))
        if isinstance(error, ssl.SSLError) and "ALERT" in (error.reason or ""):
            return Refusal(_why_alerted(endpoint, credentials, error))
        return Refusal(_foreign(endpoint)) if _is_answer(error) else Refusal(_silent(endpoint), is_sure=False)
    if _kind(answer) == _INIT:
        return Refusal("")
    said = f"the session at {endpoint} does not take the certificate of {credentials.user} (from {credentials.source})"
    return Refusal(said, is_sure=bool(answer))


def _why_nothing_is_shown(endpoint: str, host: str, port: int, credentials: Credentials | None) -> str:
    """Why there is nothing that could be shown to a port that speaks TLS; "" where there is."""
    if credentials is None or not credentials.has_certificate:
        if _kind(_say_plainly(host, port)) in (_INIT, _CLOSE):
            return _no_tls(endpoint)
        what = "nothing" if credentials is None else f"{credentials.source}, which has no certificate,"
        return (
            f"{endpoint} speaks TLS and asks for a certificate, and {what} was shown: make a file with `elys keys export viewer` "
            "on the host's machine, carry it here, and give it as --key FILE.elyskey"
        )
    if (until := expiry(credentials.certificate)) < datetime.datetime.now(datetime.UTC):
        return (
            f"the certificate of {credentials.user} in {credentials.source} expired on {until:%Y-%m-%d}: make another with "
            "`elys keys export` on the host's machine"
        )
    return ""


def _is_answer(error: OSError) -> bool:
    """Whether somebody spoke who speaks no TLS, and the conversation did not just end."""
    ended = (TimeoutError, ConnectionResetError, ssl.SSLEOFError, ssl.SSLZeroReturnError)
    return isinstance(error, ssl.SSLError) and not isinstance(error, ended)


def _foreign(endpoint: str) -> str:
    return f"what listens at {endpoint} is no session of ELYS: check host and port"


def _silent(endpoint: str) -> str:
    return (
        f"what listens at {endpoint} does not answer: it is a session that is stopped or very busy, or is no session of ELYS; "
        "try again, or check host and port"
    )


def _no_tls(endpoint: str) -> str:
    return f"{endpoint} speaks no TLS: connect with {endpoint.replace('tls/', 'tcp/', 1)} and a secret"


def _why_host_is_not_trusted(
    endpoint: str, host: str, credentials: Credentials, error: ssl.SSLCertVerificationError
) -> str:
    said = str(error.verify_message or error.reason)
    if "mismatch" in said or "not valid for" in said:
        return (
            f"the certificate of the host at {endpoint} is not for the name '{host}': start it with --address {host}, or "
            "connect by a name or address that it has"
        )
    if "expired" in said:
        return f"the certificate of the host at {endpoint} has expired: start the session anew"
    return (
        f"the host at {endpoint} shows a certificate of another authority than {credentials.source} knows: that key is of "
        "another user or machine, or somebody stands between; make one with `elys keys export` on the host's machine"
    )


def _why_alerted(endpoint: str, credentials: Credentials, error: ssl.SSLError) -> str:
    reason = (error.reason or "").replace("_", " ").lower()
    if "expired" in reason:
        return (
            f"the session at {endpoint} says that the certificate of {credentials.user} has expired: make another with "
            "`elys keys export`, and compare the clocks of the two machines"
        )
    return (
        f"the session at {endpoint} does not take the certificate of {credentials.user} from {credentials.source} ({reason}): "
        "it is of another authority; make one with `elys keys export` on the host's machine"
    )


def _place(endpoint: str) -> tuple[str, str, int] | None:
    found = _ENDPOINT.match(endpoint)
    if found is None or found["protocol"] not in ("tcp", "tls"):
        return None
    return found["protocol"], found["host"].strip("[]"), int(found["port"])


def _greeting() -> bytes:
    """What a zenoh client says first: an InitSyn, without any extension."""
    body = bytes((_INIT, _ZENOH_VERSION, 15 << 4 | _CLIENT)) + secrets.token_bytes(16)
    return len(body).to_bytes(2, "little") + body


def _kind(answer: bytes) -> int:
    return answer[2] & _KIND_MASK if len(answer) > 2 and len(answer) >= 2 + int.from_bytes(answer[:2], "little") else 0


def _say_plainly(host: str, port: int) -> bytes:
    with socket.create_connection((host, port), _PATIENCE) as connection:
        connection.sendall(_greeting())
        try:
            return connection.recv(512)
        except (TimeoutError, ConnectionResetError):
            return b""


def _say_by_tls(host: str, port: int, credentials: Credentials) -> bytes:
    context = ssl.create_default_context(cadata=credentials.authority)
    descriptor, name = tempfile.mkstemp(prefix="elys-")  # of mode 0600: ssl takes the key from files alone
    try:
        with os.fdopen(descriptor, "w") as file:
            file.write(credentials.certificate + credentials.private_key)
        context.load_cert_chain(name)
    finally:
        Path(name).unlink(missing_ok=True)
    with (
        socket.create_connection((host, port), _PATIENCE) as connection,
        context.wrap_socket(connection, server_hostname=host) as inside,
    ):
        inside.sendall(_greeting())
        return inside.recv(512)
