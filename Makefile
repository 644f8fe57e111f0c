# make demo | make test | make bench: each does all the set-up it needs.
SHELL := bash
PYTHON ?= python3
VENV := .venv
STAMP := $(VENV)/.installed
BUILT := install/.built
# colcon does not look below the first package it finds, so the interface package is named beside it.
BASE_PATHS := . hand_msgs
RUN := source env.bash &&
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
# A domain of one's own, so that two checkouts on one machine do not hear each other.
export ROS_DOMAIN_ID ?= $(shell echo $$(( $$$$ % 90 + 10 )))

SOURCES := $(wildcard hand_*/*.py hand_*/*/*.py validation/*.py validation/*/*.py validation/*/*.html hand_*/*.dbc hand_*/*.html hand_*/*.json hand_msgs/*/* hand_msgs/* config/* launch/* tools/hand setup.* package.xml resource/*)

.PHONY: help demo test lint bench proof build clean

help:
	@echo "make demo   simulated hand, controller and recorder over ROS 2; results in out/demo"
	@echo "make test   lint, types and all tests"
	@echo "make bench  speed and quality figures into out/bench.json"
	@echo "make proof  the blind trial of the diagnosis, about an hour; scores into out/proof and docs/proof.md"
	@echo "make build  set-up only; then: source env.bash"
	@echo "make clean  remove everything that was built"

demo: $(BUILT)
	$(RUN) hand demo --out out/demo

test: lint
	$(RUN) python -m pytest

lint: $(BUILT)
	$(RUN) ruff format --check . && ruff check . && mypy

bench: $(BUILT)
	$(RUN) python -m validation.bench --out out/bench.json

# The key lives in the shell of this recipe alone; the diagnosis runs in processes that never see it.
# DATA=folder: public recordings of real machines (docs/proof.md names them), diagnosed as well.
proof: $(BUILT)
	$(RUN) rm -rf out/proof && made=$$(hand trial make out/proof --cases $(or $(CASES),404)) && \
	key=$$(echo "$$made" | sed -n 's/^key //p') && echo "$$made" | sed '/^key /d' && \
	hand trial run out/proof && (echo "$$key" | hand trial score out/proof || [ $$? = 1 ]) && \
	$(if $(DATA),hand trial reality $(DATA) --out out/reality &&) \
	python -m validation.trial.document out/proof docs/proof.md $(if $(DATA),out/reality/reality.json)

build: $(BUILT)

clean:
	rm -rf $(VENV) build install log

$(STAMP): requirements.txt requirements-ros.txt requirements-analysis.txt requirements-dev.txt tools/bootstrap.sh
	bash tools/bootstrap.sh $(PYTHON) $(VENV)
	touch $@

$(BUILT): $(STAMP) $(SOURCES)
	$(RUN) colcon build --base-paths $(BASE_PATHS) --event-handlers console_cohesion+ status-
	touch $@
