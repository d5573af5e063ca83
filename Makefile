# Two commands do everything, set-up included: `make demo` and `make test`.
SHELL := /bin/bash
PYTHON ?= python3
PY := .venv/bin/python
EXTENSION := python/pydpend/_native.abi3.so
CARGO_FLAGS := --release --workspace --locked

.PHONY: help demo screenshot test build check docs format bench validate wheel fixtures clean
help:
	@echo "make demo      set up, build, and go from the bundled film to out/demo/report.html"
	@echo "make test      set up, build, and run every test, Rust and Python"
	@echo "make check     format, lint and type checks"
	@echo "make docs      the documentation as a site, out/site/index.html"
	@echo "make validate  the long accuracy sweeps, into docs/validation/identity.md's tables (about an hour)"
	@echo "make wheel     build the wheel, install it into a new environment and use it there"
	@echo "make bench     the speed figures (criterion), and the ratios beside them"
	@echo "make fixtures  make the bundled recordings again from their seeds"
	@echo "make screenshot  the README's picture, from the demo's report"
	@echo "make format    rustfmt and ruff"

.make/system: tools/system-packages.txt tools/system-packages.sh
	@[ -n "$(SKIP_SYSTEM)" ] || tools/system-packages.sh tools/system-packages.txt
	@mkdir -p .make && touch $@

# An environment that was deleted since is made again.
ifeq ($(wildcard .venv/bin/pydpend),)
$(shell rm -f .make/venv .make/dev)
endif

.make/venv: pyproject.toml tools/venv.sh tools/pip.sh | .make/system
	@echo "Setting up .venv"
	@PYTHON=$(PYTHON) tools/venv.sh
	@mkdir -p .make && touch $@

# What tests and checks need besides: a browser, and Python's tools.
.make/test-system: tools/test-packages.txt tools/system-packages.sh
	@[ -n "$(SKIP_SYSTEM)" ] || tools/system-packages.sh tools/test-packages.txt
	@mkdir -p .make && touch $@

.make/dev: .make/venv
	@echo "Adding what tests and checks need to .venv"
	@tools/pip.sh --group dev
	@touch $@

# Always the whole workspace: one choice of features, so that nothing is built twice.
build: .make/system .make/venv
	@tools/ready.sh
	@[ -e $(EXTENSION) ] || echo "Building, up to 7 minutes on two cores the first time"
	@cargo build $(CARGO_FLAGS)
	@cmp -s target/release/lib_native.so $(EXTENSION) || \
	    { cp target/release/lib_native.so $(EXTENSION).new && mv $(EXTENSION).new $(EXTENSION); }

demo: build
	@$(PY) tools/demo.py

screenshot: demo .make/test-system .make/dev
	@$(PY) tools/screenshot.py

test: build .make/test-system .make/dev
	cargo test $(CARGO_FLAGS)
	$(PY) -m pytest -n 2 --dist loadgroup

check: build .make/dev
	cargo fmt --all -- --check
	cargo clippy $(CARGO_FLAGS) --all-targets -- -D warnings
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy
	MYPYPATH=python .venv/bin/stubtest pydpend._native
	cargo check --release --locked -p tracker --lib --no-default-features
	cargo check --release --locked -p tracker --lib --no-default-features --features ffmpeg
	cargo check --release --locked -p tracker --lib --no-default-features --features opencv

# Warnings are errors; `make test` makes it too and follows its links (tests/end_to_end/test_site.py).
docs: build .make/dev
	$(PY) -m sphinx -q -W --keep-going -d out/site-trees docs out/site
	@echo "out/site/index.html"

# Long: the eight scenes by twenty seeds, real motion filmed, then the estimators' sweeps.
validate: build .make/dev
	cargo build $(CARGO_FLAGS) --example validate
	target/release/examples/validate --seeds 200..220 --write docs/validation/identity.md
	$(PY) -m tests.validation.validate_kinematics
	$(PY) -m tests.validation.validate_resume
	$(PY) -m tests.validation.validate_batch
	$(PY) -m tests.validation.mutate --mutants 300
	for sweep in angles default physics mechanisms; do $(PY) -m tests.validation.validate_$$sweep || exit 1; done
	for part in energy inertias ratios slow all none added; do $(PY) -m tests.validation.validate_damping $$part || exit 1; done

wheel: .make/system .make/dev
	tools/wheel.sh

bench: build .make/dev
	cargo bench --workspace --locked
	$(PY) -m tests.validation.bench_tables

fixtures: build
	$(PY) fixtures/make.py

format: .make/dev
	cargo fmt --all
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

clean:
	rm -rf target out .make .venv $(EXTENSION)
