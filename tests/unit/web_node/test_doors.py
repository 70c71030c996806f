"""Over HTTP: whose questions are answered, and what every answer has."""

from __future__ import annotations

import asyncio
import ssl

import aiohttp
import pytest

from elys.bus.access.roles import Role
from elys.common.errors import ElysError
from elys.web_node import connections
from elys.web_node.access import Doorkeeper, LoginLimit
from elys.web_node.doors import HEADERS, is_loopback, is_own, own_names
from elys.web_node.node import WebOptions, serve_browsers
from tests.unit.web_node.conftest import SECRETS, Visitor, open_web

NAMES = own_names(["elys.example"])


@pytest.mark.parametrize(
    ("host", "known"),
    [
        ("localhost:8090", True),
        ("127.0.0.1:8090", True),
        ("[::1]:8090", True),
        ("192.168.1.7", True),  # numbers cannot be made to mean another machine
        ("elys.example:8090", True),
        ("ELYS.example.", True),
        ("evil.example:8090", False),
        ("localhost.evil.example", False),
        ("", False),
        ("[::1", False),
        ("user@evil.example", False),
    ],
)
def test_only_names_of_this_machine_are_answered(host, known):
    assert is_own(host, NAMES) is known


def test_what_is_near_is_known():
    assert [is_loopback(host) for host in ("127.0.0.1", "::1", "localhost", "0.0.0.0", "10.1.1.1", "example")] == [
        True,
        True,
        True,
        False,
        False,
        False,
    ]


def test_a_name_that_was_made_to_lead_here_gets_nothing(on_the_web):
    async def scenario(web):
        client = await web.client()
        for path in ("/", "/page/main.js", "/me", "/ws"):
            answer = await client.get(path, headers={"Host": f"evil.example:{web.port}"})
            assert answer.status == 421
            assert "--name" in await answer.text()

    on_the_web(scenario)


def test_every_answer_forbids_what_a_page_does_not_need(on_the_web):
    async def scenario(web):
        client = await web.client()
        for path, status in (("/", 200), ("/page/style.css", 200), ("/me", 401), ("/nowhere", 404), ("/ws", 403)):
            answer = await client.get(path)
            assert answer.status == status
            assert {name: answer.headers[name] for name in HEADERS} == HEADERS
        policy = dict(part.strip().split(" ", 1) for part in HEADERS["Content-Security-Policy"].split(";"))
        assert policy["default-src"] == "'none'"
        assert policy["script-src"] == policy["style-src"] == policy["connect-src"] == "'self'"

    on_the_web(scenario)


def test_only_the_pages_own_files_can_be_had(on_the_web):
    async def scenario(web):
        client = await web.client()
        page = await client.get("/")
        assert page.content_type == "text/html"
        again = await client.get("/", headers={"If-None-Match": page.headers["ETag"]})
        assert again.status == 304
        for path in ("/page/../access.py", "/page/%2e%2e%2faccess.py", "/page/node.py", "/page/", "/access.py"):
            assert (await client.get(path)).status == 404

    on_the_web(scenario)


def test_a_secret_is_given_once_and_then_a_cookie_that_scripts_cannot_read(on_the_web):
    async def scenario(web):
        client = await web.client()
        assert (await client.get("/me")).status == 401
        wrong = await web.log_in(client, "wrong")
        assert wrong.status == 403
        assert (await wrong.json())["reason"] == "this is no secret of this session"
        came = await web.log_in(client, SECRETS[Role.EDITOR])
        (cookie,) = came.cookies.values()
        assert cookie["httponly"] and cookie["samesite"] == "Strict" and cookie["path"] == "/"
        assert cookie.key == f"elys_{web.port}"
        assert SECRETS[Role.EDITOR] not in cookie.value
        assert await (await client.get("/me")).json() == {"role": "editor", "open": False}
        gone = await client.post("/logout", headers={"Origin": web.url})
        assert gone.status == 204
        assert (await client.get("/me")).status == 401

    on_the_web(scenario)


def test_another_page_can_neither_log_in_nor_out_nor_connect(on_the_web):
    async def scenario(web):
        client = await web.client()
        for origin in ("http://evil.example", f"http://127.0.0.1:{web.port + 1}", "null", ""):
            assert (await web.log_in(client, SECRETS[Role.OWNER], Origin=origin)).status == 403
        await web.log_in(client, SECRETS[Role.OWNER])
        assert (await client.post("/logout", headers={"Origin": "http://evil.example"})).status == 403
        for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {}):
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await client.ws_connect("/ws", headers=headers)
            assert refused.value.status == 403
        await (await client.ws_connect("/ws", headers={"Origin": web.url})).close()

    on_the_web(scenario)


def test_who_is_not_known_gets_no_connection(on_the_web):
    async def scenario(web):
        client = await web.client()
        for cookie in ("", "owner.99999999999.00", "nonsense"):
            headers = {"Origin": web.url, "Cookie": f"elys_{web.port}={cookie}"}
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await client.ws_connect("/ws", headers=headers)
            assert refused.value.status == 401

    on_the_web(scenario)


def test_who_tries_secrets_has_to_wait_even_with_the_right_one(on_the_web):
    async def scenario(web):
        client = await web.client()
        statuses = [(await web.log_in(client, f"guess {n}")).status for n in range(LoginLimit.EACH + 2)]
        assert statuses == [403] * LoginLimit.EACH + [429, 429]
        waiting = await web.log_in(client, SECRETS[Role.OWNER])
        assert waiting.status == 429
        assert 0 < int(waiting.headers["Retry-After"]) <= LoginLimit.WHILE

    on_the_web(scenario)


@pytest.mark.parametrize("body", [b"", b"{", b"[]", b'{"secret": 1}', b'{"secret": "x", "role": "owner"}', b"\xff"])
def test_a_login_that_is_none_is_refused(on_the_web, body):
    async def scenario(web):
        client = await web.client()
        assert (await client.post("/login", data=body, headers={"Origin": web.url})).status == 400

    on_the_web(scenario)


def test_a_login_of_megabytes_is_cut_off(on_the_web):
    async def scenario(web):
        client = await web.client()
        answer = await client.post("/login", data=b"x" * 100_000, headers={"Origin": web.url})
        assert answer.status == 413

    on_the_web(scenario)


def test_no_more_browsers_than_there_is_room_for(on_the_web):
    async def scenario(web):
        first, _second = await web.visitor(Role.VIEWER), await web.visitor(Role.VIEWER)
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await web.visitor(Role.VIEWER)
        assert refused.value.status == 503
        await first.socket.close()
        third = await web.visitor(Role.VIEWER)  # a place that was left is free again
        await third.hear("welcome")

    on_the_web(scenario, most_browsers=2)


def test_connections_beyond_the_bound_are_cut_off_and_places_become_free(on_the_web, monkeypatch):
    monkeypatch.setattr(connections, "MOST", 3)

    async def scenario(web):
        held = [await asyncio.open_connection("127.0.0.1", web.port) for _ in range(3)]
        reader, writer = await asyncio.open_connection("127.0.0.1", web.port)
        with pytest.raises(ConnectionError):
            writer.write(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
            if not await reader.read(1):
                raise ConnectionResetError
        for _, one in held:
            one.close()
            await one.wait_closed()
        async with asyncio.timeout(10):
            while True:
                try:
                    answer = await (await web.client()).get("/")
                    break
                except aiohttp.ClientError:
                    await asyncio.sleep(0)
        assert answer.status == 200

    on_the_web(scenario)


class FakeTransport(asyncio.Transport):
    """A connection from an address."""

    def __init__(self, address: str) -> None:
        super().__init__({"peername": (address, 5000)})
        self.is_cut_off = False

    def abort(self) -> None:
        self.is_cut_off = True


def test_an_address_has_its_own_bound_and_others_theirs(monkeypatch):
    monkeypatch.setattr(connections, "MOST_OF_AN_ADDRESS", 2)

    async def scenario():
        make = connections.limited(asyncio.Protocol)

        def connect(address):
            protocol, transport = make(), FakeTransport(address)
            protocol.connection_made(transport)
            return protocol, transport

        held = [connect("10.0.0.1"), connect("10.0.0.1")]
        _, beyond = connect("10.0.0.1")
        _, other = connect("10.0.0.2")
        near = [connect("127.0.0.1")[1] for _ in range(5)]  # all that come through a tunnel
        assert [one.is_cut_off for one in (held[0][1], held[1][1], beyond, other, *near)] == [False, False, True] + [
            False
        ] * 6
        held[0][0].connection_lost(None)
        assert not connect("10.0.0.1")[1].is_cut_off

    asyncio.run(scenario())


def test_who_connects_and_asks_nothing_is_cut_off(on_the_web, monkeypatch):
    monkeypatch.setattr(connections, "HEADER_PATIENCE", 0.2)

    async def scenario(web):
        for said in (b"", b"GET / HTTP/1.1\r\nHost: localhost\r\n"):
            reader, writer = await asyncio.open_connection("127.0.0.1", web.port)
            writer.write(said)
            try:
                async with asyncio.timeout(10):
                    assert await reader.read() == b""
            except ConnectionResetError:
                pass
            writer.close()
        visitor = await web.visitor(Role.VIEWER)
        loop = asyncio.get_running_loop()
        end = loop.time() + 2.0 * connections.HEADER_PATIENCE
        while loop.time() < end:  # who has asked once may stay as long as it likes
            await visitor.say("ping", time=1.0)
            await visitor.hear("pong")
            await asyncio.sleep(0.01)  # not a flood

    on_the_web(scenario)


def test_without_secrets_everybody_is_let_in_as_far_as_is_allowed(on_the_web):
    async def scenario(web):
        client = await web.client()
        assert await (await client.get("/me")).json() == {"role": "player", "open": True}
        visitor = Visitor(await client.ws_connect("/ws", headers={"Origin": web.url}))
        assert (await visitor.hear("welcome"))["role"] == "player"

    on_the_web(scenario, doorkeeper=Doorkeeper({}, most=Role.PLAYER, guest=Role.OWNER))


def test_with_a_certificate_everything_is_encrypted(tmp_path):
    certificate, key = self_signed(tmp_path)

    async def main():
        async with open_web(certificate=certificate, certificate_key=key) as web:
            trust = ssl.create_default_context(cafile=str(certificate))
            connector = aiohttp.TCPConnector(ssl=trust)
            url = f"https://localhost:{web.port}"
            async with aiohttp.ClientSession(url, connector=connector) as client:
                came = await client.post("/login", json={"secret": SECRETS[Role.VIEWER]}, headers={"Origin": url})
                (cookie,) = came.cookies.values()
                assert cookie["secure"]
                assert "max-age" in came.headers["Strict-Transport-Security"]
                visitor = Visitor(await client.ws_connect("/ws", headers={"Origin": url}))
                assert (await visitor.hear("welcome"))["role"] == "viewer"
                await visitor.socket.close()
            plain = aiohttp.ClientSession()
            with pytest.raises(aiohttp.ClientError):
                await plain.get(f"http://localhost:{web.port}/")
            await plain.close()

    asyncio.run(main())


def test_what_cannot_be_served_is_one_sentence(on_the_web, tmp_path):
    nothing = tmp_path / "cert.pem"

    async def scenario(web):
        for options, said in (
            (WebOptions(port=web.port), "cannot be listened at"),
            (WebOptions(host="no.such.host.invalid"), "--host and --port"),
            (WebOptions(certificate=nothing), "both PEM, with --cert and --cert-key"),
        ):
            with pytest.raises(ElysError, match=said):
                await serve_browsers(web.node, Doorkeeper(SECRETS), options, on_ready=lambda _: None)

    on_the_web(scenario)


def self_signed(folder):
    """A certificate for localhost that vouches for itself, and its key."""
    import subprocess

    certificate, key = folder / "cert.pem", folder / "key.pem"
    words = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2"]
    words += [
        "-subj",
        "/CN=localhost",
        "-addext",
        "subjectAltName=DNS:localhost",
        "-keyout",
        str(key),
        "-out",
        str(certificate),
    ]
    try:
        subprocess.run(words, check=True, capture_output=True)
    except FileNotFoundError:
        pytest.skip("there is no openssl to make a certificate with")
    return certificate, key
