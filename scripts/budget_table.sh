#!/usr/bin/env bash
# Prints the table of docs/budget.md: errors of what cameras see and of what lies open, with receivers and probes spread evenly and by
# scale, at as many of them, without near light. Against path tracing of the first bounce, by `precompute validate`.
#   SCENE=LIGHTS.json ...   scenes instead of the built-in ones, each with its light; "SCENE=" for its own light
#   PRESET=preview, RECEIVERS=60000, PROBES=150, POINTS=1024, OUT=target/budget
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
out=${OUT:-$target/budget}
mkdir -p "$out"
cargo build --release --quiet --package localprt-precompute --bin precompute
precompute=$target/release/precompute

light() {
    local file="$out/$1.json"
    printf '%s\n' "$2" >"$file"
    echo "$file"
}
if [ $# = 0 ]; then
    sun='{"type":"directional","direction":[0.4,-0.8,-0.45],"color":[1,0.95,0.85],"intensity":20}'
    set -- \
        "builtin:room-on-plain=" \
        "builtin:cornell=$(light lamp '{"lights":[{"type":"point","position":[-0.5,0.9,0.5],"color":[1,1,1],"intensity":3}]}')" \
        "builtin:two-rooms=" \
        "builtin:atrium=$(light sun_and_sky "{\"lights\":[$sun],\"sky\":{\"type\":\"constant\",\"radiance\":[0.3,0.4,0.6]}}")"
fi

row() {
    python3 - "$@" <<'PY'
import json, sys
name, density, folder, report = sys.argv[1:]
metrics, report = json.load(open(f"{folder}/metrics.json")), json.load(open(report))
views = metrics["views"]
mean = lambda key: sum(view[key] for view in views) / max(len(views), 1)
print(f"| {name}, {density} | {mean('nrmse_99'):.3f}, {mean('p95_relative'):.2f} "
      f"| {metrics['area']['nrmse_99']:.3f}, {metrics['area']['p95_relative']:.2f} "
      f"| {metrics['methods']['compressed']['nrmse']:.3f} | {100 * mean('unseen'):.1f} | {report['receivers']} "
      f"| {report['bytes']['file'] / 1e6:.1f} | {report['seconds']:.0f} |")
PY
}

echo "| scene, spread | by view: nrmse, p95 | by area: nrmse, p95 | receivers: nrmse | unseen by view, % | receivers | MB | seconds |"
echo "|---|---|---|---|---|---|---|---|"
for pair in "$@"; do
    scene=${pair%%=*} lights=${pair#*=}
    name=$(basename "${scene#builtin:}")
    name=${name%.*}
    for density in uniform scale; do
        file="$out/$name-$density.lprt"
        "$precompute" bake "$scene" -o "$file" --preset "${PRESET:-preview}" --receivers "${RECEIVERS:-60000}" \
            --probes "${PROBES:-150}" --near-bytes 0 --density "$density" --report "$out/$name-$density.json" --quiet
        "$precompute" validate "$file" ${lights:+--lights "$lights"} --bounces 1 --points "${POINTS:-1024}" \
            --flip-paths 8 --output "$out/$name-$density" --quiet >"$out/$name-$density.txt"
        row "$name" "$density" "$out/$name-$density" "$out/$name-$density.json"
    done
done
