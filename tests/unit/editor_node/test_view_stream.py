"""How pictures are asked for: one request under way, the newest wins, and nothing while nothing changes."""

from __future__ import annotations

import msgspec

from elys.bus.messages.views import ViewCamera
from elys.editor_node.view_stream import View, ViewStream


def view(x: float, *, width: int = 64, height: int = 32) -> View:
    return View(ViewCamera(position=(x, 0.0, 0.0), rotation=(0.0, 0.0, 0.0, 1.0)), width, height)


def test_one_at_a_time_and_the_newest_wins(on_stage):
    async def scenario(stage):
        source = await stage.picture_source(entity=0)
        stream = ViewStream(stage.model.session)
        await stage.until(lambda: stream.renderer is not None)
        for step in range(50):
            stream.want(view(float(step)))
        await stage.until(lambda: len(source.sent) >= 2 and source.requests[-1].newer_than_tick == 0)
        assert [request.camera.position[0] for request in source.requests] == [0.0, 49.0, 49.0]
        # An unchanged wish is not asked for again; a new one overtakes the request that waits.
        stream.want(view(49.0))
        stream.want(view(50.0))
        await stage.until(lambda: source.requests[-1].camera.position[0] == 50.0)
        assert [request.camera.position[0] for request in source.requests[:4]] == [0.0, 49.0, 49.0, 50.0]
        stream.close()
        await source.close()

    on_stage(scenario)


def test_another_renderer_takes_over(on_stage):
    async def scenario(stage):
        stream = ViewStream(stage.model.session)
        stream.want(view(1.0))
        assert stream.renderer is None and not stream.lost_renderer
        first = await stage.picture_source(entity=0)
        await stage.until(lambda: len(first.sent) == 1)
        second = await stage.picture_source(entity=0)
        await stage.until(lambda: len(stage.model.session.nodes_of("render")) == 2)
        assert second.requests == []  # the one in use stays
        await first.close()
        await stage.until(lambda: len(second.sent) == 1)
        assert not stream.lost_renderer
        await second.close()
        await stage.until(lambda: stream.lost_renderer)
        stream.close()

    on_stage(scenario)


def test_sizes_stay_what_a_slot_can_hold(on_stage):
    async def scenario(stage):
        source = await stage.picture_source(entity=0, is_sharing=False)
        stream = ViewStream(stage.model.session)
        await stage.until(lambda: stream.renderer is not None)
        stream.want(view(0.0, width=0, height=-5))
        await stage.until(lambda: len(source.requests) >= 1)
        request = source.requests[0]
        assert (request.width, request.height) == (16, 16)
        assert request.ring.slot_size >= 4096 * 2304 * 4
        stream.close()
        await source.close()

    on_stage(scenario)


class Texture:
    """Takes what is uploaded, without GL."""

    def upload(self, pixels, width: int, height: int) -> None:
        assert len(memoryview(pixels).cast("B")) == width * height * 4


def test_a_picture_that_is_none_is_refused_and_the_last_one_stays(on_stage, caplog):
    async def scenario(stage):
        source = await stage.picture_source(entity=0)
        stream = ViewStream(stage.model.session)
        stream.want(view(0.0))
        await stage.until(lambda: len(source.sent) == 1 and stream.upload(Texture()))
        shown = stream.shown
        for broken in (
            {"slot": 7},
            {"slot": 0, "width": 1 << 20, "height": 1 << 20},
            {"slot": 0, "width": -4, "height": 4},
            {"slot": -1, "jpeg": b"not a picture"},
            {"slot": -1, "jpeg": b""},
        ):
            stream._frame_arrived(msgspec.structs.replace(shown, **broken), "")
            assert not stream.upload(Texture())
            assert stream.shown is shown
        assert caplog.text.count("refused a picture") == 5
        stream.close()
        await source.close()

    on_stage(scenario)
