"""Scenes that ELYS makes by itself: demos, tests and benchmarks take them from one registry."""

from elys.samples.registry import SAMPLES, Sample, sample, write_sample

__all__ = ["SAMPLES", "Sample", "sample", "write_sample"]
