#!/usr/bin/env bash
# Bakes, relights and validates the Cornell box and names the pictures. No GPU needed.
#   scripts/demo.sh [FOLDER]     default: localprt-demo
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/setup.sh
cargo build --release --workspace --bins
target=${CARGO_TARGET_DIR:-target}
exec "$target/release/precompute" demo -o "${1:-localprt-demo}"
