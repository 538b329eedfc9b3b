# `make help` lists what there is.

# Mesa complains about a missing one, once per device.
export XDG_RUNTIME_DIR ?= /tmp

.PHONY: help demo test lint bench vulkan cxx

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "%-8s %s\n", $$1, $$2 }' Makefile

demo: vulkan cxx ## bake the bundled models, fly them with every strategy, print the table, write pictures
	cargo run --locked --release -- demo

test: vulkan cxx ## all tests; says how many GPU tests ran, and on which adapter
	@scripts/test.sh

lint: cxx ## formatting, clippy and documentation, warnings denied
	cargo fmt --check
	cargo clippy --locked --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps

bench: vulkan cxx ## the benchmarks
	cargo bench --locked

vulkan:
	@scripts/ensure-vulkan.sh

cxx:
	@scripts/ensure-cxx.sh
