"""demo: the first thing a newcomer runs. With a screen the editor on a falling yard; without one, files that show the same."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Final

from elys.bus.access.listening import LOOPBACK
from elys.common.errors import DisplayError, ElysError

SAMPLE: Final = "yard"
STEP_COUNT: Final = 300  # 5 s, in which everything falls and most of it comes to rest
PICTURE_TIME: Final = 4.0  # [s]
VIDEO_SIZE: Final = "640x360"


def demo(directory: Path, *, headless: bool) -> None:
    """Opens the editor where there is a display, else simulates, records, draws, and says what to try next."""
    if not headless and _has_display():
        from elys.bus.last_seconds import SECONDS
        from elys.verbs.run import run

        sys.stderr.write("Opening the editor on a running simulation. Ctrl-C or closing the window ends it.\n")
        run(
            SAMPLE,
            headless=False,
            step_limit=0,
            record=None,
            realtime=True,
            paused=False,
            listen=LOOPBACK,
            name="",
            threads=1,
            guard=SECONDS,
            keep=60.0,
            json=False,
        )
        return
    _demo_files(directory)


def _has_display() -> bool:
    from elys.render_node.window import probe_display

    try:
        probe_display()
    except DisplayError:
        return False
    return True


def _demo_files(directory: Path) -> None:
    from elys.bus.last_seconds import SECONDS
    from elys.bus.recording_plan import RecordingPlan
    from elys.samples.registry import write_sample
    from elys.verbs.render import render
    from elys.verbs.run import run

    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ElysError(f"{directory} cannot be made ({error.strerror}): choose another with --directory") from error
    recording, picture, video = (directory / f"demo.{suffix}" for suffix in ("mcap", "png", "mp4"))
    scene = directory / "demo.scene.json"
    write_sample(SAMPLE, scene)
    print(f"No screen here, so the demo writes files. Simulating {STEP_COUNT} ticks of {scene} ...", flush=True)
    run(
        str(scene),
        headless=True,
        step_limit=STEP_COUNT,
        record=recording,
        realtime=False,
        paused=False,
        listen=LOOPBACK,
        name="demo",
        threads=1,
        guard=SECONDS,
        keep=0.0,
        json=False,
        plan=RecordingPlan(overwrites=True),  # the demo's own files are made anew
    )
    render(str(recording), picture, size="1280x720", time=PICTURE_TIME, duration=0.0, fps=30.0)
    render(str(recording), video, size=VIDEO_SIZE, time=0.0, duration=0.0, fps=24.0)
    elys = _command()
    print(
        f"\nLook at {picture} and {video}. Then try:\n"
        f"  {elys} info {recording}              what a recording holds\n"
        f"  {elys} play {recording}              serve it; in another shell: {elys} view, or {elys} edit\n"
        f"  {elys} run {scene} --headless   simulate in real time; attach with {elys} view or {elys} edit\n"
        f"  {elys} samples                      more scenes\n"
        f"  {elys} doctor                       what this machine can do"
    )


def _command() -> str:
    """What to type for `elys` here: the name alone where the shell finds it, else the path beside this interpreter."""
    if shutil.which("elys"):
        return "elys"
    return os.path.relpath(Path(sys.executable).parent / "elys")
