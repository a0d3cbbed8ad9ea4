#!/usr/bin/env bash
# Times the GPU passes at the size of the paper's Sponza and at ten times that: per pass bytes, time, GB/s, and the share
# of a plain buffer copy measured in the same run; and what lies where in device memory.
#   scripts/bench_gpu.sh [FILE.lprt]
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/setup.sh
echo "commit $(git rev-parse --short HEAD 2>/dev/null || echo unknown), $(uname -sm)"
exec cargo run --release --quiet -p localprt-runtime --example gpu_timing -- "$@"
