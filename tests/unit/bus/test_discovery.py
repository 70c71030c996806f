"""Finding the sessions of this machine."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from elys.bus import discovery
from elys.common.errors import BusError, ConnectionLost

A = "tcp/127.0.0.1:7447"


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ELYS_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "sessions"


def test_a_session_is_found_until_it_closes() -> None:
    close = discovery.advertise(name="yard", endpoint="tcp/0.0.0.0:7447", kind="simulation", scene="Yard")
    (record,) = discovery.find_sessions()
    assert (record.name, record.endpoint, record.pid) == ("yard", "tcp/127.0.0.1:7447", os.getpid())
    assert discovery.choose_endpoint() == "tcp/127.0.0.1:7447"
    close()
    close()
    assert discovery.find_sessions() == []


def test_with_none_the_sentence_says_what_to_do() -> None:
    with pytest.raises(ConnectionLost, match=r"no session is running.*elys run SCENE.*--connect tcp/HOST:PORT"):
        discovery.choose_endpoint()


def test_of_several_the_newest_is_taken_and_said(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    discovery.advertise(name="old", endpoint="tcp/127.0.0.1:1", kind="simulation", scene="")
    discovery.advertise(name="new", endpoint="tcp/127.0.0.1:2", kind="replay", scene="")
    assert discovery.choose_endpoint() == "tcp/127.0.0.1:2"
    assert "old at tcp/127.0.0.1:1" in caplog.text


def test_what_a_dead_process_left_is_swept(runtime: Path) -> None:
    discovery.advertise(name="here", endpoint="tcp/127.0.0.1:1", kind="simulation", scene="")
    (record,) = discovery.find_sessions()
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    (runtime / "dead.json").write_bytes(msgspec.json.encode(msgspec.structs.replace(record, pid=process.pid)))
    (runtime / "reused.json").write_bytes(msgspec.json.encode(msgspec.structs.replace(record, process_started="1")))
    (runtime / "garbage.json").write_bytes(b"\xff{")
    assert discovery.find_sessions() == [record]
    assert not (runtime / "dead.json").exists() and not (runtime / "reused.json").exists()


@pytest.mark.parametrize(
    ("given", "whole"),
    [
        ("tcp/10.0.0.1:9", "tcp/10.0.0.1:9"),
        ("10.0.0.1:9", "tcp/10.0.0.1:9"),
        ("robot", "tcp/robot:7447"),
        ("tls/robot", "tls/robot:7447"),
        ("[::1]", "tcp/[::1]:7447"),
    ],
)
def test_an_endpoint_may_be_short(given: str, whole: str) -> None:
    assert discovery.choose_endpoint(given) == whole


def test_a_directory_that_cannot_be_written_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("ELYS_RUNTIME_DIR", str(tmp_path / "file"))
    with pytest.raises(BusError, match="set ELYS_RUNTIME_DIR"):
        discovery.advertise(name="x", endpoint="tcp/127.0.0.1:1", kind="simulation", scene="")


def test_worlds_behind_one_router_are_named() -> None:
    for name in ("alpha", "beta"):
        discovery.advertise(name=name, endpoint=A, kind="simulation", scene="", is_behind_router=True)
    with pytest.raises(
        BusError, match=f"several sessions run at {A}, (alpha, beta|beta, alpha): name one with --session"
    ):
        discovery.choose_endpoint()
    assert discovery.choose_endpoint("alpha@") == f"alpha@{A}"
    assert discovery.choose_endpoint("beta@10.0.0.1") == "beta@tcp/10.0.0.1:7447"
    with pytest.raises(
        ConnectionLost, match=r"no session gamma runs on this machine; there is (alpha, beta|beta, alpha)"
    ):
        discovery.choose_endpoint("gamma@")


def test_the_newest_that_listens_itself_needs_no_name() -> None:
    discovery.advertise(name="alpha", endpoint=A, kind="simulation", scene="", is_behind_router=True)
    discovery.advertise(name="beta", endpoint=A, kind="simulation", scene="", is_behind_router=True)
    discovery.advertise(name="own", endpoint="tcp/127.0.0.1:2", kind="simulation", scene="")
    assert discovery.choose_endpoint() == "tcp/127.0.0.1:2"


@pytest.mark.parametrize(
    ("connect", "session", "place"),
    [
        (None, "", None),
        ("robot", "", "robot"),
        ("robot", "yard", "yard@robot"),
        (None, "yard", "yard@"),
        ("yard@robot", "yard", "yard@robot"),
    ],
)
def test_endpoint_and_name_make_a_place(connect: str | None, session: str, place: str | None) -> None:
    assert discovery.place_of(connect, session) == place


def test_a_place_that_makes_no_sense_is_refused() -> None:
    with pytest.raises(BusError, match="names session meadow and --session yard"):
        discovery.place_of("meadow@robot", "yard")
    with pytest.raises(BusError, match="'a b' is no session's name"):
        discovery.complete_place("a b@robot")


def test_a_host_that_was_killed_and_not_yet_looked_after_is_gone(tmp_path, monkeypatch):
    monkeypatch.setenv("ELYS_RUNTIME_DIR", str(tmp_path))
    dead = subprocess.Popen([sys.executable, "-c", "pass"])
    try:
        os.waitid(os.P_PID, dead.pid, os.WEXITED | os.WNOWAIT)  # it has ended, and stays until it is waited for
        monkeypatch.setattr(os, "getpid", lambda: dead.pid)
        discovery.advertise(name="yard", endpoint="tcp/127.0.0.1:7447", kind="simulation", scene="yard")
        assert discovery.find_sessions() == []
    finally:
        monkeypatch.undo()
        dead.wait()
