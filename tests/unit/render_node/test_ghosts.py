"""Other runs in pictures: tinted, see-through, without shadows, at the instant that is seen, and only where they have parted."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg

from elys.bus import codec, topics
from elys.bus.ghost_service import GhostServer
from elys.bus.messages.ghosts import GhostChange
from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.messages.state_frame import StateFrame, pack_frame
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.bus.recording import Recording
from elys.bus.topics import Encoding
from elys.bus.transports.mcap import McapWriter
from elys.common.components import Component, Light, Material, MeshRenderer, RigidBody, Transform, values_of
from elys.common.math.matrix import look_rotation
from elys.common.scene import PictureSettings, SceneSettings
from elys.render_node.debug_drawing import DebugDrawing
from elys.render_node.ghost_worlds import SAME_PLACE, GhostWorlds
from elys.render_node.offline import OfflineRenderer, Overlay
from elys.render_node.parting_marks import length_text
from elys.render_node.pass_plan import told_passes
from elys.render_node.passes.ghosts import OPACITY
from elys.render_node.render_world import RenderWorld
from elys.render_node.scene_reader import SceneReader
from tests.unit.render_node.test_view_service import BOX, Play, play

BODY, OTHER, STILL = 1, 2, 3
CAMERA = ViewCamera(position=(0.0, 0.0, 5.0), rotation=(0.0, 0.0, 0.0, 1.0), ortho_height=4.0)
SIZE = 64  # pixels of an edge: sixteen a metre
TINT = (200, 100, 50)
PLAIN = PictureSettings(tone_mapping="none", ambient_occlusion=0.0, bloom=0.0, fxaa=False)
Poses = Mapping[int, tuple[float, float, float]]


def mirror_of(*things: tuple[int, str, tuple[Component, ...]]) -> SceneMirror:
    """A black scene of entities by id, name and components."""
    mirror = SceneMirror()
    mirror.epoch = 1
    mirror.settings = SceneSettings(background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0), picture=PLAIN)
    changes = tuple(
        Spawned(
            entity=entity, name=name, parent=0, enabled=True, components={type(c).__name__: values_of(c) for c in of}
        )
        for entity, name, of in things
    )
    mirror.apply_delta(SceneDelta(epoch=1, sequence=0, tick=0, changes=changes))
    return mirror


def body(color: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[Component, ...]:
    """A cube that glows in a colour."""
    return Transform(), MeshRenderer(), RigidBody(), Material(base_color=(0.0, 0.0, 0.0), emissive=color)


def frame(poses: Poses, time: float = 0.0) -> StateFrame:
    count = len(poses)
    return StateFrame(
        epoch=1,
        tick=round(time * 60),
        simulation_time=time,
        published_at=round(time * 1e9) + 1,
        delta_sequence=0,
        state_hash=0,
        playing=True,
        position=np.array(list(poses.values()), np.float64).reshape(count, 3),
        rotation=np.tile(np.array([0, 0, 0, 1], np.float32), (count, 1)),
        linear_velocity=np.zeros((count, 3), np.float32),
        angular_velocity=np.zeros((count, 3), np.float32),
        entity=np.array(list(poses), np.uint32),
    )


class Track:
    """A ghost of frames that are given."""

    def __init__(self, mirror: SceneMirror, *frames: StateFrame, color: tuple[int, int, int] = TINT) -> None:
        self.mirror, self.frames, self.color, self.title = mirror, frames, color, "Other"

    def own_time(self, at: float) -> float:
        return at

    def around(self, time: float) -> tuple[StateFrame, StateFrame] | None:
        earlier = [one for one in self.frames if one.simulation_time <= time + 1e-9]
        later = [one for one in self.frames if one.simulation_time >= time - 1e-9]
        return (earlier[-1], later[0]) if earlier and later else None

    def fetch(self, reference: str) -> bytes:
        raise AssertionError(reference)


def picture(context: Any, mirror: SceneMirror, here: Poses, *ghosts: Track, **options: Any) -> np.ndarray:
    mirror.keep_frame(frame(here))
    tracks = {str(number): ghost for number, ghost in enumerate(ghosts)}
    with OfflineRenderer(mirror, width=SIZE, height=SIZE, context=context, ghosts=tracks, **options) as renderer:
        return renderer.picture(camera=CAMERA)[..., :3].astype(int)


def at(pixels: np.ndarray, x: float, y: float = 0.0) -> tuple[int, ...]:
    """The colour at a place of the picture [m]."""
    row, column = round(SIZE / 2 - y * SIZE / 4), round(SIZE / 2 + x * SIZE / 4)
    return tuple(pixels[row, column].tolist())


def linear(shown: Any) -> np.ndarray:
    share = np.asarray(shown, np.float64) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def shown(light: Any) -> np.ndarray:
    light = np.clip(np.asarray(light, np.float64), 0.0, 1.0)
    return 255.0 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


@pytest.mark.gl
def test_it_is_laid_over_the_scene_in_its_colour(context: Any) -> None:
    wall = (
        STILL,
        "Wall",
        (Transform(position=(0, 0, -3), scale=(20, 20, 1)), MeshRenderer(), body((0.2, 0.5, 0.1))[3]),
    )
    mirror, other = mirror_of((BODY, "Body", body()), wall), mirror_of((BODY, "Body", body()))
    plain = picture(context, mirror, {BODY: (-1.0, 0.0, 0.0)})
    pixels = picture(context, mirror, {BODY: (-1.0, 0.0, 0.0)}, Track(other, frame({BODY: (1.0, 0.0, 0.0)})))
    expected = shown(OPACITY * linear(TINT) + (1.0 - OPACITY) * linear(at(plain, 1.0)))
    np.testing.assert_allclose(at(pixels, 1.0), expected, atol=1.5)
    away = np.ones((SIZE, SIZE), bool)
    away[:, SIZE // 2 :] = False
    np.testing.assert_array_equal(pixels[away], plain[away])


@pytest.mark.gl
def test_it_is_hidden_by_what_is_before_it_and_hides_nothing(context: Any) -> None:
    mirror, other = mirror_of((BODY, "Body", body((0.0, 0.0, 0.6)))), mirror_of((BODY, "Body", body()))
    plain = picture(context, mirror, {BODY: (0.0, 0.0, 0.0)})
    behind, before = frame({BODY: (0.0, 0.0, -2.0)}), frame({BODY: (0.0, 0.0, 2.0)})
    assert at(picture(context, mirror, {BODY: (0, 0, 0)}, Track(other, behind)), 0.0) == at(plain, 0.0)
    both = (Track(other, before), Track(other, frame({BODY: (0.0, 0.0, 1.5)}), color=(0, 255, 0)))
    pixels = at(picture(context, mirror, {BODY: (0, 0, 0)}, *both), 0.0)
    # The second is drawn over the first, though it is behind it: none writes depth.
    light = linear(at(plain, 0.0))
    for color in (TINT, (0, 255, 0)):
        light = OPACITY * linear(color) + (1.0 - OPACITY) * light
    np.testing.assert_allclose(pixels, shown(light), atol=1.5)


@pytest.mark.gl
def test_it_throws_no_shadow(context: Any) -> None:
    floor = (STILL, "Floor", (Transform(position=(0, -1.5, 0), scale=(30, 1, 30)), MeshRenderer(), Material()))
    sun = (9, "Sun", (Transform(rotation=tuple(look_rotation((0.6, -1.0, 0.2)).tolist())), Light(intensity=3.0)))
    mirror, other = mirror_of((BODY, "Body", body()), floor, sun), mirror_of((BODY, "Body", body()))
    above = ViewCamera(
        position=(0.0, 30.0, 0.0), rotation=tuple(look_rotation((0, -1, 0), (0, 0, -1)).tolist()), ortho_height=12.0
    )

    def seen(here: Poses, *ghosts: Track) -> np.ndarray:
        mirror.keep_frame(frame(here))
        tracks = {str(number): ghost for number, ghost in enumerate(ghosts)}
        with OfflineRenderer(mirror, width=96, height=96, context=context, ghosts=tracks) as renderer:
            return renderer.picture(camera=above)[..., :3].astype(int)

    away = (-4.0, 0.0, -4.0)
    plain, shadowed = seen({BODY: away}), seen({BODY: (1.0, 2.0, 1.0)})
    ghostly = seen({BODY: away}, Track(other, frame({BODY: (1.0, 2.0, 1.0)})))
    changed = np.abs(ghostly - plain).max(axis=-1) > 2
    assert 60 <= changed.sum() <= 81  # eight pixels an edge, seen from above, and no more than its edges
    assert (np.abs(shadowed - plain).max(axis=-1) > 2).sum() > 150  # what throws a shadow changes more


@pytest.mark.gl
def test_what_has_not_parted_is_not_drawn_twice(context: Any) -> None:
    mirror, other = mirror_of((BODY, "Body", body((0.1, 0.1, 0.1)))), mirror_of((BODY, "Body", body()))
    plain = picture(context, mirror, {BODY: (0.0, 0.0, 0.0)})
    same = Track(other, frame({BODY: (0.0, 0.0, 0.9 * SAME_PLACE)}))
    apart = Track(other, frame({BODY: (0.0, 0.0, 1.1 * SAME_PLACE)}))
    np.testing.assert_array_equal(picture(context, mirror, {BODY: (0, 0, 0)}, same), plain)
    assert (picture(context, mirror, {BODY: (0, 0, 0)}, apart) != plain).any()


@pytest.mark.gl
def test_who_is_in_one_run_alone_is_shown_alone(context: Any) -> None:
    mirror = mirror_of((BODY, "Body", body((0.3, 0.0, 0.0))))
    other = mirror_of((BODY, "Body", body()), (OTHER, "Guest", body()), (STILL, "Post", (Transform(), MeshRenderer())))
    track = Track(other, frame({OTHER: (1.2, 0.0, 0.0)}))
    plain = picture(context, mirror, {BODY: (-1.0, 0.0, 0.0)})
    pixels = picture(context, mirror, {BODY: (-1.0, 0.0, 0.0)}, track)
    assert at(pixels, -1.0) == at(plain, -1.0)
    np.testing.assert_allclose(at(pixels, 1.2), shown(OPACITY * linear(TINT)), atol=1.5)
    assert at(pixels, 0.0, 1.0) == at(plain, 0.0, 1.0)  # what stands still is no ghost


def test_it_is_where_it_was_at_the_instant_that_is_seen() -> None:
    mirror = mirror_of((BODY, "Body", body()))
    world, reader = RenderWorld(), SceneReader(mirror)
    frames = [frame({BODY: (3.0 * n / 60, 1.0, 0.0)}, n / 60) for n in range(4)]
    track = Track(mirror_of((BODY, "Body", body())), *frames)
    worlds = GhostWorlds()
    world.read_scene(reader)
    assert worlds.shown({"a": track}, world) == []  # before there is any state
    for number in range(1, 4):
        for tick in (number - 1, number):
            world.take_state(frame({BODY: (1.0 * tick / 60, 1.0, 0.0)}, tick / 60), tick / 60)
        for time in ((number - 0.75) / 60, (number - 0.25) / 60, number / 60):
            world.place(simulation_time=time)
            (found,) = worlds.shown({"a": track}, world)
            np.testing.assert_allclose(found.parting.here, [[time, 1.0, 0.0]], atol=1e-9)
            np.testing.assert_allclose(found.parting.there, [[3.0 * time, 1.0, 0.0]], atol=1e-9)
            np.testing.assert_allclose(found.world.position, [[3.0 * time, 1.0, 0.0]], atol=1e-6)
    assert worlds.shown({}, world) == []
    reader.close()
    worlds.close()


def test_lines_lead_from_where_things_are_to_where_they_are_there() -> None:
    things = [(entity, name, body()) for entity, name in ((BODY, "Body"), (OTHER, "Other"))]
    mirror = mirror_of(*things)
    mirror.keep_frame(frame({BODY: (0.0, 0.0, 0.0), OTHER: (5.0, 0.0, 0.0)}))
    other = mirror_of(*things, (STILL, "Guest", body()))
    track = Track(other, frame({BODY: (0.0, 3.0, 4.0), OTHER: (5.0, 0.02, 0.0), STILL: (9.0, 0.0, 0.0)}))
    world, reader = RenderWorld(), SceneReader(mirror)
    world.read_scene(reader)
    world.take_state(mirror.latest_frame, 0.0)
    world.place()
    worlds = GhostWorlds()
    ghosts = worlds.shown({"a": track}, world)
    drawing = DebugDrawing(mirror)
    found = drawing.marks(world, ("divergence",), ghosts=ghosts)
    np.testing.assert_array_equal(found.lines.ends, [[[0, 0, 0], [0, 3, 4]], [[5, 0, 0], [5, 0.02, 0]]])
    np.testing.assert_array_equal(found.lines.color, [TINT, TINT])
    assert [label.text for label in found.labels] == ["5 m", "20 mm"]
    assert found.notes == ("Other: 2 of 3 apart, Body by 5 m, 1 there alone",)
    alone = drawing.marks(world, ("divergence",), (OTHER,), ghosts=ghosts)
    assert len(alone.lines) == 1
    assert not len(drawing.marks(world, ("labels",), ghosts=ghosts).lines)
    assert length_text(0.0999) == "99.9 mm"
    reader.close()
    worlds.close()


@pytest.mark.gl
def test_without_ghosts_there_is_no_pass(context: Any) -> None:
    mirror, other = mirror_of((BODY, "Body", body())), mirror_of((BODY, "Body", body()))
    mirror.keep_frame(frame({BODY: (0.0, 0.0, 0.0)}))
    for there, is_on in ((None, False), ((0.0, 0.0, 0.0), False), ((1.0, 0.0, 0.0), True), ((99.0, 0.0, 0.0), False)):
        tracks = {} if there is None else {"a": Track(other, frame({BODY: there}))}
        with OfflineRenderer(mirror, width=SIZE, height=SIZE, context=context, ghosts=tracks) as renderer:
            renderer.picture(camera=CAMERA)
            drawer = renderer._renderer(renderer._quality)
            assert drawer.planned is not None
            told = {one.name: one for one in told_passes(drawer.planned)}["ghosts"]
            assert told.is_on == is_on, there
            assert ("ghosts" in drawer.timings) == is_on
            assert (drawer._ghosts._placing is not None) == is_on


@pytest.mark.gl
def test_parts_of_a_large_picture_fit(context: Any) -> None:
    mirror, other = mirror_of((BODY, "Body", body((0.2, 0.0, 0.0)))), mirror_of((BODY, "Body", body()))
    track = Track(other, frame({BODY: (0.5, 0.3, 1.0)}))
    whole = picture(context, mirror, {BODY: (0, 0, 0)}, track)
    np.testing.assert_allclose(picture(context, mirror, {BODY: (0, 0, 0)}, track, tile_edge=24), whole, atol=2)


@pytest.mark.gl
def test_notes_stand_on_the_picture(context: Any) -> None:
    mirror, other = mirror_of((BODY, "Body", body())), mirror_of((BODY, "Body", body()))
    overlay = Overlay(drawing=DebugDrawing(mirror), kinds=("divergence",))
    track = Track(other, frame({BODY: (0.0, -1.0, 0.0)}))
    plain = picture(context, mirror, {BODY: (0, 0, 0)}, track)
    told = picture(context, mirror, {BODY: (0, 0, 0)}, track, overlay=overlay)
    assert (told != plain).any(axis=-1).sum() > 60


def write_other(path: Path, positions: list[tuple[float, float, float]]) -> Recording:
    """A recording of the box of `test_view_service` that goes from place to place."""
    mirror = mirror_of((BOX, "Box", body()))
    writer = McapWriter(path, session="play", scene="Box")
    writer.write(topics.SNAPSHOT.name, codec.encode_body(mirror.to_snapshot(), Encoding.JSON), log_time=1)
    for tick, position in enumerate(positions):
        writer.write(topics.STATE.name, pack_frame(frame({BOX: position}, tick / 60)), log_time=tick + 2)
    writer.close()
    return Recording(path)


@pytest.mark.gl
def test_a_render_node_draws_what_is_served_beside_its_session(context: Any, tmp_path: Path) -> None:
    async def act(made: Play, recording: Recording) -> None:
        def shows(pixels: np.ndarray) -> bool:
            return bool(np.abs(pixels[15, 26].astype(int) - np.array(plain[15, 26], int)).max() > 20)

        async def seen(tick: int, *, ghost: bool) -> np.ndarray:
            made.move(frame({BOX: (-9.0, 0.0, 0.0)}, tick / 60))
            async with asyncio.timeout(20.0):
                while True:
                    shown = await made.picture()
                    pixels = simplejpeg.decode_jpeg(shown.jpeg, colorspace="RGB")
                    if shown.tick == tick and shows(pixels) == ghost:
                        return pixels

        made.move(frame({BOX: (-9.0, 0.0, 0.0)}, 0.0))
        while (first := await made.picture()).state_published_at == 0:
            made.move(frame({BOX: (-9.0, 0.0, 0.0)}, 0.0))  # nobody may have heard the first one
        plain = simplejpeg.decode_jpeg(first.jpeg, colorspace="RGB")
        server = GhostServer(recording, made.host, color=TINT)
        serving = asyncio.create_task(server.run())
        await seen(1, ghost=True)
        await seen(2, ghost=False)  # there it is elsewhere
        await seen(3, ghost=True)
        change = GhostChange(is_removed=True)
        await made.viewer.request(topics.GHOST_CHANGE, change, key=server.told.ghost)
        await serving
        await seen(3, ghost=False)

    async def whole() -> None:
        places = [(1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (-9.0, 3.0, 0.0), (1.0, 0.0, 0.0)]
        with write_other(tmp_path / "other.mcap", places) as recording:
            async with play(context) as made:
                await act(made, recording)

    asyncio.run(whole())
