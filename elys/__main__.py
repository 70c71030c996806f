"""The `elys` command: all verbs, and what becomes of errors."""

from __future__ import annotations

import sys

import typer

from elys.cli.app import app
from elys.common.errors import ElysError
from elys.common.garbage import keep_searches_short

# Verbs stand in --help in the order in which they are imported.
# isort: off
from elys.cli import sessions, network, scenes, recordings  # noqa: F401
from elys.cli import pictures, experiments, game, topics, keys, nodes, input  # noqa: F401
# isort: on

UsageError: type[typer.BadParameter] = typer.BadParameter.__mro__[1]  # the parent of all of them, which typer hides

# What the simulation alone can do without, by the extra of pyproject.toml that brings it.
_EXTRA_OF = {
    "PIL": "render",
    "aiohttp": "web",
    "distributed": "cluster",
    "foxglove": "foxglove",
    "pyarrow": "parquet",
    "vl_convert": "lab",
    "av": "render",
    "glfw": "render",
    "imgui_bundle": "editor",
    "moderngl": "render",
    "simplejpeg": "render",
    "OpenEXR": "render",
}


def main() -> None:
    """The `elys` command: errors of ELYS become one line and exit status 1, wrong options one line and 2."""
    keep_searches_short()
    try:
        sys.exit(app(_with_default_port(sys.argv[1:]), prog_name="elys", standalone_mode=False) or 0)
    except ElysError as error:
        print(f"elys: {error}", file=sys.stderr)
        sys.exit(1)
    except UsageError as error:
        print(_usage_sentence(error), file=sys.stderr)
        sys.exit(2)
    except ModuleNotFoundError as error:
        extra = _EXTRA_OF.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        print(f"elys: this needs {error.name}, which is not installed: pip install 'elys[{extra}]'", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:  # `elys topic echo | head`: the reader has had enough
        sys.stderr.close()
        sys.exit(0)


def _with_default_port(words: list[str]) -> list[str]:
    """`--foxglove` without a port means the one where the app looks: typer knows no values that may be left out."""
    made = []
    for word, following in zip(words, [*words[1:], ""], strict=False):
        made += [word, "8765"] if word == "--foxglove" and "run" in words[:1] and not following.isdecimal() else [word]
    return made


def _usage_sentence(error: typer.BadParameter) -> str:
    text = error.format_message().strip()
    if "\n" in text:
        return text  # the help itself: no command was given
    return f"elys: {text.rstrip('.')}: see {error.ctx.command_path if error.ctx else 'elys'} --help"


if __name__ == "__main__":
    main()
