"""Looking around in a local network: what strangers may send, and what they get."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.bus import beacon
from elys.bus.beacon import DATAGRAM_SIZE, Announcement, Answers, Beacon, announced_endpoint, clean
from elys.common.errors import BusError

NONCE = bytes(range(16))
QUESTION = (b"ELYS?\x01" + NONCE).ljust(DATAGRAM_SIZE, b"\0")
YARD = Announcement(name="yard", kind="simulation", port=7447, scene="Yard", age=3.0, load=0.25, clients=2)


def answer_of(*announcements: Announcement) -> bytes:
    return Beacon(lambda: announcements).answer(QUESTION)


def test_what_is_announced_is_found_at_the_address_that_it_came_from() -> None:
    answers = Answers(NONCE)
    answers.take(answer_of(YARD, msgspec.structs.replace(YARD, name="meadow", protocol="tls")), "10.0.0.7")
    meadow, yard = answers.found()
    assert (yard.name, yard.scene, yard.endpoint, yard.age, yard.load) == (
        "yard",
        "Yard",
        "tcp/10.0.0.7:7447",
        3.0,
        0.25,
    )
    assert meadow.place == "meadow@tls/10.0.0.7:7447"


@pytest.mark.parametrize("question", [b"", QUESTION[:-1], QUESTION + b"\0", b"X" + QUESTION[1:], QUESTION[:22]])
def test_only_whole_questions_are_answered(question: bytes) -> None:
    assert Beacon(lambda: [YARD]).answer(question) == b""


def test_an_answer_is_never_longer_than_its_question() -> None:
    many = [msgspec.structs.replace(YARD, name=f"world-{n}", scene="s" * 60) for n in range(100)]
    answer = answer_of(*many)
    assert len(answer) <= DATAGRAM_SIZE
    answers = Answers(NONCE)
    answers.take(answer, "10.0.0.7")
    assert 3 <= len(answers.found()) < 100


def test_a_flood_of_questions_gets_so_many_answers_a_second() -> None:
    now = 0.0
    asked = Beacon(lambda: [YARD], clock=lambda: now)
    assert sum(bool(asked.answer(QUESTION)) for _ in range(1000)) == 40
    now = 1.0
    assert sum(bool(asked.answer(QUESTION)) for _ in range(1000)) == 20


def test_what_bears_another_nonce_or_makes_no_sense_is_left_alone() -> None:
    answers = Answers(NONCE)
    good = answer_of(YARD)
    head = good[:22]
    for data in (
        Beacon(lambda: [YARD]).answer(QUESTION.replace(NONCE, bytes(16))),
        good[:-1],
        head + b"[" * 1000,
        head + b'[{"name":"a/b","kind":"simulation","port":1}]',
        head + b'[{"name":"a","kind":"simulation","port":0}]',
        head + b'[{"name":"a","kind":"virus","port":1}]',
        head + b'[{"name":"a","kind":"simulation","port":1,"protocol":"unixsock-stream"}]',
        head + b'[{"name":"' + b"a" * 65 + b'","kind":"simulation","port":1}]',
        head + b'[{"name":"a\\u001b[2J","kind":"simulation","port":1}]',
        good + bytes(DATAGRAM_SIZE),
    ):
        answers.take(data, "10.0.0.7")
    assert answers.found() == []


def test_texts_are_cleaned_and_numbers_bounded() -> None:
    answers = Answers(NONCE)
    hostile = msgspec.structs.replace(
        YARD, scene="\x1b[31mYard\r\n\u202e" + "x" * 500, age=1e300, load=-1e300, clients=-5, version="\x00"
    )
    answers.take(answer_of(hostile), "10.0.0.7")
    (found,) = answers.found()
    assert found.scene.startswith("?[31mYard???xxx") and len(found.scene) == 64
    assert (found.age, found.load, found.clients, found.version) == (1e10, -1.0, 0, "?")


def test_nobody_fills_the_list() -> None:
    answers = Answers(NONCE)
    for number in range(100):
        answers.take(answer_of(msgspec.structs.replace(YARD, name=f"w{number}")), "10.0.0.7")
    assert len(answers.found()) == beacon.MOST_FROM_ONE
    for number in range(1000):
        answers.take(answer_of(YARD), f"10.0.{number // 250}.{number % 250}")
    assert len(answers.found()) == beacon.MOST_FOUND


@given(st.binary(max_size=1300))
def test_any_bytes_are_survived(data: bytes) -> None:
    answers = Answers(NONCE)
    for datagram in (data, answer_of(YARD)[:22] + data):
        answers.take(datagram, "10.0.0.7")
        assert Beacon(lambda: [YARD]).answer(datagram) == b""
    assert answers.found() == []


@given(st.text())
def test_any_text_is_cleaned_to_one_line(text: str) -> None:
    cleaned = clean(text)
    assert len(cleaned) <= 64 and (not cleaned or cleaned.isprintable())


def test_what_only_this_machine_reaches_is_not_announced() -> None:
    assert announced_endpoint("tcp/0.0.0.0:7447") == ("tcp", 7447)
    assert announced_endpoint("tls/[::]:1") == ("tls", 1)
    for endpoint in ("tcp/127.0.0.1:7447", "tcp/localhost:7447", "tcp/[::1]:7447", "tcp/127.1.2.3:1"):
        with pytest.raises(BusError, match="can be reached from this machine alone"):
            announced_endpoint(endpoint)
    with pytest.raises(BusError, match="cannot be announced"):
        announced_endpoint("unixsock-stream/x:y")
