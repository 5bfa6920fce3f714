# Two commands for a fresh machine with Python 3.11 (venv) and make; both do all set-up.

PYTHON ?= python3.11
VENV ?= .venv
BIN := $(VENV)/bin
SIDE_BY_SIDE := -n auto --maxprocesses 8 --dist loadfile
READY := $(VENV)/.ready
CORE_TESTS := $(addprefix tests/kinetics/,formats markov network predicting rates sampling) tests/test_wheel.py \
	tests/contracts/test_engines.py tests/mechsim/world/test_own_engine.py

# Tests and demo get HOME and PATH alone, so that nothing can lean on what a machine happens to set. Set-up gets all that
# there is: pip may need certificates, a proxy or an index.
BARE := env -i HOME="$(HOME)" PATH="$(PATH)" $(if $(CI),CI="$(CI)")
DEMO :=  # further options of the demo

.PHONY: demo test core lock lint validate faults fuzz mutation benchmarks docs dist study clean

demo: $(READY)
	$(BARE) $(BIN)/wellmixed demo --folder demo-output --workers 2 $(DEMO)

test: lint
	$(BARE) $(BIN)/python -m pytest -q $(SIDE_BY_SIDE)

# The core without mechanics under another Python: make core PYTHON=python3.13 VENV=.venv-3.13
core: $(READY)
	$(BARE) $(BIN)/python -m pytest -q $(SIDE_BY_SIDE) kinetics $(CORE_TESTS)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell
	$(BIN)/mypy

validate: $(READY)
	$(BARE) $(BIN)/python -m pytest -q --validate

faults: $(READY)
	$(BARE) $(BIN)/python -m tests.faults --json results/faults.json

fuzz: $(READY)
	$(BARE) $(BIN)/python -m tests.helpers.fuzz_campaign

mutation: $(READY)
	$(BARE) $(BIN)/python -m tests.mutation

benchmarks: $(READY)
	for bench in $(notdir $(basename $(wildcard tests/benchmarks/bench_*.py))); do \
		echo "== $$bench"; $(BIN)/python -m tests.benchmarks.$$bench || exit 1; done

# The site, in .site, from where it opens in a browser; its search wants a server (`mkdocs serve`). A warning ends it.
docs: $(READY) .notebooks/.run
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

# Notebooks with their pictures; two minutes, and made again if they or the packages change.
.notebooks/.run: $(READY) $(wildcard notebooks/*.py) $(shell find kinetics mechsim calibration -name '*.py' -o -name '*.c')
	$(BARE) $(BIN)/python docs/site/notebook_pages.py .notebooks
	touch $@

# What an index takes: the source, and one wheel for all Pythons from 3.11 on, in dist. On Linux its name promises to run
# with glibc 2.17 and later, which tests/test_wheel.py holds it to; macOS and Windows name their own.
PLATFORM := $(if $(filter Linux,$(shell uname -s)),--config-settings=--build-option=--plat-name=manylinux_2_17_$(shell uname -m))
dist: $(READY)
	rm -rf dist
	$(BIN)/python -W ignore -c "from setuptools import build_meta; build_meta.build_sdist('dist')" > /dev/null
	$(BIN)/python -m pip -q --disable-pip-version-check wheel --no-deps --no-build-isolation $(PLATFORM) -w dist dist/*.tar.gz

# The study of results/line4: makes the runs that are missing, reads the others, and judges the plan. A broken rule, exit
# code 5, is a result.
STUDY := results/line4
STUDY_RUNS := --runs-folder $(STUDY)/runs --workers 2
study: $(READY)
	$(BIN)/wellmixed calibrate $(STUDY)/plan.toml $(STUDY_RUNS) --out $(STUDY)/rates.toml \
		--report $(STUDY)/calibration.html --json > $(STUDY)/calibration.json
	$(BIN)/wellmixed calibrate $(STUDY)/plan.toml $(STUDY_RUNS) --break-model first-order --out $(STUDY)/first-order.toml
	$(BIN)/wellmixed calibrate $(STUDY)/plan.toml $(STUDY_RUNS) --crowding none --out $(STUDY)/uncrowded.toml
	$(BIN)/wellmixed validate $(STUDY)/plan.toml $(STUDY_RUNS) --rates $(STUDY)/rates.toml \
		--control $(STUDY)/first-order.toml --control $(STUDY)/uncrowded.toml --csv $(STUDY)/events.csv \
		--report $(STUDY)/validation.html --json > $(STUDY)/validation.json || [ $$? -eq 5 ]
	$(BIN)/wellmixed runs crowding $(STUDY)/runs --above 0.005 --above 0.006 --json > $(STUDY)/crowding.json

# Every package by its hash, the one that builds ours among them; then ours.
$(READY): pyproject.toml requirements.lock $(wildcard kinetics/native/c/*)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -qq --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install -qq --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $(READY)

# constraints.txt says the versions, peers' and oracles' too; uv finds the hashes.
lock:
	uv pip compile pyproject.toml --extra all --extra test --extra docs --constraint constraints.txt --universal --python-version 3.11 \
		--generate-hashes --no-annotate --no-header -q -o requirements.lock

clean:
	rm -rf $(VENV) demo-output .site .notebooks dist
