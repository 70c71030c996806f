"""Over HTTP: the page, the login, and the way to the WebSocket.

GET  /              the page; GET /page/NAME its other files. They hold nothing that is secret
GET  /me            as what this browser is known: 200 with its role, or 401
POST /login         {"secret": ...}: a cookie for it
POST /logout        forgets it
GET  /ws            the WebSocket, for who is known and comes from this very page
"""

from __future__ import annotations

import asyncio
import logging
import math
import re
from collections.abc import Mapping
from typing import Final

import msgspec
from aiohttp import WSCloseCode, web

from elys.bus.access.roles import Role
from elys.common.errors import ConnectionLost
from elys.web_node.access import COOKIE_LIFE, Doorkeeper, LoginLimit
from elys.web_node.browser import Browser
from elys.web_node.doors import guard, is_from_here
from elys.web_node.live_session import LiveSession
from elys.web_node.page_files import page_files
from elys.web_node.requests import MOST_BYTES, closing_reason

LOGIN_PATIENCE: Final = 10.0  # [s] for what a login says
HEARTBEAT: Final = 15.0  # [s] between two questions whether a browser is still there
_log = logging.getLogger(__name__)


class Login(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a login says."""

    secret: str


class WebServer:
    """Answers browsers. `application` is what aiohttp runs."""

    def __init__(
        self,
        live: LiveSession,
        doorkeeper: Doorkeeper,
        *,
        names: frozenset[str],
        texts: Mapping[str, Mapping[str, str]],
        is_secure: bool,
        most_a_second: float,
        bit_rate: float,
    ) -> None:
        """`texts` as for page_files; `most_a_second` pictures for each browser; `bit_rate` [bit/s] bounds H.264, 0 for none."""
        self._live = live
        self._doorkeeper = doorkeeper
        self._limit = LoginLimit()
        self._is_secure = is_secure
        self._most_a_second = most_a_second
        self._bit_rate = bit_rate
        self._files = page_files(texts)
        self.application = web.Application(middlewares=[guard(names, is_secure=is_secure)], client_max_size=4096)
        self.application.add_routes(
            [
                web.get("/", self._page),
                web.get("/page/{name}", self._page),
                web.get("/me", self._me),
                web.post("/login", self._login),
                web.post("/logout", self._logout),
                web.get("/ws", self._socket),
            ]
        )

    async def _page(self, request: web.Request) -> web.Response:
        file = self._files.get(request.match_info.get("name", "index.html"))
        if file is None:
            raise web.HTTPNotFound
        headers = {"Cache-Control": "no-cache", "ETag": file.tag, "Content-Type": file.media_type}
        if request.headers.get("If-None-Match") == file.tag:
            return web.Response(status=304, headers=headers)
        return web.Response(body=file.content, headers=headers)

    async def _me(self, request: web.Request) -> web.Response:
        role = self._role_of(request)
        headers = {"Cache-Control": "no-store"}
        if role is None:
            return web.json_response({"role": None}, status=401, headers=headers)
        return web.json_response({"role": role.title, "open": self._doorkeeper.is_open}, headers=headers)

    async def _login(self, request: web.Request) -> web.Response:
        if not is_from_here(request):
            return _refusal(403, "a login comes from this page and no other")
        address = request.remote or ""
        wait = self._limit.wait(address)
        if wait > 0.0:
            return _refusal(429, "too many wrong secrets: wait", {"Retry-After": str(math.ceil(wait))})
        try:
            async with asyncio.timeout(LOGIN_PATIENCE):
                given = msgspec.json.decode(await request.read(), type=Login).secret
        except (msgspec.DecodeError, msgspec.ValidationError, TimeoutError):
            return _refusal(400, 'a login is {"secret": "..."}')
        role = self._doorkeeper.role_of_secret(given)
        if role is None:
            self._limit.failed(address)
            _log.warning("a wrong secret came from %s", address)
            return _refusal(403, "this is no secret of this session")
        response = web.json_response({"role": role.title}, headers={"Cache-Control": "no-store"})
        response.set_cookie(
            _cookie_name(request),
            self._doorkeeper.cookie(role),
            max_age=int(COOKIE_LIFE),
            httponly=True,
            samesite="Strict",
            secure=self._is_secure,
            path="/",
        )
        return response

    async def _logout(self, request: web.Request) -> web.Response:
        if not is_from_here(request):
            return _refusal(403, "a logout comes from this page and no other")
        response = web.Response(status=204)
        response.del_cookie(_cookie_name(request), path="/")
        return response

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if not is_from_here(request):
            return _refusal(403, "a connection comes from this page and no other")
        role = self._role_of(request)
        if role is None:
            return _refusal(401, "log in first")
        try:
            self._live.free_slot()
        except ConnectionLost as error:
            return _refusal(503, str(error))
        socket = web.WebSocketResponse(max_msg_size=MOST_BYTES, heartbeat=HEARTBEAT, compress=False)
        await socket.prepare(request)
        try:
            slot = self._live.free_slot()  # many may have come meanwhile
        except ConnectionLost as error:
            await socket.close(code=WSCloseCode.TRY_AGAIN_LATER, message=closing_reason(str(error)).encode())
            return socket
        browser = Browser(self._live, role=role, slot=slot, most_a_second=self._most_a_second, bit_rate=self._bit_rate)
        await browser.serve(socket)
        return socket

    def _role_of(self, request: web.Request) -> Role | None:
        return self._doorkeeper.role_of_cookie(request.cookies.get(_cookie_name(request), ""))


def _cookie_name(request: web.Request) -> str:
    """One for each port: cookies are the same for all of a machine."""
    return "elys_" + re.sub(r"\W", "_", request.headers.get("Host", "").rpartition(":")[2])


def _refusal(status: int, reason: str, headers: dict[str, str] | None = None) -> web.Response:
    return web.json_response(
        {"reason": reason}, status=status, headers={"Cache-Control": "no-store", **(headers or {})}
    )
