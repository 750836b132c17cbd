# SPDX-License-Identifier: GPL-3.0-or-later
# `make demo` shows the paper's experiment, `make test` runs the tests; `make help` names the rest.

VENV ?= .venv
# An interpreter of your choice (3.13 or 3.11); empty: the newest suitable one is looked for.
PYTHON ?=
OUT ?= out/paper
# Extra words for pytest, for example PYTEST_ARGS="-k gate".
PYTEST_ARGS ?=
# Processes that `make test` uses. Tests of one file share their fixtures, so they stay together;
# files marked as slow come first. Where a process crashes, the run ends: xdist would start another and
# then wait for ever.
JOBS ?= 2

PY := $(VENV)/bin/python
STAMP := $(VENV)/.radarsim-installed
PIP_FLAGS := -q -q --disable-pip-version-check --retries 5

# A virtual environment of another shell, or a PYTHONPATH, must not leak in.
unexport PYTHONPATH PYTHONHOME VIRTUAL_ENV
export PYTHONNOUSERSITE := 1

# A virtual environment whose interpreter has gone is made anew.
ifeq ($(wildcard $(PY)),)
$(shell rm -f $(STAMP))
endif

.PHONY: help install demo test validate lint bench slips fuzz chaos gui-chroot gui-test extension docs \
	test-all-blenders validate-all-blenders clean

help:
	@echo "make demo               the paper's experiment: scene, render, maps in $(OUT)/"
	@echo "make test               all tests but the GUI's"
	@echo "make validate           powers, ranges and losses against closed forms: docs/validation.md"
	@echo "make gui-test           tests in a real Blender window (root, debootstrap, 1.3 GB)"
	@echo "make test-all-blenders  make test's tests under Blender 4.5, 5.0 and, with Python 3.13, 5.2"
	@echo "make validate-all-blenders  make validate under all three, and what the others found"
	@echo "make lint               ruff and mypy"
	@echo "make bench              cost and errors next to their bounds and the version before"
	@echo "make slips              plausible mistakes in a copy: which of them no test sees"
	@echo "make fuzz               2000 changed inputs: each ends in a result or a named error"
	@echo "make chaos              60 frames by 2 workers while 40 of them and 5 coordinators are killed"
	@echo "make docs               the documentation site: out/site/index.html"
	@echo "make extension          dist/radarsim-VERSION-PLATFORM.zip, to install in Blender"
	@echo "make clean              remove what make made; the chroot of gui-test stays in .cache/"
	@echo "Variables: PYTHON=$(PYTHON) (interpreter), VENV=$(VENV), OUT=$(OUT), PYTEST_ARGS=$(PYTEST_ARGS), JOBS=$(JOBS)"

install: $(STAMP)

$(STAMP): pyproject.toml scripts/find_python.sh scripts/install.sh scripts/check_system.py
	@scripts/install.sh "$(VENV)" "$(PYTHON)" "$(PIP_FLAGS)"
	@touch $@

demo: $(STAMP)
	@$(PY) scripts/demo.py --out "$(OUT)"

test: $(STAMP)
	$(PY) -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --max-worker-restart=0 $(PYTEST_ARGS)

validate: $(STAMP)
	@$(PY) scripts/validate.py

lint: $(STAMP)
	@failed=0; for tool in "ruff check" "ruff format --check --quiet" mypy; do \
		echo "$$tool"; $(PY) -m $$tool || failed=1; done; exit $$failed

bench: $(STAMP)
	$(PY) scripts/bench.py

slips: $(STAMP)
	$(PY) scripts/slips.py

fuzz: $(STAMP)
	@$(PY) -m tests.fuzz $(FUZZ_ARGS)

chaos: $(STAMP)
	RADARSIM_KILLS=60,40,5 $(PY) -m pytest -s -k killed tests/blender/headless/test_workers.py

docs: $(STAMP)
	@NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build
	@echo "docs: out/site/index.html"

extension: $(STAMP)
	@$(PY) scripts/build_extension.py

gui-chroot:
	@scripts/gui_chroot.sh

gui-test: $(STAMP)
	$(PY) -m pytest tests/gui $(PYTEST_ARGS)

test-all-blenders:
	@scripts/test_all_blenders.sh $(PYTEST_ARGS)

validate-all-blenders:
	@DO=validate scripts/test_all_blenders.sh

clean:
	rm -rf .venv .venv-blender-* out dist build *.egg-info .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -not -path './.cache/*' -prune -exec rm -rf {} +
