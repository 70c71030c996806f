"""Files from elsewhere copied into a project's folder, a glTF model with all that it names."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal
from urllib.parse import unquote

import msgspec

from elys.editor_node.asset_folder import asset_type

OnClash = Literal["ask", "replace", "rename", "skip"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportPlan:
    """What is to be copied where: `copies` (source, target), those that would take another file's place in `clashes`.

    `refused` are sentences about what is not copied.
    """

    copies: tuple[tuple[Path, Path], ...] = ()
    clashes: tuple[Path, ...] = ()
    refused: tuple[str, ...] = ()


class _Part(msgspec.Struct):
    uri: str = ""


class _Names(msgspec.Struct):
    """Of a glTF file what it names."""

    buffers: list[_Part] = []
    images: list[_Part] = []


def plan_import(sources: Iterable[Path], target: Path, *, on_clash: OnClash = "ask") -> ImportPlan:
    """What importing files, and the assets in folders, into the folder `target` takes.

    With "rename" a file whose name is taken gets a number; the parts of a model then go into a folder of the new name, since
    the model names them. With "skip" it stays away; with "ask" and "replace" it is among the copies.
    """
    copies: dict[Path, Path] = {}  # by target
    refused: list[str] = []
    for source in sources:
        for file, place in _files_of(source, refused):
            group = [(file, place), *((part, place.parent / name) for part, name in _parts(file, refused))]
            wanted = [target / name for _, name in group]
            taken = [path for (origin, _), path in zip(group, wanted, strict=True) if _clashes(origin, path)]
            if taken and on_clash == "skip":
                continue
            if taken and on_clash == "rename":
                wanted = _renamed(wanted)
            for (origin, _), path in zip(group, wanted, strict=True):
                if not _is_same(origin, path):
                    copies[path] = origin
    clashes = tuple(path for path, origin in copies.items() if _clashes(origin, path))
    return ImportPlan(copies=tuple((s, t) for t, s in copies.items()), clashes=clashes, refused=tuple(refused))


def carry_out(plan: ImportPlan) -> list[str]:
    """Copies; returns sentences about what could not be. A file is there whole or not at all."""
    failures: list[str] = []
    for source, target in plan.copies:
        draft = target.with_name(f".{target.name}.part")
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, draft)
            draft.replace(target)
        except OSError as error:
            with contextlib.suppress(OSError):
                draft.unlink()
            failures.append(f"{source} cannot be copied to {target}: {error.strerror or error}")
    return failures


def _files_of(source: Path, refused: list[str]) -> list[tuple[Path, Path]]:
    """The assets a person means by a file or folder, and where they go within the target."""
    if source.is_dir():
        found = []
        for place, folders, names in os.walk(source):
            folders[:] = sorted(folder for folder in folders if not folder.startswith("."))
            found += [Path(place, name) for name in sorted(names) if asset_type(Path(name)) is not None]
        if not found:
            refused.append(f"{source} has no assets in it")
        return [(path, Path(source.name) / path.relative_to(source)) for path in found]
    if not source.is_file():
        refused.append(f"there is no file {source}")
    elif asset_type(source) is None:
        refused.append(
            f"{source.name} is no asset: glTF models, images, .hdr, .exr, scenes and prefabs can be imported"
        )
    else:
        return [(source, Path(source.name))]
    return []


def _parts(file: Path, refused: list[str]) -> list[tuple[Path, PurePosixPath]]:
    """The files that a .gltf names, and how it names them."""
    if file.suffix.lower() != ".gltf":
        return []
    try:
        names = msgspec.json.decode(file.read_bytes(), type=_Names)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError):
        return []  # its tile says what is wrong with it
    found: dict[PurePosixPath, Path] = {}
    for part in (*names.buffers, *names.images):
        uri = unquote(part.uri)
        if not uri or re.match(r"[a-zA-Z][a-zA-Z0-9+.-]*:", uri):  # in the file itself
            continue
        name = PurePosixPath(os.path.normpath(uri))
        if name.is_absolute() or name.parts[:1] == ("..",):
            refused.append(f"{file.name} names {uri}, which lies outside of its folder: copy that by hand")
        elif not (file.parent / name).is_file():
            refused.append(f"{file.name} names {uri}, which is not there")
        else:
            found[name] = file.parent / name
    return [(path, name) for name, path in found.items()]


def _clashes(source: Path, target: Path) -> bool:
    """Whether another file stands there."""
    if not target.exists() or _is_same(source, target):
        return False
    try:
        return source.stat().st_size != target.stat().st_size or source.read_bytes() != target.read_bytes()
    except OSError:
        return True


def _is_same(source: Path, target: Path) -> bool:
    return target.exists() and source.resolve() == target.resolve()


def _renamed(wanted: list[Path]) -> list[Path]:
    """Free names: of one file a number behind its own, of a model with its parts a folder with a number for all of them."""
    first = wanted[0]
    stem, dot, ending = first.name.partition(".")
    number = 2
    if len(wanted) == 1:
        while (first.parent / f"{stem} {number}{dot}{ending}").exists():
            number += 1
        return [first.parent / f"{stem} {number}{dot}{ending}"]
    while (first.parent / f"{stem} {number}").exists():
        number += 1
    return [first.parent / f"{stem} {number}" / path.relative_to(first.parent) for path in wanted]
