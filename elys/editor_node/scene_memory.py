"""What of a scene is locked, hidden and drawn over the picture, kept by its file and found again when it is opened anew.

Entities are kept by the names that lead to them from the top down, as their ids mean others in the next run. Of several siblings
of one name the first is found.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol, get_args

from elys.bus.messages.views import Debug
from elys.editor_node.entity_marks import Mark
from elys.editor_node.preferences import SceneLook, keep_scene

if TYPE_CHECKING:
    from elys.editor_node.model import EditorModel
    from elys.editor_node.preferences import Preferences

MOST_MARKED: Final = 500  # entities of each mark that are kept, the newest
_MARKS: Final[tuple[Mark, ...]] = get_args(Mark)

NamePath = tuple[str, ...]


class DebugLines(Protocol):
    """What is drawn over the picture: see `messages.views.ViewRequest`."""

    debug: tuple[Debug, ...]
    debugs_selection: bool


class _Occasion(NamedTuple):
    """A scene as it was opened once."""

    owner: str  # the file, or the scene's name where it has none
    epoch: int
    opened: int


class SceneMemory:
    """Works for one editor; call `follow` each frame."""

    def __init__(self, model: EditorModel, preferences: Preferences, *, lines: Callable[[], DebugLines]) -> None:
        """`lines` tells where it stands what is drawn over the picture."""
        self._model = model
        self._lines = lines
        self._preferences = preferences
        self._occasion: _Occasion | None = None
        self._seen: tuple[object, ...] = ()  # when what is kept was last brought up to date
        self._paths: dict[Mark, dict[int, NamePath]] = {mark: {} for mark in _MARKS}  # of who is marked
        self._wanted: dict[Mark, list[NamePath]] = {mark: [] for mark in _MARKS}  # that led to nobody yet

    def follow(self) -> None:
        """Keeps what a person has marked and switched since the last frame; in a scene just opened, does so again."""
        occasion = self._occasion_now()
        if occasion is None:
            return  # whose scene this is will be known in a moment
        if occasion != self._occasion:
            self._come_to(occasion)
        scene, lines = self._model.scene, self._lines()
        now = (scene.marks.version, scene.structure_version, lines.debug, lines.debugs_selection)
        if now != self._seen:
            self._find()
            self._keep(occasion.owner)
            self._seen = (scene.marks.version, *now[1:])

    def _occasion_now(self) -> _Occasion | None:
        model, mirror = self._model, self._model.scene.mirror
        is_here = model.scene.is_known and model.connected and mirror.epoch == model.session.epoch
        if not is_here or not model.history.is_attached:
            return None
        return _Occasion(model.file.origin or f"scene {mirror.scene}", mirror.epoch, model.scenes_opened)

    def _come_to(self, occasion: _Occasion) -> None:
        before, self._occasion, self._seen = self._occasion, occasion, ()
        if before is not None and before[1:] == occasion[1:]:
            return  # saved under another name: the same entities, and what is on is kept for the new file as well
        marks, scene = self._model.scene.marks, self._model.scene
        look = self._preferences.scenes.get(occasion.owner)
        for mark in _MARKS:
            marks.set(mark, [entity for entity in marks.own(mark) if not scene.exists(entity)], False)
            self._paths[mark].clear()
            self._wanted[mark] = list(getattr(look, mark)) if look is not None else []
        if look is not None:
            lines = self._lines()
            lines.debug = tuple(kind for kind in get_args(Debug) if kind in look.debug)
            lines.debugs_selection = look.debugs_selection

    def _find(self) -> None:
        """Marks those that are there by now: a large scene comes in parts."""
        scene = self._model.scene
        for mark, paths in self._wanted.items():
            found = {path: entity for path in paths if (entity := next(iter(scene.found_paths([path])), 0))}
            if found:
                self._wanted[mark] = [path for path in paths if path not in found]
                scene.marks.set(mark, found.values(), True)

    def _keep(self, owner: str) -> None:
        scene, lines = self._model.scene, self._lines()
        for mark in _MARKS:
            known = self._paths[mark]
            # Who is gone may come back by undo, and is kept by the names that led to it last.
            paths = {
                entity: scene.path_of(entity) if scene.exists(entity) else known.get(entity, ())
                for entity in scene.marks.own(mark)[-MOST_MARKED:]
            }
            self._paths[mark] = {entity: path for entity, path in paths.items() if path}
        kept = {mark: tuple(dict.fromkeys((*self._wanted[mark], *self._paths[mark].values()))) for mark in _MARKS}
        look = SceneLook(
            locked=kept["locked"][-MOST_MARKED:],
            hidden=kept["hidden"][-MOST_MARKED:],
            debug=tuple(lines.debug),
            debugs_selection=lines.debugs_selection,
        )
        keep_scene(self._preferences, owner, look)
