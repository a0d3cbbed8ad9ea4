#!/usr/bin/env bash
# Prints the tables of docs/systems.md: real-time systems on the same scenes and light, against path tracing.
#   scripts/systems.sh [SCENE[@LIGHTS.json] ...]   builtin:cornell, two-rooms-door, room-on-plain and atrium by default; second lights of
#                                                   these and lights of other scenes are in scripts/lights
#   SYSTEMS=all, BOUNCES="1 3", EQUAL=probes, PRESET=preview, PROBES=125, RECEIVERS=20000, POINTS=1000, PATHS=4096, OUT=target/systems
#   MOVING=--moving-lamp lets them follow a lamp, too
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
out=${OUT:-$target/systems}
mkdir -p "$out"
cargo build --release --quiet --package localprt-precompute --bin precompute
precompute=$target/release/precompute
if [ $# = 0 ]; then
    set -- builtin:cornell builtin:two-rooms-door builtin:room-on-plain builtin:atrium
fi
runs=()
for given in "$@"; do
    scene=${given%@*}
    name=$(basename "${scene#builtin:}")
    name=${name%.*}
    lights=()
    "$precompute" bake "$scene" -o "$out/$name.lprt" --preset "${PRESET:-preview}" --probes "${PROBES:-125}" \
        --receivers "${RECEIVERS:-20000}" --quiet
    label=$name
    if [ "$scene" != "$given" ]; then
        lights=(--lights "${given#*@}")
        label="$name, $(basename "${given#*@}" .json)"
    fi
    for bounces in ${BOUNCES:-1 3}; do
        run="$out/$label, gathers $bounces"
        "$precompute" validate "$out/$name.lprt" -o "$run" "${lights[@]}" --bounces "$bounces" --systems "${SYSTEMS:-all}" \
            --equal "${EQUAL:-probes}" ${MOVING:-} --receivers 1024 --points "${POINTS:-1000}" --paths "${PATHS:-4096}" --picture-paths 8 \
            --width 256 --flip-paths 1024 >/dev/null 2>"$out/log" || { cat "$out/log"; exit 1; }
        runs+=("$run")
    done
done
python3 - "${runs[@]}" <<'PY'
import json, pathlib, sys
runs = [(pathlib.Path(run).name, json.load(open(f"{run}/metrics.json"))["systems"]) for run in sys.argv[1:]]
names = list(runs[0][1])
# A column for each scene and light, with the figures after each number of gathers.
columns = {}
for run, systems in runs:
    columns.setdefault(run.rsplit(", gathers", 1)[0], []).append(systems)
percent = lambda value: "" if value is None else f"{100 * value:.1f}" if value < 10 else f"{100 * value:.0f}"
def table(title, figure):
    print(f"\n{title}\n\n| system | " + " | ".join(columns) + " |")
    print("|---|" + "---|" * len(columns))
    for name in names:
        cells = ([figure(systems.get(name, {})) for systems in column] for column in columns.values())
        print(f"| {name} | " + " | ".join(", ".join(filter(None, cell)) for cell in cells) + " |")
table("nrmse of what cameras see, %", lambda found: percent(found.get("view_nrmse")))
table("nrmse by area, %", lambda found: percent(found.get("area_nrmse")))
table("FLIP", lambda found: f"{found['flip']:.3f}" if found else "")
table("Bias, %", lambda found: f"{100 * found['bias']:+.1f}" if found else "")
print(f"\nWhat it takes: {runs[0][0]}\n\n| system | MB | probes | rays of an update | texels of an update | frames to 90 % | to rest |")
print("|---|---|---|---|---|---|---|")
for name, found in runs[0][1].items():
    print(f"| {name} | {found['bytes'] / 1e6:.3g} | {found['probes']} | {found['rays_per_update']:,.0f} | {found['texels_per_update']:,.0f} | "
          f"{found['frames_to_90_percent']} | {found['frames']} |")
if any("following" in found for _, systems in runs for found in systems.values()):
    of = lambda found, field: found.get("following", {}).get(field)
    table("A lamp moves: nrmse, %", lambda found: percent(of(found, "nrmse")))
    table("Frames behind", lambda found: "" if of(found, "nrmse") is None else f"{of(found, 'lag_frames'):.1f}")
    table("Flicker, % (of the truth itself)", lambda found: "" if of(found, "nrmse") is None
          else f"{100 * of(found, 'flicker'):.2f} ({100 * of(found, 'truth_flicker'):.2f})")
PY
