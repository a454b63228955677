# `make explore` and `make test` do everything on a fresh machine; `make help` lists the rest.
.DEFAULT_GOAL := help
.PHONY: explore test test-python python-packages setup build fmt lint lint-tools typos cargo-machete cargo-deny bench help

TOOLS := $(CURDIR)/target/tools
export PATH := $(TOOLS)/bin:$(PATH)
# cargo-deny takes minutes to compile.
LINT_TOOLS := typos cargo-machete cargo-deny
# Known vulnerabilities are looked up where `cargo deny fetch` has stored their list.
DENIED := licenses bans sources $(if $(wildcard $(or $(CARGO_HOME),$(HOME)/.cargo)/advisory-dbs/*/.git),advisories)
where_installed = if command -v $(1) >/dev/null; then echo "$(2)"; $(2); else echo "skipped: $(1) is not installed (make lint-tools)"; fi

explore: build ## set up, build, and start the explorer (ARGS="--seed 7" passes options on)
	@target/release/sprint explore $(ARGS)

# Tests run side by side: threads of libtorch's own would only wait for each other.
test: setup ## set up, and run all tests
	python3 -B -m unittest -q tests/setup_test.py
	OMP_NUM_THREADS=1 cargo test --release --locked

# Its packages (700 MB) are not needed by `make test`. House is tested with the program, where that is built.
PYTHON_TESTS := target/python
test-python: $(PYTHON_TESTS)/installed ## install environments in Python, and test sprint_env with them
	cd assets/python && SPRINT=$(wildcard $(CURDIR)/target/release/sprint) $(CURDIR)/$(PYTHON_TESTS)/bin/python -B -m unittest -q
	$(if $(wildcard target/release/sprint),SPRINT_REQUIRE_DATA=python cargo test --release --locked --test sprint -- babyai::)

python-packages: $(PYTHON_TESTS)/installed

$(PYTHON_TESTS)/installed: assets/python/tests/requirements.txt
	python3 -m venv $(PYTHON_TESTS)
	$(PYTHON_TESTS)/bin/python -m pip install --quiet --disable-pip-version-check -r $<
	touch $@

setup: ## find or fetch libtorch and the sentence encoder
	@command -v python3 >/dev/null || { echo "set-up failed: python3 is missing; run \`apt install python3 python3-pip\`" >&2; exit 1; }
	@python3 assets/setup.py

build: setup ## build target/release/sprint
	cargo build --release --locked

fmt: ## format the sources
	cargo fmt

lint: setup ## what the checks ask for besides the tests
	cargo fmt --check
	cargo clippy --release --locked --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --release --locked --no-deps
	@$(call where_installed,typos,typos)
	@$(call where_installed,cargo-machete,cargo machete)
	@$(call where_installed,cargo-deny,cargo deny --locked --offline check $(DENIED))

lint-tools: $(LINT_TOOLS) ## install the tools that lint uses where they are installed

typos:
	python3 -m pip install --quiet --upgrade --target $(TOOLS) typos==1.52.0

cargo-machete:
	cargo install --quiet --locked --root $(TOOLS) cargo-machete@0.9.2

cargo-deny:
	cargo install --quiet --locked --root $(TOOLS) cargo-deny@0.20.2

bench: setup ## measure the simulator, the encoder, training and the explorer
	cargo bench --locked

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1\t\2/p' Makefile | expand -t 12
