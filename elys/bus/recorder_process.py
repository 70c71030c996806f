"""The recorder as a process of its own: `python -m elys.bus.recorder_process --fd N --output F.mcap`.

It outlives the simulation on purpose. Ctrl-C and a supervisor's signals reach both; the simulation ends the pipe, and the
pipe's end is what ends the recorder, with a whole file.
"""

from __future__ import annotations

import argparse
import signal
import sys
from pathlib import Path

from elys.bus.log import start_logging
from elys.bus.recorder import record_pipe
from elys.bus.recording_plan import from_json
from elys.common.errors import RecordingError


def main(arguments: list[str] | None = None) -> int:
    """Records until the pipe ends; 0 if there is a recording then."""
    parser = argparse.ArgumentParser(prog="elys.bus.recorder_process")
    parser.add_argument("--fd", type=int, required=True, help="the pipe's end to read from")
    parser.add_argument("--output", type=Path, required=True, help="the recording to write")
    parser.add_argument("--plan", default="{}", help="a RecordingPlan in JSON")
    chosen = parser.parse_args(arguments)
    start_logging()
    for ignored in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(ignored, signal.SIG_IGN)
    try:
        record_pipe(chosen.fd, chosen.output, from_json(chosen.plan))
    except RecordingError as error:
        print(f"recorder: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
