"""The hard cases: scenes with a known end, from one registry that feeds demos, tests, benchmarks and docs.

Each is an ordinary scene document, so that everything that opens a sample opens it: `elys run newtons-cradle`. What makes it
hard, what the answer is and how an error is measured stands with it. Measures know what was recorded and nothing of how it was
simulated; answers are closed forms, or numbers whose source is named.
"""

from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase
from elys.samples.hard_cases.registry import HARD_CASES, hard_case

__all__ = ["HARD_CASES", "CaseMeasure", "CaseRun", "HardCase", "hard_case"]
