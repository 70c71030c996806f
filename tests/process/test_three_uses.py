"""The three uses, between real processes: edit what runs, replay what ran, simulate here and watch there."""

from __future__ import annotations

import asyncio
import contextlib
import json
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from elys.bus import topics
from elys.bus.discovery import join_session
from elys.bus.messages.commands import Seek, SetComponent, SetPlaying, StepTicks
from elys.bus.messages.state_frame import StateFrame, unpack_frame
from elys.bus.messages.views import ViewCamera, ViewFrame, ViewRequest
from elys.bus.session import Session
from elys.common.assets.store import AssetStore
from elys.common.math.matrix import look_rotation
from elys.editor_node.model import EditorModel
from elys.samples.registry import SAMPLES, write_sample
from elys.sim_node.simulation import Simulation
from elys.verbs.scenes import open_scene_or_sample
from tests.process.clients import client
from tests.reference import plain_recording

pytestmark = pytest.mark.process
EYE = (0.0, 3.0, 9.0)
COLUMNS = ("entity", "position", "rotation", "linear_velocity", "angular_velocity")


def test_an_edit_in_the_editor_changes_the_simulation_and_shows_in_a_picture(elys, free_port):
    """The editor's model, the simulation and the render node are three processes here; undo takes the picture back."""
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "stack", "--headless", "--paused", "--listen", endpoint).wait_for("simulating")
    elys("node", "render", "--connect", endpoint)

    async def edit() -> None:
        session = await join_session(endpoint, kind="editor", timeout=20)
        model = EditorModel(session)
        running = asyncio.create_task(model.run())
        async with asyncio.timeout(200):
            while not (model.scene.is_known and session.nodes_of("render")):
                await asyncio.sleep(0.01)
            mirror = model.scene.mirror
            cube = next(e.id for e in mirror.entities.values() if "RigidBody" in e.components)
            before = await picture(session, 1)

            model.edit.set_fields([cube], "Material", {"base_color": (1.0, 0.0, 0.0), "emissive": (0.5, 0.0, 0.0)})
            model.edit.set_fields([cube], "Transform", {"position": (0.0, 3.0, 3.0), "scale": (2.0, 2.0, 2.0)})
            await model.history.settle()
            assert mirror.entities[cube].components["Material"].base_color == (1.0, 0.0, 0.0)
            async with client(endpoint) as other:  # the simulation itself, asked by somebody else
                assert other.mirror.entities[cube].components["Transform"].position == (0.0, 3.0, 3.0)
            after = await picture(session, 2)
            assert red_share(after) > red_share(before) + 0.02

            model.undo()
            model.undo()
            await model.history.settle()
            again = await picture(session, 3)
            assert np.abs(again.astype(int) - before.astype(int)).mean() < 0.5
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running
        await session.close()

    asyncio.run(edit())


async def picture(session: Session, sequence: int) -> np.ndarray:
    """What the session's render node draws from EYE."""
    arrived: asyncio.Queue[ViewFrame] = asyncio.Queue()
    close = session.subscribe(topics.VIEW_FRAME, lambda frame, _: arrived.put_nowait(frame), key="test")
    rotation = look_rotation((-EYE[0], 1.5 - EYE[1], -EYE[2])).tolist()
    camera = ViewCamera(position=EYE, rotation=tuple(rotation))
    # Asked for until two pictures in a row are the same: assets and deltas may still be on their way to the render node.
    last: bytes = b""
    for attempt in range(100):
        request = ViewRequest(
            view="test", sequence=1000 * sequence + attempt, camera=camera, width=320, height=240, grid=False
        )
        session.publish(topics.VIEW_REQUEST, request, key=session.nodes_of("render")[0].id)
        try:
            frame = await asyncio.wait_for(arrived.get(), 10)
        except TimeoutError:  # requests and pictures are latest-wins: one may be lost, and is asked for again
            continue
        if frame.sequence >= 1000 * sequence + 2 and frame.jpeg == last:
            close()
            return simplejpeg.decode_jpeg(frame.jpeg)
        last = frame.jpeg
        await asyncio.sleep(0.05)
    raise AssertionError("the picture never came to rest")


def red_share(pixels: np.ndarray) -> float:
    red, green, blue = (pixels[..., channel].astype(int) for channel in range(3))
    return float(((red > 150) & (green < 90) & (blue < 90)).mean())


def frames_of(recording: Path) -> list[StateFrame]:
    """All state frames, read by the official MCAP reader and a reader of packed frames that has nothing of ELYS."""
    return [unpack_frame(body) for body in plain_recording.frames(recording)]


@pytest.mark.parametrize("scene", ["yard", "bridge"])
def test_replaying_gives_the_positions_that_were_recorded_bit_for_bit(scene, elys, free_port, tmp_path):
    """Recorded by one process, replayed by another, compared with a third run of the same scene in this one."""
    recording = tmp_path / f"{scene}.mcap"
    run = elys("run", scene, "--headless", "--steps", "240", "--record", recording, "--json")
    assert run.wait(seconds=240) == 0  # a scene with joints compiles more
    recorded = {frame.tick: frame for frame in frames_of(recording)}
    assert sorted(recorded) == list(range(241))

    simulation = Simulation.load(open_scene_or_sample(scene, assets := AssetStore()), assets)
    for tick in range(241):
        mine = simulation.moving_bodies()
        for column in COLUMNS:
            assert np.array_equal(getattr(recorded[tick], column), getattr(mine, column)), (tick, column)
        simulation.step()

    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("play", recording, "--paused", "--listen", endpoint).wait_for("playing")

    async def watch() -> None:
        async with client(endpoint) as viewer:
            for tick in (0, 200, 7, 240, 120):
                await viewer.ask(Seek(time=tick / 60.0))
                await viewer.until(lambda tick=tick: bool(viewer.frames) and viewer.frames[-1].tick == tick)
                assert_same(viewer.frames[-1], recorded[tick])
            await viewer.ask(StepTicks(count=-1))
            await viewer.until(lambda: viewer.frames[-1].tick == 119)
            assert_same(viewer.frames[-1], recorded[119])
            await viewer.ask(SetPlaying(playing=True))
            await viewer.until(lambda: viewer.frames[-1].tick >= 200)
            for frame in viewer.frames:
                assert_same(frame, recorded[frame.tick])
            entity = viewer.mirror.roots[0]
            reply = await viewer.ask(SetComponent(entity=entity, component="Transform", values={"position": [0, 0, 0]}))
            assert not reply.accepted
            assert "this is a recording" in reply.reason

    asyncio.run(watch())


def assert_same(shown: StateFrame, recorded: StateFrame) -> None:
    for column in COLUMNS:
        assert np.array_equal(getattr(shown, column), getattr(recorded, column)), column


def test_headless_runs_without_any_display_library(elys, free_port, tmp_path):
    """A run that simulates, listens and records has no window, GL or display library in its memory."""
    endpoint = f"tcp/127.0.0.1:{free_port}"
    run = elys("run", "yard", "--headless", "--listen", endpoint, "--record", tmp_path / "yard.mcap")
    run.wait_for("first tick")
    mapped = Path(f"/proc/{run.process.pid}/maps").read_text()
    for library in ("libGL", "libEGL", "libX11", "libwayland", "glfw", "imgui", "moderngl", "libGLX", "swrast"):
        assert library not in mapped, library
    assert "numba" in mapped or "llvmlite" in mapped


def test_two_runs_of_a_scene_end_in_the_same_state_whatever_the_threads(elys):
    reports = []
    for threads in ("1", "2"):
        run = elys("run", "yard", "--headless", "--steps", "120", "--threads", threads, "--json")
        assert run.wait() == 0
        reports.append(json.loads(run.output[run.output.index("{") :]))
    assert reports[0]["state_hash"] == reports[1]["state_hash"]
    assert reports[0]["ticks"] == 120


def test_the_demo_without_a_screen_leaves_its_three_files(elys, tmp_path):
    demo = elys("demo")
    assert demo.wait(seconds=180) == 0
    for name in ("demo.mcap", "demo.png", "demo.mp4"):
        assert (tmp_path / name).stat().st_size > 10_000, name
    assert "elys play" in demo.output


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_every_sample_comes_to_its_proper_end(name, tmp_path):
    sample = SAMPLES[name]
    write_sample(name, path := tmp_path / f"{name}.scene.json")
    simulation = Simulation.load(open_scene_or_sample(str(path), assets := AssetStore()), assets)
    for _ in range(300):
        simulation.step()
    world = simulation.world
    positions = {
        world.hierarchy.name_of(entity): world.transforms.world_pose(entity)[0] for entity in world.entities().tolist()
    }
    assert all(np.isfinite(position).all() for position in positions.values())
    if sample.check_final is not None:
        assert sample.check_final(positions) == ""
