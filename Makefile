# make train, make test and make check each create .venv and install what they need: python3 with venv is enough.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
OLDEST := .venv-interop/oldest-gymnasium
ENVIRONMENTS := tests/interop tests/masks $(wildcard tests/shield/test_logic_*.py) \
    $(addprefix tests/driving/test_,doors.py env.py vector.py)
CORE = .venv-core/$(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')

.PHONY: train test test-all test-core test-gymnasium test-interop coverage check docs clean

train: $(READY)
	$(BIN)/drlsl train --preset quick

test: $(READY)
	$(BIN)/pytest -n 2 -m "not slow"

test-all: $(READY)
	$(BIN)/pytest -n 2

# What works without PyTorch, tested without it: make test-core PYTHON=python3.13
test-core: $(CORE)/.ready
	$(CORE)/bin/pytest -n 2 -m "not slow"

# With the oldest Gymnasium that is accepted, in front of all else that .venv has.
test-gymnasium: $(OLDEST)/.ready
	$(OLDEST)/bin/python -m pytest -n 2 -m "not slow" $(ENVIRONMENTS)

# In the libraries that users train with, an environment each: long, and 10 GB.
test-interop:
	$(PYTHON) scripts/interop.py

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
	rm -rf $(VENV) .venv-core .venv-interop .coverage build dist

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

$(CORE)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(CORE)
	$(CORE)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[core-test]'
	touch $@

$(OLDEST)/.ready: tests/interop/oldest_gymnasium.txt $(READY)
	$(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps -r $<
	printf '%s\n' "$(CURDIR)" "$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')" \
	    > "$$($(OLDEST)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/shared.pth"
	touch $@
