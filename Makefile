# Everything runs in .venv, which is made at first use. Needed on the machine: Python >= 3.11, make, gcc.
PYTHON  ?= python3
# Upper limit of pytest's parallel workers; 0 runs all in one process.
WORKERS ?= 2

VENV  := .venv
BIN   := $(VENV)/bin
STAMP := $(VENV)/.installed
PIP   := -m pip --disable-pip-version-check

# A worker takes tests that stand together, which share what they build; one that is idle takes some.
PYTEST := $(BIN)/python -m pytest -n auto --maxprocesses=$(WORKERS) --dist worksteal
ifeq ($(WORKERS),0)
PYTEST := $(BIN)/python -m pytest -n 0
endif

export MPLBACKEND ?= Agg
# Workers fill the cores; the threads of linear algebra, of small matrices, would only wait for each other.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# Tests start many interpreters: without bytecode each would compile all it imports again.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install system bench test lint docs quick nightly constraints clean

help: ## list the targets
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /\1\t/' | expand -t 14

install: $(STAMP) ## make .venv, with the package in editable mode and all extras

$(STAMP): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python $(PIP) install --quiet -c constraints.txt -e '.[benchmarks,test,docs]'
	touch $@

# Other compilers and machines for what `export_c` writes. The tests that need them are skipped without.
SYSTEM := clang gcc-aarch64-linux-gnu gcc-arm-linux-gnueabihf libc6-dev-arm64-cross libc6-dev-armhf-cross qemu-user
system: ## install clang, cross compilers and an emulator for the tests (Debian, as root; else it says why not)
	@if dpkg-query -W $(SYSTEM) > /dev/null 2>&1; then echo 'system: everything is there'; \
	elif ! command -v apt-get > /dev/null || [ "$$(id -u)" != 0 ]; then \
		echo 'system: neither Debian nor root, tests of the exported C for other machines are skipped'; \
	else apt-get update -qq > /dev/null && DEBIAN_FRONTEND=noninteractive \
		apt-get install -y -qq --no-install-recommends $(SYSTEM) > /dev/null || \
		echo 'system: apt-get failed, tests of the exported C for other machines are skipped'; \
	fi

bench: $(STAMP) ## run the main job: all methods on the arm, a table and a picture
	$(BIN)/python -m benchmarks bench

test: $(STAMP) ## all checks and tests
	$(MAKE) --no-print-directory -j2 lint docs
	$(PYTEST) --cov --cov-report=term

lint: $(STAMP) ## ruff, pyright, the dependency law
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports

docs: $(STAMP) ## build the documentation, strictly, into build/docs
	$(BIN)/sphinx-build -W --keep-going -E -q -b html -d build/doctrees docs build/docs

nightly: $(STAMP) ## what goes over the whole library, of which `test` takes a third
	$(PYTEST) --nightly -m over_library

quick: $(STAMP) ## the tests that are not slow, without coverage
	$(PYTEST) -m 'not slow'

constraints: ## renew constraints.txt from the newest versions (run `make test` afterwards)
	rm -rf build/fresh
	$(PYTHON) -m venv build/fresh
	build/fresh/bin/python $(PIP) install --quiet -e '.[benchmarks,test,docs]'
	sed -n '/^#/p' constraints.txt > build/constraints.txt
	build/fresh/bin/python $(PIP) list --format=freeze --exclude-editable \
		--exclude pip --exclude setuptools >> build/constraints.txt
	mv build/constraints.txt constraints.txt
	rm -rf build/fresh

clean: ## remove .venv and everything that was built
	rm -rf $(VENV) build dist .coverage .coverage.* .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
