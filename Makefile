# Every target does its own set-up; it needs Python 3.11 or newer, make and the package index.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
JOBS ?= $(shell nproc 2>/dev/null || echo 2)
OUT ?= out
CAMPAIGNS := light light-fit moderate moderate-fit

.PHONY: help setup campaign campaign-quick loop study blind test lint bench clean

help: ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 18

setup: $(READY) ## make the virtual environment

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

campaign: $(READY) ## fly data/campaigns, identify, print the paper's tables, close the loop (into out/)
	$(BIN)/python scripts/campaign.py --out $(OUT) --jobs $(JOBS)

campaign-quick: $(READY) ## the same with a tenth of the runs
	$(BIN)/python scripts/campaign.py --out $(OUT)/quick --jobs $(JOBS) --quick

loop: $(READY) ## the paper's experiment through the loop: 2000 runs, every method before and after (six minutes)
	$(BIN)/python scripts/paper_loop.py --out $(OUT)/loop-2000 --jobs $(JOBS) --affine 300

study: $(READY) ## every cause behind docs/paper.md and docs/closed_loop.md, off and on (about ten minutes)
	$(BIN)/python scripts/paper_study.py --out $(OUT)/study --jobs $(JOBS)
	$(BIN)/python scripts/closed_loop_study.py
	$(BIN)/python -m pytest -q -m study tests/trace/test_conformance_trace.py
	$(BIN)/python scripts/foreign_aircraft.py

blind: $(READY) ## 200 flight tests that the tracer has not seen, scored against their truth
	$(BIN)/python scripts/blind_trials.py --trials 200 --seed 1 --jobs $(JOBS) --out $(OUT)/blind

test: $(READY) lint ## lint, type-check and run every test
	$(BIN)/python -m pytest -n $(JOBS) --dist loadgroup

lint: $(READY) ## ruff, mypy --strict, the import contract
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(READY) ## ratios against bare baselines and peers
	$(BIN)/python benchmarks/bench_fly.py
	$(BIN)/python benchmarks/bench_identify.py
	$(BIN)/python benchmarks/bench_filter_error.py
	$(BIN)/python benchmarks/bench_peers.py
	$(BIN)/python benchmarks/bench_trace.py

clean: ## remove the environment, caches and output
	rm -rf $(VENV) $(OUT) .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
