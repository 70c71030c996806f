"""python -m tests.benchmarks.inspector: how long a frame of the editor takes to build with much in the inspector.

The real editor on GLFW's null platform, a host in the same process that answers nothing: what is measured is the panel, as time
of this thread, from the begin of a frame's widgets to their draw lists. Drawing them is the driver's.
"""

from __future__ import annotations

import asyncio
import os
import time
from typing import Annotated

import numpy as np

from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.components import Component, about, component
from elys.common.scene import EntityRecord

FRAMES = 200
COUNT = 5000
PARTS = 30


def declare_parts() -> list[str]:
    """Thirty components of eight fields."""
    names = []
    for number in range(PARTS):
        fields = {f"value_{place}": Annotated[float, about("Anything.", unit="m")] for place in range(8)}
        namespace = {"__annotations__": fields, "__doc__": "Of a benchmark.", **dict.fromkeys(fields, 0.0)}
        names.append(component(type(Component)(f"Part{number:02}", (Component,), namespace, frozen=True)).__name__)
    return names


async def measure() -> None:
    from imgui_bundle import imgui

    from elys.editor_node.node import Editor
    from tests.unit.editor_node.scene_host import SceneHost

    parts = {name: {} for name in declare_parts()}
    records = [EntityRecord(name="Everything", components={"Transform": {}, "RigidBody": {}, "Material": {}, **parts})]
    plain = {"Transform": {}, "RigidBody": {}, "Collider": {}, "MeshRenderer": {}, "Material": {}}
    records += [
        EntityRecord(name=f"Box {n}", components={**plain, "Transform": {"position": [n, 0, 0]}}) for n in range(COUNT)
    ]
    broker = LoopbackBroker()
    host_session = await Session.host(broker.listen(), name="crowd", kind="simulation", epoch=1)
    host = SceneHost(host_session)
    host.load(records)
    session = await Session.join(broker.connect(), kind="editor")
    with Editor(session, null_platform=True, size=(1600, 900)) as editor:
        window = asyncio.create_task(editor.run())
        while not editor.model.scene.is_known:
            await asyncio.sleep(0.01)
        entities = list(editor.model.scene.mirror.entities)

        def build_times(moving: bool) -> np.ndarray:
            taken = []
            for frame in range(FRAMES):
                if moving:
                    editor.model.scene.version += 1  # as a state frame does: all is to be looked at again
                imgui.backends.opengl3_new_frame()
                imgui.backends.glfw_new_frame()
                imgui.new_frame()
                start = time.thread_time()
                editor.workspace.draw(1.0 / 60.0)
                imgui.render()
                if frame >= 5:
                    taken.append(time.thread_time() - start)
            return np.array(taken) * 1e3

        for label, selected in (
            ("nothing", []),
            ("one box", entities[1:2]),
            (f"an entity of {PARTS + 3} components", entities[:1]),
            (f"{COUNT} entities", entities[1:]),
        ):
            editor.model.selection.replace(selected)
            first = time.thread_time()
            editor.widgets.update(0.0)
            first = (time.thread_time() - first) * 1e3
            for moving in (False, True):
                times = build_times(moving)
                state = "moving" if moving else "at rest"
                print(
                    f"{label:32} {state:8} median {np.median(times):5.2f} ms   99 % {np.percentile(times, 99):5.2f} ms"
                    f"   first, drawn {first:5.1f} ms"
                )
        editor.application.close()
        await window
    await session.close()
    await host_session.close()


if __name__ == "__main__":
    os.environ["ELYS_NULL_PLATFORM"] = "1"
    asyncio.run(measure())
