"""What is only listened to while somebody looks: a subscription lives as long as frames draw what it is for."""

from __future__ import annotations

from collections.abc import Callable

from elys.bus.transports.transport import Closer


class Watches:
    """Begun by the first frame that keeps them, ended by the first that does not."""

    def __init__(self) -> None:
        self._running: dict[str, Closer] = {}
        self._kept: set[str] = set()

    def keep(self, name: str, begin: Callable[[], Closer]) -> None:
        """Says in each frame that `name` is looked at; `begin` starts to listen and returns what stops it."""
        self._kept.add(name)
        if name not in self._running:
            self._running[name] = begin()

    def end_frame(self) -> None:
        """Ends what the frame did not keep. Call it after everything was drawn."""
        for name in [name for name in self._running if name not in self._kept]:
            self._running.pop(name)()
        self._kept.clear()

    def is_running(self, name: str) -> bool:
        """Whether it is listened to."""
        return name in self._running
