# Both variables can be set on the command line: `make test WORKERS=4`, `make demo PYTHON=python3.12`.
PYTHON ?=
WORKERS ?= 2
ARGS ?=

RUN := .venv/bin/python -m
STAMP := .venv/.installed
PYTEST := $(RUN) pytest $(ARGS)
BENCHMARKS = $(filter-out benchmarks/_%,$(wildcard benchmarks/*.py))

export PYRIGHT_PYTHON_IGNORE_WARNINGS := 1

.DEFAULT_GOAL := help
.PHONY: help install demo demo-cartpole test lint check docs soak bench clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-13s %s\n", $$1, $$2 }' Makefile

install: $(STAMP) ## create .venv and install the project with its tools

# Two Python candidates: a command may exist and still not run, or lack the module that makes environments.
$(STAMP): pyproject.toml constraints.txt
	@echo "Installing hprs and its tools into .venv. This happens once and takes a few minutes."
	@set -e; \
	if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then \
	  for python in $(or $(PYTHON),python3.11 python3); do \
	    if $$python -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then \
	      found=$$python; break; \
	    fi; \
	  done; \
	  if [ -z "$${found:-}" ]; then \
	    echo "This needs Python 3.11 or newer with its venv module. Name one: make PYTHON=/path/to/python3.11" >&2; \
	    exit 2; \
	  fi; \
	  $$found -m venv --clear .venv; \
	fi
	@$(RUN) pip install -qq --disable-pip-version-check --no-input -c constraints.txt -e '.[dev]'
	@touch $@

demo: $(STAMP) ## train, assess and film a car that drives a lap
	@.venv/bin/python examples/demo.py

demo-cartpole: $(STAMP) ## the same for the language's first example, a cart pole
	@.venv/bin/python examples/demo.py hprs/CartPole-v0 --out runs/demo-cartpole

# Each worker computes on one core, so that two of them do not fight for threads.
test: export OMP_NUM_THREADS ?= 1
test: $(STAMP) ## run the tests (COVERAGE=1 adds the branch coverage gate)
	@$(PYTEST) -n $(WORKERS) $(if $(COVERAGE),--cov)

lint: $(STAMP) ## check format, style, spelling, types and layers
	$(RUN) ruff format --check .
	$(RUN) ruff check .
	$(RUN) codespell_lib
	$(RUN) pyright
	.venv/bin/lint-imports --no-logo

check: lint ## everything that must hold: lint, then the tests with the coverage gate
	@$(MAKE) --no-print-directory test COVERAGE=1

docs: $(STAMP) ## build the documentation site into build/docs; a warning is an error
	@$(RUN) sphinx -q -W --keep-going -b html -d build/doctrees docs build/docs
	@echo "build/docs/index.html"

soak: $(STAMP) ## run the long tests, without time limits
	@$(PYTEST) -m '(slow or soak) and not gpu'

bench: $(STAMP) ## run the speed measurements, one script after the other
	@set -e; for script in $(BENCHMARKS); do echo "== $$script"; .venv/bin/python $$script; done

clean: ## remove what builds and tests leave behind; keeps .venv and runs
	@rm -rf build dist htmlcov .coverage .coverage.* .hypothesis .pytest_cache .ruff_cache .import_linter_cache
	@find src tests examples benchmarks -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
