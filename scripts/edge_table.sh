#!/usr/bin/env bash
# Prints the table of docs/edges.md: light at edges and mottling by view, of the file against path tracing.
#   scripts/edge_table.sh [SCENE ...]   builtin:blinds, builtin:room-on-plain and builtin:cornell by default
#   PRESET=preview, PROBES=150, PATHS=4096, OUT=target/edges
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
out=${OUT:-$target/edges}
mkdir -p "$out"
cargo build --release --quiet --package localprt-precompute --bin precompute
precompute=$target/release/precompute
if [ $# = 0 ]; then
    set -- builtin:blinds builtin:room-on-plain builtin:cornell
fi
echo "| scene, view | leak | edge ratio | mottling | off by 10 %, 50 % | nrmse without the worst 1 % | MB, matrices + links | seconds |"
echo "|---|---|---|---|---|---|---|---|"
for scene in "$@"; do
    name=$(basename "${scene#builtin:}")
    name=${name%.*}
    "$precompute" bake "$scene" -o "$out/$name.lprt" --preset "${PRESET:-preview}" --probes "${PROBES:-150}" \
        --report "$out/$name.json" --quiet
    "$precompute" validate "$out/$name.lprt" -o "$out/$name" --receivers 256 --points 1500 --paths "${PATHS:-4096}" \
        --picture-paths 8 --width 256 --flip-paths "${PATHS:-4096}" >/dev/null 2>"$out/$name.log" || { cat "$out/$name.log"; exit 1; }
    python3 - "$name" "$out/$name.json" "$out/$name/metrics.json" <<'PY'
import json, sys
name, report, metrics = sys.argv[1], json.load(open(sys.argv[2])), json.load(open(sys.argv[3]))
size = report["bytes"]
matrices = (size["projection"] + size["reconstruction"]) / 1e6
for view in metrics["states"][0]["views"]:
    figure = lambda field, digits: "none" if view.get(field) is None else f"{view[field]:.{digits}f}"
    print(f"| {name}, {view['name']} | {figure('leak', 3)} | {figure('edge_ratio', 2)} | {figure('mottling', 3)} | "
          f"{100 * view['off_10']:.1f}, {100 * view['off_50']:.1f} % | {figure('nrmse_99', 3)} | "
          f"{matrices:.1f} + {size['near_light'] / 1e6:.1f} | {report['seconds']:.0f} |")
PY
done
