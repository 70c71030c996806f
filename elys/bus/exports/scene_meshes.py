"""The meshes that a scene names, each read once."""

from __future__ import annotations

import logging
from collections.abc import Callable

from elys.common.assets.mesh import Mesh, decode_mesh
from elys.common.assets.primitives import is_primitive, primitive
from elys.common.errors import ElysError

_log = logging.getLogger(__name__)


class SceneMeshes:
    """Primitives by their names, others by `fetch`, which gives the bytes of an asset or raises ElysError."""

    def __init__(self, fetch: Callable[[str], bytes]) -> None:
        self._fetch = fetch
        self._meshes: dict[str, Mesh | None] = {}

    def get(self, name: str) -> Mesh | None:
        """A mesh that has something to draw; None, said once, if it cannot be had."""
        if name not in self._meshes:
            self._meshes[name] = None
            try:
                mesh = primitive(name) if is_primitive(name) else decode_mesh(self._fetch(name))
            except ElysError as error:
                _log.warning("left out: %s", error)
            else:
                self._meshes[name] = mesh if len(mesh.indices) else None
        return self._meshes[name]
