PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test bench report accuracy clean

demo: $(VENV)/demo.stamp
	$(BIN)/python -m sat_collision.demo

# numba's cache misses changes in a kernel's callees, so the tests compile afresh.
test: $(VENV)/test.stamp
	rm -rf sat_collision/__pycache__
	$(BIN)/python -m pytest

# What everything costs, measured and written to docs/benchmarks in less than eight minutes.
bench: $(VENV)/bench.stamp
	$(BIN)/python benchmarks/bench.py

# Speed against error, measured and written to docs/report.
report: $(VENV)/bench.stamp
	$(BIN)/python benchmarks/report

# The long run against the exact oracle, and its figures in the report: make accuracy PAIRS=1000000
PAIRS ?= 20000000
accuracy: $(VENV)/bench.stamp
	$(BIN)/python benchmarks/accuracy.py --pairs $(PAIRS) --json docs/report/accuracy.json
	$(BIN)/python benchmarks/report --written

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip 'setuptools<80' wheel

$(VENV)/demo.stamp: setup.py | $(BIN)/python
	$(BIN)/pip install --quiet --editable '.[ros,fast,plot]'
	touch $@

$(VENV)/test.stamp: setup.py | $(BIN)/python
	$(BIN)/pip install --quiet --editable '.[ros,fast,plot,replay,test]'
	touch $@

$(VENV)/bench.stamp: setup.py | $(BIN)/python
	$(BIN)/pip install --quiet --editable '.[ros,fast,bench]'
	touch $@

clean:
	rm -rf $(VENV) build install log
