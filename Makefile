# make run: fly the demo.  make test: all checks and tests.  Both need Python 3.11 or newer, make and git; what else
# they need goes into .venv, from the lock files.  make thorough: the tests with every row in every way of flying.
PYTHON ?= $(shell for each in python3.11 python3.12 python3.13 python3; do \
	$$each -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && command -v $$each && break; done)
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install
# A compiler and Python's headers, or neither: another name, so that a compiler installed later is used.
CAN_COMPILE = command -v cc >/dev/null && $(PYTHON) -c 'import pathlib, sys, sysconfig; \
	sys.exit(not pathlib.Path(sysconfig.get_path("include"), "Python.h").exists())'
CREATED := $(VENV)/.created
NEEDED := $(VENV)/.requirements
BUILT = $(VENV)/.$(shell $(CAN_COMPILE) && echo compiled || echo plain)
TOOLS := $(VENV)/.dev
READ := $(VENV)/.read
# Many processes are started, and start in half of the time where Python keeps what it compiled.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run test thorough checked check setup compiler browser receiver-tools orca lock clean pictures

run: setup
	$(BIN)/companion-sim demo

# More than half of the time of all tests is waiting, for sockets, processes and clocks: eight keep two cores at work.
PYTEST = $(BIN)/pytest --numprocesses 8

test: checked
	$(PYTEST)

thorough: checked
	THOROUGH=1 $(PYTEST)

# Beside the checks the tests are read once: otherwise each process of pytest compiles all of them by itself.
checked: setup $(TOOLS)
	@$(MAKE) --no-print-directory --jobs 2 check $(READ)

$(READ): $(BUILT) $(TOOLS) $(shell find companion sim tests -name '*.py')
	@$(BIN)/pytest --collect-only --quiet >$@.log || { cat $@.log; exit 1; }
	@touch $@

check: setup $(TOOLS)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

setup: $(BUILT)

# All that must be there already is looked for before anything is downloaded.
$(CREATED):
	@test -n "$(PYTHON)" || { echo "Companion needs Python 3.11 or newer, which is not installed; \
	if it has another name: make PYTHON=NAME" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else \
	"Companion needs Python 3.11 or newer, and $(PYTHON) is " + sys.version.split()[0])'
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "Companion needs the venv module of $(PYTHON): \
	apt install python3-venv (Debian)" >&2; exit 1; }
	@echo "== Setting up $(VENV): $$($(PYTHON) --version)"
	@$(PYTHON) -m venv $(VENV)
	@touch $@

$(NEEDED): $(CREATED) requirements.lock
	@echo "== Installing what Companion flies with: $$(grep -c == requirements.lock) packages, some 45 MB to download"
	@$(PIP) --require-hashes -r requirements.lock
	@touch $@

$(BUILT): $(NEEDED) pyproject.toml setup.py companion/compiled/kernels.py companion/compiled/pairs.py sim/compiled/airframe_step.py
	@$(CAN_COMPILE) && echo "== Installing Companion: compiling three files, half a minute" || \
		echo "== Installing Companion: without a C compiler and Python's headers (make compiler)"
	@PYTHONWARNINGS=ignore $(PIP) --quiet --no-deps --no-build-isolation -e .
	@$(BIN)/python -c 'from companion.compiled import slow_notice; print("==", slow_notice() or "Ready")'
	@touch $@

$(TOOLS): $(NEEDED) dev.lock orca.lock
	@echo "== Installing what checks and tests need: $$(grep -c == dev.lock) packages, some 120 MB to download"
	@$(PIP) --require-hashes -r dev.lock
	@$(MAKE) --no-print-directory orca || \
		echo "== The library of ORCA is not available here: its tests are skipped"
	@touch $@

# A C compiler and Python's headers: without them a decision takes 20 to 100 times as long. Debian, as root.
compiler:
	{ $(CAN_COMPILE); } || { apt-get update -qq && \
		apt-get install -y -qq --no-install-recommends gcc libc6-dev python3-dev; }

# Chromium, for the tests of the display; they are skipped without. Debian, as root.
browser:
	command -v chromium >/dev/null || { apt-get update -qq && \
		apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core; }

# A receiver of Mode S, for the test that compares ours with it; it is skipped without. Debian, as root.
receiver-tools:
	command -v dump1090-mutability >/dev/null || { apt-get update -qq && DEBIAN_FRONTEND=noninteractive \
		apt-get install -y -qq --no-install-recommends dump1090-mutability; }

# The library of ORCA, a method that campaigns compare with, without what it lists as its dependencies.
orca: $(NEEDED)
	$(PIP) --quiet --no-deps --require-hashes -r orca.lock

# Writes the lock files again from pyproject.toml; run it when a dependency changes.
LOCK = CUSTOM_COMPILE_COMMAND="make lock" $(BIN)/pip-compile --quiet --all-build-deps --generate-hashes \
	--allow-unsafe --strip-extras --no-emit-index-url --no-emit-find-links
lock: $(TOOLS)
	$(LOCK) --output-file requirements.lock pyproject.toml
	$(LOCK) --extra report --extra sim --extra dev --constraint requirements.lock --output-file dev.lock pyproject.toml

clean:
	rm -rf $(VENV) build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	rm -f companion/compiled/*.so sim/compiled/*.so

# Redraws display.png, the terminal in README.md and the tables in REFERENCE.md from what runs now.
pictures: setup $(TOOLS)
	$(BIN)/python -m tests.tools.documents
	$(BIN)/python -m tests.tools.pictures
