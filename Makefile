# The one door: `make help` lists what there is. Needs make and a Python 3.11 or newer, no compiler.

MODEL ?= fourbar3

# What `make run` draws: the swing of the follower for the four-bars, the energy for all else.
QUANTITY_fourbar3 := follower.r.y
QUANTITY ?= $(or $(QUANTITY_$(notdir $(MODEL))),energy.total)

# More for `dap3d run`, such as FLAGS=--allow-code for a model with types of its own.
FLAGS ?=

# Runs are named after the model, also where MODEL is a path. Recipes quote what may hold a space.
RUN := runs/$(basename $(notdir $(MODEL)))

# Paths are relative, so that the folder of the project may have any name.
override VENV := .venv
PYTHON := $(VENV)/bin/python
PIP := $(PYTHON) -m pip --disable-pip-version-check
INSTALL := $(PIP) install --quiet --only-binary=:all:
PYTHON3 ?= python3 python3.13 python3.12 python3.11 python3.14 python

CHECK_PYTHON := import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))

# Some machines forbid Python to keep its bytecode: each of the many processes of the tests would
# then compile all sources again, a fifth of its time.
unexport PYTHONDONTWRITEBYTECODE

.DELETE_ON_ERROR:
.PHONY: help run install wheel test test-all verify verify-long unit-nojit coverage no-fma lowest newest \
    lint audit format docs bench bench-peers fuzz clean

help:  ## show this list
	@echo "make TARGET, where TARGET is one of"
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  %-12s %s\n", $$1, $$2}' Makefile
	@echo "make run MODEL=NAME takes another model (folders of models/), QUANTITY=NAME draws another curve."

run: $(VENV)/.installed  ## simulate MODEL (fourbar3): result, picture, curve and page in runs/
	@mkdir -p runs
	@$(VENV)/bin/dap3d run "$(MODEL)" -o "$(RUN).nc" --force $(FLAGS)
	@$(VENV)/bin/dap3d animate "$(RUN).nc" -o "$(RUN).png" --at 0 --model "$(MODEL)" --force
	@$(VENV)/bin/dap3d plot "$(RUN).nc" "$(QUANTITY)" -o "$(RUN)-curve.png" --force
	@$(VENV)/bin/dap3d view "$(RUN).nc" -o "$(RUN).html" --model "$(MODEL)" --play --force $(FLAGS)
	@echo "Open $(RUN).html in a browser: the scene moves there, with its curves and its ledger."

install: $(VENV)/.installed  ## put dap3d into .venv, editable (what run, test and lint do themselves)

wheel: $(VENV)/.installed-dev  ## the wheel as it is published, with ready-made objects, into dist
	@DAP3D_READY_OBJECTS=all $(PYTHON) -m build --wheel

test: $(VENV)/.installed-test  ## the quick tests
	@$(PYTHON) -m pytest -n auto -m "not slow"

test-all: $(VENV)/.installed-docs  ## all tests, the slow verification as well
	@$(PYTHON) -m pytest -n auto

# A file stays with one worker: its tests share a built site, a browser, reference solutions.
verify: $(VENV)/.installed-docs  ## the slow verification alone
	@$(PYTHON) -m pytest -n auto --dist loadfile --no-loadscope-reorder -m "slow and not long"

verify-long: $(VENV)/.installed-docs  ## verification that takes longest, for a release
	@$(PYTHON) -m pytest -n auto --dist loadfile -m long

# Packages that run kernels; what the others do is the same with and without a compiler.
PLAIN := $(addprefix tests/unit/,assembly formulations integrators interface kernels linear model \
    simulation study testing)
unit-nojit: $(VENV)/.installed-test  ## quick unit tests with kernels as plain Python
	@DAP3D_PLAIN=1 $(PYTHON) -m pytest -n auto -m "not slow" $(PLAIN)

coverage: $(VENV)/.installed-test  ## the same, and what part of the sources they run
	@DAP3D_PLAIN=1 $(PYTHON) -m pytest -n auto -m "not slow" --cov --cov-report=term tests/unit

# Neither compiled code nor the C library may fuse products and sums: an older processor in effect.
NO_FMA := DAP3D_CPU=x86-64-v2 GLIBC_TUNABLES=glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2
no-fma: $(VENV)/.installed-test  ## tests of compiled bits as on a processor without FMA (x86-64)
	@if [ "$$(uname -m)" != x86_64 ]; then echo "no-fma: only on x86-64"; exit 0; fi; \
	$(NO_FMA) $(PYTHON) -m pytest -n auto -m "not slow" \
	    tests/unit/kernels/compiler/test_core.py tests/unit/kernels/compiler/test_complex.py

# What meets the dependencies: commands, files, pictures, the compiler, clusters, formats.
SMOKE := tests/e2e/test_run.py tests/e2e/test_commands.py tests/unit/result/file tests/unit/plot \
    tests/unit/kernels/compiler tests/matlab tests/unit/formats tests/unit/study/sweep
# Old packages use what newer ones have deprecated since.
SMOKE_TEST = -m pytest -n auto -m "not slow" -W ignore::DeprecationWarning $(SMOKE)
LOWEST_VENV := build/lowest-venv
lowest: $(LOWEST_VENV)/.installed  ## part of the tests with the lowest versions that pyproject.toml allows
	@$(LOWEST_VENV)/bin/python $(SMOKE_TEST)

NEWEST_VENV := build/newest-venv
newest: $(NEWEST_VENV)/.installed  ## the same part with the newest Python that is installed here
	@if [ -x $(NEWEST_VENV)/bin/python ]; then $(NEWEST_VENV)/bin/python $(SMOKE_TEST); \
	else cat $<; fi

# All checks run, also after one has failed; the last line says which.
lint: $(VENV)/.installed-dev  ## format, lint, types, layers, circles, sizes, words
	@failed=""; \
	check() { name="$$1"; shift; echo "-- $$name"; "$$@" || failed="$$failed $$name"; }; \
	check format $(PYTHON) -m ruff format --check .; \
	check ruff $(PYTHON) -m ruff check .; \
	check mypy $(PYTHON) -m mypy; \
	check layers $(VENV)/bin/lint-imports; \
	check circles $(PYTHON) tools/check_circles.py; \
	check sizes $(PYTHON) tools/check_sizes.py; \
	check words $(PYTHON) tools/check_words.py; \
	if [ -n "$$failed" ]; then echo "lint failed:$$failed" >&2; exit 1; fi; \
	echo "lint: all clean"

# pip-audit is no part of the other installs: where it cannot be had in this time, it is left out.
# It is named here and not in an extra: an install of dap3d that runs out of time takes dap3d away.
AUDIT_WAIT ?= 60
audit: $(VENV)/.installed-test  ## licences and known holes of what dap3d depends on
	@$(PYTHON) -c "import pip_audit" 2>/dev/null || timeout $(AUDIT_WAIT) $(INSTALL) "pip-audit>=2.7" 2>/dev/null || true
	@$(PYTHON) tools/audit.py

format: $(VENV)/.installed-dev  ## let ruff format and repair what it can
	@$(PYTHON) -m ruff format .
	@$(PYTHON) -m ruff check --fix .

# Built anew each time: pages, pictures and references all follow the sources.
docs: $(VENV)/.installed-docs  ## build the documentation into build/docs; warnings are errors
	@rm -rf build/docs build/docs-source && mkdir -p build/docs-source
	@MPLBACKEND=Agg $(PYTHON) -m sphinx -W --keep-going -q -c docs build/docs-source build/docs
	@echo "build/docs/index.html written"

bench: $(VENV)/.installed  ## measure speed against error (benchmarks/run.py)
	@$(PYTHON) benchmarks/run.py

# Minutes that `make fuzz` takes in all.
MINUTES ?= 10
fuzz: $(VENV)/.installed-fuzz  ## random and damaged inputs for MINUTES; what fails goes to build/fuzz
	@$(PYTHON) tests/fuzz/run.py --minutes $(MINUTES)

# Rivals live in an environment of their own: what they need does not touch what is tested.
PEERS_VENV := build/peers-venv
PEERS_PYTHON := $(PEERS_VENV)/bin/python
# More for benchmarks/peers/run.py, such as FLAGS=--quick.
bench-peers: $(PEERS_VENV)/.installed  ## measure beside Exudyn, MuJoCo, Drake, Pinocchio
	@$(PEERS_PYTHON) benchmarks/peers/run.py $(FLAGS)

# One that cannot be installed here is skipped; the benchmark says so again.
$(PEERS_VENV)/.installed: pyproject.toml $(PYTHON)
	@echo "Installing dap3d and its rivals into $(PEERS_VENV) ..."
	@$(PYTHON) -m venv --clear $(PEERS_VENV)
	@$(PEERS_PYTHON) -m pip --disable-pip-version-check install --quiet \
	    --only-binary=:all: -e ".[peers]" || { \
	    $(PEERS_PYTHON) -m pip --disable-pip-version-check install --quiet \
	        --only-binary=:all: -e . && \
	    for peer in $$(sed -n 's/^peers = \[\(.*\)\]/\1/p' pyproject.toml | tr -d '",'); do \
	        $(PEERS_PYTHON) -m pip --disable-pip-version-check install --quiet \
	            --only-binary=:all: "$$peer" || echo "$$peer cannot be installed: skipped"; \
	    done; }
	@touch $@

# Environments of their own: what they need does not touch what is tested.
# Of the packages, what is imported is compiled then: a tenth.
SMOKE_INSTALL := install --quiet --only-binary=:all: --no-compile --disable-pip-version-check
$(LOWEST_VENV)/.installed: pyproject.toml tools/lowest.py $(PYTHON)
	@echo "Installing dap3d with the lowest versions of its dependencies into $(LOWEST_VENV) ..."
	@rm -rf $(LOWEST_VENV)
	@$(PYTHON) -m venv $(LOWEST_VENV)
	@$(PYTHON) tools/lowest.py > $(LOWEST_VENV)/lowest.txt
	@$(LOWEST_VENV)/bin/python -m pip $(SMOKE_INSTALL) -c $(LOWEST_VENV)/lowest.txt -e ".[smoke,xacro]"
	@$(LOWEST_VENV)/bin/python -m pip $(SMOKE_INSTALL) --no-deps -e plugins/dap3d-example
	@touch $@

$(NEWEST_VENV)/.installed: pyproject.toml tools/newest_python.py $(PYTHON)
	@rm -rf $(NEWEST_VENV) && mkdir -p $(NEWEST_VENV)
	@python=$$($(PYTHON) tools/newest_python.py) || { \
	    echo "newest: skipped, no Python here is newer than that of .venv" > $@; exit 0; }; \
	echo "Installing dap3d for $$python into $(NEWEST_VENV) ..."; \
	"$$python" -m venv $(NEWEST_VENV) && \
	$(NEWEST_VENV)/bin/python -m pip $(SMOKE_INSTALL) -e ".[smoke]" && \
	$(NEWEST_VENV)/bin/python -m pip $(SMOKE_INSTALL) --no-deps -e plugins/dap3d-example && \
	touch $@

clean:  ## remove caches, builds and coverage (.venv and runs stay)
	@rm -rf build dist htmlcov .coverage .coverage.*
	@rm -rf .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	@find src plugins tests models benchmarks tools -name __pycache__ -type d -prune \
	    -exec rm -rf {} + 2>/dev/null || true

# Each stamp is redone when pyproject.toml changes. They hang on one another, so that `make -j`
# never runs two installs at once.
$(VENV)/.installed: pyproject.toml $(PYTHON)
	@echo "Installing dap3d into .venv; the first time takes a minute ..."
	@$(PYTHON) -m pip --version >/dev/null 2>&1 || $(PYTHON) -m ensurepip >/dev/null
	@$(INSTALL) -e .
	@touch $@

$(VENV)/.installed-test: $(VENV)/.installed plugins/dap3d-example/pyproject.toml
	@echo "Installing what the tests need ..."
	@$(INSTALL) -e ".[test]"
	@$(INSTALL) --no-deps -e plugins/dap3d-example
	@touch $@

$(VENV)/.installed-fuzz: $(VENV)/.installed-test
	@$(INSTALL) -e ".[fuzz]" || echo "atheris cannot be installed: fuzzing goes on without it"
	@touch $@

$(VENV)/.installed-docs: $(VENV)/.installed-test
	@echo "Installing what the documentation is built with ..."
	@$(INSTALL) -e ".[docs]"
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed-docs
	@echo "Installing what the checks need ..."
	@$(INSTALL) -e ".[dev]"
	@touch $@

$(PYTHON):
	@for python in $(PYTHON3); do \
	    if "$$python" -c '$(CHECK_PYTHON)' >/dev/null 2>&1; then \
	        "$$python" -m venv --clear $(VENV) && exit 0; \
	    fi; \
	done; \
	echo "dap3d needs Python 3.11 or newer with its venv module; none of these is one: $(PYTHON3)." \
	    "Install one, or name it: make run PYTHON3=/path/to/python3" >&2; exit 1
