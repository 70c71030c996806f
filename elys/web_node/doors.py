"""What every answer over HTTP must have, and which questions are answered at all.

A page of somebody else's must not be able to speak for a person who is logged in here, so questions are answered only
under names that are this machine's (a name of an attacker's may lead here: DNS rebinding), and what does something only where it
comes from this very page (Origin). See https://fetch.spec.whatwg.org/#origin-header and RFC 6455, section 10.2.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Collection
from typing import Final
from urllib.parse import urlsplit

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware

HEADERS: Final = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach what listens there."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def own_names(more: Collection[str] = ()) -> frozenset[str]:
    """What this machine may be called in an address, besides its numbers."""
    name = socket.gethostname().lower()
    return frozenset({"localhost", name, f"{name}.local", socket.getfqdn().lower(), *(n.lower() for n in more)})


def is_own(host: str, names: Collection[str]) -> bool:
    """Whether a Host header (NAME, NAME:PORT, [ADDRESS]:PORT) names this machine: by a name of its own, or by number."""
    try:
        name = urlsplit(f"//{host}").hostname
    except ValueError:
        return False
    if not name:
        return False
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name.rstrip(".") in names
    return True  # numbers cannot be made to mean another machine


def is_from_here(request: web.BaseRequest) -> bool:
    """Whether a question comes from a page that was loaded from where it is asked."""
    origin = request.headers.get("Origin", "")
    try:
        place = urlsplit(origin)
    except ValueError:
        return False
    return place.scheme in ("http", "https") and place.netloc.lower() == request.headers.get("Host", "").lower()


def guard(names: Collection[str], *, is_secure: bool) -> Middleware:
    """A middleware that answers only under own names, and adds the headers that every answer has."""
    headers = {**HEADERS, "Strict-Transport-Security": "max-age=31536000"} if is_secure else HEADERS

    @web.middleware
    async def guarded(request: web.Request, handler: Handler) -> web.StreamResponse:
        if not is_own(request.headers.get("Host", ""), names):
            response: web.StreamResponse = web.Response(
                status=421, text="this machine is not called so: name it with `elys web --name`\n"
            )
        else:
            try:
                response = await handler(request)
            except web.HTTPException as error:
                error.headers.update(headers)
                raise
        if not response.prepared:
            response.headers.update(headers)
        return response

    return guarded
