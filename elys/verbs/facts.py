"""schema, samples: verbs that print facts and start nothing."""

from __future__ import annotations

from pathlib import Path

from elys.common.errors import SceneError
from elys.verbs.output import print_json, print_table


def schema(component: str) -> None:
    """Prints the JSON Schema of the scene file, of files of edits, or of one component."""
    from elys.common.components.schema import component_schema, scene_schema
    from elys.verbs.edit_file import edits_schema

    if component == "edits":
        print_json(edits_schema())
        return
    print_json(component_schema(component) if component else scene_schema())


def samples(name: str, output: Path | None, *, json: bool) -> None:
    """Lists the samples, the levels of the game and the hard cases, or writes one as a scene file."""
    from elys.samples.game.levels import LEVELS
    from elys.samples.hard_cases import HARD_CASES
    from elys.samples.registry import SAMPLES, write_sample

    if name:
        path = output or Path(f"{name}.scene.json")
        if path.is_file():
            raise SceneError(f"{path} is there already: choose another name with -o, or remove it first")
        if name in LEVELS:
            LEVELS[name].write(path)
            print(f"{path}\nTry: elys game {path}, or elys run {path} to change it")
            return
        write_sample(name, path)
        print(f"{path}\nTry: elys run {path}")
        return
    scenes = [(sample.name, sample.title) for sample in SAMPLES.values()]
    levels = [(level.name, level.about) for level in LEVELS.values()]
    cases = [(case.name, case.title) for case in HARD_CASES.values()]
    if json:
        print_json([{"name": name, "title": title} for name, title in (*scenes, *levels, *cases)])
    else:
        print_table(("sample", "what it is"), scenes)
        print()
        print_table(("level", "of the game (elys game NAME)"), levels)
        print()
        print_table(("hard case", "what it is"), cases)
        print("\nTry: elys run NAME, or elys samples NAME to write it as a file.")
