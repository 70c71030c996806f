"""Rigid bodies against peers and against truth.

python -m tests.benchmarks rigid                       everything
python -m tests.benchmarks rigid --case stack-30       one case or crowd; may be given again
python -m tests.benchmarks rigid --quick               first seeds and short windows
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from elys.samples.rigid_cases import CROWDS, RIGID_CASES
from tests.benchmarks.rigid_accuracy import accuracy_table, measure_case

ROOT = Path(__file__).parents[2]


def main(words: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks rigid")
    parser.add_argument("--case", action="append", choices=[*RIGID_CASES, *CROWDS], metavar="NAME")
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args(words)
    chosen = options.case or list(RIGID_CASES)
    rows = [row for name in chosen for row in measure_case(RIGID_CASES[name], quick=options.quick)]
    print(accuracy_table(rows))


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
