"""The editor's node: a window onto a session that somebody else hosts."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np

from elys.bus.access.keyring import configuration_directory
from elys.bus.messages.streaming import MOST_NAMED, StreamInterest
from elys.bus.session import Session
from elys.bus.state_source import tell_interest
from elys.editor_node.action_list import add_actions
from elys.editor_node.actions import Actions
from elys.editor_node.application import Application
from elys.editor_node.asset_folder import AssetFile
from elys.editor_node.asset_library import AssetLibrary
from elys.editor_node.attachments import Attachments, Join, Openers
from elys.editor_node.camera_views import CameraViews
from elys.editor_node.file_drops import FileDropLayer
from elys.editor_node.game_layer import GameLayer
from elys.editor_node.gpu import TextureShelf, WindowContext, save_picture
from elys.editor_node.imgui_layer import ImGuiLayer
from elys.editor_node.key_bindings import KeyBindings
from elys.editor_node.language import tr, use_language
from elys.editor_node.link_meter import LinkMeter
from elys.editor_node.model import EditorModel
from elys.editor_node.panels.assets import AssetsPanel
from elys.editor_node.panels.viewport import ViewportPanel
from elys.editor_node.preferences import (
    Preferences,
    SessionState,
    keep_session,
    load_preferences,
    save_preferences,
)
from elys.editor_node.recovery import Recovery, state_directory
from elys.editor_node.scene_memory import SceneMemory
from elys.editor_node.seat import Seat
from elys.editor_node.session_state import restore_session, session_state
from elys.editor_node.shortcuts import ChordCapture, ShortcutLayer
from elys.editor_node.type_ahead import TypeAheadLayer
from elys.editor_node.ui import Rectangle, Ui
from elys.editor_node.view_stream import ViewStream
from elys.editor_node.viewport_layer import ViewportLayer
from elys.editor_node.viewports import Viewports
from elys.editor_node.window import Window
from elys.editor_node.workspace import Workspace

TEXT_CURSOR_BLINK: Final = 0.4  # [s]
PREFERENCES: Final = "editor.json"


async def run_editor(
    session: Session | None,
    *,
    openers: Openers | None = None,
    null_platform: bool = False,
    frames: int | None = None,
    size: tuple[int, int] = (1600, 900),
    screenshot: str | Path | None = None,
) -> None:
    """Shows the editor until its window is closed, or for `frames` frames; then writes `screenshot`, if one is named.

    Without a session it begins with its start page; `openers` start what takes other nodes.

    Raises:
        DisplayError: there is no display, or no OpenGL on it.
    """
    with Editor(session, openers=openers, null_platform=null_platform, size=size) as editor:
        await editor.run(frames=frames)
        if screenshot is not None:
            editor.screenshot(screenshot)


class Editor:
    """Model, window and layers put together. A context manager: leaving it closes the window, not the session."""

    def __init__(
        self,
        session: Session | None = None,
        *,
        openers: Openers | None = None,
        join: Join | None = None,
        directory: Path | None = None,
        null_platform: bool = False,
        size: tuple[int, int] = (1600, 900),
    ) -> None:
        """`directory` keeps preferences and layout; the one of `configuration_directory` where none is named.

        Without a display it is a test or a picture: unless a directory is named it neither depends on what a person chose nor
        changes it.
        """
        self.window = Window("ELYS", size, null_platform=null_platform)
        self._directory = directory or (None if self.window.null_platform else configuration_directory())
        self.preferences = Preferences() if self._directory is None else load_preferences(self._directory / PREFERENCES)
        use_language(self.preferences.language)
        self.context = WindowContext()
        self.application = Application(self.window)
        redraw = self.application.request_redraw
        self.seat = Seat(session)
        self.attachments = Attachments(
            self.seat,
            self.preferences,
            openers=openers,
            join=join,
            on_change=redraw,
            on_leave=self._keep_session,
            on_failure=lambda reason: self.model.say("error", reason),
        )
        # As with preferences: tests and pictures leave nothing behind and find nothing.
        recovery = None if self._directory is None else Recovery(state_directory())
        self.model = EditorModel(
            self.seat, request_redraw=redraw, recovery=recovery, listened=lambda: self.application.listened
        )
        self.model.tree.clipboard = self.window
        self.viewports = Viewports(self.seat, self.context, on_frame=redraw)
        self.camera_views = CameraViews(self.model, lambda: self.viewports.current.camera)
        self.widgets = ImGuiLayer(
            self.window,
            self.context,
            draw=self._draw,
            reserves=lambda event: self.viewports.takes_mouse,
            layout_file=self._directory / "editor.ini" if self._directory is not None else None,
            preferences=self.preferences,
        )
        actions = Actions()
        actions.has_session = lambda: self.attachments.is_attached
        self.ui = Ui(
            self.model,
            self.widgets.fonts,
            actions,
            KeyBindings(actions, self.preferences.keys),
            self.preferences,
            self.attachments,
            LinkMeter(self.seat, on_change=redraw),
        )
        self.scene_memory = SceneMemory(self.model, self.preferences, lines=lambda: self.viewports.first.look)
        capture = ChordCapture()
        self.assets = AssetLibrary(self.model)
        self._shelf: TextureShelf[object] = TextureShelf(self.context.texture_of)
        assets = AssetsPanel(self.assets, self._shelf)
        self.viewports.take_drop, self.viewports.look_from = assets.take_drop, self.camera_views.look_from
        self.workspace = Workspace(
            self.ui,
            self.viewports,
            ask_to_close=self.window.request_close,
            close=self.application.close,
            load_docking=self.widgets.load_docking,
            capture=capture,
            assets=assets,
        )
        self.ui.take_picture, self.ui.place_file = self._take_picture, self._place_file
        self.application.on_close = lambda: self.workspace.save_dialog.may_close(self.ui)
        self.navigation = ViewportLayer(self.model, self.viewports, hold_pointer=self.window.hold_pointer)
        self.navigation.grabs = lambda: self.ui.tools.tool == "grab"
        self.game = GameLayer(
            self.model,
            self.viewports,
            self.ui.keys,
            hold_pointer=self.window.hold_pointer,
            pads=self.window.pads,
            keeps_bindings=self._directory is not None,
        )
        add_actions(actions, self.ui, self.workspace, self.navigation, self.camera_views, self.game)
        self._stack_layers(actions, capture)
        self.seat.on_link(self._link_changed)
        self._seen_session = ""  # whose camera it is
        self._title = ""
        if self._directory is not None and not self.preferences.has_seen_tour:
            self.workspace.tour.start()
        if self.attachments.is_attached:
            self._show_session()

    def _stack_layers(self, actions: Actions, capture: ChordCapture) -> None:
        """Who hears events, from the last to the first."""
        push = self.application.push_layer
        push(ShortcutLayer(actions, self.ui.keys))
        push(TypeAheadLayer(self.model.walk, self.workspace.hierarchy, self.ui.keys))
        push(self.navigation)
        push(FileDropLayer(lambda paths: self.workspace.assets.dialogs.take_files(self.ui, paths)))
        push(self.widgets)
        push(self.game)
        push(capture)

    @property
    def panel(self) -> ViewportPanel:
        """The viewport that was used last."""
        return self.viewports.used

    @property
    def stream(self) -> ViewStream:
        """Its pictures."""
        return self.viewports.used.stream

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self.attachments.is_attached:
            self._keep_session()
        self._save_preferences()
        if kind is None:
            self.model.documents.close()
        self.viewports.release()
        self.assets.close()
        self._shelf.release()
        self.widgets.close()
        self.context.release()
        self.window.close()

    async def run(self, *, frames: int | None = None) -> None:
        """Follows the session and draws, until the window is closed or `frames` frames were drawn."""
        async with asyncio.TaskGroup() as group:
            following = group.create_task(self.model.run())
            await self.application.run(frames=frames)
            following.cancel()
        await self.attachments.close()

    def screenshot(self, path: str | Path) -> None:
        """Writes what the window shows as a picture."""
        self.widgets.update(0.0)  # what was swapped away need not be there any more
        save_picture(self.context.read_window(*self.window.framebuffer_size), path)

    def _place_file(self, file: AssetFile) -> None:
        async def place() -> None:
            await self.assets.placing.place(file, np.array(self.ui.focus))

        self.model.session.start(place())

    def _take_picture(self, path: Path, rectangle: Rectangle) -> None:
        """Writes a part of the window as a picture once the frame that is being built is done."""

        def take() -> None:
            self.widgets.update(0.0)
            width, height = self.window.framebuffer_size
            pixels, scale = self.context.read_window(width, height), width / self.window.size[0]
            left, top, right, bottom = (max(round(edge * scale), 0) for edge in rectangle)
            try:
                save_picture(pixels[top:bottom, left:right], path)
            except (OSError, ValueError) as error:
                self.model.say("error", tr("{path} cannot be written: {reason}", path=path, reason=error))
            else:
                self.model.say("info", tr("Wrote {path}", path=path))

        asyncio.get_running_loop().call_soon(take)

    def _note_frame(self) -> None:
        """What the last frame took, while somebody looks."""
        if self.ui.watches.is_running("editor frames"):
            build, draw = 1e3 * self.widgets.build_time, 1e3 * self.widgets.draw_time
            total = 1e3 * self.application.frame_time
            stages = {"build": build, "draw": draw, "show": max(total - build - draw, 0.0)}
            self.workspace.instruments.add_editor_frame(self.application.frame_count, total, stages)

    def _draw(self, elapsed: float) -> None:
        self._note_frame()
        self.scene_memory.follow()
        self.workspace.frame_time = self.application.frame_time
        self.workspace.assets.begin_frame()
        self.workspace.draw(elapsed)
        self._tell_interest()
        scene = f"{self.model.status.scene} - " if self.model.status is not None else ""
        title = f"{'* ' if self.model.file.is_dirty else ''}{scene}ELYS"
        if title != self._title:
            self._title = title
            self.window.set_title(title)
        self.application.request_redraw(max(0.0, self.viewports.next_deadline - time.monotonic()))
        if self.widgets.is_typing:
            self.application.request_redraw(TEXT_CURSOR_BLINK)

    def _tell_interest(self) -> None:
        """What the stream of states shall see to first: what is selected, then what stands in the tree, then what is near."""
        lines = tuple(self.model.scene.tree.entities[:MOST_NAMED])
        camera = self.viewports.used.camera.view
        tell_interest(self.seat, StreamInterest(cameras=(camera,), chosen=self.model.selection.entities, open=lines))

    def _link_changed(self, connected: bool) -> None:
        if connected:
            self.viewports.refresh()
            self._show_session()
        self.application.request_redraw()

    def _show_session(self) -> None:
        """Looks at another session as it was looked at last; at one never seen as its scene wants it."""
        if self.seat.name == self._seen_session:
            return
        self._seen_session = self.seat.name
        self.viewports.forget()
        self._save_preferences()  # an editor that is killed forgets nothing of before
        kept = self.preferences.sessions.get(self.seat.name)
        self.navigation.is_placed = kept is not None and bool(kept.views)
        restore_session(kept or SessionState(), self.viewports, self.ui.tools, self.camera_views.places)

    def _save_preferences(self) -> None:
        if self._directory is not None:
            self.preferences.keys = self.ui.keys.chosen
            self.preferences.hidden_panels = self.workspace.hidden_panels
            save_preferences(self.preferences, self._directory / PREFERENCES)

    def _keep_session(self) -> None:
        state = session_state(self.viewports, self.ui.tools, self.camera_views.places)
        keep_session(self.preferences, self.seat.name, state)
