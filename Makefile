# `make view` shows a recording in the browser, `make test` runs the tests; the rest is for those who change things.
VENV ?= .venv
PYTHON ?= python3
BIN := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
FILE ?=
OUT ?= pictures
# Processes that share the tests, by files; they wait for pages more than they compute. 0: one after the other, in this one.
JOBS ?= 3
SHARED = --numprocesses $(JOBS) --dist loadfile --no-loadscope-reorder
# Benchmarks that want pictures or recordings of yours, and what others import.
NEED_FILES := benchmarks/measure.py benchmarks/simulate.py benchmarks/simulate_real.py

.PHONY: view test test-slow test-tools lint pictures evaluate benchmark clean

view: $(VENV)/.view
	@$(BIN)/etnet-view $(if $(FILE),"$(FILE:~/%=$$HOME/%)")

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed; run: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { echo "Python's venv module is missing; run: apt-get install python3-venv"; exit 1; }

$(VENV)/.view: pyproject.toml constraints.txt | $(VENV)/bin/python
	@echo "installing into $(VENV) (a few minutes the first time)"
	@$(INSTALL) --editable .
	@touch $@

$(VENV)/.test: pyproject.toml constraints.txt | $(VENV)/bin/python
	@echo "installing into $(VENV) (a few minutes the first time)"
	@$(INSTALL) --editable '.[test]'
	@touch $(VENV)/.view $@

test-tools: $(VENV)/.test
	@tests/install_browser.sh

test: test-tools
	@$(BIN)/python -m pytest -m "not slow" $(SHARED)

test-slow: test-tools
	@$(BIN)/python -m pytest -m slow

lint: $(VENV)/.test
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/basedpyright --pythonpath $(BIN)/python

pictures: test-tools
	@$(BIN)/python -m tests.browser.pictures $(OUT)

evaluate: $(VENV)/.view
	@folder=$$($(BIN)/etnet sample slider_depth) && $(BIN)/etnet evaluate etnet-half "$$folder" static/samples/*.h5

benchmark: test-tools
	@for script in $(filter-out $(NEED_FILES),$(wildcard benchmarks/*.py)); do \
		echo "== $$script"; $(BIN)/python $$script || echo "== $$script: failed, or an aim was missed"; done

clean:
	@rm -rf $(VENV) build dist .pytest_cache .ruff_cache .hypothesis pictures
