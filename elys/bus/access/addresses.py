"""Under which addresses and names others reach this machine."""

from __future__ import annotations

import fcntl
import socket
import struct
from pathlib import Path
from typing import Final

_SIOCGIFADDR: Final = 0x8915  # asks the kernel for an interface's address
LOOPBACK: Final = "127.0.0.1"


def own_addresses() -> tuple[str, ...]:
    """The IPv4 and IPv6 addresses of this machine's interfaces, without loopback and those of one cable alone (fe80::)."""
    return tuple(dict.fromkeys((*_addresses_of_interfaces(), *_global_addresses())))


def own_names(also: tuple[str, ...] = ()) -> tuple[str, ...]:
    """All under which a host may be called: those named by its user, the machine's name, localhost, and its addresses."""
    return tuple(dict.fromkeys((*also, socket.gethostname(), "localhost", LOOPBACK, "::1", *own_addresses())))


def _addresses_of_interfaces() -> list[str]:
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        for _, name in socket.if_nameindex():
            try:
                answer = fcntl.ioctl(asking, _SIOCGIFADDR, struct.pack("256s", name.encode()[:15]))
            except OSError:
                continue  # one without such an address
            found.append(socket.inet_ntoa(answer[20:24]))
    return [address for address in found if not address.startswith("127.")]


def _global_addresses() -> list[str]:
    try:
        lines = Path("/proc/net/if_inet6").read_text().splitlines()
    except OSError:
        return []
    found = []
    for line in lines:
        digits, *_ = line.split()
        address = socket.inet_ntop(socket.AF_INET6, bytes.fromhex(digits))
        if not address.startswith(("fe80:", "::1")):
            found.append(address)
    return found
