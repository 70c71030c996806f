"""The panel of diagnostics: what the host measured stands there, and a named entity is selected with a click."""

from __future__ import annotations

import pytest
from imgui_bundle import imgui

from elys.bus import topics
from elys.bus.messages.physics import Diagnostics
from elys.editor_node.panels import diagnostics

pytestmark = pytest.mark.gl


def measured(tick, crate):
    return Diagnostics(
        tick=tick,
        kinetic=1.0,
        potential=2.0,
        momentum=(0.0, 1.0, 0.0),
        angular_momentum=(0.0, 0.0, 0.0),
        deepest_overlap=0.001 * tick,
        deepest=(crate, 999),
        residual=0.0,
        restless=(0, 0),
        joint_error=0.0,
        joint_angle_error=0.0,
        joint=0,
        turned_joint=0,
        bodies=2,
        awake=2,
        contacts=1,
        islands=1,
    )


def test_a_named_entity_is_selected_with_a_click(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        crate = person.stage.named("Crate")
        await person.frames(8)  # docked windows have taken their places
        assert not host.session.has_listener(topics.DIAGNOSTICS)  # nothing is measured for a panel that is hidden
        imgui.set_window_focus(diagnostics.TITLE)
        await person.until(lambda: host.session.has_listener(topics.DIAGNOSTICS))
        measured_here = editor.workspace.instruments.measured
        for tick in range(1, 30):
            host.session.publish(topics.DIAGNOSTICS, measured(tick, crate))
        await person.until(lambda: measured_here and measured_here[-1].tick == 29)
        await person.frames(4)
        assert not editor.model.selection
        await person.click("diagnostics/deepest overlap/0")
        await person.frames(2)
        assert editor.model.selection.entities == (crate,)
        assert "diagnostics/deepest overlap/1" not in editor.ui.landmarks.rectangles  # that one is gone

    at_the_editor(scenario)
