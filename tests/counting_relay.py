"""A TCP relay that counts what passes through it: what a connection carries is measured, not believed."""

from __future__ import annotations

import socket
import threading
from types import TracebackType


class CountingRelay:
    """Connects everybody who comes to one port of loopback with `target`; use as a context manager."""

    def __init__(self, target: int) -> None:
        self.down = 0  # [bytes] from the target to those who came
        self.up = 0  # [bytes] from them to the target
        self._target = target
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._sockets: list[socket.socket] = [self._listener]
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def endpoint(self) -> str:
        return f"tcp/127.0.0.1:{self.port}"

    def __enter__(self) -> CountingRelay:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            for opened in self._sockets:
                opened.close()

    def _accept(self) -> None:
        while True:
            try:
                came, _ = self._listener.accept()
                gone = socket.create_connection(("127.0.0.1", self._target))
            except OSError:
                return
            with self._lock:
                self._sockets += [came, gone]
            for source, sink, is_down in ((gone, came, True), (came, gone, False)):
                threading.Thread(target=self._pass_on, args=(source, sink, is_down), daemon=True).start()

    def _pass_on(self, source: socket.socket, sink: socket.socket, is_down: bool) -> None:
        try:
            while data := source.recv(1 << 16):
                if is_down:
                    self.down += len(data)
                else:
                    self.up += len(data)
                sink.sendall(data)
        except OSError:
            pass
        for end in (source, sink):
            with self._lock:
                end.close()
