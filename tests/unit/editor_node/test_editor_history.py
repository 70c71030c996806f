"""Whatever is edited, undoing all of it gives the scene back, and redoing all of it what it had become."""

from __future__ import annotations

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from elys.common.scene import SceneSettings

# Each action is a kind and some numbers, read as indices into whatever is there when it is made.
ACTIONS = st.lists(
    st.tuples(
        st.sampled_from(
            (
                *("rename", "reparent", "place", "enable", "move", "turn", "mass", "add", "remove", "spawn"),
                *("duplicate", "delete", "settings", "undo", "redo"),
            )
        ),
        st.integers(0, 1000),
        st.integers(0, 1000),
        st.integers(0, 3),
    ),
    max_size=14,
)


def perform(stage, action):
    kind, first, second, count = action
    model, edit, scene = stage.model, stage.model.edit, stage.model.scene
    everyone = list(scene.mirror.entities)
    if not everyone and kind not in ("spawn", "undo", "redo", "settings"):
        return None
    chosen = [everyone[(first + 7 * step) % len(everyone)] for step in range(count + 1)] if everyone else []
    other = ([0, *everyone])[second % (len(everyone) + 1)]
    match kind:
        case "rename":
            return edit.rename(chosen[0], f"Name {second}")
        case "reparent":
            return edit.reparent(chosen, other)
        case "place":
            return edit.reparent(chosen, other, second % 4)
        case "enable":
            return edit.set_enabled(chosen, second % 2 == 0)
        case "move":
            return edit.set_fields(chosen, "Transform", {"position": (first / 7.0, second / 3.0, -1.5)})
        case "turn":
            return edit.set_fields(chosen, "Transform", {"rotation": (first + 1.0, 2.0, second / 9.0, 0.5)})
        case "mass":
            return edit.set_fields(chosen, "RigidBody", {"mass": 1.0 + second})
        case "add":
            return edit.add_component(chosen, ("Camera", "Light", "Script")[second % 3])
        case "remove":
            return edit.remove_component(chosen, ("Transform", "Material", "RigidBody")[second % 3])
        case "spawn":
            return edit.spawn(("Box", "Empty", "Light")[second % 3], parent=other if count else 0)
        case "duplicate" | "delete":
            model.selection.replace(chosen)
            return edit.duplicate() if kind == "duplicate" else edit.delete()
        case "settings":
            return edit.set_settings(SceneSettings(substeps=1 + second % 8))
        case "undo":
            return model.history.undo() if model.history.undo_label else None
        case "redo":
            return model.history.redo() if model.history.redo_label else None


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
