"""Who may come into this user's sessions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from elys.cli.app import keys_app
from elys.cli.options import Json

Name = Annotated[str, typer.Argument(help="a role (viewer, player, editor, owner), or whom the key was made for")]


@keys_app.callback(invoke_without_command=True)
def keys(context: typer.Context, json: Json = False) -> None:
    """List who may come into your sessions, without the secrets."""
    if context.invoked_subcommand is None:
        from elys.verbs import keys as verb

        verb.listed(json=json)


@keys_app.command("show")
def show(name: Name) -> None:
    """Print a secret, as --secret and ELYS_SECRET take it."""
    from elys.verbs import keys as verb

    verb.show(name)


@keys_app.command("make")
def make(
    role: Annotated[str, typer.Argument(help="viewer, player, editor or owner")],
    name: Annotated[str, typer.Argument(help="whom it is for")],
) -> None:
    """Make a key for one person or machine, that can be revoked alone."""
    from elys.verbs import keys as verb

    verb.make(role, name)


@keys_app.command("export")
def export(
    name: Name,
    output: Annotated[Optional[Path], typer.Option("--output", "-o", help="default: NAME.elyskey")] = None,  # noqa: UP045
    days: Annotated[float, typer.Option(help="how long its certificate is good", min=0.01, max=3650.0)] = 365.0,
) -> None:
    """Write a file to carry to another machine: secret, and certificates for TLS."""
    from elys.verbs import keys as verb

    verb.export(name, output, days=days)


@keys_app.command("renew")
def renew(name: Annotated[str, typer.Argument(help="a key, or all")]) -> None:
    """Give a key another secret; what was handed out before opens nothing more."""
    from elys.verbs import keys as verb

    verb.renew(name)


@keys_app.command("revoke")
def revoke(name: Name) -> None:
    """Take a key away."""
    from elys.verbs import keys as verb

    verb.revoke(name)
