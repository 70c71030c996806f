"""The layer above all others while a person plays: keys and mouse go to the running game, until they are taken back.

A viewport is played in. The pointer is held, so that it can turn without end; what it does, and every key but the one that gives
them back, reaches the simulation as the player's, and nothing in the editor hears of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from elys.bus.input_sender import InputSender
from elys.common.input_names import KEY_NAMES, MOUSE_NAMES
from elys.editor_node.events import (
    CharacterTyped,
    Event,
    KeyPressed,
    KeyReleased,
    MouseMoved,
    MousePressed,
    MouseReleased,
    MouseScrolled,
    WindowFocused,
)
from elys.editor_node.key_bindings import Chord, KeyBindings
from elys.editor_node.model import EditorModel
from elys.editor_node.panels.viewport import ViewportPanel
from elys.editor_node.viewports import Viewports

LEAVE: Final = "game.leave"  # the action whose keys take keys and mouse back
LEAVE_KEYS: Final = ("Escape",)


class GameLayer:
    """Plays in one viewport, or in none."""

    def __init__(
        self,
        model: EditorModel,
        viewports: Viewports,
        keys: KeyBindings,
        *,
        hold_pointer: Callable[[bool], None] = lambda is_held: None,
    ) -> None:
        self._model = model
        self._viewports = viewports
        self._keys = keys
        self._hold_pointer = hold_pointer
        self.sender = InputSender(model.session)
        self.panel: ViewportPanel | None = None  # that is played in
        self._pointer: tuple[float, float] | None = None  # None: wherever it comes to be next

    @property
    def is_on(self) -> bool:
        """Whether the game has keys and mouse."""
        return self.panel is not None

    @property
    def is_possible(self) -> bool:
        """Whether there is a game: a simulation, that is, and now rather than then."""
        model = self._model
        return model.connected and model.status is not None and not model.is_replay and not model.timeline.is_rewound

    def play(self) -> None:
        """In the viewport that keys mean, and lets time go on."""
        if self.is_on or not self.is_possible:
            return
        self.panel = self._viewports.current
        self._viewports.use(self.panel)
        self.panel.is_played = True
        self._pointer = None
        self._hold_pointer(True)
        if not self._model.is_playing:
            self._model.toggle_playing()
        self._model.request_redraw(0.0)

    def leave(self) -> None:
        """Gives keys and mouse back; time goes on, and the player lets go of everything."""
        panel, self.panel = self.panel, None
        if panel is None:
            return
        panel.is_played = False
        self._hold_pointer(False)
        self.sender.let_go_of_all()
        self.sender.send()
        self._model.request_redraw(0.0)

    def on_event(self, event: Event) -> bool:
        """Consumes what belongs to the game."""
        if not self.is_on:
            return False
        match event:
            case KeyPressed() if self._takes_back(event):
                self.leave()
            case KeyPressed(repeated=repeated):
                if not repeated:
                    self.sender.press(KEY_NAMES.get(event.place, ""))
            case KeyReleased():
                name = KEY_NAMES.get(event.place, "")
                was_ours = name in self.sender.held
                self.sender.let_go(name)
                return was_ours  # one that went down before is the editor's: it would be held there for ever
            case CharacterTyped(codepoint):
                self.sender.type(chr(codepoint))
            case MouseMoved(x, y):
                self._move(x, y)
            case MousePressed(button):
                self.sender.press(_mouse_name(button))
            case MouseReleased(button):
                was_ours = _mouse_name(button) in self.sender.held
                self.sender.let_go(_mouse_name(button))
                return was_ours
            case MouseScrolled(x, y):
                self.sender.move("wheel_x", x)
                self.sender.move("wheel_y", y)
            case WindowFocused(False):
                self.leave()
                return False
            case _:
                return False
        return True

    def update(self, elapsed: float) -> None:
        """Sends what was done since the last frame; ends where there is no game any more, or it is not seen."""
        if self.panel is None:
            return
        if not self.is_possible or self.panel not in self._viewports or not self.panel.is_seen:
            self.leave()
        else:
            self.sender.send()

    def _takes_back(self, event: KeyPressed) -> bool:
        chord = Chord.of(event)
        # Whoever has taken these keys away from the action must still come out.
        chords = self._keys.chords_of(LEAVE) or tuple(map(Chord.parse, LEAVE_KEYS))
        return chord is not None and chord in chords

    def _move(self, x: float, y: float) -> None:
        if self._pointer is not None:
            self.sender.move("pointer_x", x - self._pointer[0])
            self.sender.move("pointer_y", y - self._pointer[1])
        self._pointer = (x, y)


def _mouse_name(button: int) -> str:
    return MOUSE_NAMES[button] if 0 <= button < len(MOUSE_NAMES) else ""
