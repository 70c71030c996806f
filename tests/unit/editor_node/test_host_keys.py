"""Hosts that ask who it is, from the start page: refused with the reason, let in with a secret or a file."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import msgspec
import pytest

from elys.bus.access.credentials import KEY_VARIABLE, SECRET_VARIABLE, Credentials
from elys.bus.access.host import HostAccess
from elys.bus.access.keyring import Keyring, key_file, new_key
from elys.bus.access.roles import GIVEN, Role
from elys.bus.session import Session
from elys.bus.transports.zenoh import ZenohTransport
from elys.common.errors import AccessError
from elys.editor_node.host_keys import HostKeys, credentials_of, is_secret
from elys.editor_node.keys import Key
from elys.editor_node.sentences import is_known, tr_sentence
from elys.verbs.openers import ChildProcesses
from tests.unit.bus.access.guarded import free_port
from tests.unit.editor_node.person import CTRL, Person, person_at
from tests.unit.editor_node.scene_host import SceneHost
from tests.unit.editor_node.stage import yard_records
from tests.unit.editor_node.test_editor_attach import Town

SECRET = "viewer-k3x9:" + "m" * 24


@pytest.fixture
def keyring() -> Keyring:
    ring = Keyring(keys=[new_key(role) for role in GIVEN])
    ring.authority.ensure()
    return ring


def test_keys_are_of_an_endpoint_whatever_session_is_behind_it(tmp_path: Path) -> None:
    keys = HostKeys()
    keys.choose("yard@tcp/server:7447", f" {SECRET} ")
    shown = keys.of("tcp/server:7447")
    assert shown is not None and (shown.user, shown.secret) == tuple(SECRET.split(":"))
    assert keys.of("meadow@tcp/server:7447") == shown and keys.of("tcp/server:7448") is None
    with pytest.raises(AccessError, match="the field Key gives is no secret"):
        keys.choose("tcp/server:7447", "hello")
    with pytest.raises(AccessError, match=r"none\.elyskey cannot be read"):
        keys.choose("tcp/server:7447", str(tmp_path / "none.elyskey"))
    assert keys.of("tcp/server:7447") == shown
    keys.choose("tcp/server:7447", "")
    assert keys.of("tcp/server:7447") is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", False),
        ("viewer-k3", False),
        ("viewer-k3x9:m4", True),
        ("/keys/a:b.elyskey", False),
        ("~/it.elyskey", False),
    ],
)
def test_a_secret_is_covered_and_a_path_is_not(text: str, expected: bool) -> None:
    assert is_secret(text) is expected


def test_what_is_started_for_a_host_shows_the_same(
    tmp_path: Path, keyring: Keyring, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "another.elyskey")
    path = tmp_path / "viewer.elyskey"
    path.write_bytes(msgspec.json.encode(key_file(keyring, keyring.named("viewer"), days=3.0)))
    children = ChildProcesses()
    children.show("tcp/a:1", credentials_of(SECRET))
    children.show("tcp/b:1", credentials_of(str(path)))
    for endpoint, name, value in (("tcp/a:1", SECRET_VARIABLE, SECRET), ("tcp/b:1", KEY_VARIABLE, str(path))):
        environment = children._environment(("--connect", endpoint))
        assert {key: environment.get(key) for key in (SECRET_VARIABLE, KEY_VARIABLE)} == {
            SECRET_VARIABLE: None,
            KEY_VARIABLE: None,
            name: value,
        }
        assert Credentials.from_environment(environment) is not None
    children.show("tcp/a:1", None)
    assert children._environment(("--connect", "tcp/a:1")) == dict(os.environ)


@pytest.mark.gl
@pytest.mark.parametrize("language", ["en", "fr"])
def test_a_host_that_asks_for_a_secret_is_reached_from_the_start_page(
    keyring: Keyring, language: str, screenshot_directory: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from elys.editor_node.language import use_language
    from elys.editor_node.node import Editor

    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "mine"))
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    secret = f"{keyring.named('editor').user}:{keyring.named('editor').secret}"

    async def scenario(person: Person, town: Town) -> None:
        editor = person.editor
        attachments = editor.attachments

        async def told(said: str) -> None:
            await person.until(lambda: said in attachments.error and not attachments.doing)

        await person.click("start/endpoint")
        await person.type(endpoint)
        await person.press(Key.ENTER)
        await told("lets in only who shows a secret")
        is_french = tr_sentence(attachments.error).startswith("la session à tcp/127.0.0.1:")
        assert is_french == (language == "fr")
        await person.click("start/key")
        await person.type(SECRET)
        await person.frames(2)
        editor.screenshot(screenshot_directory / f"start-key-{language}.png")
        await person.press(Key.ENTER)
        await told("does not take the secret of viewer-k3x9")
        assert is_known(attachments.error, "fr")
        await person.click("start/key")
        await person.press(Key.A, CTRL)
        await person.type("hello")
        await person.click("start/connect")
        await told("is no secret")
        assert is_known(attachments.error, "fr")
        assert not attachments.is_attached and not town.shown
        await person.click("start/key")
        await person.press(Key.A, CTRL)
        await person.type(secret)
        await person.click("start/connect")
        await person.until(lambda: editor.model.scene.is_known)
        assert editor.seat.session.permissions.role is Role.EDITOR
        await person.until(lambda: town.started == [f"draw {endpoint}"])
        assert town.shown[endpoint] == attachments.keys.of(endpoint) is not None
        assert secret not in repr(editor.preferences)

    async def main() -> None:
        host = await Session.host(
            ZenohTransport.listen(endpoint, access=HostAccess.of(keyring)), name="yard", kind="simulation", epoch=1
        )
        SceneHost(host, epoch=1).load(yard_records())
        town = Town()
        with Editor(openers=town, null_platform=True, size=(1600, 900)) as editor:
            use_language(language)
            try:
                async with person_at(editor, town) as person:
                    await person.frames(3)
                    await scenario(person, town)
            finally:
                use_language("en")
                await host.close()

    asyncio.run(main())
