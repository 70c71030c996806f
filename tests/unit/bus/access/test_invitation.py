"""What is said to who wants to come in from elsewhere, and what the options make of it."""

from __future__ import annotations

import io
import os
import re
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from elys.bus.access.addresses import own_addresses, own_names
from elys.bus.access.credentials import Credentials
from elys.bus.access.keyring import required_keyring
from elys.bus.access.listening import LOOPBACK, Listening
from elys.bus.discovery import choose_endpoint, is_of_this_machine
from elys.cli.options import Connect, listening, shows_credentials
from elys.common.errors import BusError
from elys.verbs.invitation import invite


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))
    for name in ("ELYS_SECRET", "ELYS_KEY"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


class Terminal(io.StringIO):
    """Where a person reads."""

    def isatty(self) -> bool:
        return True


def said(where: Listening, endpoint: str, monkeypatch: pytest.MonkeyPatch, stream: io.StringIO) -> str:
    monkeypatch.setattr(sys, "stderr", stream)
    invite(where, endpoint)
    return stream.getvalue()


def test_who_listens_at_loopback_is_told_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert said(LOOPBACK, "tcp/127.0.0.1:7447", monkeypatch, Terminal()) == ""


def test_a_person_is_shown_lines_to_copy(monkeypatch: pytest.MonkeyPatch) -> None:
    where = Listening(endpoint="tcp/0.0.0.0:7447", addresses=("server.example",))
    text = said(where, "tcp/0.0.0.0:7447", monkeypatch, Terminal())
    for verb, role in (("view", "viewer"), ("edit", "editor")):
        found = re.search(rf"ELYS_SECRET=(\S+) elys {verb} --connect tcp/server\.example:7447", text)
        assert found is not None
        assert Credentials.from_secret(found[1]).secret == required_keyring().named(role).secret
    assert re.search(r"ssh -L 7447:127\.0\.0\.1:7447 \S+@server\.example", text)
    assert "not encrypted" in text


def test_no_secret_goes_into_a_log(monkeypatch: pytest.MonkeyPatch) -> None:
    where = Listening(endpoint="tcp/0.0.0.0:7447")
    text = said(where, "tcp/0.0.0.0:7447", monkeypatch, io.StringIO())
    assert not any(key.secret in text for key in required_keyring().keys)
    assert re.search(r'ELYS_SECRET="\$\(ssh \S+ elys keys show viewer\)" elys view', text)


def test_tls_and_insecure(monkeypatch: pytest.MonkeyPatch) -> None:
    where = Listening(endpoint="tls/10.1.2.3:7448")
    text = said(where, "tls/10.1.2.3:7448", monkeypatch, Terminal())
    assert "elys view --connect tls/10.1.2.3:7448 --key viewer.elyskey" in text
    assert "ssh -L 7448:10.1.2.3:7448" in text and "not encrypted" not in text
    text = said(Listening(endpoint="tcp/[::]:7447", insecure=True), "tcp/[::]:7447", monkeypatch, Terminal())
    assert text.startswith("warning: --insecure: whoever reaches tcp/[::]:7447")
    text = said(Listening(endpoint="tcp/[fd00::7]:7447"), "tcp/[fd00::7]:7447", monkeypatch, Terminal())
    assert "--connect tcp/[fd00::7]:7447" in text


def test_options_of_who_listens() -> None:
    assert listening(None, tls=False, insecure=False, addresses=[]) == LOOPBACK
    assert listening(None, tls=True, insecure=False, addresses=[]).endpoint == "tls/127.0.0.1:7447"
    given = listening("0.0.0.0:9", tls=True, insecure=True, addresses=["a", "b"])
    assert given.endpoint == "tls/0.0.0.0:9" and given.speaks_tls and not given.is_local
    assert given.words() == ["--insecure", "--address", "a", "--address", "b"]
    with pytest.raises(BusError, match="is no endpoint"):
        listening("tcp/:::", tls=False, insecure=False, addresses=[])
    for local in ("tcp/127.0.0.1:1", "tcp/127.3.4.5:1", "tcp/localhost:1", "tcp/[::1]:1"):
        assert Listening(endpoint=local).is_local
    for open_to_others in ("tcp/0.0.0.0:1", "tcp/[::]:1", "tls/192.168.0.1:1", "tcp/server.example:1"):
        assert not Listening(endpoint=open_to_others).is_local


def test_this_machine_is_known_by_its_addresses() -> None:
    assert is_of_this_machine("localhost") and is_of_this_machine("[::1]") and is_of_this_machine("127.0.0.1")
    assert all(is_of_this_machine(address) for address in own_addresses())
    assert not is_of_this_machine("192.0.2.77") and not is_of_this_machine("server.example")
    assert {"localhost", "127.0.0.1", "also"} <= set(own_names(("also",)))
    assert choose_endpoint("tcp/0.0.0.0:7447") == "tcp/127.0.0.1:7447"


def test_verbs_that_connect_take_secret_and_key(folder: Path) -> None:
    program = typer.Typer()
    seen: list[tuple[str | None, Credentials | None]] = []

    @program.command()
    @shows_credentials
    def look(connect: Connect = None) -> None:
        """Looks."""
        seen.append((connect, Credentials.from_environment()))

    (folder / "k").write_text("editor-abcdef:" + "s" * 32)
    (folder / "k").chmod(0o600)
    for words, user in (
        ([], None),
        (["--secret", "viewer-abcdef:" + "v" * 32], "viewer-abcdef"),
        (["--secret", f"@{folder / 'k'}"], "editor-abcdef"),
        (["--key", str(folder / "k")], "editor-abcdef"),
    ):
        try:
            result = CliRunner().invoke(program, ["--connect", "tcp/h:1", *words])
        finally:
            for name in ("ELYS_SECRET", "ELYS_KEY"):
                os.environ.pop(name, None)
        assert result.exit_code == 0, result.output
        connect, credentials = seen.pop()
        assert connect == "tcp/h:1" and (credentials.user if credentials else None) == user
