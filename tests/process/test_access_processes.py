"""A session beyond loopback as its users meet it: the line to type, the refusals, and no secret where others could read it."""

from __future__ import annotations

import re
import socket
from pathlib import Path

import pytest

from elys.bus.access.addresses import own_addresses
from elys.bus.access.keyring import required_keyring

pytestmark = pytest.mark.process


@pytest.fixture
def address() -> str:
    found = [address for address in own_addresses() if ":" not in address]
    if not found:
        pytest.skip("this machine has no address but loopback")
    return found[0]


@pytest.fixture
def elsewhere(tmp_path: Path) -> dict[str, str]:
    """Variables of a user who has none of this one's keys and finds no session by himself."""
    return {"ELYS_CONFIG_DIR": str(tmp_path / "theirs"), "ELYS_RUNTIME_DIR": str(tmp_path / "their-runtime")}


def command_lines() -> str:
    """What `ps` shows of every process."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                found.append((entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace"))
            except OSError:
                continue
    return "\n".join(found)


def test_seen_from_another_machine(elys, free_port, address, elsewhere, tmp_path):
    host = elys(
        *("run", "yard", "--headless", "--listen", f"tcp/0.0.0.0:{free_port}"), *("--record", "run.mcap", "--keep", "0")
    )
    found = host.wait_for(
        r"to watch: +ELYS_SECRET=\"\$\(ssh (\S+) elys keys show viewer\)\" (elys view --connect (\S+))"
    )
    endpoint = found[3]
    assert endpoint.endswith(f":{free_port}")
    host.wait_for("first tick")

    # What the substitution in that line runs here, and what the line then does there.
    shown = elys("keys", "show", "viewer")
    assert shown.wait() == 0
    secret = shown.lines[-1]
    seen = elys("topic", "echo", "status", "-n", "1", "--connect", endpoint, ELYS_SECRET=secret, **elsewhere)
    assert seen.wait() == 0 and '"scene":"Yard"' in seen.output
    recorded = elys(
        "record", "-o", "there.mcap", "--seconds", "1", "--connect", endpoint, ELYS_SECRET=secret, **elsewhere
    )
    assert recorded.wait() == 0, recorded.output
    (tmp_path / "file").write_text(secret)
    (tmp_path / "file").chmod(0o600)
    words = ("topic", "echo", "state", "--connect", endpoint)
    running = elys(*words, "--secret", f"@{tmp_path / 'file'}", **elsewhere)
    running.wait_for("epoch")

    refused = elys("topic", "echo", "status", "-n", "1", "--connect", endpoint, **elsewhere)
    assert refused.wait() == 1
    assert re.fullmatch(r"elys: the session at \S+ lets in only who shows a secret: .*", refused.output)

    secrets = [key.secret for key in required_keyring().keys]
    shown_by_ps = command_lines()
    files = [path for path in tmp_path.rglob("*") if path.is_file() and path.name != "file"]
    running.process.terminate()
    host.process.terminate()
    assert host.wait() == 0, host.output
    for text in secrets:
        assert text not in shown_by_ps
        assert text not in host.output and text not in running.output and text not in recorded.output
        assert not [path for path in files if path.exists() and text.encode() in path.read_bytes()]
    assert {path.name for path in files} >= {"run.mcap", "there.mcap"}
    # Nothing was made for who only came to look.
    assert not (tmp_path / "theirs").exists()


def test_loopback_asks_its_own_user_nothing_and_others_for_a_secret(elys, elsewhere):
    host = elys("run", "yard", "--headless", "--keep", "0")
    port = int(host.wait_for(r"simulating Yard at tcp/127\.0\.0\.1:(\d+)")[1])
    host.wait_for("first tick")
    assert not any("another machine" in line for line in host.lines)
    for address in own_addresses():
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        with socket.socket(family) as probe:
            assert probe.connect_ex((address, port)) != 0
    own = elys("topic", "echo", "status", "-n", "1")
    assert own.wait() == 0 and '"scene":"Yard"' in own.output
    other = elys("topic", "echo", "status", "-n", "1", "--connect", f"127.0.0.1:{port}", **elsewhere)
    assert other.wait() == 1 and "lets in only who shows a secret" in other.output


def test_tls_with_a_key_that_was_carried_over(elys, free_port, address, elsewhere, tmp_path):
    host = elys("run", "yard", "--headless", "--tls", "--listen", f"0.0.0.0:{free_port}", "--keep", "0")
    host.wait_for("first tick")
    for role in ("viewer", "editor"):
        made = elys("keys", "export", role, "-o", f"{role}.elyskey")
        assert made.wait() == 0, made.output
        assert (tmp_path / f"{role}.elyskey").stat().st_mode & 0o777 == 0o600
    endpoint = f"tls/{address}:{free_port}"
    seen = elys("topic", "echo", "status", "-n", "1", "--connect", endpoint, "--key", "viewer.elyskey", **elsewhere)
    assert seen.wait() == 0 and '"scene":"Yard"' in seen.output, seen.output
    refused = elys("topic", "echo", "status", "-n", "1", "--connect", endpoint, **elsewhere)
    assert refused.wait() == 1 and "asks for a certificate" in refused.output
    renewed = elys("keys", "renew", "viewer")
    assert renewed.wait() == 0 and "until they are started anew: Yard" in renewed.output


def test_insecure_is_spelled_out_and_warned_of(elys, free_port, address, elsewhere):
    host = elys("run", "yard", "--headless", "--insecure", "--listen", f"0.0.0.0:{free_port}", "--keep", "0")
    host.wait_for("warning: --insecure: whoever reaches")
    host.wait_for("first tick")
    seen = elys("topic", "echo", "status", "-n", "1", "--connect", f"{address}:{free_port}", **elsewhere)
    assert seen.wait() == 0 and '"scene":"Yard"' in seen.output
