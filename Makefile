# Two commands do all the set-up: `make demo` and `make test`.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
OUT ?= out
# nproc says how many threads OpenMP may use, which is not how many tests run at a time
CORES ?= $(shell env -u OMP_NUM_THREADS nproc 2>/dev/null || echo 2)
export PIP_DISABLE_PIP_VERSION_CHECK = 1

.PHONY: demo test check unit clean help
.DELETE_ON_ERROR:

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "MatPhys needs Python 3.11 or newer; name one: make PYTHON=python3.12 …" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)

# A stamp a set of extras: an installation is repeated only when what it came from has changed.
$(VENV)/.run: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/pip install --quiet --constraint constraints.txt --editable .
	@touch $@

$(VENV)/.test: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[test]'
	@touch $@ $(VENV)/.run

demo: $(VENV)/.run  ## set up, film a clip of our own, turn it into a twin
	@mkdir -p $(OUT)
	$(BIN)/python -m model.scenes.demo $(OUT)/demo.mp4
	$(BIN)/matphys twin $(OUT)/demo.mp4 --out $(OUT)/demo.twin.zip --preview $(OUT)/demo.preview.mp4
	$(BIN)/matphys inspect $(OUT)/demo.twin.zip

test: $(VENV)/.test check unit  ## set up, check style, types and import rules, run the tests

check: $(VENV)/.test
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Tests of real servers share the machine with everything else here: one that fails gets a second try alone,
# and both runs are in the output.
unit: $(VENV)/.test
	OMP_NUM_THREADS=1 $(BIN)/pytest -n $(CORES) --dist loadfile --durations 40 || \
	  { echo "failed in a crowd; each once more, alone:" >&2; \
	    OMP_NUM_THREADS=1 $(BIN)/pytest --last-failed --last-failed-no-failures none; }

clean:  ## remove the environment and everything made
	rm -rf $(VENV) $(OUT) build dist ./*.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
