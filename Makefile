# The two that matter: `make demo` shows ELYS, `make test` proves it. Both set everything up the first time.

PY := .venv/bin/python
READY := .venv/.ready

.DEFAULT_GOAL := help
.PHONY: help setup demo test check lint format wheel bench soak golden pictures gallery reports pin clean

help:  ## this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

$(READY): pyproject.toml setup.sh
	@./setup.sh

setup: $(READY)  ## make .venv with ELYS and what it needs

demo: $(READY)  ## show ELYS: an editor where there is a screen, else files
	@$(PY) -m elys demo

test: $(READY)  ## all tests, two files at a time
	@$(PY) -m pytest -n 2 --dist loadfile

check: lint  ## style, types, imports and the fast tests
	@$(PY) -m pytest tests/unit -m "not gl and not process"

lint: $(READY)  ## style, types and imports alone
	@$(PY) -m ruff check elys tests
	@$(PY) -m ruff format --check elys tests
	@$(PY) -m mypy
	@.venv/bin/lint-imports

format: $(READY)  ## put the code into its form
	@$(PY) -m ruff check --fix elys tests
	@$(PY) -m ruff format elys tests

wheel: $(READY)  ## build dist/*.whl with compiled kernels for this platform
	@HATCH_BUILD_HOOK_ENABLE_CUSTOM=true ELYS_KERNEL_CACHE=build/kernels $(PY) -m hatchling build -t wheel

bench: $(READY)  ## measure: rigid bodies beside their peers, tick times, latency, starts (README's table)
	-@$(PY) -m pip install --quiet --disable-pip-version-check -e '.[peers]'
	@$(PY) -m tests.benchmarks

soak: $(READY)  ## long campaigns: kills, fuzz and emulated processors
	@$(PY) -m pytest tests/process tests/property tests/network tests/unit/bus/test_hostile_files.py --soak

golden: $(READY)  ## draw the golden pictures anew (look at them before committing)
	@$(PY) -m pytest tests/golden --draw-golden

pin: $(READY)  ## pin the state hashes anew, after the physics was changed on purpose
	@$(PY) -m tests.pinned_hashes --pin

pictures: $(READY)  ## draw the pictures of the docs anew
	@$(PY) -m tests.pictures

gallery: $(READY)  ## run the hard cases and draw docs/hard-cases.md anew
	@$(PY) -m tests.gallery

REPORTED := stack-10 newtons-cradle heavy-chain closed-loop dominoes

reports: $(READY)  ## study five hard cases anew: docs/reports/speed-against-error.html
	-@$(PY) -m pip install --quiet --disable-pip-version-check -e '.[peers]'
	@mkdir -p docs/reports
	@$(PY) -m elys pareto $(REPORTED) --seconds 4 --peers --html docs/reports/speed-against-error.html

clean:  ## take away what was made here
	rm -rf .venv build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis demo.mcap demo.png demo.mp4 demo.scene.json
