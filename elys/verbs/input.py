"""input: what players can do in a scene, which controls do it, and which of them a person has chosen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from elys.common.components import InputMap, component_from
from elys.common.errors import InputError
from elys.common.input_bindings import BindingsFile, load_bindings, save_bindings, shared_controls, user_file
from elys.common.input_controls import SORTS, Control, Sort, check_name, controls_of, sorts_taking
from elys.verbs.output import print_json, print_table


def listed(scene: str, *, player: int | None, file: Path | None, json: bool) -> None:
    """Prints names, controls and whose they are."""
    declared, bound = _declared(scene), _read(file).of(player or 1)
    rows = [
        (name, sort, bound.get(name, usual), "own" if name in bound else "the scene's")
        for sort, names in declared.items()
        for name, usual in names.items()
    ]
    unknown = [name for name in bound if all(name not in names for names in declared.values())]
    shared = shared_controls(_controls(declared, bound))
    if json:
        told = [dict(zip(("name", "sort", "controls", "whose"), row, strict=True)) for row in rows]
        conflicts = [{"control": control, "names": list(names)} for control, names in shared]
        print_json({"file": str(file or user_file()), "inputs": told, "unknown": unknown, "shared": conflicts})
        return
    print_table(("name", "is", "controls", "whose"), [(*row[:2], row[2] or "nothing", row[3]) for row in rows])
    if unknown:
        print(f"\nThe scene has no {', '.join(unknown)}: what is bound to that waits for one that has.")
    _tell_shared(shared)
    print(f"\nOwn ones are kept in {file or user_file()}. `elys input bind NAME CONTROLS` chooses others.")


def bind(name: str, controls: str, scene: str, *, player: int | None, file: Path | None) -> None:
    """Writes one binding, and says with what it shares controls."""
    check_name(name)
    declared = _declared(scene)
    sorts: tuple[Sort, ...] = tuple(sort for sort in SORTS if name in declared[sort])
    if scene and not sorts:
        known = ", ".join(known for names in declared.values() for known in names)
        raise InputError(f"{scene} has no {name!r}: there are {known}")
    for sort in sorts:
        controls_of(sort, controls)
    if not sorts:
        sorts_taking(controls)
    written = _read(file)
    written = written.with_told(player, {**written.told(player), name: controls})
    path = save_bindings(written, file)
    print(f"{name} is bound to {controls or 'nothing'}{_whose(player)}, in {path}")
    _tell_shared([told for told in shared_controls(_controls(declared, written.of(player or 1))) if name in told[1]])


def reset(names: Sequence[str], *, player: int | None, file: Path | None) -> None:
    """Takes bindings out of the file."""
    written = _read(file)
    told = written.told(player)
    unknown = [name for name in names if name not in told]
    if unknown:
        there = f"bound are {', '.join(told)}" if told else "nothing is bound"
        raise InputError(f"{', '.join(unknown)} is bound to nothing of your own{_whose(player)}: {there}")
    path = save_bindings(
        written.with_told(player, {name: told[name] for name in told if names and name not in names}), file
    )
    print(f"{', '.join(names) if names else 'everything'} has the scene's controls again{_whose(player)}, in {path}")


def _read(file: Path | None) -> BindingsFile:
    return load_bindings(file) if file is None or file.exists() else BindingsFile()


def _declared(scene: str) -> dict[Sort, dict[str, str]]:
    values: dict[str, object] = {}
    if scene:
        from elys.common.assets.store import AssetStore
        from elys.verbs.scenes import open_scene_or_sample

        records = open_scene_or_sample(scene, AssetStore()).records
        values = next((r.components["InputMap"] for r in records if "InputMap" in r.components and r.enabled), {})
    usual = component_from("InputMap", values)
    assert isinstance(usual, InputMap)
    return {"action": dict(usual.actions), "axis": dict(usual.axes), "vector": dict(usual.vectors)}


def _controls(declared: dict[Sort, dict[str, str]], bound: dict[str, str]) -> dict[str, tuple[Control, ...]]:
    controls = {}
    for sort, names in declared.items():
        for name, usual in names.items():
            try:
                controls[name] = controls_of(sort, bound.get(name, usual))
            except InputError as error:
                raise InputError(f"{name}, which is an {sort} here: {error}") from None
    return controls


def _tell_shared(shared: list[tuple[str, tuple[str, ...]]]) -> None:
    for control, names in shared:
        print(f"Conflict: {control} does {', '.join(names[:-1])} and {names[-1]}.")


def _whose(player: int | None) -> str:
    return f" for player {player}" if player else ""
