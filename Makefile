# `make explore` and `make test` do everything on a fresh machine; `make help` lists the rest.
.DEFAULT_GOAL := help
.PHONY: explore test setup build fmt lint bench help

explore: build ## set up, build, and start the explorer (ARGS="--seed 7" passes options on)
	@target/release/sprint explore $(ARGS)

# Tests run side by side: threads of libtorch's own would only wait for each other.
test: setup ## set up, and run all tests
	python3 -B -m unittest -q tests/setup_test.py
	OMP_NUM_THREADS=1 cargo test --release --locked

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

bench: setup ## measure the simulator, the encoder and the explorer
	cargo bench --locked

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/\1\t\2/p' Makefile | expand -t 10
