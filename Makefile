# Set-up included: every target installs what it needs into .venv, once, and is quick afterwards.
# A machine needs make, Python 3.11 or newer and the package index.

PYTHON ?= $(shell for p in python3.11 python3 python3.12 python3.13; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
PYTEST_FLAGS ?=
# What the README and docs/tutorial.md go on with after the demo.
DEMO_EXTRAS := fast,view,planning
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.DEFAULT_GOAL := help
# One installation after the other.
.NOTPARALLEL:
.PHONY: help demo test lint format docs wheel tables pictures dev clean

help:  ## list the targets
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' Makefile | expand -t 18

demo: $(VENV)/demo.stamp  ## convert the seed scene, let it fall, report contacts, draw a picture
	@$(BIN)/python models/demo.py
	$(warm)

test: $(VENV)/test.stamp  ## run the quick tests; PYTEST_FLAGS="-k alpha" picks some, PYTEST_FLAGS="-m slow" the slow ones
	$(BIN)/python -m pytest -n 2 --dist worksteal $(PYTEST_FLAGS)

lint: $(VENV)/lint.stamp  ## ruff, its formatter, the layers of the package, pyright
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports --no-logo
	$(BIN)/pyright

format: $(VENV)/lint.stamp  ## let ruff format and fix
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

docs: $(VENV)/docs.stamp  ## build the site into docs/_build/html; a warning is an error
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html

wheel: $(VENV)/demo.stamp  ## build the wheel into dist/
	$(PIP) wheel --no-deps --wheel-dir dist .

tables: $(VENV)/demo.stamp  ## make the tables of README.md, benchmarks/ and docs/ anew
	$(BIN)/python benchmarks/table.py
	$(BIN)/python docs/diagnostics.py
	$(BIN)/python docs/figures/connection.py
	$(BIN)/python docs/figures/architecture.py

pictures: $(VENV)/demo.stamp  ## draw the pictures in docs/ anew
	$(BIN)/python models/demo.py --gallery docs/models.png

dev: $(VENV)/dev.stamp  ## install what all of these need, and what slow tests and benchmarks compare with

clean:  ## remove what was built, .venv included
	rm -rf $(VENV) build dist demo docs/_build .pytest_cache .ruff_cache .import_linter_cache .hypothesis

# A stamp is written last, so that an interrupted installation is taken up again.
$(VENV)/demo.stamp: pyproject.toml
	$(call install,$(DEMO_EXTRAS))
	@touch $@

$(VENV)/docs.stamp $(VENV)/lint.stamp: $(VENV)/%.stamp: pyproject.toml
	$(call install,$*)
	@touch $@

$(VENV)/test.stamp: pyproject.toml
	$(call install,test)
	$(warm)
	@touch $(VENV)/demo.stamp $@

$(VENV)/dev.stamp: pyproject.toml
	$(call install,dev)
	$(warm)
	@touch $(patsubst %,$(VENV)/%.stamp,demo docs lint test) $@

define warm
	@$(BIN)/env2mjcf cache warm >&2
endef

define install
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed: none of python3.11, python3 is" >&2; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV)
	@echo "installing env2mjcf[$(1)] into $(VENV), once" >&2
	@$(PIP) install --editable '.[$(1)]'
endef
