#!/usr/bin/env bash
# Bakes, relights and validates the Cornell box and names the pictures. No GPU needed.
#   scripts/demo.sh [FOLDER]     default: localprt-demo
set -euo pipefail
cd "$(dirname "$0")/.."

# What the demo runs and nothing else: neither the viewer, nor compute shaders, nor the decoders of packed scenes.
scripts/setup.sh --bake
cargo build --release --package localprt-precompute --bin precompute --no-default-features --features command
target=${CARGO_TARGET_DIR:-target}
exec "$target/release/precompute" demo -o "${1:-localprt-demo}"
