"""Keys as files: who can read them, what is in them, and what they are worth once renewed."""

from __future__ import annotations

import datetime
import threading
from pathlib import Path

import msgspec
import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec

from elys.bus.access.certificates import Authority
from elys.bus.access.credentials import Credentials, KeyFile, remember
from elys.bus.access.keyring import changed_keyring, keyring_path, load_keyring, required_keyring
from elys.bus.access.listening import Listening, access_of, keyring_with_authority
from elys.bus.access.roles import GIVEN, Role, role_of_node, signed_id, user_of
from elys.common.errors import AccessError
from elys.verbs import keys


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("ELYS_RUNTIME_DIR", str(tmp_path / "runtime"))
    for name in ("ELYS_SECRET", "ELYS_KEY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


def test_keys_are_made_once_and_for_this_user_alone() -> None:
    assert load_keyring() is None
    ring = required_keyring()
    assert [key.role for key in ring.keys] == list(GIVEN)
    assert len({key.secret for key in ring.keys}) == 4 and all(len(key.secret) >= 32 for key in ring.keys)
    assert mode(keyring_path()) == 0o600 and mode(keyring_path().parent) == 0o700
    assert required_keyring() == ring


def test_processes_that_start_together_make_the_same_keys() -> None:
    rings: list[object] = []
    threads = [threading.Thread(target=lambda: rings.append(required_keyring())) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(rings) == 8 and all(ring == rings[0] for ring in rings)


def test_a_file_that_others_could_read_is_closed_and_that_is_said(caplog: pytest.LogCaptureFixture) -> None:
    required_keyring()
    keyring_path().chmod(0o644)
    required_keyring()
    assert mode(keyring_path()) == 0o600 and "could be read by other users" in caplog.text


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"keys": 3}', b"\xff\xfe"])
def test_a_file_that_is_none_is_refused_and_left_alone(content: bytes) -> None:
    keyring_path().parent.mkdir()
    keyring_path().write_bytes(content)
    with pytest.raises(AccessError, match="holds no keys"):
        required_keyring()
    assert keyring_path().read_bytes() == content


def test_where_keys_cannot_be_kept_only_loopback_is_listened_at(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    (folder / "config").write_text("a file where a folder should be")
    assert access_of(Listening()) is None and "all users of this machine can come" in caplog.text
    with pytest.raises(AccessError, match="ELYS_CONFIG_DIR"):
        access_of(Listening(endpoint="tcp/0.0.0.0:7447"))
    assert access_of(Listening(endpoint="tcp/0.0.0.0:7447", insecure=True)) is None


def test_keys_of_persons_are_made_exported_renewed_and_revoked(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    keys.make("viewer", "ana")
    keys.export("ana", None, days=30.0)
    path = folder / "ana.elyskey"
    assert mode(path) == 0o600
    exported = Credentials.from_file(path)
    assert exported.role is Role.VIEWER and exported.has_certificate
    assert exported.secret == required_keyring().named("ana").secret
    capsys.readouterr()
    keys.show("ana")
    shown = capsys.readouterr().out
    assert Credentials.from_secret(shown) == Credentials(user=exported.user, secret=exported.secret, source="--secret")
    keys.listed(json=False)
    assert exported.secret not in capsys.readouterr().out
    keys.renew("ana")
    assert required_keyring().named("ana").user != exported.user
    keys.revoke("ana")
    for wrong in (lambda: keys.show("ana"), lambda: keys.revoke("owner"), lambda: keys.make("viewer", "editor")):
        with pytest.raises(AccessError):
            wrong()
    with pytest.raises(AccessError, match="there are viewer, player, editor, owner"):
        keys.make("king", "ana")


def test_renewing_all_leaves_nothing_of_before() -> None:
    before = keyring_with_authority()
    keys.renew("all")
    after = required_keyring()
    assert not {key.secret for key in before.keys} & {key.secret for key in after.keys}
    assert before.authority.certificate != after.authority.certificate
    assert [key.role for key in before.keys] == [key.role for key in after.keys]


def test_a_change_that_fails_changes_nothing() -> None:
    before = required_keyring()
    with pytest.raises(RuntimeError), changed_keyring() as ring:
        ring.keys.clear()
        raise RuntimeError
    assert required_keyring() == before


def test_secrets_stand_in_no_repr_and_in_no_command_line(folder: Path) -> None:
    text = "viewer-abcdef:" + "s" * 32
    environment: dict[str, str] = {}
    remember(secret=text, environment=environment)
    assert environment == {"ELYS_SECRET": text}
    found = Credentials.from_environment(environment)
    assert found is not None and "s" * 32 not in repr(found) and found.secret == "s" * 32
    (folder / "file").write_text(text + "\n")
    (folder / "file").chmod(0o600)
    remember(secret="@file", environment=environment)
    assert environment == {"ELYS_KEY": str(folder / "file")}
    found = Credentials.from_environment(environment)
    assert found is not None and (found.user, found.secret) == ("viewer-abcdef", "s" * 32)
    assert Credentials.from_environment({}) is None
    with pytest.raises(AccessError, match="twice"):
        remember(secret=text, key_file=folder / "file", environment=environment)


def test_a_key_file_that_others_can_read_is_said(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    (folder / "k").write_bytes(msgspec.json.encode(KeyFile(user="editor-abcdef", secret="s" * 32)))
    (folder / "k").chmod(0o644)
    assert Credentials.from_file(folder / "k").role is Role.EDITOR
    assert "chmod 600" in caplog.text


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is no secret"),
        ("viewer", "is no secret"),
        ("viewer-abc:short", "is no secret"),
        ("host-abcdef:" + "s" * 32, "there is no role 'host'"),
        ("king-abcdef:" + "s" * 32, "there is no role 'king'"),
        ("@nowhere", "cannot be read"),
        ("viewer-abc.owner-x:" + "s" * 32, "is no secret"),
    ],
)
def test_what_is_no_secret_is_refused_without_repeating_it(text: str, sentence: str) -> None:
    with pytest.raises(AccessError, match=sentence) as caught:
        Credentials.from_secret(text)
    assert "s" * 32 not in str(caught.value)


@pytest.mark.parametrize("content", ["{}", '{"user": 3}', '{"user": "king-abcdef"}', "{", "text"])
def test_what_is_no_key_file_is_refused(folder: Path, content: str) -> None:
    (folder / "k").write_text(content)
    with pytest.raises(AccessError):
        Credentials.from_file(folder / "k")


def test_ids_tell_the_user_that_is_proven_and_no_other() -> None:
    assert signed_id("tool-1", "viewer-abc") == "tool-1.viewer-abc"
    assert signed_id("tool-1.owner-x", "viewer-abc") == "tool-1.viewer-abc"  # from one session into another
    assert signed_id("tool-1.owner-x", "") == "tool-1"
    assert user_of("x.owner-zz.viewer-abc") == "viewer-abc"  # as the router lets it through
    assert role_of_node("x.owner-zz.viewer-abc") is Role.VIEWER
    assert role_of_node("x.king-abc") is Role.VIEWER and role_of_node("tool-1") is Role.OWNER


def test_certificates_say_what_they_are_for() -> None:
    authority = Authority()
    assert authority.ensure() and not authority.ensure()
    root = x509.load_pem_x509_certificate(authority.certificate.encode())
    host = x509.load_pem_x509_certificate(authority.host(("server.example", "10.0.0.1", "::1"))[0].encode())
    client = x509.load_pem_x509_certificate(authority.client("viewer-abcdef", days=30)[0].encode())
    purposes = x509.oid.ExtendedKeyUsageOID
    for certificate, purpose in ((host, purposes.SERVER_AUTH), (client, purposes.CLIENT_AUTH)):
        certificate.verify_directly_issued_by(root)
        assert list(certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value) == [purpose]
        assert not certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
        assert isinstance(certificate.public_key(), ec.EllipticCurvePublicKey)
    names = host.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["server.example"]
    assert [str(address) for address in names.get_values_for_type(x509.IPAddress)] == ["10.0.0.1", "::1"]
    (common_name,) = client.subject.get_attributes_for_oid(x509.oid.NameOID.COMMON_NAME)
    assert common_name.value == "viewer-abcdef"
    left = client.not_valid_after_utc - datetime.datetime.now(datetime.UTC)
    assert datetime.timedelta(days=29.9) < left <= datetime.timedelta(days=30)
