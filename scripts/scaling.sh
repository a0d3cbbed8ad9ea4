#!/usr/bin/env bash
# Memory and time of a bake against the size of its scene: cities of so many blocks, at few receivers and probes a block.
#   scripts/scaling.sh FOLDER BLOCKS...     leaves files, reports, memory.png and time.png in FOLDER and prints the table
set -euo pipefail
cd "$(dirname "$0")/.."

if [ $# -lt 2 ]; then
    sed -n '2,3s/^# //p' "$0" >&2
    exit 2
fi
folder=$1
shift
mkdir -p "$folder"
cargo build --release -p localprt-precompute --bin precompute --example scaling
target=${CARGO_TARGET_DIR:-target}/release
reports=()
for n in "$@"; do
    # The light map grows with the blocks, as a side of 256 texels for one.
    side=$(awk -v n="$n" 'BEGIN { print int(256 * sqrt(n)) }')
    "$target/precompute" bake "builtin:city:$n" -o "$folder/city-$n.lprt" --preset preview --probes $((80 * n)) \
        --receivers $((2500 * n)) --direct-map "$side" --no-cache --new-layout --report "$folder/city-$n.json"
    reports+=("$folder/city-$n.json")
done
"$target/examples/scaling" "$folder" "${reports[@]}"
