# make run: fly the demo.  make test: all checks and tests.  Both set up .venv first, from the lock file.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.locked
BUILT := $(VENV)/.built

.PHONY: run test check setup browser lock clean

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

# The one compiled file; it needs a C compiler and Python's headers (Debian: gcc, python3-dev).
$(BUILT): $(STAMP) pyproject.toml setup.py companion/compiled/kernels.pyx
	PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

# Chromium, for the tests of the display; they are skipped without. Debian, as root.
browser:
	command -v chromium >/dev/null || { apt-get update -qq && \
		apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core; }

# Writes requirements.lock anew from pyproject.toml; run it when a dependency changes.
lock: $(STAMP)
	CUSTOM_COMPILE_COMMAND="make lock" $(BIN)/pip-compile --quiet --extra dev --all-build-deps --generate-hashes --allow-unsafe \
		--strip-extras --no-emit-index-url --no-emit-find-links --output-file requirements.lock pyproject.toml

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis
