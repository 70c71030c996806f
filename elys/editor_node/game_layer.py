"""The layer above all others while a person plays: keys, mouse and gamepads go to the running game, until they are taken back.

A viewport is played in. The pointer is held, so that it can turn without end; what it does, and every key but the one that gives
them back, reaches the simulation as the player's, and nothing in the editor hears of it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Final

from elys.bus.gamepads import PadState
from elys.bus.host_clock import HostClock
from elys.bus.local_players import LocalPlayers
from elys.common.errors import InputError
from elys.common.input_bindings import load_bindings
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
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.viewports import Viewports

LEAVE: Final = "game.leave"  # the action whose keys take keys and mouse back
LEAVE_KEYS: Final = ("Escape",)
FRAME_TIME: Final = 1.0 / 60.0  # [s] between two looks at gamepads, which tell nothing by themselves


class GameLayer:
    """Plays in one viewport, or in none. `pads` tells how gamepads stand; `keeps_bindings`: the user's own ones count."""

    def __init__(
        self,
        model: EditorModel,
        viewports: Viewports,
        keys: KeyBindings,
        *,
        hold_pointer: Callable[[bool], None] = lambda is_held: None,
        pads: Callable[[], Mapping[int, PadState]] = dict,
        keeps_bindings: bool = False,
    ) -> None:
        self._model = model
        self._viewports = viewports
        self._keys = keys
        self._hold_pointer = hold_pointer
        self._pads = pads
        self._keeps_bindings = keeps_bindings
        self._players = LocalPlayers(model.session, bindings=self._bindings)
        self.sender = self._players.main
        self._host_clock = HostClock(model.session)
        self._clock_pings: asyncio.Task[None] | None = None  # while somebody plays
        self._refusal = ""  # that was told
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
        self._players.start(self._pads())
        self._clock_pings = self._model.session.start(self._host_clock.run())
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
        self._players.stop()
        self._send(panel)
        if self._clock_pings is not None:
            self._clock_pings.cancel()
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
            self._players.update(self._pads())
            self._send(self.panel)
            self._tell_refusal()
            self._model.request_redraw(FRAME_TIME)

    def _send(self, panel: ViewportPanel) -> None:
        """What was done goes out with what the player saw when he did it."""
        shown = panel.stream.shown
        seen_time = shown.simulation_time if shown is not None else -1.0
        self._players.send(seen_time=seen_time, host_time=self._host_clock.host_time())

    def _tell_refusal(self) -> None:
        refusal = self._players.refusal
        if refusal != self._refusal:
            self._refusal = refusal
            if refusal:
                self._model.say("warning", tr_sentence(refusal))

    def _bindings(self, player: int) -> Mapping[str, str]:
        try:
            return load_bindings().of(player) if self._keeps_bindings else {}
        except InputError as error:
            self._model.say("error", tr_sentence(str(error)))
            return {}

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
