# make train, make test and make check each create .venv and install what they need: python3 with venv is enough.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
CORE = .venv-core/$(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')

.PHONY: train test test-all test-core coverage check docs clean

train: $(READY)
	$(BIN)/drlsl train --preset quick

test: $(READY)
	$(BIN)/pytest -n 2 -m "not slow"

test-all: $(READY)
	$(BIN)/pytest -n 2

# What works without PyTorch, tested without it: make test-core PYTHON=python3.13
test-core: $(CORE)/.ready
	$(CORE)/bin/pytest -n 2 -m "not slow"

# Apart from make test, for measuring more than doubles the processor time that the tests take.
coverage: $(READY)
	$(BIN)/pytest -n 2 -m "not slow" --cov

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

# The documentation as a site, in build/docs; a warning is an error.
docs: $(READY)
	$(BIN)/mkdocs build

clean:
	rm -rf $(VENV) .venv-core .coverage build dist

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

$(CORE)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(CORE)
	$(CORE)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[core-test]'
	touch $@
