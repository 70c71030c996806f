"""Paths lead to the numbers they name, and those are read as state frames and measurements arrive."""

from __future__ import annotations

import math

import pytest

from elys.bus import topics
from elys.bus.messages.physics import Diagnostics
from elys.bus.messages.plan import PhysicsPlan
from elys.common.scene import EntityRecord
from elys.editor_node.field_paths import FIGURES, WORLD_FIGURES, FieldPathError, FieldPaths
from elys.editor_node.instruments import PLAN_INTERVAL, Instruments


def records() -> list[EntityRecord]:
    body = {"Transform": {"position": [1, 2, 3]}, "RigidBody": {"mass": 5.0, "linear_velocity": [3, 0, 4]}}
    return [
        EntityRecord(name="Crate", components=body | {"Material": {"base_color": [0.1, 0.2, 0.3]}}),
        EntityRecord(name="Crate.left", parent=0, components={"Transform": {"position": [0, 1, 0]}}),
        EntityRecord(name="Crate", components=body),
        EntityRecord(name="world", components={"Light": {"intensity": 7.0}}),
        EntityRecord(name="Face", enabled=False, components={"Morph": {"weights": "0.5, 0 0.25"}}),
    ]


def measured(tick: int, **values) -> Diagnostics:
    fields = {
        "kinetic": 1.0, "potential": 2.0, "momentum": (3.0, 0.0, 4.0), "angular_momentum": (0.0, 0.0, 0.0),
        "deepest_overlap": 0.0, "deepest": (0, 0), "residual": 0.0, "restless": (0, 0), "joint_error": 0.0,
        "joint_angle_error": 0.0, "joint": 0, "turned_joint": 0, "bodies": 2, "awake": 2, "contacts": 9, "islands": 1,
    }  # fmt: skip
    return Diagnostics(tick=tick, **(fields | values))


def test_paths_lead_to_the_numbers_they_name(on_stage):
    async def scenario(stage):
        paths = FieldPaths(stage.model.scene)
        _, _, second, light, _ = stage.model.scene.mirror.entities
        for path, number, unit in (
            ("Crate.Transform.position.z", 3.0, "m"),
            ("Crate.left.Transform.position.y", 1.0, "m"),  # the longest name that there is
            ("Crate.left.height", 3.0, "m"),  # in the world
            ("Crate.RigidBody.mass", 5.0, "kg"),
            ("Crate.speed", 5.0, "m/s"),
            ("Crate.spin", 0.0, "rad/s"),
            ("Crate.enabled", 1.0, ""),
            ("Face.enabled", 0.0, ""),
            ("Face.Morph.weights.2", 0.25, ""),
            ("Face.Morph.weights.9", 0.0, ""),
            ("Crate.Material.base_color.g", 0.2, ""),
            (f"#{light}.Light.intensity", 7.0, None),
            (f"  #{second}.Transform.rotation.w ", 1.0, ""),
        ):
            field = paths.resolve(path)
            assert paths.read(field) == pytest.approx(number), path
            assert unit is None or field.unit == unit, path
        for figure in WORLD_FIGURES:
            assert math.isnan(paths.read(paths.resolve(f"world.{figure}")))
            assert math.isfinite(paths.read(paths.resolve(f"world.{figure}"), measured(1)))
        assert paths.read(paths.resolve("world.momentum"), measured(1)) == 5.0
        assert paths.read(paths.resolve("world.energy"), measured(1)) == 3.0

    on_stage(scenario, records())


@pytest.mark.parametrize(
    ("path", "says"),
    [
        ("", "begins with no entity"),
        ("Nobody.Transform.position.y", "begins with no entity"),
        ("#999.Transform.position.y", "begins with no entity"),
        (
            "Crate.Light.intensity",
            "no Light; it has Transform, RigidBody, Material, height, speed, spin, enabled, contacts",
        ),
        ("Crate.Transform.position", "'position' has x, y, z: name one of them"),
        ("Crate.Transform.position.w", "'position' has x, y, z"),
        ("Crate.Transform.position.xy", "'position' has x, y, z"),
        ("Crate.RigidBody.mass.x", "no parts"),
        ("Crate.RigidBody.nonsense", "RigidBody has no number 'nonsense'"),
        ("Crate.Material.base_color_texture", "no number"),
        ("Face.Morph.weights", "Morph has no number 'weights'; it has weights.0"),
        ("Face.Morph.weights.-1", "Morph has no number"),
        ("world.nonsense", "there is kinetic, potential"),
    ],
)
def test_what_leads_nowhere_says_what_there_is(on_stage, path, says):
    async def scenario(stage):
        with pytest.raises(FieldPathError) as caught:
            FieldPaths(stage.model.scene).resolve(path)
        assert says in str(caught.value)

    on_stage(scenario, records())


def test_every_suggestion_goes_on_or_is_a_path(on_stage):
    async def scenario(stage):
        paths = FieldPaths(stage.model.scene)
        seen, waiting = set(), [""]
        while waiting:
            for found in paths.suggestions(waiting.pop()):
                if found in seen:
                    continue
                seen.add(found)
                if found.endswith("."):
                    waiting.append(found)
                else:
                    paths.resolve(found)
        assert {"Crate.Transform.position.x", "world.kinetic", "Crate.speed", "Crate.left.Transform."} <= seen
        assert paths.suggestions("crat") == ["Crate.", "Crate.left."]
        assert paths.suggestions("Crate.posi") == []
        assert paths.suggestions("Crate.Tra") == ["Crate.Transform."]
        assert "Crate.Transform.position.x" in paths.suggestions("Crate.Transform.pos")
        assert set(FIGURES) <= {path.removeprefix("Crate.") for path in paths.suggestions("Crate.")}

    on_stage(scenario, records())


def test_the_path_of_a_field_leads_back_to_it(on_stage):
    async def scenario(stage):
        paths = FieldPaths(stage.model.scene)
        for entity in stage.model.scene.mirror.entities:
            for component in stage.model.scene.components_of(entity):
                field = (
                    "intensity"
                    if component == "Light"
                    else {"Transform": "position", "Material": "base_color"}.get(component)
                )
                for place, path in enumerate(paths.paths_to(entity, component, field) if field else ()):
                    found = paths.resolve(path)
                    assert (found.entity, found.component, found.field) == (entity, component, field)
                    assert found.element == (-1 if component == "Light" else place)

    on_stage(scenario, records())


def test_numbers_are_read_as_frames_arrive_and_measurements_into_their_tick(on_stage):
    async def scenario(stage):
        host, model = stage.host, stage.model
        plots = Instruments(model).plots
        crate = next(iter(model.scene.mirror.entities))
        assert not host.session.has_listener(topics.DIAGNOSTICS)
        height, kinetic = plots.add("Crate.Transform.position.y"), plots.add("world.kinetic")
        await stage.until(lambda: host.session.has_listener(topics.DIAGNOSTICS))

        async def tick(number: int) -> None:
            host.tick = number
            host.publish_frame({crate: (0.0, float(number), 0.0)})
            await stage.until(lambda: plots.is_paused or plots.table.ticks[-1:].tolist() == [number])
            host.session.publish(topics.DIAGNOSTICS, measured(number, kinetic=10.0 * number))
            await stage.until(lambda: plots.is_paused or plots.newest(kinetic) == 10.0 * number)

        for number in range(1, 6):
            await tick(number)
        assert plots.table.values(height).tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
        assert plots.table.values(kinetic).tolist() == [10.0, 20.0, 30.0, 40.0, 50.0]
        plots.is_paused = True
        await tick(6)
        assert len(plots.table) == 5
        plots.is_paused = False
        plots.remove(kinetic)
        await stage.until(lambda: not host.session.has_listener(topics.DIAGNOSTICS))

    on_stage(scenario, records())


def test_no_frame_is_left_out_however_many_come_at_once(on_stage):
    async def scenario(stage):
        host, model = stage.host, stage.model
        plots = Instruments(model).plots
        crate = next(iter(model.scene.mirror.entities))
        series = plots.add("Crate.height")
        for number in range(1, 201):  # while the editor does something else
            host.tick = number
            host.publish_frame({crate: (0.0, float(number), 0.0)})
        await stage.until(lambda: plots.table.ticks[-1:].tolist() == [200])
        assert plots.table.values(series).tolist() == [float(number) for number in range(1, 201)]
        assert model.scene.frame.tick == 200

    on_stage(scenario, records())


def test_what_is_deleted_leaves_a_gap_and_what_comes_under_its_name_goes_on(on_stage):
    async def scenario(stage):
        host, model = stage.host, stage.model
        plots = Instruments(model).plots
        old, other = stage.named("Crate.left"), list(model.scene.mirror.entities)[2]
        series = plots.add("Crate.left.Transform.position.y")

        async def tick(number: int) -> None:
            host.tick = number
            host.publish_frame({other: (0.0, 0.0, 0.0)})
            await stage.until(lambda: plots.table.ticks[-1:].tolist() == [number])

        await tick(1)
        model.selection.replace((old,))
        model.edit.delete()
        await stage.settle()
        await tick(2)
        model.edit.rename(other, "Crate.left")
        await stage.settle()
        await tick(3)
        values = plots.table.values(series).tolist()
        assert values[0] == 1.0
        assert math.isnan(values[1])
        assert values[2] == 0.0

    on_stage(scenario, records())


def test_the_plan_is_asked_for_no_more_often_than_it_is_looked_at(on_stage):
    async def scenario(stage):
        asked = []

        async def give(request, key):
            asked.append(key)
            return PhysicsPlan(tick=len(asked), bodies=0, contacts=0, stages=())

        stage.host.session.serve(topics.PLAN, give)
        plan = Instruments(stage.model).plan
        for now in (0.0, 0.1, 0.2):
            plan.refresh(now)
        await stage.until(lambda: plan.newest is not None)
        plan.refresh(PLAN_INTERVAL / 2.0)
        plan.refresh(PLAN_INTERVAL)
        await stage.until(lambda: plan.newest.tick == 2)
        assert len(asked) == 2
        plan.forget()
        assert plan.newest is None

    on_stage(scenario, records())
