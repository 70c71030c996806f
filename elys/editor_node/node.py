"""The editor's node: a window onto a session that somebody else hosts."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from elys.bus.session import Session
from elys.editor_node.action_list import add_actions
from elys.editor_node.actions import Actions
from elys.editor_node.application import Application
from elys.editor_node.camera import OrbitCamera
from elys.editor_node.gpu import WindowContext, save_picture
from elys.editor_node.imgui_layer import ImGuiLayer
from elys.editor_node.key_bindings import KeyBindings
from elys.editor_node.language import use_language
from elys.editor_node.model import EditorModel
from elys.editor_node.panels.viewport import ViewportPanel
from elys.editor_node.preferences import Preferences, configuration_directory, load_preferences, save_preferences
from elys.editor_node.shortcuts import ShortcutLayer
from elys.editor_node.type_ahead import TypeAheadLayer
from elys.editor_node.ui import Ui
from elys.editor_node.view_stream import ViewStream
from elys.editor_node.viewport_layer import ViewportLayer
from elys.editor_node.window import Window
from elys.editor_node.workspace import Workspace

TEXT_CURSOR_BLINK: Final = 0.4  # [s]
PREFERENCES: Final = "editor.json"


async def run_editor(
    session: Session,
    *,
    null_platform: bool = False,
    frames: int | None = None,
    size: tuple[int, int] = (1600, 900),
    screenshot: str | Path | None = None,
) -> None:
    """Shows the editor until its window is closed, or for `frames` frames; then writes `screenshot`, if one is named.

    Raises:
        DisplayError: there is no display, or no OpenGL on it.
    """
    with Editor(session, null_platform=null_platform, size=size) as editor:
        await editor.run(frames=frames)
        if screenshot is not None:
            editor.screenshot(screenshot)


class Editor:
    """Model, window and layers put together. A context manager: leaving it closes the window, not the session."""

    def __init__(self, session: Session, *, null_platform: bool = False, size: tuple[int, int] = (1600, 900)) -> None:
        self.window = Window("ELYS", size, null_platform=null_platform)
        # Without a display it is a test or a picture: it neither depends on what a person chose nor changes it.
        self._directory = None if self.window.null_platform else configuration_directory()
        self.preferences = Preferences() if self._directory is None else load_preferences(self._directory / PREFERENCES)
        use_language(self.preferences.language)
        self.context = WindowContext()
        self.application = Application(self.window)
        self.model = EditorModel(session, request_redraw=self.application.request_redraw)
        self.model.tree.clipboard = self.window
        self.stream = ViewStream(session, on_frame=self.application.request_redraw)
        self._picture = self.context.picture()
        self.panel = ViewportPanel(self.stream, self._picture, OrbitCamera())
        self.widgets = ImGuiLayer(
            self.window,
            self.context,
            draw=self._draw,
            reserves=lambda event: self.panel.takes_mouse,
            layout_file=self._directory / "editor.ini" if self._directory is not None else None,
        )
        actions = Actions()
        self.ui = Ui(
            self.model, self.widgets.fonts, actions, KeyBindings(actions, self.preferences.keys), self.preferences
        )
        self.workspace = Workspace(
            self.ui, self.panel, ask_to_close=self.window.request_close, close=self.application.close
        )
        self.application.on_close = lambda: self.workspace.save_dialog.may_close(self.ui)
        navigation = ViewportLayer(self.model, self.panel, hold_pointer=self.window.hold_pointer)
        add_actions(actions, self.ui, self.workspace, navigation)
        self.application.push_layer(ShortcutLayer(actions, self.ui.keys))
        self.application.push_layer(TypeAheadLayer(self.model.walk, self.workspace.hierarchy, self.ui.keys))
        self.application.push_layer(navigation)
        self.application.push_layer(self.widgets)
        session.on_link(self._link_changed)
        self._title = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._directory is not None:
            self.preferences.keys = self.ui.keys.chosen
            save_preferences(self.preferences, self._directory / PREFERENCES)
        self.stream.close()
        self._picture.release()
        self.widgets.close()
        self.context.release()
        self.window.close()

    async def run(self, *, frames: int | None = None) -> None:
        """Follows the session and draws, until the window is closed or `frames` frames were drawn."""
        async with asyncio.TaskGroup() as group:
            following = group.create_task(self.model.run())
            await self.application.run(frames=frames)
            following.cancel()

    def screenshot(self, path: str | Path) -> None:
        """Writes what the window shows as a picture."""
        self.widgets.update(0.0)  # what was swapped away need not be there any more
        save_picture(self.context.read_window(*self.window.framebuffer_size), path)

    def _draw(self, elapsed: float) -> None:
        self.workspace.frame_time = self.application.frame_time
        self.workspace.draw(elapsed)
        scene = f"{self.model.status.scene} - " if self.model.status is not None else ""
        title = f"{'* ' if self.model.file.is_dirty else ''}{scene}ELYS"
        if title != self._title:
            self._title = title
            self.window.set_title(title)
        self.application.request_redraw(max(0.0, self.stream.next_deadline - time.monotonic()))
        if self.widgets.is_typing:
            self.application.request_redraw(TEXT_CURSOR_BLINK)

    def _link_changed(self, connected: bool) -> None:
        if connected:
            self.stream.refresh()
        self.application.request_redraw()
