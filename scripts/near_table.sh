#!/usr/bin/env bash
# Prints the tables of docs/near-light.md: errors of a file's rows with and without links, and what bytes of links buy. Against
# path tracing of the first bounce at receivers.
#   scripts/near_table.sh [SCENE=LIGHTS.json,LIGHTS.json ...]   scenes instead of the built-in ones, each with its lights
#   PRESET=preview, PROBES=150, RECEIVERS=600 (measured), SWEEP="0 8 16 32 64" and DEGREES="4 7" for the second table, none if empty,
#   OUT=target/near
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
out=${OUT:-$target/near}
mkdir -p "$out"
cargo build --release --quiet --package localprt-precompute --bin precompute --example transport_error
precompute=$target/release/precompute
export REFERENCES=$out/references
mkdir -p "$REFERENCES"

light() {
    printf '%s\n' "$2" >"$out/$1.json"
    echo "$out/$1.json"
}
lamp() {
    echo "{\"lights\":[{\"type\":\"point\",\"position\":[$1],\"color\":[1,1,1],\"intensity\":3}]}"
}
if [ $# = 0 ]; then
    sun=$(light sun '{"lights":[{"type":"directional","direction":[-0.45,-0.7,0.55],"color":[1,0.95,0.85],"intensity":20}],"sky":{"type":"constant","radiance":[0.2,0.3,0.5]}}')
    set -- \
        "builtin:room-on-plain=$(light lamp_room "$(lamp -0.65,0.4,-0.32)"),$sun" \
        "builtin:atrium=$(light lamp_atrium "$(lamp 0.14,0.43,1.34)"),$sun" \
        "builtin:cornell=$(light lamp_cornell "$(lamp 0.3,1.8,-0.6)"),$(light lamp_box "$(lamp -0.5,0.9,0.5)")"
fi

# Figures of the lines of transport_error: name, way, then the numbers.
rows() {
    python3 - "$@" <<'PY'
import json, re, sys
scene, report, errors, form = sys.argv[1:]
report = json.load(open(report))
found = {}
for line in open(errors):
    if match := re.match(r"(.*), (paper|without links|rows|file): nrmse (\S+), without the worst 1 % (\S+), median \S+, 95 % (\S+), 99 % \S+, bias (\S+) %", line):
        found.setdefault(match[1], {})[match[2]] = [float(value) for value in match.groups()[2:]]
bytes_ = report["bytes"]
matrices = (bytes_["projection"] + bytes_["reconstruction"]) / 1e6
for light, ways in found.items():
    if form == "lights":
        cells = [" → ".join(f"{ways[way][i]:.3f}" for way in ("paper", "without links", "file")) for i in (1, 2, 0)]
        bias = " → ".join(f"{ways[way][3]:+.1f}" for way in ("without links", "file"))
        print(f"| {scene}, {light} | {' | '.join(cells)} | {bias} |")
    else:
        print(f"| {scene}, {light} | {form} | {report['options']['near_bytes']} | {report['links']['mean']:.1f} | "
              f"{matrices:.1f} + {bytes_['near_light'] / 1e6:.1f} | {ways['file'][1]:.3f} | {ways['file'][2]:.2f} | {report['seconds']:.0f} |")
PY
}
bake() {
    "$precompute" bake "$1" -o "$2.lprt" --preset "${PRESET:-preview}" --probes "${PROBES:-150}" --report "$2.json" --quiet "${@:4}"
    IFS=, read -ra lights <<<"$3"
    "$target/release/examples/transport_error" "$2.lprt" "${RECEIVERS:-600}" 1 "${lights[@]}" >"$2.txt"
}

echo "| scene, light | nrmse without the worst 1 %: paper → without links → file | 95 % | nrmse | bias, % |"
echo "|---|---|---|---|---|"
for pair in "$@"; do
    scene=${pair%%=*} name=$(basename "${pair%%=*}")
    name=${name#builtin:} name=${name%.*}
    bake "$scene" "$out/$name" "${pair#*=}"
    rows "$name" "$out/$name.json" "$out/$name.txt" lights
done
echo
echo "| scene, light | degree | bytes asked | links | MB, matrices + links | nrmse without the worst 1 % | 95 % | seconds |"
echo "|---|---|---|---|---|---|---|---|"
for pair in "$@"; do
    scene=${pair%%=*} name=$(basename "${pair%%=*}")
    name=${name#builtin:} name=${name%.*}
    for degree in ${DEGREES-4 7}; do
        for bytes in ${SWEEP-0 8 16 32 64}; do
            bake "$scene" "$out/$name-$degree-$bytes" "${pair#*=}" --near-bytes "$bytes" --probe-degree "$degree"
            rows "$name" "$out/$name-$degree-$bytes.json" "$out/$name-$degree-$bytes.txt" "$degree"
        done
    done
done
