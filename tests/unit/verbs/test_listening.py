"""Where nobody can listen is said before anything is started."""

from __future__ import annotations

import socket

import pytest

from elys.common.errors import LaunchError
from elys.verbs.run import free_endpoint, require_listenable, start


@pytest.mark.parametrize(
    ("endpoint", "expected"),
    [
        ("tcp/no-such-machine.invalid:7447", "cannot listen on 'tcp/no-such-machine.invalid:7447'"),
        ("tls/192.0.2.1:7447", "cannot listen on 'tls/192.0.2.1:7447' (Cannot assign requested address)"),
        ("tcp/[2001:db8::1]:7447", "cannot listen on"),
    ],
)
def test_where_nobody_can_listen_is_one_sentence(endpoint: str, expected: str) -> None:
    with pytest.raises(LaunchError) as failed:
        start("editor", {"scene": "empty"}, endpoint=endpoint)
    assert str(failed.value).startswith(expected)


def test_a_port_at_which_somebody_listens_is_in_use() -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        with pytest.raises(LaunchError, match="is in use"):
            require_listenable(f"tcp/127.0.0.1:{listener.getsockname()[1]}")


def test_a_free_port_stays_free() -> None:
    endpoint = free_endpoint()
    require_listenable(endpoint)
    require_listenable(endpoint)
