# Everything runs in .venv, which `make setup` makes once and remakes when pyproject.toml changes.
# Another interpreter: make PYTHON=/path/to/python3.12 setup

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
SOURCES := forest tests scenarios analysis docs

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-stand bench bench-quick lint format docs notebook clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-11s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(READY)  ## make .venv and install the project with all its tools
	@echo "setup: $(VENV) is ready"

$(READY): pyproject.toml
	@if ! [ -x $(BIN)/python ]; then \
	  for python in $(PYTHON) python3.11 python3.12 python3.13 python3; do \
	    if $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	      found=$$python; break; fi; done; \
	  [ -n "$$found" ] || { echo "forest needs Python 3.11 or newer: make PYTHON=/path/to/it"; exit 1; }; \
	  echo "setup: making $(VENV) with $$($$found --version)"; \
	  $$found -m venv $(VENV); fi
	@echo "setup: installing the project and its tools (a few minutes the first time)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev,docs,view]'
	@touch $@

demo: $(READY)  ## grow the Saxony spruce stand for 60 years, print its table, draw and report it
	@mkdir -p out
	@$(BIN)/forest run scenarios/saxony_spruce.toml --out out/run.h5 --force
	@$(BIN)/forest picture out/run.h5 --to out/stand.png --development out/development.png --force
	@$(BIN)/forest report out/run.h5 --to out/report.html --force

# One process compiles the kernels of an ordinary run before two use them; each test worker then
# takes a copy of that cache (tests/conftest.py).
test: $(READY)  ## the ordinary tests, on two processes
	@$(BIN)/python -m forest.warm
	@$(BIN)/python -m pytest -q -n 2 --dist loadfile --no-loadscope-reorder

test-stand: $(READY)  ## tests on whole stands (minutes)
	@$(BIN)/python -m forest.warm
	@$(BIN)/python -m pytest -q -m stand

bench: $(READY)  ## benchmarks: time and memory per metamer; a quarter of an hour
	@$(BIN)/python -m forest.warm
	@$(BIN)/python -m tests.benchmarks --out out/bench.json
	@$(BIN)/python -m pytest -q -m bench

bench-quick: $(READY)  ## the same on smaller stands, in two minutes
	@$(BIN)/python -m forest.warm
	@$(BIN)/python -m tests.benchmarks --quick --out out/bench.json

lint: $(READY)  ## style, types, and the direction of imports
	@$(BIN)/ruff check --quiet $(SOURCES)
	@$(BIN)/ruff format --check --quiet $(SOURCES) || { echo "not formatted: make format"; exit 1; }
	@$(BIN)/mypy --no-error-summary
	@$(BIN)/lint-imports > $(VENV)/layers.log || { cat $(VENV)/layers.log; exit 1; }
	@echo "lint: style, types and layers hold"

format: $(READY)  ## format the sources in place
	@$(BIN)/ruff check --quiet --fix $(SOURCES)
	@$(BIN)/ruff format --quiet $(SOURCES)

docs: $(READY)  ## build the documentation in docs/_build/html
	@$(BIN)/sphinx-build -q -W --keep-going -b html docs docs/_build/html
	@echo "docs: docs/_build/html/index.html"

notebook: $(READY)  ## execute docs/notebooks/rings.ipynb again (installs Jupyter's kernel)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[notebook]'
	@$(BIN)/python docs/notebooks/make_notebook.py

clean:  ## remove what was built, but not .venv
	@rm -rf out dist docs/_build .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
