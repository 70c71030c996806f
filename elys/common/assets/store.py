"""Assets by the hash of their content: what is drawn is named by what it is, so any machine can ask for what it lacks."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final, Literal

from elys.common.errors import AssetError

AssetKind = Literal["mesh", "image", "heights", "clips", "skin", "script", "prefab"]

PREFIX: Final = "blake2b:"
_DIGEST_SIZE: Final = 16
_REFERENCE: Final = re.compile(r"blake2b:[0-9a-f]{32}")
_REFERENCE_BYTES: Final = re.compile(_REFERENCE.pattern.encode())


def reference_of(data: bytes) -> str:
    """The name of content: `blake2b:` and 32 hex digits."""
    return PREFIX + hashlib.blake2b(data, digest_size=_DIGEST_SIZE).hexdigest()


def is_reference(text: str) -> bool:
    """Whether `text` is the name of content, as `reference_of` makes them."""
    return _REFERENCE.fullmatch(text) is not None


def references_in(data: bytes) -> list[str]:
    """The names of content that stand anywhere in a message or a file, each once, in order."""
    return list(dict.fromkeys(found.decode() for found in _REFERENCE_BYTES.findall(data)))


class AssetStore:
    """Bytes by reference, in memory, and behind that in a directory if one is given.

    The directory is a cache that processes share: files are written whole or not at all, and checked when read.
    """

    def __init__(self, directory: Path | None = None) -> None:
        """Raises AssetError if `directory` cannot be made."""
        self._contents: dict[str, bytes] = {}
        self._kinds: dict[str, AssetKind] = {}
        self._sources: dict[str, str] = {}
        self._directory = directory
        if directory is not None:
            try:
                directory.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise AssetError(f"the asset cache {directory} cannot be made: {error.strerror}") from error

    def put(self, data: bytes, *, kind: AssetKind, source: str = "") -> str:
        """Keeps content and returns its reference; `source` says which file it came from.

        Raises AssetError if the cache directory cannot be written.
        """
        reference = reference_of(data)
        if source:
            self._sources.setdefault(reference, source)
        self._kinds[reference] = kind
        if reference not in self._contents:
            self._contents[reference] = bytes(data)
            self._write_cached(reference, data)
        return reference

    def get(self, reference: str) -> bytes:
        """The content named `reference`; raises AssetError if it is not here or its cached file is damaged."""
        data = self._contents.get(reference)
        if data is None:
            data = self._read_cached(reference)
            self._contents[reference] = data
        return data

    def has(self, reference: str) -> bool:
        """Whether `get` would find it."""
        if reference in self._contents:
            return True
        path = self._path_of(reference)
        return path is not None and path.is_file()

    def kind(self, reference: str) -> AssetKind | None:
        """What the content was when it was put here; None if it came from another process's cache."""
        return self._kinds.get(reference)

    def source(self, reference: str) -> str:
        """The file (and place in it) the content came from, "" if it is not known."""
        return self._sources.get(reference, "")

    def references(self) -> Iterator[str]:
        """The names of all content in memory, in the order in which it came."""
        return iter(tuple(self._contents))

    def _path_of(self, reference: str) -> Path | None:
        # Only well-formed references become file names: they arrive from other machines.
        if self._directory is None or not is_reference(reference):
            return None
        return self._directory / reference.removeprefix(PREFIX)

    def _read_cached(self, reference: str) -> bytes:
        path = self._path_of(reference)
        if path is None:
            wrong = "" if is_reference(reference) else "; a reference is blake2b: and 32 hex digits"
            raise AssetError(f"there is no asset {reference!r}{wrong}")
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            raise AssetError(f"there is no asset {reference}") from None
        except OSError as error:
            raise AssetError(f"asset {reference} cannot be read from {path}: {error.strerror}") from error
        if reference_of(data) != reference:
            with contextlib.suppress(OSError):  # another process may have thrown it away already
                path.unlink()
            raise AssetError(
                f"asset {reference} was damaged in the cache at {path} and was removed; load its scene again"
            )
        return data

    def _write_cached(self, reference: str, data: bytes) -> None:
        path = self._path_of(reference)
        if path is None or path.exists():
            return
        try:
            replace_file(path, data, durable=False)
        except OSError as error:
            raise AssetError(f"asset {reference} cannot be written to {path}: {error.strerror}") from error


def replace_file(path: Path, data: bytes, *, durable: bool = True) -> None:
    """Writes a file so that others see the old content or the new one, never half of it. Raises OSError.

    `durable` also waits until the new content survives a power cut. A link stays one; what is no file (a pipe, a device) is
    written to as it is.
    """
    path = path.resolve()
    if path.exists() and not path.is_file():
        path.write_bytes(data)
        return
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:64]}.")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            if durable:
                os.fsync(file.fileno())
        Path(temporary).chmod(path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask())
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _umask() -> int:
    # The only way to read it is to set it; the value is put back at once.
    mask = os.umask(0)
    os.umask(mask)
    return mask
