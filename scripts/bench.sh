#!/usr/bin/env bash
# Where the time of a bake goes: seconds and shares by stage, rays by purpose, peak memory; and the same machine's speed on the naive rays of
# that bake (1,024 gather rays a receiver and seven visibility rays from what each meets), by our rays and, where its development
# package is installed (Debian: libembree-dev), by Embree's, in the same run.
#   scripts/bench.sh SCENE [bake options]     such as: scripts/bench.sh builtin:atrium --preset preview
#   RECEIVERS=N     receivers whose naive rays are traced, not 1000
# The last line is what the bake took over what the naive rays alone would take.
set -euo pipefail
if [ $# -lt 1 ]; then
    sed -n '2,7s/^# //p' "$0" >&2
    exit 2
fi
scene=$1
shift
case $scene in builtin:* | /*) ;; *) scene=$PWD/$scene ;; esac
cd "$(dirname "$0")/.."

scripts/setup.sh --bake
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cargo build --release -p localprt-precompute --bin precompute
cargo build --release -p localprt-surfaces --example ray_speed
target=${CARGO_TARGET_DIR:-target}/release
threads=${RAYON_NUM_THREADS:-$(nproc)}
echo "commit $(git rev-parse --short HEAD 2>/dev/null || echo unknown), $(uname -sm), $threads threads"

"$target/examples/ray_speed" "$scene" --receivers "${RECEIVERS:-1000}" --export "$folder/rays" >"$folder/naive"
if command -v g++ >/dev/null 2>&1; then
    for version in 4 3; do
        g++ -O3 -o "$folder/embree_rays" scripts/bench/embree_rays.cpp "-lembree$version" -lpthread 2>/dev/null || continue
        "$folder/embree_rays" "$folder/rays" "$threads" >>"$folder/naive"
        break
    done
fi
rm -rf "$folder/rays"
"$target/precompute" bake "$scene" -o "$folder/bench.lprt" --no-cache --new-layout --quiet --report "$folder/report.json" "$@"
scripts/bench/table.py "$folder/report.json" "$folder/naive"
