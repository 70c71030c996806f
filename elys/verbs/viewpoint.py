"""From where `elys render` looks: a camera of the scene by its name, a path from a file, or around the scene."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from elys.bus.mirror import SceneMirror
from elys.common.errors import ElysError
from elys.render_node.camera_path import CameraPath, CircularPath, read_camera_path
from elys.render_node.offline import CameraAt, OfflineRenderer

MIN_PERIOD = 0.05  # [s] of a turn
MAX_NAMED = 12  # cameras that an error counts up


@dataclass(frozen=True, slots=True, kw_only=True)
class Viewpoint:
    """What was asked for; at most one of the three. `period` [s] of a turn around the scene, 0 for none."""

    camera: str = ""
    path: CameraPath | None = None
    period: float = 0.0

    @classmethod
    def asked(cls, camera: str, path: Path | None, orbit: float) -> Viewpoint:
        """Of the options of a command line. Raises ElysError for more than one, and for a file that is no path."""
        given = [
            name
            for name, value in (("--camera", camera), ("--path", path), ("--orbit", orbit))
            if value not in ("", None, 0.0)
        ]
        if len(given) > 1:
            raise ElysError(f"{' and '.join(given)} both say from where to look: give one of them")
        if orbit and orbit < MIN_PERIOD:
            raise ElysError(f"--orbit {orbit:g}: a turn around the scene takes at least {MIN_PERIOD} s")
        return cls(camera=camera, path=read_camera_path(path) if path is not None else None, period=orbit)

    def entity_in(self, mirror: SceneMirror) -> int:
        """The entity of the named camera, 0 if none was asked for. Raises ElysError where there is no such one."""
        return camera_entity(mirror, self.camera) if self.camera else 0

    def camera_at(self, renderer: OfflineRenderer, origin: float) -> CameraAt | None:
        """Where the camera is by simulation time [s], paths counting from `origin`; None for a camera of the scene."""
        if self.path is not None:
            path = self.path
            return lambda time: path.camera_at(time - origin)
        if self.period:
            lower, upper = renderer.place().bounds()
            circle = CircularPath.around(lower, upper, period=self.period, aspect=renderer.width / renderer.height)
            return lambda time: circle.camera_at(time - origin)
        return None


def named_entities(mirror: SceneMirror, names: Sequence[str]) -> tuple[int, ...]:
    """The entities that have these names or paths of names ("Car/Front"), all that are called so. Raises ElysError."""
    paths = [(_path_of(mirror, entity), entity) for entity in mirror.entities] if names else []
    found: list[int] = []
    for name in names:
        called = [entity for path, entity in paths if path == name or path.endswith("/" + name)]
        if not called:
            near = difflib.get_close_matches(name, [path for path, _ in paths], n=3, cutoff=0.5)
            raise ElysError(f"there is no entity '{name}'" + (f"; near it are {', '.join(near)}" if near else ""))
        found += called
    return tuple(dict.fromkeys(found))


def camera_entity(mirror: SceneMirror, name: str) -> int:
    """The entity with a camera that has this name, or this path of names ("Car/Front"). Raises ElysError."""
    paths = {
        _path_of(mirror, entity): entity for entity, found in mirror.entities.items() if "Camera" in found.components
    }
    matching = [path for path in paths if path == name] or [path for path in paths if path.endswith("/" + name)]
    if not matching:
        if not paths:
            raise ElysError(f"there is no camera '{name}': the scene has none; --path and --orbit bring their own")
        known = ", ".join(sorted(paths)[:MAX_NAMED]) + (", ..." if len(paths) > MAX_NAMED else "")
        raise ElysError(f"there is no camera '{name}': cameras are {known}")
    if len(matching) > 1:
        raise ElysError(f"several cameras are called '{name}': say which of {', '.join(sorted(matching)[:MAX_NAMED])}")
    entity = paths[matching[0]]
    if not mirror.world_enabled(entity):
        raise ElysError(f"the camera '{name}' is switched off, or what it belongs to is")
    return entity


def _path_of(mirror: SceneMirror, entity: int) -> str:
    names: list[str] = []
    while entity:
        here = mirror.entities[entity]
        names.insert(0, here.name)
        entity = here.parent
    return "/".join(names)
