"""What nodes say and what edits are called: English on the bus, and in the person's language where it is shown."""

from __future__ import annotations

import ast
import json
import re
import string
from pathlib import Path

import pytest

import elys.editor_node
from elys.bus.messages import commands
from elys.editor_node.language import translations, use_language
from elys.editor_node.sentences import is_known, sentence, sentences_of, tr_sentence
from elys.editor_node.units import _NAMES
from elys.sim_node.physics.settings import PhysicsSettings
from elys.sim_node.physics.world import PhysicsWorld
from tests.unit.editor_node.node_sentences import parsed, raised, told

SOURCE = Path(elys.editor_node.__file__).parent
COUNTED_THINGS = ["solid thing", "solid things", "see-through things", "selected thing", "thing with a normal map"]
REFUSING = (
    "sim_node/systems/apply_commands.py",
    "sim_node/systems/apply_edits.py",
    "sim_node/flight_recorder.py",
    "sim_node/ecs/columns.py",
    "bus/player.py",
    "common/components/values.py",
)


@pytest.fixture
def in_french():
    use_language("fr")
    yield
    use_language("en")


def reasons_of_plans() -> list[str]:
    joints = ["no joints", "1 joint", "7 joints"]
    physics = told(
        "sim_node/physics/plan.py",
        "_tell",
        what=["restitution", "rolling or spinning friction"],
        touching=["1 contact", "7 contacts"],
        _joint_text=joints,
        listed=["1 box, 7 height fields"],
    )
    pictures = "render_node/pass_plan.py"
    passes = [text for text in told(pictures, "told_passes") if text not in ("lamp shadows", "debug lines")]  # names
    around = ["the scene's colours", "a colour", "a clear sky", "a picture"]
    more = [
        "",
        ", and 1 finer map around the eye for the long view",
        ", and 2 finer maps around the eye for the long view",
    ]
    effects = ["surfaces and sky are dimmed", "bright light spreads", "edges are smoothed"]
    why = [
        *told(pictures, "_why_seen", noun=COUNTED_THINGS, plural=COUNTED_THINGS),
        *told(pictures, "_why_marked", noun=["line", "label"]),
        *told(pictures, "_why_set", effect=effects),
        *told(pictures, "_why_environment", what=around),
        *(text for text in told(pictures, "_why_shadow", more=more) if not text.startswith(",")),
        *told(pictures, "_why_lights"),
        *told(pictures, "_why_lamp_shadows"),
        *told(pictures, "_why_overlays"),
        *told(pictures, "_why_occlusion"),
    ]
    events = [f"events are switched {how} by the settings" for how in ("on", "off")]
    return [text for text in (*physics, *passes, *why, *joints, *events) if len(text) > 2]


def refusals() -> list[str]:
    described = {"described": list(_NAMES.values())}
    history = "sim_node/edit_history.py"
    conflicts = [
        f"{whose} {part} {'were' if part.endswith('ings') else 'was'} changed by ann meanwhile: {rest}"
        for whose in ("Crate's", "the scene's")
        for part in ("name", "place in the tree", "switch", "settings", "Transform")
        for rest in ("look and try again", "its earlier value was not put back over that", "it was not ended with that")
    ]
    return [
        *conflicts,
        *(text for text in raised(history) if text != "7"),
        *raised("sim_node/node.py"),
        *(text for module in REFUSING for text in raised(module)),
        *(
            text.replace("7 cannot", "entity 7 cannot").replace("under 7", "under entity 7")
            for text in raised("sim_node/scene/hierarchy.py")
            if text != "7"
        ),
        *raised("editor_node/expressions.py", **described),
        *_NAMES.values(),
        *raised("editor_node/scene_documents.py"),
        *raised("editor_node/scene_file.py"),
        *raised("editor_node/scene_clipboard.py"),
        "/a/b.json cannot be written: No space left on device",
    ]


def test_every_reason_of_a_plan_has_its_french(in_french):
    reasons = reasons_of_plans()
    assert len(reasons) > 60 and "7 of 7 colliders with restitution" in reasons
    assert [text for text in reasons if not is_known(text, "fr")] == []
    english = re.compile(r"\b(bodies|body|colliders?|things?|seen|nobody|nothing|contacts? and|joints?|the|with|of)\b")
    assert [tr_sentence(text) for text in reasons if english.search(tr_sentence(text))] == []


def test_the_plan_of_a_world_is_french_to_the_last_word(in_french):
    """Those that a real world tells, which no search in a source could miss."""
    for stage in PhysicsWorld(PhysicsSettings()).plan():
        assert is_known(stage.why, "fr") and tr_sentence(stage.why) != stage.why, stage
    passes = {
        call.args[0].value
        for call in ast.walk(parsed("render_node/pass_plan.py"))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "PlannedPass"
    }
    names = passes | {stage.name.replace("_", " ") for stage in PhysicsWorld(PhysicsSettings()).plan()}
    assert len(names) > 25 and sorted(names - set(translations("fr"))) == []


def test_refusals_have_their_french(in_french):
    said = refusals()
    assert len(said) > 80
    assert [text for text in said if not is_known(text, "fr")] == []
    assert tr_sentence("'3 kg' is a mass, and this takes a length [m]") == (
        "« 3 kg » est une masse, or il faut ici une longueur [m]"
    )
    assert tr_sentence("Box's Transform was changed by ann meanwhile: look and try again") == (
        "Box, Transform : modifié entre-temps par ann ; regardez, puis réessayez"
    )


def labels() -> set[str]:
    """The templates of all edits that the editor makes."""
    found = set()
    for path in SOURCE.rglob("*.py"):
        for call in (node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Call)):
            name = getattr(call.func, "attr", getattr(call.func, "id", ""))
            if name in ("sentence", "lay_over") and call.args and isinstance(call.args[0], ast.Constant):
                found.add(call.args[0].value)
    return found - {"{verb} {label}", "{count} entities"}  # parts of others


def test_every_label_of_an_edit_has_its_french(in_french):
    names = {name for _, name, _, _ in string.Formatter().parse("".join(labels())) if name}
    sevens = dict.fromkeys(names, "7")
    assert len(labels()) > 15
    assert [label for label in sorted(labels()) if not is_known(label.format(**sevens), "fr")] == []
    tags = [getattr(getattr(kind, "__struct_config__", None), "tag", None) for kind in vars(commands).values()]
    said = [tag.replace("_", " ").capitalize() for tag in tags if tag]
    assert len(said) > 15 and [text for text in said if not is_known(text, "fr")] == []


def test_names_stay_as_they_are(in_french):
    for name in ("Sun", "settings", "3 contacts", "no joints", "{0}", "a: b", "Ünïcode ✦\nline", "12 entities more"):
        label = sentence("Delete {what}", what=name)
        assert tr_sentence(label) == f"Supprimer {name}"
        assert tr_sentence(f"Undo {label}") == f"Annuler : Supprimer {name}"
    assert tr_sentence("Delete 12 entities") == "Supprimer 12 entités"
    assert tr_sentence("Move Crate to the top") == "Déplacer Crate vers la racine"
    assert tr_sentence("what nobody has ever said") == "what nobody has ever said"


def test_templates_fill_the_same_places():
    for english, french in sentences_of("fr").items():
        places = {name for _, name, _, _ in string.Formatter().parse(english) if name}
        assert places == {name for _, name, _, _ in string.Formatter().parse(french) if name}, english
    text = (SOURCE / "languages" / "fr.sentences.json").read_text(encoding="utf-8")
    assert list(json.loads(text)) == sorted(json.loads(text)) and "\\u" not in text


def test_english_stays_english():
    assert tr_sentence("there is nothing to undo") == "there is nothing to undo"


@pytest.mark.gl
def test_two_editors_show_one_history_each_in_its_language(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        await person.click("hierarchy/Crate")
        await editor.model.edit.set_fields(editor.model.selection, "Transform", {"position": (1.0, 2.0, 5.0)})
        editor.preferences.language = "fr"
        use_language("fr")
        try:
            await editor.model.edit.delete()
            await person.frames(3)
            assert [entry.label for entry in editor.model.history.undoable] == [
                "Set Transform.position of Crate",
                "Delete Crate",
            ]
            assert host.history.told_to(editor.model.history.author).undoable[-1].label == "Delete Crate"
            assert [line.text for line in editor.model.console][-1] == "Supprimer Crate"
            await editor.model.history.undo()
            await person.frames(2)
            assert [line.text for line in editor.model.console][-1] == "Annuler : Supprimer Crate"
        finally:
            use_language("en")

    at_the_editor(scenario)
