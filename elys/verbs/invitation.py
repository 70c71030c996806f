"""What to type on another machine to come into a session that is hosted here."""

from __future__ import annotations

import getpass
import socket
import sys
from collections.abc import Iterator

from elys.bus.access.addresses import own_addresses
from elys.bus.access.keyring import Keyring, required_keyring
from elys.bus.access.listening import Listening

ANYWHERE = ("0.0.0.0", "::", "")


def invite(listening: Listening, endpoint: str) -> None:
    """Says so on stderr; secrets only where a person reads it: lines that go into a file or a log fetch them by ssh."""
    if listening.is_local:
        return
    lines = insecure_lines(endpoint) if listening.insecure else secure_lines(listening, endpoint, sys.stderr.isatty())
    sys.stderr.write("\n".join(lines) + "\n")
    sys.stderr.flush()


def insecure_lines(endpoint: str) -> list[str]:
    """The warning of --insecure."""
    return [
        f"warning: --insecure: whoever reaches {endpoint} may watch, change and replace the scene, and have files written here.",
        "         Leave it out, and who comes in needs a secret that is made for you.",
    ]


def secure_lines(listening: Listening, endpoint: str, shows_secrets: bool) -> list[str]:
    """The lines for watching and editing from elsewhere, and by ssh."""
    protocol, _, place = endpoint.partition("/")
    port = place.rpartition(":")[2]
    first, *others = reachable(listening)
    remote = f"{protocol}/{f'[{first}]' if ':' in first else first}:{port}"
    login = f"{getpass.getuser()}@{first}"
    keyring = required_keyring()
    lines = ["From another machine:"]
    if listening.speaks_tls:
        lines.append("  keys are made here:  elys keys export viewer -o viewer.elyskey   (or editor; carry it over)")
        lines.append(f"  to watch:  elys view --connect {remote} --key viewer.elyskey")
        lines.append(f"  to edit:   elys edit --connect {remote} --key editor.elyskey")
    else:
        shown = {role: secret_words(keyring, role, login, shows_secrets) for role in ("viewer", "editor")}
        lines.append(f"  to watch:  ELYS_SECRET={shown['viewer']} elys view --connect {remote}")
        lines.append(f"  to edit:   ELYS_SECRET={shown['editor']} elys edit --connect {remote}")
    lines.extend(ssh_lines(listening, protocol, port, login))
    if others:
        lines.append(f"  this machine is also {', '.join(others)}")
    if not listening.speaks_tls:
        lines.append("  what is sent is not encrypted: over networks that are not yours add --tls, or go by ssh")
    return lines


def ssh_lines(listening: Listening, protocol: str, port: str, login: str) -> Iterator[str]:
    """The other way, with nothing but ssh open to the network."""
    here = "127.0.0.1" if listening.host in ANYWHERE else listening.host
    yield f"  by ssh:    ssh -L {port}:{here}:{port} {login}   and there the same with --connect {protocol}/localhost:{port}"


def secret_words(keyring: Keyring, role: str, login: str, shows_secrets: bool) -> str:
    """The secret, or what fetches it."""
    key = keyring.named(role)
    return f"{key.user}:{key.secret}" if shows_secrets else f'"$(ssh {login} elys keys show {role})"'


def reachable(listening: Listening) -> list[str]:
    """Addresses and names under which others reach this machine, the most likely first."""
    if listening.addresses or listening.host not in ANYWHERE:
        return [*listening.addresses] or [listening.host]
    return [*own_addresses()] or [socket.gethostname()]
