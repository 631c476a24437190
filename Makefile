# Bunraku from a fresh checkout: `make run` dances, `make test` checks everything. Both build .venv first.

SHELL := /bin/bash
VENV := .venv
BIN := $(VENV)/bin
PICTURE := out/dance.png
ARGS ?= --seconds 30
TEST_ARGS ?=

# What the tests need from the system, as package:command.
DEBIAN_FOR_TESTS := liblo-tools:oscdump iproute2:ip

.DEFAULT_GOAL := help
.PHONY: help run studio test lint bench lock clean debian-for-tests

help: ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-8s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@echo "  make run ARGS='--seconds 10' passes options on; make run ARGS= dances until Ctrl-C"

run: $(VENV)/.ready-to-run ## dance with an emulated sensor and draw a picture of it
	@mkdir -p $(dir $(PICTURE))
	@$(BIN)/bunraku play --emulate --filmstrip $(PICTURE) $(ARGS)

studio: $(VENV)/.ready-to-test ## add what training needs (PyTorch) to the environment

test: $(VENV)/.ready-to-test debian-for-tests lint ## style, types, import contracts and all tests
	@$(BIN)/pytest $(TEST_ARGS)

lint: $(VENV)/.ready-to-test ## style, types and import contracts alone
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy --strict -p appliance -p hw_sim
	@$(BIN)/lint-imports

bench: $(VENV)/.ready-to-test ## the speed of everything that a tick does, as ratios in one run
	@$(BIN)/pytest tests/benchmarks --benchmark-enable --benchmark-only $(TEST_ARGS)

# One environment for both: `make run` installs the box and pictures, `make test` adds torch and the checks.
$(VENV)/bin/python:
	@for python in python3.11 python3.12 python3.13 python3; do \
	    if $$python -c 'import sys, ensurepip, venv; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null; \
	    then echo "Building $(VENV) with $$($$python --version)"; $$python -m venv $(VENV); exit; fi; \
	done; \
	echo "Bunraku needs Python 3.11, 3.12 or 3.13 with venv. On Debian: sudo apt-get install -y python3 python3-venv" >&2; \
	exit 1

$(VENV)/.ready-to-run: requirements.txt pyproject.toml | $(VENV)/bin/python
	@$(call install,requirements.txt)
	@touch $@

$(VENV)/.ready-to-test: requirements-test.txt $(VENV)/.ready-to-run
	@$(call install,requirements-test.txt)
	@touch $@

define install
echo "Installing what $(1) names (the first time takes minutes)" && \
$(BIN)/python -m pip install --quiet --disable-pip-version-check -r $(1) && \
$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
endef

debian-for-tests:
	@missing=; for pair in $(DEBIAN_FOR_TESTS); do \
	    command -v $${pair#*:} >/dev/null || missing="$$missing $${pair%%:*}"; done; \
	if [ -n "$$missing" ]; then \
	    echo "Missing Debian packages:$$missing. Install them with: sudo apt-get install -y$$missing"; \
	    [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && apt-get update -qq && \
	    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $$missing >/dev/null; \
	fi

lock: | $(VENV)/bin/python ## choose the newest versions that pyproject.toml allows and pin them
	@rm -rf build && $(BIN)/python -m venv build/lock
	@$(call pin,pictures,requirements.txt,make run: the box and pictures)
	@$(call pin,pictures$(comma)studio$(comma)test,requirements-test.txt,make test and make bench: everything)
	@rm -rf build

comma := ,
define pin
build/lock/bin/python -m pip install --quiet --disable-pip-version-check --upgrade setuptools '.[$(1)]' && \
{ echo "# $(strip $(3)). Pinned by 'make lock'; change pyproject.toml instead."; \
  build/lock/bin/python -m pip freeze --all --exclude pip --exclude bunraku | sed 's/+cpu$$//'; } > $(2)
endef

clean: ## remove the environment and everything built, keep what was trained
	rm -rf $(VENV) build out benchmarks.json *.egg-info .pytest_cache .mypy_cache .ruff_cache \
	    .import_linter_cache .hypothesis .benchmarks
