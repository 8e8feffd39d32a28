# make demo   set everything up, build the example scenes as FMUs, run them, write out/
# make test   set everything up, run all tests
# make bench  time the kernels and the FMU calls, write bench/latest.csv
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
REQUIRES = $(shell sed -n 's/^requires = \[\(.*\)\]/\1/p' pyproject.toml | sed 's/", /" /g')
SOURCES := CMakeLists.txt $(wildcard src/*.?pp modelDescription/*.?pp fmu/*.?pp python/bindings/*.?pp)

# Other people's tools that the tests run FMUs in, each set in an environment of its own. Not compiled ahead: most of
# their files are never imported.
TOOLS := build/tools/importers/installed build/tools/cofmupy/installed

.PHONY: demo test tools bench clean
demo: $(VENV)/installed
	$(BIN)/tiefmu demo --out out

test: $(VENV)/installed tools
	$(BIN)/python -m pytest -n 2

bench: $(VENV)/installed
	$(BIN)/python bench/run.py

$(VENV)/built-with: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet $(REQUIRES)
	touch $@

$(VENV)/installed: $(VENV)/built-with $(SOURCES)
	$(BIN)/python -m pip install --quiet --no-build-isolation --editable '.[test]'
	touch $@

tools: $(TOOLS)

build/tools/importers/installed: tests/tools/requirements.txt
	$(PYTHON) -m venv --clear $(@D)
	$(@D)/bin/python -m pip install --quiet --no-compile -r $<
	touch $@

build/tools/cofmupy/installed: tests/tools/requirements-cofmupy.txt
	$(PYTHON) -m venv --clear $(@D)
	$(@D)/bin/python -m pip install --quiet --no-compile --no-deps -r $<
	touch $@

clean:
	rm -rf $(VENV) build out
