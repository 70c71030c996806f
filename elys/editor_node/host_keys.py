"""What the editor shows hosts that ask who it is: chosen by a person for an endpoint, and forgotten when the editor ends."""

from __future__ import annotations

from pathlib import Path

from elys.bus.access.credentials import SUFFIX, Credentials
from elys.bus.discovery import split_place
from elys.editor_node.language import tr


class HostKeys:
    """By endpoint. Where none was chosen the environment's is shown, or on this machine the user's own."""

    def __init__(self) -> None:
        self._chosen: dict[str, Credentials] = {}

    def choose(self, place: str, text: str) -> None:
        """From now on shows `text` there, USER:SECRET or an .elyskey file; with "" nothing of its own.

        Raises:
            AccessError: it is neither, or the file cannot be read.
        """
        endpoint, text = split_place(place)[1], text.strip()
        if text:
            self._chosen[endpoint] = credentials_of(text)
        else:
            self._chosen.pop(endpoint, None)

    def of(self, place: str) -> Credentials | None:
        """What was chosen for a place."""
        return self._chosen.get(split_place(place)[1])


def credentials_of(text: str) -> Credentials:
    """What a person typed: a secret, or the path of a file. Raises AccessError."""
    path = Path(text.removeprefix("@")).expanduser()
    if text.startswith("@") or text.endswith(SUFFIX) or path.is_file():
        return Credentials.from_file(path)
    return Credentials.from_secret(text, source=tr("the field Key"))


def is_secret(text: str) -> bool:
    """Whether what is being typed is to be seen by nobody: a secret, as soon as its user stands there, and no path."""
    return ":" in text and "/" not in text.partition(":")[0]
