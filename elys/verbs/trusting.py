"""`elys trust`, and the question before a scene's scripts run for the first time."""

from __future__ import annotations

import logging
import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec
import typer

from elys.common.assets.store import AssetStore
from elys.common.errors import ScriptError
from elys.common.scene_document import EntityRecord
from elys.common.trust import is_trusted, remember, trusted_folders

_log = logging.getLogger(__name__)


def trust(folder: Path | None, *, forget: bool, json: bool) -> None:
    """Lists trusted folders, or adds or takes one away."""
    if folder is not None:
        if not forget and not folder.is_dir():
            raise ScriptError(f"there is no folder {folder}")
        if forget and folder.resolve() not in trusted_folders():
            raise ScriptError(f"{folder} is not trusted anyhow; `elys trust` lists the folders that are")
        remember(folder, trusted=not forget)
    folders = [str(known) for known in trusted_folders()]
    if json:
        typer.echo(msgspec.json.encode(folders).decode())
    else:
        typer.echo("\n".join(folders) or "no folder is trusted: `elys trust FOLDER` lets the scripts in it run")


def asks_about_scripts(records: Sequence[EntityRecord], assets: AssetStore) -> bool:
    """Whether there are scripts that nobody has trusted."""
    return any(place and not is_trusted(place) for place in (_script_of(record, assets) for record in records))


def ask_about_scripts(records: Sequence[EntityRecord], assets: AssetStore) -> None:
    """Asks whether the scripts of a scene may run, where a person can answer and has not yet; else says that they do not."""
    places = {place: None for record in records if (place := _script_of(record, assets))}
    asked = [Path(place) for place in places if not is_trusted(place)]
    if not asked:
        return
    folders = list(dict.fromkeys(path.parent for path in asked))
    named = ", ".join(str(path) for path in asked[:5]) + (f" and {len(asked) - 5} more" if len(asked) > 5 else "")
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        _log.warning(
            "the scene's scripts do not run, for nobody has trusted them: %s; start with --trust to run them", named
        )
        return
    typer.echo(f"This scene has scripts: {named}.\nThey are programs and may do whatever you may.", err=True)
    if typer.confirm(
        f"Run them, now and from now on all in {' and '.join(map(str, folders))}?", default=False, err=True
    ):
        for folder in folders:
            remember(folder)


def _script_of(record: EntityRecord, assets: AssetStore) -> str:
    values = record.components.get("Script") or {}
    return assets.source(str(values.get("source", ""))).partition("#")[0]
