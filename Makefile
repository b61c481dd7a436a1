# Two commands: `make demo` and `make test`. Both set everything up first.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
BARE := $(VENV)/.bare
COMPILED := $(VENV)/.compiled
DEMO_READY := $(VENV)/.demo_ready
READY := $(VENV)/.ready
# Python translates each file when it is first imported; translating all of plotly takes longer.
INSTALL := $(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt

# One thread per process: small matrices only lose by more, and the tests run in parallel.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

# Where Python may not keep its translations, every process of the tests translates scipy and wbc
# anew: an import of the diagnosis takes 2.5 s instead of 1 s.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test versions lint docs pictures clean

# What is compiled needs little of what is installed: one goes on beside the other.
demo:
	$(MAKE) --jobs=2 $(COMPILED) $(DEMO_READY)
	$(BIN)/python -m sims.demo

test:
	$(MAKE) --jobs=2 $(COMPILED) lint
	$(BIN)/python -m pytest -n 2 --dist worksteal

# The tests on other versions of Python, each in an environment of its own; before a release.
VERSIONS ?= 3.12 3.13
versions:
	for version in $(VERSIONS); do \
	  python$$version -m venv .venv-$$version && \
	  .venv-$$version/bin/python -m pip install --quiet --constraint constraints.txt ".[dev]" && \
	  .venv-$$version/bin/python -m pytest -n 2 --dist worksteal || exit 1; \
	done

lint: $(READY)
	$(BIN)/ruff check wbc sims tests benchmarks
	$(BIN)/ruff format --check wbc sims tests benchmarks
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

$(BARE): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) --editable .
	touch $@

$(COMPILED): $(BARE)
	@echo "Compiling controller and simulator beside the rest of the installation, once: about a minute."
	$(BIN)/python -m wbc.compile_all
	touch $@

$(DEMO_READY): $(BARE)
	$(INSTALL) --editable ".[all]"
	touch $@

$(READY): $(BARE)
	$(INSTALL) --editable ".[dev]"
	touch $(DEMO_READY) $@

docs: $(READY)
	$(INSTALL) --editable ".[docs]"
	$(BIN)/sphinx-build -q -W -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

# The pictures of the pages, from the studies and commands that they show, and what notebooks show; needs Chromium.
pictures: $(READY) $(COMPILED)
	$(BIN)/python docs/pictures.py
	$(BIN)/python docs/notebooks.py

clean:
	rm -rf $(VENV) .venv-* out docs/_build
