PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test clean

demo: $(VENV)/demo.stamp
	$(BIN)/python -m sat_collision.demo

# numba's cache misses changes in a kernel's callees, so the tests compile afresh.
test: $(VENV)/test.stamp
	rm -rf sat_collision/__pycache__
	$(BIN)/python -m pytest

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip 'setuptools<80' wheel

$(VENV)/demo.stamp: setup.py | $(BIN)/python
	$(BIN)/pip install --quiet --editable '.[ros,fast,plot]'
	touch $@

$(VENV)/test.stamp: setup.py | $(BIN)/python
	$(BIN)/pip install --quiet --editable '.[ros,fast,plot,replay,test]'
	touch $@

clean:
	rm -rf $(VENV) build install log
