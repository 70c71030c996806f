"""Two editors at one host: each undoes its own, nobody loses an edit unseen; and who comes back finds what can be undone."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from elys.bus.messages import commands as c
from elys.bus.session import Session
from elys.editor_node.history_rows import history_rows
from elys.editor_node.model import EditorModel


@contextlib.asynccontextmanager
async def another_editor(stage) -> AsyncIterator[EditorModel]:
    session = await Session.join(stage.broker.connect(), kind="editor")
    model = EditorModel(session)
    running = asyncio.create_task(model.run())
    try:
        await stage.until(lambda: model.scene.is_known and model.history.is_attached)
        yield model
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await session.close()


def mass_of(stage, name: str) -> float:
    return stage.host.mirror.entities[stage.named(name)].components["RigidBody"].mass


def place_of(stage, name: str) -> float:
    return stage.host.mirror.entities[stage.named(name)].components["Transform"].position[0]


async def agree(stage, *models: EditorModel) -> None:
    """Until all mirrors show what the host has."""
    await stage.until(lambda: all(model.scene.mirror.sequence == stage.host.mirror.sequence for model in models))


def test_each_undoes_its_own(on_stage):
    async def scenario(stage):
        async with another_editor(stage) as other:
            crate, box = stage.named("Crate"), stage.named("Box 1")
            await stage.model.edit.set_fields([crate], "RigidBody", {"mass": 7.0})
            await agree(stage, other)
            await other.edit.set_fields([box], "RigidBody", {"mass": 8.0})
            await other.edit.set_fields([crate], "Transform", {"position": (9.0, 2.0, 3.0)})  # another component of it
            assert stage.model.history.author != other.history.author
            await stage.model.history.undo()
            assert (mass_of(stage, "Crate"), mass_of(stage, "Box 1"), place_of(stage, "Crate")) == (5.0, 8.0, 9.0)
            await other.history.undo()
            await other.history.undo()
            assert (mass_of(stage, "Box 1"), place_of(stage, "Crate")) == (1.0, 1.0)
            assert not other.history.undo_label and not stage.model.history.undo_label

    on_stage(scenario)


def test_an_edit_made_from_an_older_scene_is_refused_and_says_whose_was_first(on_stage):
    async def scenario(stage):
        async with another_editor(stage) as other:
            crate = stage.named("Crate")
            await agree(stage, other)
            # Both at once: neither has heard of the other's.
            first = other.edit.set_fields([crate], "Transform", {"position": (4.0, 0.0, 0.0)})
            second = stage.model.edit.set_fields([crate], "Transform", {"position": (6.0, 0.0, 0.0)})
            beside = stage.model.edit.set_fields([crate], "RigidBody", {"mass": 6.0})
            outcomes = [await done for done in (first, second, beside)]
            accepted = [outcome.accepted for outcome in outcomes[:2]]
            assert sorted(accepted) == [0, 1]
            winner = other if accepted[0] else stage.model
            refused = outcomes[accepted.index(0)].refusals
            assert refused == [
                f"Crate's Transform was changed by {winner.history.author} meanwhile: look and try again"
            ]
            assert outcomes[2].accepted  # nobody else changed that
            await agree(stage, other, stage.model)
            again = stage.model.edit.set_fields([crate], "Transform", {"position": (6.5, 0.0, 0.0)})
            assert (await again).accepted and place_of(stage, "Crate") == 6.5

    on_stage(scenario)


def test_who_drags_first_keeps_hold_of_it(on_stage):
    async def scenario(stage):
        async with another_editor(stage) as other:
            crate, stroke, late = stage.named("Crate"), object(), object()
            place = lambda x: {"position": (x, 0.0, 0.0)}  # noqa: E731
            assert (await stage.model.edit.set_fields([crate], "Transform", place(2.0), stroke=stroke)).accepted
            await agree(stage, other)
            assert (await other.edit.set_fields([crate], "Transform", place(20.0), stroke=late)).accepted
            await agree(stage, stage.model)
            # The first has seen it by now, and yet his drag began before it.
            outcome = await stage.model.edit.set_fields([crate], "Transform", place(3.0), stroke=stroke)
            assert not outcome.accepted and "meanwhile" in outcome.refusals[0]
            assert (await other.edit.set_fields([crate], "Transform", place(21.0), stroke=late)).accepted
            assert place_of(stage, "Crate") == 21.0

    on_stage(scenario)


def test_deleting_what_another_drags_is_refused_and_deleting_it_later_is_not(on_stage):
    async def scenario(stage):
        async with another_editor(stage) as other:
            lid = stage.named("Lid")
            await agree(stage, other)
            stage.model.selection.replace([stage.named("Crate")])
            dragged = other.edit.set_fields([lid], "Transform", {"position": (0.0, 4.0, 0.0)}, stroke=object())
            deleted = stage.model.edit.delete()
            first, second = await dragged, await deleted
            if first.accepted:  # it came first
                assert second.refusals == [
                    f"Lid's Transform was changed by {other.history.author} meanwhile: look and try again"
                ]
                await agree(stage, stage.model)
                stage.model.selection.replace([stage.named("Crate")])
                assert (await stage.model.edit.delete()).accepted
            await agree(stage, other)
            outcome = other.edit.set_fields([lid], "Transform", {"position": (0.0, 5.0, 0.0)})
            assert outcome is None  # gone: the mirror says so before anything is sent

    on_stage(scenario)


def test_an_undo_over_somebody_elses_edit_is_refused_stays_listed_and_may_be_forced(on_stage):
    async def scenario(stage):
        async with another_editor(stage) as other:
            model, crate = stage.model, stage.named("Crate")
            await model.edit.set_fields([crate], "RigidBody", {"mass": 7.0})
            await agree(stage, other)
            await other.edit.set_fields([crate], "RigidBody", {"mass": 8.0})
            await agree(stage, model)
            await model.edit.set_fields([crate], "RigidBody", {"mass": 9.0})  # which he has seen
            await model.history.undo()
            assert mass_of(stage, "Crate") == 8.0
            outcome = await model.history.undo()
            assert outcome.refusals == [
                f"Crate's RigidBody was changed by {other.history.author} meanwhile: "
                "its earlier value was not put back over that"
            ]
            assert mass_of(stage, "Crate") == 8.0 and model.history.undo_label and model.history.conflict == "undo"
            # The other takes its own back: then nothing is in the way any more.
            await other.history.undo()
            assert mass_of(stage, "Crate") == 7.0
            await other.history.redo()
            await model.history.undo(force=True)
            assert mass_of(stage, "Crate") == 5.0 and model.history.conflict is None

    on_stage(scenario)


def test_undoing_an_added_entity_spares_what_another_put_into_it(on_stage):
    async def scenario(stage):
        async with another_editor(stage) as other:
            model = stage.model
            await model.edit.spawn("Box")
            await agree(stage, other)
            box = stage.named("Box")
            await other.edit.spawn("Sphere", parent=box)
            outcome = await model.history.undo()
            assert "Sphere's place in the tree was changed by" in outcome.refusals[0]
            assert stage.host.mirror.entities[box].children
            await other.history.undo()
            assert (await model.history.undo()).accepted
            assert box not in stage.host.mirror.entities

    on_stage(scenario)


def test_who_comes_back_goes_on_with_the_same_history(on_stage):
    async def scenario(stage):
        crate = stage.named("Crate")
        async with another_editor(stage) as first:
            await first.edit.rename(crate, "Treasure")
            await first.edit.set_fields([crate], "RigidBody", {"mass": 7.0})
            first.selection.replace([crate])
            await first.edit.delete()
            await first.history.undo()
            author = first.history.author
        async with another_editor(stage) as second:
            history = second.history
            assert history.author == author
            assert [entry.label for entry in history.undoable] == [
                "Rename to Treasure",
                "Set RigidBody.mass of Treasure",
            ]
            assert history.redo_label == "Delete Treasure"
            await history.undo()  # of an entity that has another id now
            await history.undo()
            assert stage.named("Crate") and mass_of(stage, "Crate") == 5.0
            assert not second.file.is_dirty
        # A second one of the same person, at the same time, has a history of its own.
        async with another_editor(stage) as third, another_editor(stage) as beside:
            assert third.history.author == author != beside.history.author
            assert not beside.history.undoable

    on_stage(scenario)


def test_the_history_is_a_list_to_go_along(on_stage):
    async def scenario(stage):
        model, crate = stage.model, stage.named("Crate")
        for mass in (6.0, 7.0, 8.0):
            await model.edit.set_fields([crate], "RigidBody", {"mass": mass}, stroke=object())
        model.file.saved_content = model.history.undoable[1].content
        await model.history.go_to(1)
        assert mass_of(stage, "Crate") == 6.0
        rows = history_rows(model.history, saved=model.file.saved_content)
        assert [(row.is_made, row.is_now, row.is_saved) for row in rows] == [
            (True, False, False),
            (True, True, False),
            (False, False, True),
            (False, False, False),
        ]
        await model.history.go_to(3)
        assert mass_of(stage, "Crate") == 8.0
        await model.history.go_to(0)
        assert mass_of(stage, "Crate") == 5.0 and not model.history.undo_label

    on_stage(scenario)


def test_an_edit_of_several_commands_is_made_whole_or_not_at_all(on_stage, scene_tree):
    async def scenario(stage):
        model = stage.model
        names = [stage.named(f"Box {number}") for number in (1, 2, 3)]
        before = scene_tree(stage.host.mirror)
        done = model.edit.set_fields(names, "RigidBody", {"mass": 4.0})
        gone = c.CommandRequest(origin="x", command=c.RemoveComponent(entity=names[1], component="RigidBody"))
        await stage.host._take(gone, "")
        outcome = await done
        assert not outcome.accepted and "Box 2's RigidBody was changed by x meanwhile" in outcome.refusals[0]
        assert mass_of(stage, "Box 1") == mass_of(stage, "Box 3") == 1.0
        assert not model.history.undo_label and scene_tree(stage.host.mirror) != before

    on_stage(scenario)
