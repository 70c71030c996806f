"""What can be done with other runs: to see them as ghosts, and to make another one of a recording."""

from __future__ import annotations

from elys.editor_node.actions import Action
from elys.editor_node.panels.fork_dialog import ForkDialog
from elys.editor_node.panels.ghosts import GhostsWindow
from elys.editor_node.ui import Ui


def other_run_actions(ui: Ui, ghosts: GhostsWindow, fork: ForkDialog) -> tuple[Action, ...]:
    """All of them."""
    model, attachments = ui.model, ui.attachments

    def may_fork() -> bool:
        return model.is_replay and model.status is not None and bool(model.status.recording)

    return (
        Action(
            name="view.ghost",
            label="Show another run as ghost...",
            run=lambda: ghosts.ask(ui),
            is_possible=lambda: attachments.openers is not None,
        ),
        Action(
            name="view.ghosts",
            label="Ghosts",
            run=lambda: setattr(ghosts, "is_open", not ghosts.is_open),
            is_on=lambda: ghosts.is_open,
        ),
        Action(name="time.fork", label="Fork here...", run=lambda: fork.ask(ui), is_possible=may_fork),
        Action(
            name="time.back_to_recording",
            label="Back to the recording",
            run=attachments.back_to_recording,
            is_possible=lambda: bool(attachments.forked_from),
        ),
    )
