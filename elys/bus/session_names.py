"""Names of sessions: two that run at the same time are told apart.

On one machine the second of two that call themselves alike gets a number, or is refused where a person chose its name. Through a
router it is refused by `Session.host`, which asks for the name first.
"""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import logging
from collections.abc import Iterator

from elys.bus.discovery import find_sessions, runtime_directory
from elys.common.errors import BusError

_log = logging.getLogger(__name__)


@contextlib.contextmanager
def claimed_name(name: str, *, is_chosen: bool) -> Iterator[str]:
    """A name that no session of this user's on this machine has: `name`, or with a number where nobody chose it.

    Nobody else can claim it until the end of the block, within which it is to be advertised.

    Raises:
        BusError: a session of a chosen name runs already.
    """
    folder = runtime_directory() / "sessions"
    with contextlib.ExitStack() as held:
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            file = held.enter_context((folder / "names.lock").open("w"))
            fcntl.flock(file, fcntl.LOCK_EX)
        except OSError as error:
            raise BusError(
                f"sessions cannot be written down in {folder} ({error.strerror}): set ELYS_RUNTIME_DIR to a directory of yours"
            ) from error
        yield _free_name(name, is_chosen=is_chosen)


def _free_name(name: str, *, is_chosen: bool) -> str:
    taken = {record.name: record for record in find_sessions()}
    if name not in taken:
        return name
    there = taken[name]
    if is_chosen:
        raise BusError(
            f"a session called {name} runs already at {there.endpoint} (process {there.pid}): end that one, or choose "
            "another --name"
        )
    free = next(other for number in itertools.count(2) if (other := f"{name}-{number}") not in taken)
    _log.warning("a session called %s runs already at %s: this one is called %s", name, there.endpoint, free)
    return free
