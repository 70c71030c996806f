"""Tells what a script raised from what somebody did while it ran: Ctrl+C ends the session, `raise KeyboardInterrupt` a script."""

from __future__ import annotations

import dis
from typing import Final

_RAISE: Final = dis.opmap["RAISE_VARARGS"]
_HANDLERS: Final = frozenset(("elys.common.garbage", "asyncio.runners"))  # of the signal, that are written in Python


def is_interruption(error: BaseException) -> bool:
    """Whether somebody pressed Ctrl+C: the line where it was raised says nothing of it, or is a signal handler's."""
    traceback = error.__traceback__
    if not isinstance(error, KeyboardInterrupt) or traceback is None:
        return False
    while traceback.tb_next is not None:
        traceback = traceback.tb_next
    frame = traceback.tb_frame
    is_raised_here = frame.f_code.co_code[traceback.tb_lasti] == _RAISE
    return not is_raised_here or frame.f_globals.get("__name__") in _HANDLERS
