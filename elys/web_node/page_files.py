"""The files of the page, as they lie in the package: read once, and served by name. Nothing else can be asked for."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from importlib import resources
from typing import Final, NamedTuple

import msgspec

TYPES: Final = {
    "html": "text/html; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "json": "application/json; charset=utf-8",
    "svg": "image/svg+xml",
}


class PageFile(NamedTuple):
    """One file as it is served."""

    content: bytes
    media_type: str
    tag: str  # of its content, so that browsers ask for it again only when it has changed


def page_files(texts: Mapping[str, Mapping[str, str]]) -> dict[str, PageFile]:
    """All files of the page by name. `texts` are translations that it does not have itself, by language and English text."""
    found = {}
    for entry in (resources.files("elys.web_node") / "page").iterdir():
        ending = entry.name.rpartition(".")[2]
        if ending in TYPES:
            content = entry.read_bytes()
            if ending == "json":
                known = texts.get(entry.name.removesuffix(".json"), {})
                content = msgspec.json.encode({**known, **msgspec.json.decode(content)})
            found[entry.name] = PageFile(content, TYPES[ending], f'"{hashlib.sha256(content).hexdigest()[:20]}"')
    return found
