"""The inspector's logic without a window: what edits mean, what is told of a field, what is copied, what a prefab says."""

from __future__ import annotations

import asyncio
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from elys.bus import prefab_service
from elys.bus.messages import commands as c
from elys.bus.messages import scene as s
from elys.common.assets import AssetStore
from elys.common.components import Joint, Material, RigidBody, Transform, declaration_of, declarations
from elys.common.errors import ComponentError, RequestError
from elys.common.scene import EntityRecord, open_scene
from elys.editor_node import comparison, prefab_values
from elys.editor_node.colors import (
    hex_from_linear,
    linear_from_hex,
    split_intensity,
    srgb_from_linear,
    with_intensity,
)
from elys.editor_node.comparison import Comparison
from elys.editor_node.component_clipboard import components_in, text_of
from elys.editor_node.expressions import read_entry
from elys.editor_node.field_search import GROUPS, offers, shows_field
from elys.editor_node.field_values import (
    FieldChange,
    has_bar,
    is_radiance,
    label_of,
    may_keep_proportions,
    switch_of,
    values_of_each,
)
from elys.editor_node.language import translations
from elys.editor_node.rotations import ShownAngles, degrees_from, nearest_degrees, rotation_from

TRANSFORM, BODY, MATERIAL = declaration_of("Transform"), declaration_of("RigidBody"), declaration_of("Material")


def changed(declaration, name, own, **change):
    return values_of_each(declaration, declaration.field(name), own, FieldChange(**change))


def test_one_axis_changes_and_the_others_stay_each_ones_own():
    own = {1: (1.0, 2.0, 3.0), 2: (4.0, 5.0, 6.0)}
    assert changed(TRANSFORM, "position", own, value=(4.0, 9.0, 6.0), axis=1) == {
        1: (1.0, 9.0, 3.0),
        2: (4.0, 9.0, 6.0),
    }
    entry = read_entry("+= 50 cm", "m")
    assert changed(TRANSFORM, "position", own, value=(4.0, 5.0, 6.0), axis=1, entry=entry) == {
        1: (1.0, 2.5, 3.0),
        2: (4.0, 5.5, 6.0),
    }
    assert changed(BODY, "mass", {1: 2.0, 2: 3.0}, value=3.0, entry=read_entry("*2", "kg")) == {1: 4.0, 2: 6.0}


def test_proportions_are_each_ones_own():
    own = {1: (1.0, 2.0, 4.0), 2: (10.0, 10.0, 0.5)}
    assert changed(TRANSFORM, "scale", own, value=(20.0, 10.0, 0.5), axis=0, keeps_proportions=True) == {
        1: (20.0, 40.0, 80.0),
        2: (20.0, 20.0, 1.0),
    }
    flat = changed(TRANSFORM, "scale", {1: (0.0, 2.0, 3.0)}, value=(5.0, 2.0, 3.0), axis=0, keeps_proportions=True)
    assert flat == {1: (5.0, 5.0, 5.0)}
    assert may_keep_proportions(TRANSFORM.field("scale"))
    assert not may_keep_proportions(TRANSFORM.field("position"))


def test_a_turn_about_one_axis_keeps_each_ones_others():
    own = {1: rotation_from((10.0, 20.0, 30.0)), 2: rotation_from((40.0, 0.0, 0.0))}
    chosen = changed(TRANSFORM, "rotation", own, value=(40.0, 50.0, 0.0), axis=1)
    assert degrees_from(chosen[1]) == pytest.approx((10.0, 50.0, 30.0), abs=1e-3)
    assert degrees_from(chosen[2]) == pytest.approx((40.0, 50.0, 0.0), abs=1e-3)
    alone = {1: rotation_from((0.0, 89.0, 0.0))}
    entry = read_entry("+=0.25 turn", "deg")
    chosen = changed(TRANSFORM, "rotation", alone, value=(0.0, 89.0, 0.0), axis=1, entry=entry)
    expected = Rotation.from_euler("xyz", (0.0, 179.0, 0.0), degrees=True)
    assert Rotation.from_quat(chosen[1]).approx_equal(expected, atol=1e-9)


@pytest.mark.parametrize(
    ("component", "field", "own", "typed", "words"),
    [
        ("RigidBody", "mass", 5.0, "-=6", "at least 1e-06 kg"),
        ("Collider", "restitution", 0.5, "3", "at most 1"),
        ("Collider", "mask", 1, "2.5", "whole number"),
        ("Collider", "mask", 1, "2^40", "32 bits"),
        ("RigidBody", "gravity_scale", 1e200, "*1e200", "finite"),
    ],
)
def test_what_is_out_of_range_is_refused_for_all(component, field, own, typed, words):
    declaration = declaration_of(component)
    entry = read_entry(typed, declaration.field(field).unit)
    with pytest.raises(ComponentError, match=words):
        changed(declaration, field, {1: own, 2: own}, value=own, entry=entry)


def test_bars_radiances_and_switches_come_from_declarations():
    assert has_bar(MATERIAL.field("roughness"))
    assert not has_bar(BODY.field("mass"))  # from a milligram to a million tons: a pixel would be worth too many
    assert is_radiance(MATERIAL.field("emissive"))
    assert not is_radiance(MATERIAL.field("base_color"))
    assert switch_of(declaration_of("Script")).name == "enabled"
    assert switch_of(declaration_of("MeshRenderer")).name == "visible"
    assert switch_of(BODY) is None


ANGLES = st.floats(-720.0, 720.0)


@given(st.tuples(ANGLES, ANGLES, ANGLES), st.sampled_from([0, 1, 2]), st.floats(-3.0, 3.0))
def test_angles_do_not_jump_while_one_is_turned(start, axis, step):
    before = start
    after = tuple(angle + (step if place == axis else 0.0) for place, angle in enumerate(start))
    rotation = np.float32(rotation_from(after)).tolist()
    shown = nearest_degrees(rotation, before)
    turn = Rotation.from_euler("xyz", shown, degrees=True)
    assert (
        turn.inv() * Rotation.from_quat(rotation)
    ).magnitude() < 2e-3  # near +-90 degrees asin loses half its digits
    if abs(math.cos(math.radians(after[1]))) > 0.1:
        assert shown == pytest.approx(after, abs=0.05)


def test_shown_angles_stay_what_was_typed_and_follow_what_turns():
    shown = ShownAngles()
    shown.keep("a", (0.0, 100.0, 0.0))
    assert shown.of("a", np.float32(rotation_from((0.0, 100.0, 0.0))).tolist()) == (0.0, 100.0, 0.0)
    for degrees in range(101, 400, 7):  # a body that spins goes on past 180
        assert shown.of("a", rotation_from((0.0, float(degrees), 0.0))) == pytest.approx((0.0, degrees, 0.0), abs=1e-3)
    shown.forget()
    assert shown.of("a", rotation_from((0.0, 100.0, 0.0))) == pytest.approx((180.0, 80.0, 180.0), abs=1e-3)


@given(st.integers(0, 0xFFFFFF))
def test_every_hex_colour_survives(code):
    text = f"#{code:06x}"
    assert hex_from_linear(linear_from_hex(text)) == text


def test_colours_are_written_in_several_ways_and_shine():
    assert linear_from_hex("fff") == linear_from_hex(" #FFFFFF ") == (1.0, 1.0, 1.0)
    assert linear_from_hex("#808080")[0] == pytest.approx(0.21586, abs=1e-5)  # IEC 61966-2-1
    assert srgb_from_linear(0.5) == pytest.approx(0.735357, abs=1e-6)
    assert [linear_from_hex(text) for text in ("", "#12", "#gggggg", "red", "#1234567")] == [None] * 5
    color, intensity = split_intensity((8.0, 2.0, 0.0))
    assert (color, intensity) == ((1.0, 0.25, 0.0), 8.0)
    assert with_intensity(color, intensity) == (8.0, 2.0, 0.0)
    assert split_intensity((0.1, 0.2, 0.3)) == ((0.1, 0.2, 0.3), 1.0)


def test_fields_are_found_by_their_words():
    def found(query):
        return [f"{d.name}.{f.name}" for d in declarations().values() for f in d.fields if shows_field(query, d, f)]

    assert found("linear vel") == ["RigidBody.linear_velocity"]
    assert found("rigidbody MASS") == ["RigidBody.mass"]
    assert found("kg/m^3") == ["Collider.density"]
    assert found("nothing of the kind") == []
    assert "Transform.scale" in found("")


def test_components_are_offered_by_group_and_what_they_do():
    names = [offer.declaration.name for offer in offers("", declarations())]
    assert set(names) == set(declarations())
    assert names.index("RigidBody") < names.index("MeshRenderer") < names.index("Script")
    assert next(iter(offers("light", declarations()))).declaration.name == "Light"
    assert [offer.declaration.name for offer in offers("collides", declarations())] == ["Collider"]
    assert {offer.declaration.name for offer in offers("physics", declarations(), owned=("Joint",))} >= {"RigidBody"}
    assert "Joint" not in [offer.declaration.name for offer in offers("physics", declarations(), owned=("Joint",))]
    assert all(name in declarations() for group in GROUPS.values() for name in group)


def test_every_field_of_every_component_is_told_in_french():
    french = translations("fr")
    for declaration in declarations().values():
        if declaration.struct.__module__.startswith("elys."):  # not what tests declare
            assert declaration.text in french, declaration.name
            for field in declaration.fields:
                assert {label_of(field), field.text} <= french.keys(), f"{declaration.name}.{field.name}"


# --- with a scene ------------------------------------------------------------------------------------------------------


def test_components_are_copied_as_text_and_read_again(on_stage):
    async def scenario(stage):
        scene, lid = stage.model.scene, stage.named("Lid")
        joint = Joint(kind="hinge", other=lid, axis=(0.0, 1.0, 0.0))
        text = text_of({"Joint": joint, "Material": Material(roughness=0.25)}, scene)
        assert json.loads(text)["elys_components"]["Joint"]["other"] == "Lid"
        found = components_in(text, scene)
        assert Joint(**found["Joint"]) == joint
        assert found["Material"]["roughness"] == 0.25
        assert components_in('{"elys_components": {"RigidBody": {"mass": 2}}}', scene) == {"RigidBody": {"mass": 2.0}}

        two = Joint(other=stage.named("Zwilling"))
        text = text_of({"Joint": two}, scene)
        assert components_in(text, scene)["Joint"]["other"] == two.other  # by its id: the name would mean either

        for bad, words in (
            ("", "holds no component"),
            ("[" * 100000, "holds no component"),
            ('{"elys_components": {}}', "holds no component"),
            ('{"elys_components": {"Lever": {}}}', "no component 'Lever'"),
            ('{"elys_components": {"Joint": {"other": "Nobody"}}}', "Joint.other: nobody here"),
            ('{"elys_components": {"RigidBody": {"mass": "heavy"}}}', "RigidBody.mass must be a number"),
            ('{"elys_components": {"RigidBody": {"mas": 1}}}', "no field 'mas'"),
            ('{"elys_components": {"RigidBody": 3}}', "must be fields"),
        ):
            with pytest.raises(ComponentError, match=words):
                components_in(bad, scene)

    records = [
        EntityRecord(name="Lid", components={"Transform": {}}),
        EntityRecord(name="Zwilling"),
        EntityRecord(name="Zwilling"),
    ]
    on_stage(scenario, records)


def test_what_the_simulation_wrote_is_told_from_what_was_set(on_stage):
    async def scenario(stage):
        model, host, crate = stage.model, stage.host, stage.named("Crate")

        def written(component="Transform"):
            return model.set_values.written_fields(crate, model.scene.component_of(crate, component))

        assert written() == {}
        host.tick += 1
        host.publish_frame({crate: (1.0, 1.5, 3.0)})
        await stage.until(lambda: model.scene.component_of(crate, "Transform").position[1] == 1.5)
        assert written() == {"position": (1.0, 2.0, 3.0)}

        await model.edit.set_fields([crate], "Transform", {"position": (0.0, 9.0, 0.0)})
        await stage.until(lambda: written() == {})  # a hand set it: that is what it was now
        host._publish([host._set(crate, "RigidBody", {"mass": 7.0})])  # no command: the simulation's own doing
        await stage.until(lambda: model.scene.component_of(crate, "RigidBody").mass == 7.0)
        assert written("RigidBody") == {"mass": 5.0}
        await model.edit.set_fields([crate], "RigidBody", {"gravity_scale": 0.5})
        await stage.until(lambda: model.set_values.of(crate, "RigidBody").gravity_scale == 0.5)
        assert written("RigidBody") == {"mass": 5.0}

        await model.edit.reparent([crate], stage.named("Ground"))
        await stage.until(lambda: model.scene.parent_of(crate) != 0)
        assert written() == {}  # its place in another's space is no doing of the simulation
        await model.edit.remove_component([crate], "RigidBody")
        await model.edit.add_component([crate], "RigidBody")
        assert written("RigidBody") == {}
        host._publish([s.Despawned(entity=crate)])
        await stage.until(lambda: not model.scene.exists(crate))
        assert model.set_values.of(crate, "Transform") is None

    on_stage(scenario)


def test_another_snapshot_of_the_same_run_forgets_nothing(on_stage):
    async def scenario(stage):
        mirror, values, crate = stage.model.scene.mirror, stage.model.set_values, stage.named("Crate")
        stage.host._publish([stage.host._set(crate, "RigidBody", {"mass": 7.0})])
        await stage.until(lambda: stage.model.scene.component_of(crate, "RigidBody").mass == 7.0)
        stage.host._publish([s.ComponentSet(entity=crate, component="Light", values={})])
        mirror.apply_snapshot(stage.host.mirror.to_snapshot())
        assert values.of(crate, "RigidBody").mass == 5.0
        assert values.of(crate, "Light") is not None
        stage.host.mirror.epoch += 1
        mirror.apply_snapshot(stage.host.mirror.to_snapshot())
        assert values.of(crate, "RigidBody").mass == 7.0  # another run: what it starts with was loaded

    on_stage(scenario)


def test_what_others_set_counts_and_what_was_refused_does_not(on_stage):
    async def scenario(stage):
        crate, values = stage.named("Crate"), stage.model.set_values

        def record(accepted, **fields):
            command = c.SetComponent(entity=crate, component="RigidBody", values=fields)
            return c.CommandRecord(tick=0, origin="another", command=command, accepted=accepted)

        values.command_seen(record(False, mass=3.0))
        assert values.of(crate, "RigidBody") == RigidBody(mass=5.0)
        values.command_seen(record(True, mass="nonsense"))
        assert values.of(crate, "RigidBody") == RigidBody(mass=5.0)
        values.command_seen(record(True, mass=3.0))
        assert values.of(crate, "RigidBody") == RigidBody(mass=3.0)

    on_stage(scenario)


@pytest.fixture
def lamps(tmp_path):
    """A scene with two instances of a lamp of a pole and a bulb, in one of which something was changed."""
    (tmp_path / "lamp.prefab.json").write_text(
        json.dumps(
            {
                "elys_scene": 1,
                "entities": [
                    {
                        "name": "Lamp",
                        "components": {"Transform": {}, "MeshRenderer": {}, "Joint": {"other": "Bulb"}},
                        "children": [
                            {
                                "name": "Bulb",
                                "components": {"Transform": {"position": [0, 1, 0]}, "Light": {"kind": "point"}},
                            }
                        ],
                    }
                ],
            }
        ),
        encoding="utf-8",
    )
    scene = {
        "elys_scene": 1,
        "entities": [
            {
                "name": "First",
                "prefab": "lamp.prefab.json",
                "components": {"Transform": {"position": [5, 0, 0]}, "Joint": {"kind": "hinge"}},
                "overrides": {"Bulb": {"Light": {"intensity": 50}}},
                "children": [{"name": "Shade", "components": {"Transform": {}}}],
            },
            {"name": "Second", "prefab": "lamp.prefab.json"},
        ],
    }
    (tmp_path / "room.scene.json").write_text(json.dumps(scene), encoding="utf-8")
    return open_scene(tmp_path / "room.scene.json", AssetStore()).records


def test_prefabs_tell_what_was_changed_and_take_it_back(on_stage, lamps, tmp_path, monkeypatch):
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))

    async def scenario(stage):
        model = stage.model
        first, second = stage.named("First"), stage.named("Second")
        bulb = model.scene.children_of(first)[0]
        assert model.prefabs.of(first) is None  # it is being read
        await stage.until(lambda: model.prefabs.of(first) is not None)
        found = model.prefabs.of(bulb)
        assert (found.root, found.path, found.problem) == (first, ("Bulb",), "")
        assert found.changed_fields(model.scene.component_of(bulb, "Light")) == {"intensity": 3.0}
        root = model.prefabs.of(first)
        # Where an instance stands is its own; whom its joint names is the bulb of the same instance.
        assert root.changes(model.scene.components_of(first)) == {"Joint": {"kind": "fixed"}}
        assert root.components["Joint"].other == bulb
        assert model.prefabs.of(second).components["Joint"].other == model.scene.children_of(second)[0]
        assert model.prefabs.of(second).changes(model.scene.components_of(second)) == {}
        assert model.prefabs.of(stage.named("Shade")) is None  # no part of the prefab

        await model.edit.remove_component([bulb], "Light")
        await model.edit.add_component([bulb], "Camera")
        changes = model.prefabs.of(bulb).changes(model.scene.components_of(bulb))
        assert set(changes) == {"Light", "Camera"} and changes["Camera"] is None
        before = len(model.history.undoable)
        await model.edit.lay_over("Revert to the prefab: {what}", {bulb: changes})
        assert model.prefabs.of(bulb).changes(model.scene.components_of(bulb)) == {}
        assert len(model.history.undoable) == before + 1
        await model.history.undo()
        assert set(model.scene.components_of(bulb)) == {"Transform", "Camera"}

    on_stage(scenario, lamps)


def test_a_prefab_that_is_not_here_is_said_and_read_when_it_comes(on_stage, lamps, tmp_path, monkeypatch):
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(prefab_values, "LOOK_INTERVAL", 0.0)
    file = tmp_path / "lamp.prefab.json"
    text = file.read_text(encoding="utf-8")
    file.unlink()

    async def scenario(stage):
        model, first = stage.model, stage.named("First")
        await stage.until(lambda: model.prefabs.of(first) is not None)
        found = model.prefabs.of(first)
        assert "lamp.prefab.json" in found.problem and "\n" not in found.problem
        assert found.changes(model.scene.components_of(first)) == {}
        file.write_text(text, encoding="utf-8")
        await stage.until(lambda: not model.prefabs.of(first).problem)
        await asyncio.to_thread(file.write_text, text.replace("[0, 1, 0]", "[0, 2, 0]"), encoding="utf-8")
        bulb = model.scene.children_of(first)[0]
        await stage.until(lambda: model.prefabs.of(bulb).components["Transform"] == Transform(position=(0.0, 2.0, 0.0)))

    on_stage(scenario, lamps)


def test_where_the_host_cannot_tell_the_file_is_read_here(on_stage, lamps, tmp_path, monkeypatch):
    """As when a recording is played on another machine than the one it was made on."""
    monkeypatch.setattr(prefab_values, "LOOK_INTERVAL", 0.0)

    def refuse(path):
        raise RequestError("that disk is not here")

    monkeypatch.setattr(prefab_service, "read_prefab", refuse)  # the host's; the editor has its own name for it

    async def scenario(stage):
        model, bulb = stage.model, stage.model.scene.children_of(stage.named("First"))[0]
        await stage.until(lambda: model.prefabs.of(bulb) is not None)
        assert model.prefabs.of(bulb).changed_fields(model.scene.component_of(bulb, "Light")) == {"intensity": 3.0}
        (tmp_path / "lamp.prefab.json").unlink()
        await stage.until(lambda: model.prefabs.of(bulb).problem == "that disk is not here")

    on_stage(scenario, lamps)


def test_many_are_compared_a_few_at_a_time(on_stage, monkeypatch):
    monkeypatch.setattr(comparison, "BUDGET", 10)

    async def scenario(stage):
        model = stage.model
        boxes = [e.id for e in model.scene.mirror.entities.values() if e.name.startswith("Box")]
        model.selection.replace(boxes)
        compared = Comparison(model.scene)
        position, roughness = TRANSFORM.field("position"), MATERIAL.field("roughness")

        def update():
            compared.update(model.selection.entities, model.selection.version)

        update()
        assert compared.common == ("Transform", "RigidBody", "MeshRenderer", "Material")
        assert compared.mixed("Transform", position) == (True, False, False)
        assert not compared.mixed("Material", roughness)[0]
        await model.edit.set_fields(boxes[:1], "Material", {"roughness": 0.1})
        for _ in range(10):  # the one that differs comes last
            update()
        assert compared.mixed("Material", roughness) == (True,)
        assert not compared.is_default("Material", roughness)
        await model.edit.set_fields(boxes, "Material", {"roughness": 0.1})
        for _ in range(10):
            update()
        assert compared.mixed("Material", roughness) == (False,)
        await model.edit.remove_component(boxes[3:4], "RigidBody")
        update()
        assert compared.common == ("Transform", "MeshRenderer", "Material")
        model.selection.replace([stage.named("Sun"), *boxes])
        update()
        assert compared.common == ("Transform",)

    on_stage(scenario)


def test_bodies_that_move_are_compared_where_they_are(on_stage):
    async def scenario(stage):
        model = stage.model
        boxes = [stage.named(f"Box {number}") for number in (1, 2, 3)]
        stage.host.publish_frame({box: (4.0, float(place), 0.0) for place, box in enumerate(boxes)})
        await stage.until(lambda: model.scene.frame is not None)
        model.selection.replace(boxes)
        compared = Comparison(model.scene)
        compared.update(boxes, model.selection.version)
        assert compared.mixed("Transform", TRANSFORM.field("position")) == (False, True, False)
        assert compared.primary["Transform"].position == (4.0, 2.0, 0.0)

    on_stage(scenario)
