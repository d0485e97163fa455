# `make demo` and `make test` are all that a newcomer needs; each makes the virtual environment when it is missing.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Where Python keeps no compiled files, each of the many processes of a test compiles the program, and pytest every test.
export PYTHONDONTWRITEBYTECODE :=
TYPESCRIPT := typescript@5.9.3

.PHONY: help demo test test-long test-peers test-training fast coverage check format docs bench mutation clean lock materials browser systemd drivers training peers
.DEFAULT_GOAL := help

help:
	@echo "make demo    start everything in simulation; prints a link to sign in with   (ARGS='--port 8001 --seed 3')"
	@echo "make test    make check, then the tests that take seconds at most"
	@echo "make test-long  the tests that take longer"
	@echo "make test-peers  the tests with others' controllers and planners"
	@echo "make test-training  the tests of the training, with PyTorch"
	@echo "make fast    quick tests: no browser, no processes, none that computes for seconds"
	@echo "make coverage  make fast, then the lines and branches covered, by folder"
	@echo "make format  format the code, write the generated files anew"
	@echo "make check   formatting, types, import contracts, generated files, docs"
	@echo "make docs    the documentation as a site, in build/site; without warnings, or it fails"
	@echo "make bench   measurements                                                     (ARGS='tick --json tick.json')"
	@echo "make mutation   small changes of what safety rests on: a test has to fail for each   (ARGS='codec --sample 20')"
	@echo "make lock    bring the lock files up to date with pyproject.toml"
	@echo "make materials  the bill of materials, CycloneDX, as build/materials.cdx.json"
	@echo "make clean   remove the virtual environment and caches"

# A system library that a Python package needs but does not bring: $(call library,FILE,PACKAGE,WHO needs).
library = $(BIN)/python -c 'import ctypes; ctypes.CDLL("$(1)")' 2>/dev/null || \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		echo "installing $(2), which $(3)"; apt-get update -qq; \
		DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $(2) >/dev/null; \
	else \
		echo "$(2) is not installed, and $(3) it: sudo apt-get install $(2)"; exit 1; \
	fi

demo: $(VENV)/.project
	@exec $(BIN)/rolling-panda demo $(ARGS)

# $(call stages,WHICH): first the tests that others may run beside; then those that keep real time, two at once; then those
# that anything beside them would disturb. Training and others' controllers have their own targets, since nothing else
# needs their packages.
PEER_TESTS := tests/benchmarks/test_peers.py
TRAINING_TESTS := tests/perception/test_training.py tests/perception/test_wide_training.py tests/perception/test_tune.py \
	tests/perception/test_familiarity.py tests/perception/test_int8.py \
	tests/benchmarks/test_familiarity_scores.py
WITHOUT_EXTRAS := $(PEER_TESTS:%=--ignore %) $(TRAINING_TESTS:%=--ignore %)
stages = $(BIN)/pytest -n auto --dist worksteal -m "$(1) and not (paced or alone or slow)" $(WITHOUT_EXTRAS) && \
	$(BIN)/pytest -n 2 --dist loadfile -m "paced and $(1) and not (alone or slow)" $(WITHOUT_EXTRAS) && \
	$(BIN)/pytest -m "alone and $(1) and not slow" $(WITHOUT_EXTRAS)
test: check browser systemd drivers
ifdef ARGS
	$(BIN)/pytest $(ARGS)
else
	$(call stages,not long)
	@echo "make test-long runs the tests that take longer, make test-training those of the training; it installs PyTorch"
endif

test-long: browser systemd drivers
	$(call stages,long)

test-peers: peers
	$(BIN)/pytest $(PEER_TESTS)

test-training: training
	$(BIN)/pytest $(TRAINING_TESTS)

# Fewer random examples than `make test` has.
FAST = HYPOTHESIS_PROFILE=fast $(BIN)/pytest -n auto -m "not (paced or alone or slow or browser or processes or long)" \
	$(WITHOUT_EXTRAS) tests/bridge tests/controller tests/perception tests/recorder tests/rolling_panda tests/server
fast: $(VENV)/.project
	$(FAST)

coverage: $(VENV)/.project
	@mkdir -p build/coverage
	$(FAST) --cov --cov-report=
	@$(BIN)/coverage json --quiet -o build/coverage/report.json
	@$(BIN)/python tests/support/coverage_table.py build/coverage/report.json

format: $(VENV)/.project
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/python -m rolling_panda.generate --write

check: $(VENV)/.project
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m rolling_panda.generate --check
	@$(MAKE) --no-print-directory docs
	@if ! command -v npx >/dev/null; then \
		echo "web/: not type-checked, as Node.js is not installed here"; \
	elif ! npx --yes --package $(TYPESCRIPT) tsc --version >/dev/null 2>&1; then \
		echo "web/: not type-checked, as $(TYPESCRIPT) cannot be fetched here"; \
	else \
		echo "npx $(TYPESCRIPT) tsc -p web/jsconfig.json"; \
		npx --yes --package $(TYPESCRIPT) tsc -p web/jsconfig.json --noEmit; \
	fi

# Built anew when something of it has changed. `--strict` turns a warning, such as a broken link, into an error; it would
# count none with `--quiet`.
DOCUMENTED := mkdocs.yml $(wildcard *.md benchmarks/*.md) assets/network/vine.md web/icon.svg $(shell find docs/* \
	rolling_panda bridge controller perception server recorder labelling -name __pycache__ -prune -o \( -type d -o -type f \) -print)
docs: build/docs/.built
build/docs/.built: build/docs/.installed $(DOCUMENTED)
	NO_MKDOCS_2_WARNING=1 build/docs/bin/mkdocs build --strict
	@touch $@
	@echo "the documentation is in build/site: open build/site/index.html"

build/docs/.installed: requirements-docs.lock | $(VENV)/.locked
	@rm -rf build/docs
	$(PYTHON) -m venv --without-pip build/docs
	@$(BIN)/pip --python build/docs/bin/python install --quiet --disable-pip-version-check --only-binary :all: \
		--require-hashes -r requirements-docs.lock -c requirements-docs.lock || { rm -rf build/docs; \
		echo "The documentation is not checked: the packages of requirements-docs.lock cannot be installed here."; exit 1; }
	@touch $@

bench: $(VENV)/.project
	@exec $(BIN)/rolling-panda bench $(ARGS)

# mutmut lives apart, beside the project's packages, as nothing but this needs it.
build/mutation/.installed: $(VENV)/.project
	$(PYTHON) -m venv build/mutation
	build/mutation/bin/pip install --quiet --disable-pip-version-check 'mutmut==3.8.1'
	@echo "import site; site.addsitedir('$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')')" \
		> "$$(build/mutation/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/project.pth"
	@touch $@

mutation: build/mutation/.installed
	@exec $(BIN)/rolling-panda bench mutation $(ARGS)

# The browser tests drive the system's Chromium, or else Playwright's own (Ubuntu has no package that works in a
# container); without one, and without the right to install it, they fail and say how.
browser: $(VENV)/.project
	@if command -v chromium >/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		echo "installing Chromium"; apt-get update -qq; \
		DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium >/dev/null \
			|| $(BIN)/playwright install --with-deps chromium; \
	else \
		echo "Chromium is not installed; the browser tests may fail. Install it: sudo apt-get install chromium"; \
	fi

# The tests of the systemd units read them with systemd's own checker; without it they fail and say how to get it.
systemd:
	@if command -v systemd-analyze >/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		echo "installing systemd, for systemd-analyze"; apt-get update -qq; \
		DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends systemd >/dev/null; \
	else \
		echo "systemd-analyze is not installed; its tests fail. Install it: sudo apt-get install systemd"; \
	fi

# Also as constraints: otherwise pip takes the newest release of a package that another one wants with an extra.
$(VENV)/.locked: requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	@echo "installing the packages into $(VENV), which takes minutes the first time"
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock -c requirements.lock
	@touch $@

# The real robot's drivers, for their tests: both bridges are held to the same contract.
drivers: $(VENV)/.drivers
$(VENV)/.drivers: $(VENV)/.project requirements-real.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements-real.lock -c requirements-real.lock
	@$(call library,libusb-1.0.so.0,libusb-1.0-0,librealsense needs)
	@touch $@

# PyTorch's build without CUDA, which is on PyTorch's own package index: give that one to pip (PIP_EXTRA_INDEX_URL).
training: $(VENV)/.training
$(VENV)/.training: $(VENV)/.project requirements-training.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements-training.lock -c requirements-training.lock
	@touch $@

# Others' controllers, for `make bench ARGS='reach --method hierarchy mink'`.
peers: $(VENV)/.peers
$(VENV)/.peers: $(VENV)/.project requirements-peers.lock requirements-mpc.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements-peers.lock -c requirements-peers.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r requirements-mpc.lock -c requirements-mpc.lock
	@touch $@

# The control code becomes machine code when it is first imported: better here than at the first start.
$(VENV)/.project: $(VENV)/.locked pyproject.toml
	@$(call library,libgomp.so.1,libgomp1,Pinocchio needs)
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	$(BIN)/python -c 'import controller.core'
	@touch $@

# pip-tools lives apart, as it is no part of what the locks describe. No index address is written into them.
COMPILE = CUSTOM_COMPILE_COMMAND='make lock' build/lock/bin/pip-compile --quiet --generate-hashes --allow-unsafe \
	--strip-extras --no-emit-index-url --no-emit-trusted-host --no-emit-find-links --no-emit-options

materials: $(VENV)/.project
	mkdir -p build
	$(BIN)/cyclonedx-py requirements requirements-run.lock --pyproject pyproject.toml --output-reproducible \
		--output-format JSON --output-file build/materials.cdx.json

# What model predictive control needs, locked apart: it is installed without its dependencies, which name an older
# example-robot-data than the robot's model is from.
MPC := crocoddyl==3.2.1 libcrocoddyl==3.2.1 libmim-solvers==0.3.0 mim-solvers==0.3.0

lock:
	$(PYTHON) -m venv build/lock
	build/lock/bin/pip install --quiet 'pip-tools>=7.5,<8'
	$(COMPILE) --extra dev --output-file requirements.lock pyproject.toml
	$(COMPILE) --constraint requirements.lock --output-file requirements-run.lock pyproject.toml
	$(COMPILE) --constraint requirements.lock --extra real --output-file requirements-real.lock pyproject.toml
	for extra in training docs peers; do \
		$(BIN)/python -c 'import sys, tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"][sys.argv[1]], sep="\n")' $$extra \
			| $(COMPILE) --constraint requirements.lock --output-file requirements-$$extra.lock - || exit 1; \
	done
	rm -rf build/mpc
	for processor in x86_64 aarch64; do \
		build/lock/bin/pip download --quiet --no-deps --only-binary=:all: --python-version 3.11 --abi cp311 --abi none \
			--platform manylinux_2_28_$$processor --dest build/mpc $(MPC) || exit 1; \
	done
	grep '^#' requirements-mpc.lock > build/mpc/lock
	for name in $(MPC); do \
		echo "$$name \\"; \
		sha256sum build/mpc/$$(echo $$name | sed 's/-/_/g; s/==/-/')-*.whl | cut -c-64 | sort | sed 's/.*/    --hash=sha256:& \\/; $$s/ \\$$//'; \
	done >> build/mpc/lock
	mv build/mpc/lock requirements-mpc.lock

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
