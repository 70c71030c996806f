"""Secrets, cookies and roles: who is let in as what, and who is not."""

from __future__ import annotations

import pytest

from elys.bus.access.keyring import Keyring, new_key
from elys.bus.access.roles import GIVEN, Role, role_named
from elys.bus.messages import commands as c
from elys.bus.messages.commands import role_for
from elys.web_node.access import COOKIE_LIFE, Doorkeeper, LoginLimit, new_secrets, secrets_of


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def test_each_secret_opens_its_role_and_no_other_text_does():
    known = new_secrets()
    keeper = Doorkeeper(known)
    assert {keeper.role_of_secret(secret) for secret in known.values()} == set(GIVEN)
    for wrong in ("", "x", known[Role.EDITOR][:-1], known[Role.EDITOR] + " ", "\ud800", "é" * 9):
        assert keeper.role_of_secret(wrong) is None
    assert len({*known.values(), *new_secrets().values()}) == 2 * len(GIVEN)


def test_nobody_may_more_than_the_node_allows():
    known = new_secrets()
    keeper = Doorkeeper(known, most=Role.PLAYER)
    assert keeper.role_of_secret(known[Role.OWNER]) is Role.PLAYER
    assert keeper.role_of_secret(known[Role.VIEWER]) is Role.VIEWER
    assert keeper.role_of_cookie(Doorkeeper(known).cookie(Role.OWNER)) is Role.PLAYER


def test_a_cookie_is_known_again_until_it_ends_or_the_secret_changes():
    clock, known = Clock(), new_secrets()
    cookie = Doorkeeper(known, clock=clock).cookie(Role.EDITOR)
    again = Doorkeeper(known, clock=clock)  # a node that was started anew
    assert again.role_of_cookie(cookie) is Role.EDITOR
    assert Doorkeeper(new_secrets(), clock=clock).role_of_cookie(cookie) is None
    clock.now += COOKIE_LIFE - 1.0
    assert again.role_of_cookie(cookie) is Role.EDITOR
    clock.now += 2.0
    assert again.role_of_cookie(cookie) is None


@pytest.mark.parametrize(
    "forge",
    [
        lambda role, end, seal: f"owner.{end}.{seal}",
        lambda role, end, seal: f"{role}.{int(end) + 1}.{seal}",
        lambda role, end, seal: f"{role}.{end}.{seal[:-1]}",
        lambda role, end, seal: f"{role}.{end}.",
        lambda role, end, seal: f"{role}.-1.{seal}",
        lambda role, end, seal: f"{role}.²²².{seal}",
        lambda role, end, seal: f"host.{end}.{seal}",
        lambda role, end, seal: "x" * 5000,
        lambda role, end, seal: "",
    ],
)
def test_a_forged_cookie_is_none(forge):
    keeper = Doorkeeper(new_secrets())
    assert keeper.role_of_cookie(forge(*keeper.cookie(Role.VIEWER).split("."))) is None


def test_without_secrets_everybody_is_a_guest():
    keeper = Doorkeeper({}, most=Role.EDITOR, guest=Role.OWNER)
    assert keeper.is_open
    assert keeper.role_of_cookie("") is Role.EDITOR


def test_who_tries_secrets_has_to_wait_and_nobody_else():
    clock = Clock()
    limit = LoginLimit(clock)
    for _ in range(LoginLimit.EACH):
        assert limit.wait("10.0.0.1") == 0.0
        limit.failed("10.0.0.1")
        clock.now += 1.0
    assert limit.wait("10.0.0.1") == LoginLimit.WHILE - LoginLimit.EACH
    assert limit.wait("10.0.0.2") == 0.0
    clock.now += LoginLimit.WHILE
    assert limit.wait("10.0.0.1") == 0.0


def test_many_who_try_from_everywhere_hold_up_the_next():
    clock = Clock()
    limit = LoginLimit(clock)
    for number in range(LoginLimit.ALL):
        assert limit.wait(f"10.0.0.{number}") == 0.0
        limit.failed(f"10.0.0.{number}")
    assert limit.wait("10.9.9.9") == LoginLimit.WHILE
    for number in range(3 * LoginLimit.MOST_ADDRESSES):
        limit.failed(f"host {number}")
    assert len(limit._failed) <= LoginLimit.MOST_ADDRESSES


def test_what_changes_the_session_takes_an_editor_and_what_replaces_it_an_owner():
    edits = (c.SetComponent(entity=1, component="Light", values={}), c.Undo(), c.Despawn(entity=1))
    time = (c.SetPlaying(playing=True), c.StepTicks(), c.Seek(time=0.0), c.SetRate(rate=1.0), c.Resume())
    assert {role_for(command) for command in (*edits, *time)} == {Role.EDITOR}
    assert role_for(c.LoadScene(name="x", records=())) is Role.OWNER


def test_roles_are_called_by_name():
    assert [role_named(role.title) for role in GIVEN] == list(GIVEN)
    with pytest.raises(ValueError, match="there is no role 'king': there are viewer, player, editor, owner"):
        role_named("king")


def test_secrets_follow_from_the_users_keys_and_do_not_tell_them():
    keyring = Keyring(keys=[new_key(role) for role in GIVEN] + [new_key(Role.OWNER, "Anna")])
    known = secrets_of(keyring)
    assert known == secrets_of(keyring)  # of a node that is started anew
    assert set(known) == set(GIVEN)
    assert not {key.secret for key in keyring.keys} & set(known.values())
    renewed = Keyring(keys=[new_key(Role.VIEWER), *keyring.keys[1:]])
    assert [role for role in GIVEN if secrets_of(renewed)[role] != known[role]] == [Role.VIEWER]
