"""The editor on fifty thousand entities: frames, clicks, searches, orders, and one edit of thousands.

The real editor on GLFW's null platform and a host in the same process. Frames are timed from the begin of the widgets to their
draw lists, as time of this thread; drawing them is the driver's. A response is wall time, until its frame was shown.
"""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np

from elys.bus.messages.commands import Batch, Command, Despawn, SetComponent, Spawn
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.scene import EntityRecord, SceneSettings
from elys.editor_node.events import Modifiers, MouseButton, MouseMoved, MousePressed, MouseReleased
from elys.sim_node.collection import without_collection
from elys.sim_node.edit_history import EditHistory
from elys.sim_node.simulation import Simulation
from elys.sim_node.systems.apply_edits import EditableSimulation

if TYPE_CHECKING:
    from elys.editor_node.node import Editor

COUNT: Final = 50_000
CHOSEN: Final = 5000
_KINDS: Final = (
    {"Transform": {}, "RigidBody": {}, "Collider": {}, "MeshRenderer": {}},
    {"Transform": {}, "Light": {}},
    {"Transform": {}, "MeshRenderer": {}},
    {"Transform": {}},
)
_SEARCHES: Final = ("b", "box 1", "t:Light", "t:sphere", "enabled", "!c:RigidBody", "")
Row = tuple[str, str]


def crowd(count: int = COUNT) -> list[EntityRecord]:
    """Roots of four kinds."""
    return [EntityRecord(name=f"Box {n}", components=_KINDS[n % len(_KINDS)]) for n in range(count)]


def measure() -> list[Row]:
    """Rows of the table."""
    before = os.environ.get("ELYS_NULL_PLATFORM")
    os.environ["ELYS_NULL_PLATFORM"] = "1"
    try:
        return [*asyncio.run(_at_the_editor()), *edits()]
    finally:
        if before is None:
            del os.environ["ELYS_NULL_PLATFORM"]


async def _at_the_editor() -> list[Row]:
    from elys.editor_node.node import Editor
    from tests.unit.editor_node.conftest import SceneHost

    broker = LoopbackBroker()
    host_session = await Session.host(broker.listen(), name="crowd", kind="simulation", epoch=1)
    host = SceneHost(host_session)
    host.load(crowd())
    session = await Session.join(broker.connect(), kind="editor")
    with Editor(session, null_platform=True, size=(1600, 900)) as editor:
        running = asyncio.create_task(editor.run())
        while not editor.model.scene.is_known or editor.application.frame_count < 20:
            editor.application.keep_awake(1.0)
            await asyncio.sleep(0.01)
        rows = [*frames(editor), await clicks(editor), await response(editor)]
        editor.application.close()
        await running
    await session.close()
    await host_session.close()
    return rows


def frames(editor: Editor) -> list[Row]:
    """What frames take to build: at rest, and while the tree is searched and sorted."""
    quiet = [_build(editor) for _ in range(200)]
    rows = [(f"{COUNT:,} entities: a frame, p50 / worst", f"{np.median(quiet):.1f} / {max(quiet):.1f} ms")]
    panel, worst, longest = editor.workspace.hierarchy, 0.0, 0

    def until_shown(change: Callable[[], None]) -> None:
        nonlocal worst, longest
        change()
        times = [_build(editor)]
        while editor.model.scene.tree.is_behind:
            times.append(_build(editor))
        worst, longest = max(worst, *times), max(longest, len(times))

    for search in _SEARCHES:
        until_shown(lambda search=search: panel.search_for(search))
    rows.append(("searches in them: the worst frame; the most frames", f"{worst:.1f} ms; {longest}"))
    worst, longest = 0.0, 0
    for order in ("name", "kind", "scene"):
        until_shown(lambda order=order: setattr(panel, "_order", order))
    rows.append(("sorting them: the worst frame; the most frames", f"{worst:.1f} ms; {longest}"))
    return rows


async def clicks(editor: Editor) -> Row:
    """From the press on a line until the frame in which the inspector shows it."""
    application, landmarks, times = editor.application, editor.ui.landmarks, []
    landmarks.is_wanted = True
    await _frames(editor, 3)
    scene = editor.model.scene
    for entity in scene.tree.show().entities[:12]:
        application.offer(MouseMoved(*landmarks.center(f"hierarchy/{scene.name_of(entity)}")))
        await _frames(editor, 2)
        began = time.perf_counter()
        application.offer(MousePressed(MouseButton.LEFT, Modifiers.NONE))
        await _frames(editor, 1)
        application.offer(MouseReleased(MouseButton.LEFT, Modifiers.NONE))
        last = application.frame_count + 60
        while editor.model.selection.entities != (entity,):
            assert application.frame_count < last, "the click selected nothing"
            await _frames(editor, 1)
        await _frames(editor, 1)  # the inspector is drawn after the hierarchy, in the same frame or the next
        times.append(1e3 * (time.perf_counter() - began))
    shown = f"{np.median(times):.0f} / {max(times):.0f} ms"
    return "a click on one of them until the inspector shows it, wall time, p50 / worst", shown


def edits() -> list[Row]:
    """One field of thousands at once: what that is for the editor, and for the tick of a simulation."""
    simulation = Simulation(settings=SceneSettings())
    history = EditHistory(EditableSimulation(simulation))
    author = history.attach("bench", "editor-1", alive=("editor-1",))

    def take(command: Command) -> float:
        began = time.thread_time()
        with without_collection():  # as the node does
            history.perform(command, author=author, writer=author, label="bench", stroke="", made_from=-1)
            simulation.settle()
            simulation.take_changes()
        return 1e3 * (time.thread_time() - began)

    def undo() -> float:
        began = time.thread_time()
        with without_collection():
            history.undo(author)
            simulation.settle()
            simulation.take_changes()
        return 1e3 * (time.thread_time() - began)

    take(Spawn(records=tuple(crowd())))
    entities = simulation.world.entities()[:COUNT].tolist()
    set_one = [
        SetComponent(entity=entity, component="Transform", values={"position": [float(n), 1.0, 0.0]})
        for n, entity in enumerate(entities[:CHOSEN])
    ]
    all_deleted = take(Batch(edits=tuple(Despawn(entity=entity) for entity in entities)))
    all_undone = undo()
    edited = take(Batch(edits=tuple(set_one)))
    deleted = take(Batch(edits=tuple(Despawn(entity=entity) for entity in entities[:CHOSEN])))
    undone = undo()
    return [
        (f"a field of {CHOSEN} entities set at once: the simulation's tick", f"{edited:.0f} ms"),
        (f"{CHOSEN} of them deleted, undone: the simulation's tick", f"{deleted:.0f}, {undone:.0f} ms"),
        (f"all {COUNT:,} deleted, undone: the simulation's tick", f"{all_deleted:.0f}, {all_undone:.0f} ms"),
    ]


async def response(editor: Editor) -> Row:
    """Of an edit of thousands, from the edit until the first frame that knows of it from the host."""
    entities = editor.model.scene.tree.show().entities[:CHOSEN]
    editor.model.selection.replace(entities)
    await _frames(editor, 3)
    began, scene = time.perf_counter(), editor.model.scene
    editor.model.edit.set_fields(entities, "Transform", {"scale": (2.0, 2.0, 2.0)})
    while scene.components_of(entities[-1])["Transform"].scale[0] != 2.0:
        await asyncio.sleep(0.0)
    await _frames(editor, 1)
    return (
        f"a field of {CHOSEN} selected entities set: until a frame shows it, wall time, host included",
        f"{1e3 * (time.perf_counter() - began):.0f} ms",
    )


async def _frames(editor: Editor, count: int) -> None:
    goal = editor.application.frame_count + count
    editor.application.keep_awake(1.0)
    while editor.application.frame_count < goal:
        await asyncio.sleep(0.0)


def _build(editor: Editor) -> float:
    """Builds a frame, and what that took [ms]."""
    from imgui_bundle import imgui

    imgui.backends.opengl3_new_frame()
    imgui.backends.glfw_new_frame()
    imgui.new_frame()
    began = time.thread_time()
    editor.workspace.draw(1.0 / 60.0)
    imgui.render()
    return 1e3 * (time.thread_time() - began)
