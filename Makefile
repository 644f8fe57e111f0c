# make demo | make test | make bench ...: each does all the set-up it needs, in this folder.
SHELL := bash
# What the tests need is installed while the packages are built.
MAKEFLAGS += --jobs=2
PYTHON ?= python3
VENV := .venv
# `make demo` installs what runs, `make studio` also the page; other targets what tests, benches and the proof import, too.
BASE := $(VENV)/.base
VIEWED := $(VENV)/.studio
CHECKED := $(VENV)/.full
BUILT := install/.built
RUNNING := requirements-ros.txt requirements.txt
CHECKING := requirements-analysis.txt requirements-studio.txt requirements-validation.txt requirements-dev.txt
# WHEELHOUSE=folder: install from this folder alone, without a network; `make wheelhouse` fills it.
WHEELHOUSE ?=
OFFLINE := $(if $(WHEELHOUSE),--wheelhouse $(WHEELHOUSE))
# Test processes. Tests in real time run one at a time whatever this is.
WORKERS ?= 2
# Files or folders of tests to run alone: make test TESTS=test/model
TESTS ?=
# LONG=1: also the tests marked long
LONG ?=
# colcon does not look below the first package it finds, so the interface package is named next to it.
BASE_PATHS := . hand_msgs
# The wheels of ROS have no tf2_msgs: where it is not installed, the package of this name in interfaces/ is built, too.
TF2 := python -c "import tf2_msgs" 2> /dev/null && [ ! -d install/tf2_msgs ] || echo interfaces/tf2_msgs
# Where control_msgs is not installed, the tests use the package of the same name in test/interfaces.
ACTIONS := install/.actions
RUN := source env.bash &&
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
# A domain of its own, so that two checkouts on one machine do not receive each other's messages.
export ROS_DOMAIN_ID ?= $(shell echo $$(( $$$$ % 90 + 10 )))

# The build links to the source tree (--symlink-install): an edit of Python code or of config/ takes effect at once.
# Only these files need another build.
BUILD_INPUTS := $(wildcard hand_msgs/*/* hand_msgs/* interfaces/*/* interfaces/*/*/* config config/layouts urdf launch/* tools/nodes/* hand_*/__init__.py hand_*/*/__init__.py validation/__init__.py validation/*/__init__.py setup.py package.xml resource/*)

.PHONY: help studio demo test lint bench faults soak proof machines figures mutate docs build wheelhouse clean

help:
	@echo "make studio      the simulated hand in the browser; Ctrl-C ends it"
	@echo "make demo        simulated hand, controller and recorder over ROS 2; results in out/demo"
	@echo "make test        lint, types and all tests"
	@echo "make bench       speed and quality into out/bench.json"
	@echo "make faults      injects faults in virtual time; FULL=1: also into processes in real time"
	@echo "make soak        HOURS=1: the simulated hand in motion as processes; memory, missed periods, latches"
	@echo "make figures     tables, numbers and pictures of README and docs; TAKE=out/bench.json stores a run"
	@echo "make proof       blind trials of the diagnosis against every plant; scores into out/proof, with WRITE=1 also into the documents"
	@echo "make machines    recordings of real machines in DATA=folder into out/machines.json; CLONES=folder: reads them first"
	@echo "make mutate      mutation tests: which changes of the code no test notices"
	@echo "make docs        the documents as a site into out/site, in an environment of its own; a broken link is an error"
	@echo "make build       set-up only; then: source env.bash"
	@echo "make wheelhouse  all requirements as wheels into out/wheelhouse; offline: make demo WHEELHOUSE=out/wheelhouse"
	@echo "make clean       remove everything that was installed and built here"

studio: $(BUILT) $(VIEWED)
	$(RUN) hand studio --sim

demo: $(BUILT)
	$(RUN) hand demo --out out/demo

# Lint and types run next to the first tests, which need no deadlines, and are shown at the end.
LINT := ruff format --check . && ruff check . && mypy && hadolint Dockerfile
test: $(BUILT) $(CHECKED) $(ACTIONS)
	mkdir -p out
	$(RUN) { (nice -n 19 bash -c '$(LINT)' > out/lint.log 2>&1) & lint=$$!; \
	tests=0; python -m pytest -n $(WORKERS) $(if $(LONG),-m '') $(TESTS) || tests=$$?; \
	checks=0; wait $$lint || checks=$$?; cat out/lint.log; exit $$((tests > checks ? tests : checks)); }

lint: $(BUILT) $(CHECKED)
	$(RUN) $(LINT)

bench: $(BUILT) $(CHECKED)
	$(RUN) python -m validation.bench --out out/bench.json

faults: $(BUILT) $(CHECKED)
	$(RUN) python -m validation.faults $(if $(FULL),--full) --out out/faults.json

soak: $(BUILT) $(CHECKED)
	$(RUN) python -m validation.faults.soak --hours $(or $(HOURS),1) --out out/soak.json

figures: $(BUILT) $(CHECKED)
	$(RUN) python -m validation.figures $(if $(TAKE),--take $(TAKE))

mutate: $(BUILT) $(CHECKED)
	$(RUN) python -m validation.mutation

# The key of a trial stays in the process of validation.proof; those that diagnose do not receive it.
# CASES=number of recordings, SCHEDULER=address of a dask scheduler, WRITE=1: store the scores and write the documents.
# DATA=folder: public recordings of real machines (docs/proof.md names them), diagnosed as well.
proof: $(BUILT) $(CHECKED)
	$(RUN) rm -rf out/proof && python -m validation.proof --cases $(or $(CASES),600) --out out/proof \
		$(if $(SCHEDULER),--scheduler $(SCHEDULER)) $(if $(WRITE),--write-docs) \
		$(if $(DATA),&& hand trial reality $(DATA) --out out/reality && \
			$(if $(WRITE),python -m validation.figures --take out/reality/reality.json,true))

# DATA=folder: recordings of real machines, as `python -m validation.machines collect` writes them from CLONES=folder.
machines: $(BUILT) $(CHECKED)
	@test -n "$(DATA)" || { echo "make machines needs DATA=folder; see docs/proof.md, section Real machines" >&2; exit 2; }
	$(if $(CLONES),$(RUN) python -m validation.machines collect --clones $(CLONES) --data $(DATA))
	$(RUN) python -m validation.machines --data $(DATA) $(if $(ONLY),--only $(ONLY)) --out out/machines.json

docs: out/docs_tools/.installed
	NO_MKDOCS_2_WARNING=1 out/docs_tools/bin/mkdocs build --strict --site-dir out/site
	@echo "written: out/site/index.html"

out/docs_tools/.installed: tools/docs_requirements.txt
	$(PYTHON) -m venv out/docs_tools
	out/docs_tools/bin/pip install --quiet -r tools/docs_requirements.txt
	touch $@

build: $(BUILT)

wheelhouse: $(BASE)
	$(RUN) python -m pip wheel --quiet --wheel-dir out/wheelhouse $(addprefix -r ,$(RUNNING) $(CHECKING))

clean:
	rm -rf $(VENV) build install log

$(BASE): $(RUNNING) tools/bootstrap.sh
	bash tools/bootstrap.sh $(PYTHON) $(VENV) $(RUNNING) $(OFFLINE)
	touch $@

$(VIEWED): $(BASE) requirements-studio.txt
	bash tools/bootstrap.sh $(PYTHON) $(VENV) $(RUNNING) requirements-studio.txt $(OFFLINE)
	touch $@

$(CHECKED): $(BASE) $(CHECKING)
	bash tools/bootstrap.sh $(PYTHON) $(VENV) $(RUNNING) $(CHECKING) $(OFFLINE)
	touch $(VIEWED) $@

$(ACTIONS): $(BUILT) $(wildcard test/interfaces/*/* test/interfaces/*/*/*)
	$(RUN) python -c "import control_msgs" 2> /dev/null && [ ! -d install/control_msgs ] || colcon build --symlink-install --base-paths test/interfaces --event-handlers console_cohesion+ status-
	touch $@

# A tree that was installed by copies, or by another version of this file, is removed first: links do not replace files.
$(BUILT): $(BASE) $(BUILD_INPUTS)
	[ -e $@ ] && grep -q symlink $@ || rm -rf build install log
	$(RUN) colcon build --symlink-install --base-paths $(BASE_PATHS) $$($(TF2)) --event-handlers console_cohesion+ status-
	$(RUN) { python -m hand_control & control=$$!; python -m hand_model.kernel && wait $$control; }
	echo "built with --symlink-install" > $@
