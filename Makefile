# `make help` lists what there is.

# Mesa complains about a missing one, once per device.
export XDG_RUNTIME_DIR ?= /tmp

.PHONY: help demo test lint bench vulkan

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "%-8s %s\n", $$1, $$2 }' Makefile

demo: vulkan ## bake the bundled models, fly them with every strategy, print the table, write pictures
	cargo run --locked --release -- demo

test: vulkan ## all tests; says how many GPU tests ran, and on which adapter
	@scripts/test.sh

lint: ## formatting, clippy and documentation, warnings denied
	cargo fmt --check
	cargo clippy --locked --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps

bench: vulkan ## the benchmarks
	cargo bench --locked

vulkan:
	@scripts/ensure-vulkan.sh
