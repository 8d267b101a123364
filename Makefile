# make run: fly the demo.  make test: all checks and tests.  Both set up .venv first, from the lock file.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.locked
BUILT := $(VENV)/.built

.PHONY: run test check setup compiler browser orca lock clean pictures

run: setup
	$(BIN)/companion-sim demo

test: check
	$(BIN)/pytest --numprocesses 3

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

setup: $(BUILT)

$(STAMP): requirements.lock
	$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "Companion needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	touch $@

# What is compiled.
$(BUILT): $(STAMP) pyproject.toml setup.py companion/compiled/kernels.pyx sim/compiled/wing.pyx
	@command -v cc >/dev/null || { echo "Companion compiles two files and needs a C compiler: make compiler (Debian)" >&2; exit 1; }
	PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

# A C compiler and Python's headers. Debian, as root.
compiler:
	command -v cc >/dev/null || { apt-get update -qq && \
		apt-get install -y -qq --no-install-recommends gcc libc6-dev python3-dev; }

# Chromium, for the tests of the display; they are skipped without. Debian, as root.
browser:
	command -v chromium >/dev/null || { apt-get update -qq && \
		apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core; }

# The library of ORCA, which campaigns can compare with; its tests are skipped without.
orca: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r orca.lock

# Writes requirements.lock anew from pyproject.toml; run it when a dependency changes.
lock: $(STAMP)
	CUSTOM_COMPILE_COMMAND="make lock" $(BIN)/pip-compile --quiet --extra dev --all-build-deps --generate-hashes --allow-unsafe \
		--strip-extras --no-emit-index-url --no-emit-find-links --output-file requirements.lock pyproject.toml

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis

# Redraws display.png, the terminal in README.md and the tables in REFERENCE.md from what runs now.
pictures: setup
	$(BIN)/python -m tests.tools.documents
	$(BIN)/python -m tests.tools.pictures
