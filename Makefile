# make demo   set everything up, build the example scenes as FMUs, run them, write out/
# make test   set everything up, with the tools below, run all tests
# make instructions  compare instruction counts of the kernels with bench/instructions.csv; needs valgrind
# make browser  open the page of tiefmu report in headless Chromium; part of make test where one is installed
# make lint   clang-format, ruff and mypy find nothing (part of make test)
# make format  what of that a program can mend
# make tools  install other people's tools that the tests run FMUs in
# make study  measure speed, accuracy and stability, write charts and tables to docs/study/
# make sanitize  the FMU's functions under sanitizers, 62,500 random sequences of calls by both standards (CI: SEQUENCES=2000)
# make projections  1,000,000 random quads against a search in extended precision (make test: 20,000)
# make fuzz   60 s of fuzzing of resources, serialised states and scene files
# make binaries  build the FMU's library for Linux (glibc 2.17 or later) and Windows, for every FMU built afterwards;
#             make binaries PLATFORMS="aarch64-linux ..." builds others. About ten minutes each.
# make test-linux, test-debian11, test-windows, test-arm, test-macos  what `make binaries` built: run here, with the
#             C library of Debian 11, under wine, under qemu-user; of macOS only what the file says of itself
# make wheels  wheels for Linux (x86-64, Arm) and Windows, each with the FMU's library for every system, to dist/; for
#             Python 3.10, 3.11, and 3.12 and later, as far as PYTHONS="python3.10 ..." are there
# make test-wheels  install those for this machine in fresh environments and run the demo
# make bench  time the kernels, the FMU calls and what grows with a scene, write bench/latest.csv and docs/bench.svg
# Bench counts instructions too.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
REQUIRES = $(shell sed -n 's/^requires = \[\(.*\)\]/\1/p' pyproject.toml | sed 's/", /" /g')
SOURCES := CMakeLists.txt $(wildcard src/*.?pp modelDescription/*.?pp fmu/*.?pp python/bindings/*.?pp)

# Each set in an environment of its own; not compiled ahead, as most of their files are never imported.
TOOLS := build/tools/importers/installed build/tools/cofmupy/installed

.PHONY: demo test binaries wheels test-linux test-debian11 test-windows test-arm test-macos test-wheels instructions lint format tools study sanitize projections fuzz bench valgrind browser chromium clean
demo: $(VENV)/installed
	$(BIN)/tiefmu demo --out out
	$(BIN)/tiefmu accept examples/acceptance/weld.toml examples/acceptance/criteria.toml --pictures out/acceptance
	$(BIN)/tiefmu report scenes/bracket.toml -o out/bracket.html
	$(BIN)/tiefmu info scenes/bracket.toml --vtu out/bracket.vtu > out/bracket.txt
	$(BIN)/tiefmu sweep examples/sweep/sweep.toml -o out/sweep.csv
	$(BIN)/tiefmu advise scenes/heavy_slave.toml --host-step 1e-6 --host-stiffness 1e6

# A second thread of NumPy's BLAS beside two workers only waits.
test: $(VENV)/tested-with tools
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2
	@if command -v chromium >/dev/null; then $(BIN)/python -m pytest -m browser; \
	  else echo "chromium is not installed: make browser opens the report in it"; fi

browser: $(VENV)/tested-with chromium
	$(BIN)/python -m pytest -m browser

instructions: $(VENV)/tested-with valgrind
	$(BIN)/python -m pytest -m instructions

lint: $(VENV)/tested-with
	$(BIN)/python -m pytest tests/test_house.py

format: $(VENV)/tested-with
	$(BIN)/clang-format -i $(shell find bench fmu modelDescription python src tests -name '*.?pp')
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

study: $(VENV)/installed
	$(BIN)/tiefmu study speed-accuracy scenes/*.toml --out docs/study
	$(BIN)/tiefmu study coupling scenes/heavy_slave.toml scenes/spotweld.toml --out docs/study
	$(BIN)/tiefmu study stability --out docs/study
	cp docs/study/speed-accuracy-bracket.svg docs/speed-accuracy.svg

SEQUENCES ?= 100000
sanitize: $(VENV)/tested-with
	TIEFMU_SEQUENCES=$(SEQUENCES) $(BIN)/python -m pytest -s -m sanitizers

QUADS ?= 1000000
projections: $(VENV)/tested-with
	TIEFMU_QUADS=$(QUADS) $(BIN)/python -m pytest -s tests/test_projection.py

# Clang brings libFuzzer.
CLANG ?= $(or $(shell command -v clang++ || command -v clang++-14),clang++)
FUZZ_SECONDS ?= 20
fuzz: $(VENV)/tested-with
	PATH=$(abspath $(BIN)):$$PATH cmake --preset fuzz -DCMAKE_CXX_COMPILER=$(CLANG) -DPython_EXECUTABLE=$(abspath $(BIN)/python)
	PATH=$(abspath $(BIN)):$$PATH cmake --build --preset fuzz
	for input in resource state; do \
	  mkdir -p build/fuzz/$$input && TIEFMU_FUZZ_SCENE=tests/fuzz/scene.bin build/fuzz/fuzz_$$input -timeout=20 \
	    -max_len=8192 -max_total_time=$(FUZZ_SECONDS) -artifact_prefix=build/fuzz/found_ build/fuzz/$$input \
	    tests/fuzz/corpus/$$input || exit 1; \
	done
	$(BIN)/python tests/fuzz/scenes.py --seconds $(FUZZ_SECONDS) --first $$(date +%s)

bench: $(VENV)/tested-with valgrind
	$(BIN)/python bench/run.py

$(VENV)/built-with: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet $(REQUIRES)
	touch $@

$(VENV)/installed: $(VENV)/built-with $(SOURCES)
	$(BIN)/python -m pip install --quiet --no-build-isolation --editable '.[accept,report,sweep]'
	touch $@

# What tests and contributors need besides.
$(VENV)/tested-with: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group test --group dev
	touch $@

PLATFORMS ?= linux64 win64
binaries: $(VENV)/installed build/zig/installed
	PATH=$(abspath $(BIN)):$$PATH $(BIN)/python cmake/build_binaries.py build/zig/wheel/ziglang $(PLATFORMS)

build/zig/installed: cmake/requirements.txt
	$(BIN)/python -m pip install --quiet --no-compile --no-deps --upgrade --target build/zig/wheel -r $<
	touch $@

# What `make binaries` built, where it is meant to run. Debian: wine; qemu-user and libc6-arm64-cross; debootstrap.
ELSEWHERE = $(BIN)/python -m pytest -m elsewhere tests/test_elsewhere.py -k
test-linux: binaries $(VENV)/elsewhere
	$(ELSEWHERE) linux64

test-debian11: binaries $(VENV)/elsewhere build/debian11
	$(ELSEWHERE) debian11

test-windows: binaries $(VENV)/elsewhere
	$(ELSEWHERE) 'win64 and not darwin64'

test-arm: PLATFORMS := aarch64-linux
test-arm: binaries $(VENV)/elsewhere
	$(ELSEWHERE) aarch64-linux

test-macos: PLATFORMS := darwin64
test-macos: binaries $(VENV)/elsewhere
	$(ELSEWHERE) darwin

build/debian11:
	rm -rf $@.part
	debootstrap --variant=minbase bullseye $@.part
	mv $@.part $@

PYTHONS ?= python3.10 python3.11 python3.12
wheels: PLATFORMS := linux64 win64 aarch64-linux darwin64
wheels: binaries $(VENV)/elsewhere
	PATH=$(abspath $(BIN)):$$PATH $(BIN)/python cmake/build_wheels.py build/zig/wheel/ziglang $(PYTHONS)

test-wheels: wheels
	$(BIN)/python -m pytest -m elsewhere tests/test_wheels.py

# scikit-build-core runs in each of PYTHONS, from .venv; Python 3.10 lacks what it takes from the standard library later.
$(VENV)/elsewhere: $(VENV)/tested-with
	$(BIN)/python -m pip install --quiet --group elsewhere
	$(BIN)/python -m pip install --quiet --no-deps --upgrade --target build/wheels/backports --python-version 3.10 \
	  --platform any --only-binary :all: tomli exceptiongroup typing_extensions
	touch $@

tools: $(TOOLS)

valgrind:
	@command -v valgrind >/dev/null || (apt-get update && apt-get install --yes valgrind) >/dev/null 2>&1 || \
	  { echo "valgrind is missing and could not be installed: apt-get install valgrind"; exit 1; }

chromium:
	@command -v chromium >/dev/null || (apt-get update && apt-get install --yes chromium) >/dev/null 2>&1 || \
	  { echo "chromium is missing and could not be installed: apt-get install chromium"; exit 1; }

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
