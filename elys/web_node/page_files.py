"""The files of the page, as they lie in the package: read once, and served by name. Nothing else can be asked for."""

from __future__ import annotations

import hashlib
from importlib import resources
from typing import Final, NamedTuple

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


def page_files() -> dict[str, PageFile]:
    """All files of the page by name."""
    found = {}
    for entry in (resources.files("elys.web_node") / "page").iterdir():
        ending = entry.name.rpartition(".")[2]
        if ending in TYPES:
            content = entry.read_bytes()
            found[entry.name] = PageFile(content, TYPES[ending], f'"{hashlib.sha256(content).hexdigest()[:20]}"')
    return found
