"""Whatever is edited, undoing all of it gives the scene back, and redoing all of it what it had become."""

from __future__ import annotations

from hypothesis import HealthCheck, given, settings

from tests.unit.editor_node.random_edits import ACTIONS, perform


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(actions=ACTIONS)
def test_undoing_everything_gives_the_scene_back(on_stage, scene_tree, actions):
    async def scenario(stage):
        history, mirror = stage.model.history, stage.host.mirror
        before = (scene_tree(mirror), mirror.settings)
        for action in actions:
            done = perform(stage, action)
            if done is not None:
                outcome = await done
                assert not outcome.refusals, (action, outcome)
        after = (scene_tree(mirror), mirror.settings)
        while history.undo_label:
            outcome = await history.undo()
            assert not outcome.refusals
        assert (scene_tree(mirror), mirror.settings) == before
        while history.redo_label:
            await history.redo()
        redone = (scene_tree(mirror), mirror.settings)
        # What had been undone among the actions is redone as well: only without such actions both ends are the same.
        if not any(kind in ("undo", "redo") for kind, *_ in actions):
            assert redone == after
        assert scene_tree(stage.model.scene.mirror) == scene_tree(mirror)

    on_stage(scenario)


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(actions=ACTIONS)
def test_edits_made_without_waiting_are_undone_as_well(on_stage, scene_tree, actions):
    async def scenario(stage):
        history, mirror = stage.model.history, stage.host.mirror
        before = (scene_tree(mirror), mirror.settings)
        for action in actions:
            perform(stage, action)
        await stage.settle()
        while history.undo_label:
            await history.undo()
        assert (scene_tree(mirror), mirror.settings) == before

    on_stage(scenario)
