#!/usr/bin/env bash
# Everything that CI runs: format, lints, documentation, tests. All in one profile, with one set of features and one
# target folder, so that every dependency is built once.
#   scripts/test.sh [--bucket]    with the feature bucket, a third more dependencies, and its server on loopback
#   CI=true    requires what is optional elsewhere: the feature xatlas, a driver for the GPU tests, and a virtual display for
#              the window tests
set -euo pipefail
cd "$(dirname "$0")/.."

if [ "${CI:-}" = true ]; then
    optional=$(scripts/setup.sh --require-xatlas --require-gpu --require-window --print-optional)
else
    optional=$(scripts/setup.sh --print-optional)
fi
read -r xatlas gpu window <<<"$optional"
# Where there is a driver, a GPU test that finds no adapter is a failure.
if [ "$gpu" = yes ]; then
    export REQUIRE_GPU=1
fi
if [ "$gpu $window" = "yes yes" ]; then
    export REQUIRE_WINDOW=1
fi
bucket=no
if [ "${1:-}" = --bucket ]; then bucket=yes; fi
# The workspace's default members are all but the bucket.
features=()
if [ "$bucket" = yes ]; then
    features+=(--workspace --features localprt-precompute/bucket)
fi
if [ "$xatlas" = yes ]; then
    features+=(--features localprt-precompute/xatlas)
fi

# Vulkan drivers complain about a missing one.
if [ -z "${XDG_RUNTIME_DIR:-}" ]; then
    XDG_RUNTIME_DIR=$(mktemp -d)
    export XDG_RUNTIME_DIR
    trap 'rm -rf "$XDG_RUNTIME_DIR"' EXIT
fi

step() {
    echo "== $*" >&2
    local began=$SECONDS code=0
    "$@" || code=$?
    echo "== $((SECONDS - began)) s" >&2
    return $code
}

step cargo fmt --all --check
if command -v python3 >/dev/null 2>&1; then
    step python3 scripts/structure.py >&2
    step python3 scripts/spelling.py
fi
# The fuzz targets are a workspace of their own, whose lock file no other step reads.
step cargo metadata --locked --manifest-path fuzz/Cargo.toml --format-version 1 >/dev/null
step cargo clippy --release --all-targets "${features[@]}" -- -D warnings
RUSTDOCFLAGS="-D warnings" step cargo doc --release --no-deps "${features[@]}"
step cargo test --release --all-targets "${features[@]}"
# Examples in the documentation are no target of their own.
step cargo test --release --doc "${features[@]}"
if [ "$bucket" = yes ]; then
    # The program that the tests have built. Exit code 77: there is no server to be had.
    code=0
    step scripts/test_bucket.sh "${CARGO_TARGET_DIR:-target}/release/precompute" || code=$?
    if [ "$code" = 77 ]; then bucket=no; elif [ "$code" != 0 ]; then exit "$code"; fi
fi
untested=()
if [ "$bucket" = no ]; then untested+=("caches in a bucket"); fi
if [ "$xatlas" = no ]; then untested+=("the feature xatlas"); fi
if [ "$gpu" = no ]; then untested+=("the GPU passes"); fi
if [ "$window" = no ]; then untested+=("the viewer's window"); fi
if [ ${#untested[@]} -gt 0 ]; then
    echo "== all passed; not tested: $(printf '%s, ' "${untested[@]}")see what scripts/setup.sh says" >&2
else
    echo "== all passed" >&2
fi
