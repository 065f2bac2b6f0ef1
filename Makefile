PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-all style kernels test-lowest test-newest coverage knowing motion paths docs surface \
    release-check sbom audit bench report accuracy adversary faults soak fuzz clean

demo: $(VENV)/demo.stamp
	$(BIN)/python -m sat_collision.demo

# Each of the many processes that tests start would compile the whole package again.
unexport PYTHONDONTWRITEBYTECODE

# More at a time than there are cores, because tests of nodes mostly wait; long ones compute.
test: TESTS = -n 4 -m 'not long and not linter'
test-all: TESTS = -n 3 -m 'not linter'
test-all: $(VENV)/messages.stamp
test test-all: $(VENV)/test.stamp
	$(MAKE) --jobs=2 --output-sync style kernels
	$(BIN)/python -m pytest --dist worksteal $(TESTS)

# All tests are read here, and their byte code is kept for those that run several at a time.
style:
	$(BIN)/python -m mypy
	$(BIN)/python -m pytest -m linter

kernels:
	$(BIN)/python -m sat_collision.replay.kernels

# Lines and branches that tests run, without the longest tests: kernels as plain Python, the node
# as it is.
COVER := $(BIN)/coverage run -m pytest -m 'not long'
coverage: $(VENV)/test.stamp
	$(BIN)/coverage erase
	NUMBA_DISABLE_JIT=1 $(COVER) test/geometry test/scene test/messages test/replay test/test_*.py
	$(COVER) test/node test/geometry/test_jit.py test/geometry/test_kernel_cache.py
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report --show-missing

# All that needs no ROS, with the lowest and with the newest versions, in environments of their own;
# these need the network, and the Python that they name: make test-newest NEWEST=python3.14
ALONE := hypothesis pytest pytest-timeout 'shapely>=2' '.[replay]'
TEST_ALONE := -m pytest -m 'not long' test/test_library.py test/geometry test/replay
test-lowest:
	python3.10 -m venv $(VENV)/lowest
	$(VENV)/lowest/bin/pip install --quiet 'numpy==1.26.*' 'numba==0.59.*' $(ALONE)
	$(VENV)/lowest/bin/python $(TEST_ALONE)

NEWEST ?= python3.13
test-newest:
	$(NEWEST) -m venv --clear $(VENV)/newest
	$(VENV)/newest/bin/pip install --quiet --upgrade numpy numba $(ALONE)
	$(VENV)/newest/bin/python $(TEST_ALONE)

# What README, config and docs take from the code and from the benchmarks, and the plan's picture.
docs: $(VENV)/demo.stamp
	$(BIN)/python docs/generate.py
	$(BIN)/python docs/path_picture.py

# The list of what docs/stability.md promises, after a change of it that is meant.
surface: $(VENV)/test.stamp
	$(BIN)/python test/support/surface.py

# What a release still lacks.
release-check:
	$(PYTHON) .ci/release_check.py

# What is installed with the extras for users, as CycloneDX, written to sbom.json; and which of it
# has known flaws, by the advisories of the index. Both need the network.
RUNTIME := $(VENV)/runtime
sbom: $(RUNTIME)/stamp $(VENV)/audit.stamp
	$(BIN)/cyclonedx-py environment --output-reproducible --output-file sbom.json \
	    $(RUNTIME)/bin/python

AUDITED := $(VENV)/audited.txt
audit: $(RUNTIME)/stamp $(VENV)/audit.stamp
	$(BIN)/pip-audit --path $(RUNTIME)/lib/python3*/site-packages >$(AUDITED) || \
	    { cat $(AUDITED); exit 1; }
	cat $(AUDITED)
	if grep -q '^numpy .* could not be audited' $(AUDITED); then \
	    echo 'nothing was audited: the index has no advisories' >&2; exit 1; fi

# What everything costs, measured and written to docs/benchmarks.
bench: $(VENV)/bench.stamp
	$(BIN)/python -m sat_collision.replay.kernels
	$(BIN)/python benchmarks/bench.py
	$(BIN)/python docs/generate.py

# Speed against error, measured anew; replaces the tables and plots of docs/report.
report: $(VENV)/bench.stamp
	$(BIN)/python benchmarks/report

# The long run against the exact oracle, and its figures in the report: make accuracy PAIRS=1000000
PAIRS ?= 20000000
accuracy: $(VENV)/bench.stamp
	$(BIN)/python benchmarks/report --accuracy $(PAIRS)

# The search for inputs that break the proofs of docs/exactness.md: make adversary EVALUATIONS=1e6
EVALUATIONS ?= 1e7
adversary: $(VENV)/test.stamp
	PYTHONPATH=.:test/support $(BIN)/python test/geometry/test_adversary.py --evaluations $(EVALUATIONS)

# Random paths beside shapely at 10,000 places of each segment: make paths PATHS=1e3
PATHS ?= 1e5
paths: $(VENV)/test.stamp
	PYTHONPATH=.:test/support $(BIN)/python test/geometry/test_path.py --paths $(PATHS)

# Random recordings beside the exact oracle of recorded motion: make motion RECORDINGS=1e4
RECORDINGS ?= 1e6
motion: $(VENV)/test.stamp
	PYTHONPATH=.:test/support $(BIN)/python test/replay/motion/test_replay_theory.py --recordings $(RECORDINGS)

# What can happen around one source, every order of DEPTH events and random RUNS in each form:
# make knowing DEPTH=1 RUNS=1e3
DEPTH ?= 2
RUNS ?= 13e3
knowing: $(VENV)/test.stamp
	PYTHONPATH=test/support $(BIN)/python test/scene/knowing.py --depth $(DEPTH) --runs $(RUNS)

# What faults do to real processes, measured and written to docs/reliability.md:
# make faults REPEAT=3 LENGTH=1
REPEAT ?= 10
LENGTH ?= 5
faults: $(VENV)/test.stamp
	PYTHONPATH=.:test/support:docs $(BIN)/python test/faults/test_faults.py --repeat $(REPEAT) \
	    --length $(LENGTH) --write docs/reliability.md

# The node under load for a long time, written to docs/reliability.md: make soak MINUTES=2
MINUTES ?= 30
soak: $(VENV)/bench.stamp
	$(BIN)/python benchmarks/soak.py --minutes $(MINUTES)

# Random bytes, polygons and parameters, and damaged files, recordings and stored results among
# them: make fuzz INPUTS=1e5 FILES=1e4
INPUTS ?= 1e7
FILES ?= 1e5
FUZZ := PYTHONPATH=.:test/support $(BIN)/python test/fuzz/test_fuzz.py
fuzz: $(VENV)/test.stamp
	$(FUZZ) --inputs $(INPUTS) --files $(FILES)
	if $(BIN)/pip install --quiet atheris; then NUMBA_DISABLE_JIT=1 $(FUZZ) --guided $(FILES); fi

$(BIN)/pip:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip 'setuptools<80' wheel

$(VENV)/demo.stamp: setup.py | $(BIN)/pip
	$(BIN)/pip install --quiet --editable '.[ros,fast,plot]'
	touch $@

$(VENV)/test.stamp: setup.py | $(BIN)/pip
	$(BIN)/pip install --quiet --editable '.[ros,fast,plot,replay,test]'
	touch $@

# The messages of polygon_msgs, which PyPI does not have; this needs g++ and Python's headers.
$(VENV)/messages.stamp: $(wildcard test/polygon_msgs_source/* test/polygon_msgs_source/msg/*) | $(BIN)/pip
	bash test/polygon_msgs_source/build.sh $(BIN)/python
	touch $@

$(VENV)/bench.stamp: setup.py | $(BIN)/pip
	$(BIN)/pip install --quiet --editable '.[ros,fast,bench]'
	touch $@

$(RUNTIME)/stamp: setup.py | $(BIN)/pip
	$(BIN)/python -m venv $(RUNTIME)
	$(RUNTIME)/bin/pip install --quiet --upgrade pip setuptools '.[ros,fast,plot,replay]'
	touch $@

$(VENV)/audit.stamp: setup.py | $(BIN)/pip
	$(BIN)/pip install --quiet --editable '.[audit]'
	touch $@

clean:
	rm -rf $(VENV) build install log
