# Every target does its own set-up; it needs Python 3.11 or newer, make and the package index.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
DEVELOP := $(VENV)/.develop
# Modules are compiled when they are first imported: most of those of the libraries never are.
INSTALL := -m pip install --quiet --disable-pip-version-check --no-compile
JOBS ?= $(shell nproc 2>/dev/null || echo 2)
OUT ?= out
LOCK := uv pip compile --quiet pyproject.toml --universal --python-version 3.11 --generate-hashes --no-header --no-annotate
# Processes run side by side: further threads for small matrices only wait for each other.
export OPENBLAS_NUM_THREADS ?= 1
# Containers set this variable, and every process then compiles all modules that it imports, which takes seconds.
unexport PYTHONDONTWRITEBYTECODE
BUDGET ?= 1
# make lateral RUNS=600
RUNS ?= 300
# make campaign-quick STORE=s3://BUCKET/FOLDER flies into an object store (docs/stores.md)
AT := $(if $(STORE),--store $(STORE))
LATE := elevator_delay actuator_lag gyro_lag sensor_delay
CAMPAIGNS := light light-fit moderate moderate-fit

.PHONY: lateral planned planned-ties check-study help setup setup-dev lock installed docs docs-links campaign campaign-further campaign-quick loop study blind test test-slow test-long test-all fuzz robustness mutants lint kernels picture screenshots browser bench clean

help: ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 18

setup: $(READY) ## make the virtual environment of a user

setup-dev: $(DEVELOP) ## the same with the tools of a developer

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python $(INSTALL) --require-hashes -r requirements.lock
	$(BIN)/python $(INSTALL) --no-deps --no-build-isolation -e .
	touch $@

$(DEVELOP): requirements-dev.lock $(READY)
	$(BIN)/python $(INSTALL) --require-hashes -r requirements-dev.lock
	touch $@

lock: ## resolve pyproject.toml into the three lock files, with hashes (needs uv)
	$(LOCK) --extra dev -o requirements-dev.lock
	$(LOCK) --extra build -c requirements-dev.lock -o requirements.lock
	$(LOCK) --extra build --extra docs -c requirements-dev.lock -o requirements-docs.lock

installed: $(DEVELOP) ## the README from an installed wheel in an empty folder, and the time of each command
	$(BIN)/python -m scripts.readme --wheel

docs: $(VENV)/.docs ## build the site into out/site; its numbers and pictures come from code that runs now (minutes; kept in out/docs-cache)
	$(BIN)/python -m sphinx -q -W --keep-going -b html -d $(OUT)/docs-trees docs $(OUT)/site
	@echo "open $(OUT)/site/index.html"

docs-links: $(VENV)/.docs ## test the links of the site to other sites (needs a network)
	$(BIN)/python -m sphinx -q -b linkcheck -d $(OUT)/docs-trees docs $(OUT)/site-links

$(VENV)/.docs: requirements-docs.lock $(READY)
	$(BIN)/python $(INSTALL) --require-hashes -r requirements-docs.lock
	touch $@

campaign: $(READY) ## fly data/campaigns, identify, print the paper's tables, close the loop (into out/)
	$(BIN)/python -m scripts.campaign --out $(OUT) $(AT) --jobs $(JOBS)

campaign-further: $(READY) ## the same with six more methods, and a trace of each log of data/undeclared (about half an hour)
	$(BIN)/python -m scripts.campaign --out $(OUT) $(AT) --jobs $(JOBS) --further --undeclared

campaign-quick: $(READY) ## make campaign with a tenth of the runs
	$(BIN)/python -m scripts.campaign --out $(OUT)/quick $(AT) --jobs $(JOBS) --quick

loop: $(READY) ## the paper's experiment through the loop: 2000 runs, every method before and after (six minutes)
	$(BIN)/python -m studies.paper_loop --out $(OUT)/loop-2000 --jobs $(JOBS) --affine 300

study: $(DEVELOP) ## every cause behind docs/paper.md and docs/closed_loop.md, off and on (about ten minutes)
	$(BIN)/python -m studies.paper_study --out $(OUT)/study --jobs $(JOBS)
	$(BIN)/python -m studies.closed_loop_study
	$(BIN)/python -m pytest -q -n $(JOBS) --dist loadgroup -m study
	$(BIN)/python -m studies.foreign_aircraft

lateral: $(DEVELOP) ## the lateral estimators: affine aircraft, RUNS flights of the GTM's tables, every cause off and on (an hour at 300)
	for level in 0 1 2; do $(BIN)/python -m studies.lateral_study --runs $(RUNS) --level $$level || exit 1; done
	$(BIN)/python -m studies.lateral_flights --out $(OUT)/lateral --runs $(RUNS) --jobs $(JOBS)
	$(BIN)/python -m studies.lateral_causes
	$(BIN)/python -m studies.measured_lateral

fleet: $(READY) ## 35 aircraft of the JSBSim package surveyed, flown and traced (hours; continues after an interruption)
	$(BIN)/python -m studies.foreign_fleet --out $(OUT)/fleet
	$(BIN)/python -m studies.foreign_lateral_calm --out $(OUT)/lateral-fleet

planned: $(DEVELOP) ## planned flights of six pairs of effects, flown and traced (about an hour; continues after an interruption)
	$(BIN)/python -m studies.planned_flights --out $(OUT)/planned

planned-ties: $(DEVELOP) ## the next flight after blind trials that leave a tie, planned, flown and traced (hours; continues after an interruption)
	$(BIN)/python -m validation.blind --mode single --seed 20262202 --trials 446 --only-counted $(LATE:%=--effect %) --jobs $(JOBS) --out $(OUT)/blind-ties
	$(BIN)/python -m studies.planned_ties --blind $(OUT)/blind-ties --out $(OUT)/planned-ties --seed 20262201 --jobs $(JOBS)

check-study: $(DEVELOP) ## 500 records with none to three sensor errors through `airtruth check` (about ten minutes)
	$(BIN)/python -m studies.check_study --jobs $(JOBS)

blind: $(READY) ## 200 flight tests that the tracer has not seen, scored against their truth
	$(BIN)/python -m validation.blind --trials 200 --seed 1 --jobs $(JOBS) --out $(OUT)/blind

test: $(DEVELOP) ## lint, types, unit and property tests, one end-to-end run of each command
	$(MAKE) --no-print-directory --jobs $(JOBS) lint kernels
	$(BIN)/python -m pytest -n $(JOBS) --dist loadgroup

test-slow: kernels ## interrupted campaigns, stores, clusters, pages in a browser, one of each kind of trace
	$(BIN)/python -m pytest -n $(JOBS) --dist loadgroup -m "slow and not long and not study"

test-long: kernels ## the rest: frozen trials, data/undeclared, measured flights, every fault, every document (an hour)
	$(BIN)/python -m pytest -n $(JOBS) --dist loadgroup -m "long and not study"

test-all: test test-slow test-long ## every test

fuzz: kernels ## damage 38,000 logs, imported files, TOML files and results and use each (about half an hour; BUDGET scales it)
	$(BIN)/python -m validation.fuzz --budget $(BUDGET) --seed 1

robustness: $(DEVELOP) ## kill commands 200 times and damage a campaign 150 times; every file has to be restored (about an hour)
	$(BIN)/python -m validation.robustness --kills 200 --damages 150 --seed 1

mutants: $(DEVELOP) ## mutation testing of physics, regression, covariance, campaign, resume and the selection of effects (about an hour)
	$(BIN)/python $(INSTALL) cosmic-ray==8.7.0
	$(BIN)/python -m scripts.mutants --jobs $(JOBS)

kernels: $(DEVELOP) ## compile the numba kernels once, so that parallel tests do not each compile them
	$(BIN)/python -m scripts.compile_kernels

picture: $(READY) ## draw the picture of README, docs/images/trace.png (a minute)
	$(BIN)/python -m scripts.picture

screenshots: $(READY) ## make a page of each kind and take its pictures in headless Chromium (minutes)
	$(BIN)/python -m scripts.screenshots --out $(OUT)/screenshots

browser: ## install Debian's headless Chromium, in which the slow tests open the pages (needs root)
	apt-get update -qq
	DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends chromium-headless-shell fonts-dejavu-core

lint: $(DEVELOP) ## ruff, mypy --strict, the import contract
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(DEVELOP) ## ratios against bare baselines and peers
	$(BIN)/python -m benchmarks.bench_fly
	$(BIN)/python -m benchmarks.bench_identify
	$(BIN)/python -m benchmarks.bench_import
	$(BIN)/python -m benchmarks.bench_filter_error
	$(BIN)/python -m benchmarks.bench_lateral
	$(BIN)/python -m benchmarks.bench_peers
	$(BIN)/python -m benchmarks.bench_trace

clean: ## remove the environment, caches and output
	rm -rf $(VENV) $(OUT) .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
