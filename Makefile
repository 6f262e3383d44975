# make demo: the whole story on the simulated rig.   make test: what is checked before a commit, in minutes.
# make test-all: the long statistics, kills, browser and fuzzing as well: everything that CI checks.
# make test-release: searches of minutes each and statistics of many seeds, before a release.
# make docs: the documentation site, into out/docs/index.html; its notebooks are executed when they have changed.
# make audit: known weaknesses of the pinned dependencies; needs the network, so it is no part of make test.
# Strict: an index that knows no weaknesses is no reason to find none.
PYTHON ?= python3
BIN := .venv/bin
# Compiled modules are kept: each process of the tests would compile all of them anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-all test-release setup tools bench docs lint audit clean

demo: .venv/program
	$(BIN)/rig demo --folder out/demo --force

# Worksteal: neighbours in a file run in one process, which then works out only once what they share.
test: setup lint
	$(BIN)/pytest -n auto --dist worksteal -m "not slow and not release"

test-all: test
	$(BIN)/pytest -n auto --dist worksteal -m "slow and not release"

test-release: setup
	$(BIN)/pytest -n auto --dist worksteal -m release

lint: setup
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

docs: setup
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs out/docs

bench: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[bench]'
	$(BIN)/python -m tests.benchmark
	$(BIN)/python -m tests.benchmark.discovery --sets 24
	$(BIN)/python -m tests.benchmark.noise_discovery 40

audit: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'pip-audit>=2.7,<3'
	$(BIN)/pip-audit --strict --no-deps --disable-pip -r constraints.txt

setup: .venv/ready

# What tests run besides Python; only root may install it.
tools:
	missing=$$(for tool in mbpoll gcc clang chromium; do command -v $$tool >/dev/null || echo $$tool; done); \
	if [ -n "$$missing" ] && [ "$$(id -u)" = 0 ]; then \
		apt-get -qq update; for tool in $$missing; do apt-get -qq install -y $$tool || true; done; \
	fi

# Each stamp is newer than what it was made from, so that a second call starts at once. The demo needs the program alone,
# and compiles those kernels that it uses. Packages and tools are installed at the same time; mypy reads the types of the
# dependencies once, for a minute, beside the compiler.
.venv/program: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

.venv/ready: .venv/program
	{ $(MAKE) -s tools || true; } & \
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,fleet,docs]' && wait
	command -v chromium >/dev/null || $(BIN)/python -m playwright install chromium || true
	{ $(BIN)/mypy >/dev/null || true; } & $(BIN)/python -m rig.warm && wait
	touch $@

clean:
	rm -rf .venv
