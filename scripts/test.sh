#!/usr/bin/env bash
# Runs `cargo test` with the given arguments; at the end says how many GPU tests ran, and on which adapter.
#
# Each GPU test adds a line to the file named by COLLAPSAR_GPU_TEST_LOG (src/gpu/testing.rs).
set -euo pipefail
cd "$(dirname "$0")/.."

log=$(mktemp)
trap 'rm -f "$log"' EXIT
export COLLAPSAR_GPU_TEST_LOG="$log"

status=0
# One failure must not hide the others.
cargo test --locked --no-fail-fast "$@" || status=$?

awk -F '\t' '
    $1 == "ran" { ran++; adapters[$3]++ }
    $1 == "skipped" { skipped++ }
    END {
        printf "GPU tests: %d ran, %d skipped (no GPU)\n", ran, skipped
        for (adapter in adapters) printf "GPU tests: %d on %s\n", adapters[adapter], adapter
    }' "$log"
if [[ $status != 0 ]]; then echo "tests: FAILED" >&2; else echo "tests: passed"; fi
exit "$status"
