# Two commands for a fresh machine with Python 3.11 (venv) and make; both do all set-up.

PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
SIDE_BY_SIDE := -n auto --maxprocesses 8 --dist loadfile
READY := $(VENV)/.ready

.PHONY: demo test lint validate benchmarks clean

demo: $(READY)
	$(BIN)/wellmixed demo --folder demo-output --workers 2

test: lint
	$(BIN)/python -m pytest -q $(SIDE_BY_SIDE)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell
	$(BIN)/mypy

validate: $(READY)
	$(BIN)/python -m pytest -q --validate

benchmarks: $(READY)
	for bench in $(notdir $(basename $(wildcard tests/benchmarks/bench_*.py))); do \
		echo "== $$bench"; $(BIN)/python -m tests.benchmarks.$$bench || exit 1; done

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e ".[all,test]"
	touch $(READY)

clean:
	rm -rf $(VENV) demo-output
