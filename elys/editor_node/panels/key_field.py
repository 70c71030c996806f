"""The field for what a host that asks for it is shown; beside it stands where the host is."""

from __future__ import annotations

from imgui_bundle import imgui

from elys.editor_node.host_keys import is_secret
from elys.editor_node.language import tr
from elys.editor_node.ui import Ui


def key_field(ui: Ui, text: str, *, name: str, width: float) -> tuple[bool, str]:
    """Whether Enter was pressed, and what stands there. A secret is not shown."""
    flags = imgui.InputTextFlags_.enter_returns_true.value
    if is_secret(text):
        flags |= imgui.InputTextFlags_.password.value
    imgui.set_next_item_width(width)
    entered, text = imgui.input_text_with_hint("###key", tr("key, if it asks for one"), text, flags)
    ui.landmarks.note(name)
    imgui.set_item_tooltip(
        tr("USER:SECRET as `elys keys show` prints it on the host's machine, or the path of an .elyskey file")
    )
    return entered, text
