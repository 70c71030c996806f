"""The editor's operations against a real host over the loopback bus: what they send, what comes back, undo and redo."""

from __future__ import annotations

import pytest

from elys.bus.messages import commands as c
from elys.common.components import Transform
from elys.common.errors import ComponentError


def test_an_edit_goes_through_the_host_and_back(on_stage):
    async def scenario(stage):
        crate = stage.named("Crate")
        done = stage.model.edit.rename(crate, "  Box of apples ")
        assert stage.model.scene.name_of(crate) == "Crate"  # not before the host said so
        outcome = await done
        assert outcome.accepted == 1
        assert stage.host.mirror.entities[crate].name == "Box of apples"
        assert stage.model.scene.name_of(crate) == "Box of apples"

    on_stage(scenario)


def test_undo_and_redo_of_every_operation(on_stage, scene_tree):
    async def scenario(stage):
        model, edit, selection = stage.model, stage.model.edit, stage.model.selection
        crate, sun = stage.named("Crate"), stage.named("Sun")
        boxes = [stage.named("Box 1"), stage.named("Box 3")]
        operations = [
            lambda: edit.rename(crate, "Other"),
            lambda: edit.reparent(boxes, crate),
            lambda: edit.reparent([sun], 0, 1),
            lambda: edit.set_enabled([crate, sun], False),
            lambda: edit.set_fields([crate, *boxes], "RigidBody", {"mass": 7.0}),
            lambda: edit.set_fields([crate], "Transform", {"rotation": (0.0, 1.0, 0.0, 0.0)}),
            lambda: edit.add_component([sun, crate], "Camera"),
            lambda: edit.remove_component([crate], "Collider"),
            lambda: edit.spawn("Sphere", parent=crate),
            lambda: (selection.replace([*boxes, crate]), edit.duplicate())[1],
            lambda: (selection.replace([crate, *boxes]), edit.delete())[1],
        ]
        trees = [scene_tree(stage.host.mirror)]
        for operation in operations:
            outcome = await operation()
            assert outcome.accepted and not outcome.refusals
            trees.append(scene_tree(stage.host.mirror))
            assert trees[-1] != trees[-2]
        for before in reversed(trees[:-1]):
            await model.history.undo()
            assert scene_tree(stage.host.mirror) == before
        assert not model.history.undo_label
        for after in trees[1:]:
            await model.history.redo()
            assert scene_tree(stage.host.mirror) == after
        assert not model.history.redo_label
        for before in reversed(trees[:-1]):
            await model.history.undo()
            assert scene_tree(stage.host.mirror) == before

    on_stage(scenario)


def test_a_drag_is_one_entry_and_returns_to_its_start(on_stage):
    async def scenario(stage):
        crate, stroke = stage.named("Crate"), object()
        for step in range(30):
            stage.model.edit.set_fields([crate], "Transform", {"position": (step, 2.0, 3.0)}, stroke=stroke)
        await stage.settle()
        sent = [command for command in stage.host.received if isinstance(command, c.SetComponent)]
        assert len(sent) < 30  # the newest wins while one is under way
        assert sent[-1].values["position"] == [29.0, 2.0, 3.0]
        await stage.model.history.undo()
        assert stage.host.mirror.entities[crate].components["Transform"].position == (1.0, 2.0, 3.0)
        assert not stage.model.history.undo_label

    on_stage(scenario)


def test_strokes_of_their_own_are_entries_of_their_own(on_stage):
    async def scenario(stage):
        crate = stage.named("Crate")
        for value in (6.0, 7.0):
            await stage.model.edit.set_fields([crate], "RigidBody", {"mass": value}, stroke=object())
        await stage.model.history.undo()
        assert stage.host.mirror.entities[crate].components["RigidBody"].mass == 6.0

    on_stage(scenario)


def test_what_changes_nothing_is_not_sent(on_stage):
    async def scenario(stage):
        crate = stage.named("Crate")
        edit = stage.model.edit
        assert edit.rename(crate, "Crate") is None
        assert edit.rename(crate, "   ") is None
        assert edit.set_enabled([crate], True) is None
        assert edit.set_fields([crate], "RigidBody", {"mass": 5.0}) is None
        assert edit.add_component([crate], "RigidBody") is None
        assert edit.reparent([crate], crate) is None
        assert edit.reparent([crate], stage.named("Handle")) is None  # below itself
        assert edit.reparent([crate], 0, stage.model.scene.place_of(crate)[1]) is None
        stage.model.selection.clear()
        assert edit.delete() is None
        assert stage.host.received == []

    on_stage(scenario)


def test_a_value_no_host_would_take_is_refused_here(on_stage):
    async def scenario(stage):
        with pytest.raises(ComponentError, match=r"RigidBody\.mass must be at least"):
            stage.model.edit.set_fields([stage.named("Crate")], "RigidBody", {"mass": -1.0})

    on_stage(scenario)


def test_a_refusal_is_told_and_leaves_no_entry(on_stage):
    async def scenario(stage):
        crate = stage.named("Crate")
        gone = stage.model.edit.set_fields([crate], "RigidBody", {"mass": 1.0})
        await stage.host._take(c.CommandRequest(origin="x", command=c.Despawn(entity=crate)), "")
        outcome = await gone
        assert outcome.accepted == 0
        await stage.settle()
        assert not stage.model.history.undo_label
        lines = [line for line in stage.model.console if line.level == "error"]
        assert "refused: there is no entity" in lines[-1].text

    on_stage(scenario)


def test_an_undone_delete_brings_back_selection_and_older_entries(on_stage):
    async def scenario(stage):
        model, crate, lid = stage.model, stage.named("Crate"), stage.named("Lid")
        await model.edit.rename(lid, "Cover")
        model.selection.replace([crate])
        await model.edit.delete()
        await stage.until(lambda: not model.selection)
        await model.history.undo()
        assert stage.named("Crate") == crate
        assert model.selection.primary in model.scene.mirror.entities
        await model.history.undo()  # of the rename, whose entity was gone meanwhile
        assert model.scene.name_of(stage.named("Lid")) == "Lid"

    on_stage(scenario)


def test_a_moving_body_is_edited_from_where_it_is(on_stage):
    async def scenario(stage):
        crate = stage.named("Crate")
        stage.host.publish_frame({crate: (4.0, 5.0, 6.0)})
        await stage.until(lambda: stage.model.scene.frame is not None)
        transform = stage.model.scene.component_of(crate, "Transform")
        assert isinstance(transform, Transform)
        assert transform.position == (4.0, 5.0, 6.0)
        await stage.model.edit.set_fields([crate], "Transform", {"position": (0.0, 0.0, 0.0)})
        assert stage.model.scene.component_of(crate, "Transform").position == (0.0, 0.0, 0.0)
        await stage.model.history.undo()
        assert stage.host.mirror.entities[crate].components["Transform"].position == (4.0, 5.0, 6.0)

    on_stage(scenario)


def test_time_is_commanded(on_stage):
    async def scenario(stage):
        model = stage.model
        model.toggle_playing()
        await stage.until(lambda: model.is_playing)
        model.step(3)
        await stage.until(lambda: not model.is_playing and stage.host.tick == 3)
        model.set_rate(0.5)
        await stage.until(lambda: stage.host.rate == 0.5)
        model.seek(1.0)
        await stage.until(lambda: "Seek refused: that is for replays" in model.error)

    on_stage(scenario)


def test_a_host_that_goes_is_noticed(on_stage):
    async def scenario(stage):
        await stage.model.edit.rename(stage.named("Crate"), "Other")
        await stage.host.session.close()
        await stage.until(lambda: not stage.model.connected)
        outcome = await stage.model.edit.rename(stage.named("Other"), "Third")
        assert outcome.accepted == 0
        assert "not sent" in outcome.refusals[0]

    on_stage(scenario)


def test_names_stay_apart(on_stage):
    async def scenario(stage):
        model = stage.model
        await model.edit.spawn("Box")
        assert model.scene.name_of(model.selection.primary) == "Box"
        await model.edit.spawn("Box")
        assert model.scene.name_of(model.selection.primary) == "Box 7"  # 1 to 6 stand in the yard

    on_stage(scenario)


def test_framing_reaches_all(on_stage):
    async def scenario(stage):
        center, radius = stage.model.bounds_of([stage.named("Box 1"), stage.named("Box 6")])
        assert center == pytest.approx((3.5, 1.0, 0.0))
        assert radius == pytest.approx(2.5 + 3**0.5 / 2, rel=1e-6)
        assert stage.model.bounds_of([]) is None

    on_stage(scenario)
