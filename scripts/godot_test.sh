#!/usr/bin/env bash
# The add-on for Godot as people use it: the reader against the golden files, the example run on the engine's own Vulkan renderer, the
# passes' light against precompute's, pictures against the viewer's in the same light, a thousand frames.
# Takes Godot 4.6 or later from $GODOT or from the PATH; a machine without a display needs xvfb-run, one without a GPU Mesa's lavapipe.
# Where there is none of these it says so, and that is no failure. Not part of scripts/test.sh.
#   FRAMES=N     other than 1000
#   METHOD=mobile  the other renderer (not forward_plus)
#   KEEP=DIR     pictures stay there
set -euo pipefail
cd "$(dirname "$0")/.."

frames=${FRAMES:-1000}
method=${METHOD:-forward_plus}
# Mean FLIP. Edges of triangles are antialiased otherwise, and Godot draws shadow maps of its own.
allowed=0.02
# Pictures whose difference is told without a bound, beside that of their maps: Godot's own directional shadows leak along a wall, and
# Mobile draws into ten bits a channel, which shows as bands.
told=" sun "
[ "$method" = forward_plus ] || told=all

. scripts/pictures.sh
godot=${GODOT:-$(command -v godot4 || command -v godot || true)}
[ -n "$godot" ] || skip "there is no godot, and GODOT names none"
"$godot" --version >/dev/null 2>&1 || skip "$godot does not start"
display=()
if [ -z "${DISPLAY:-}" ]; then
    command -v xvfb-run >/dev/null 2>&1 || skip "there is neither a display nor xvfb-run"
    display=(xvfb-run -a -s "-screen 0 1280x1024x24")
fi

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
pictures=${KEEP:-$folder/pictures}
site=$folder/project
mkdir -p "$pictures"
scripts/setup.sh
build_commands
scripts/godot.sh --out "$folder/godot"
cp -r runtime/godot/example "$site"
cp -r "$folder/godot/addons" "$site/"
cp -r runtime/godot/tests "$site/tests"
cp -r formats/tests/data "$site/golden"
bake_cornell -o "$site/cornell.lprt" --lightmap 128
# Of few texels, for many frames.
bake_cornell -o "$folder/small.lprt" --lightmap 64 --direct-map 256
for file in "$site/cornell.lprt" "$folder/small.lprt"; do
    "$folder/godot/localprt-godot" surfaces "$file"
done
mv "$folder"/small.* "$site/"

# Errors of scripts and of the device end in text alone, and a script with one may never end.
run() {
    local log=$folder/log code=0
    timeout 1800 "$@" >"$log" 2>&1 || code=$?
    grep -vE '^(Godot Engine|Vulkan |$)' "$log" || true
    [ $code = 0 ] || fail "exit code $code of: $*"
    ! grep -qE 'SCRIPT ERROR|^ERROR|VUID' "$log" || fail "the engine has an error: $(grep -E 'SCRIPT ERROR|^ERROR|VUID' "$log" | head -n1)"
}
headless() { run "$godot" --headless --path "$site" "$@"; }
# Frames as fast as they come, the light not tied to a screen.
drawn() { run "${display[@]}" "$godot" --path "$site" --audio-driver Dummy --rendering-method "$method" --disable-vsync "$@"; }

"$godot" --headless --path "$site" --import >"$folder/import.log" 2>&1 || fail "the project is not imported: $(cat "$folder/import.log")"
headless --script res://tests/read.gd -- "$site/golden"
mkdir "$folder/lights"
headless --script res://tests/lights.gd -- "$folder/lights"
for lighting in "$folder"/lights/*.json; do
    "$target/release/precompute" relight "$site/cornell.lprt" --lights "$lighting" --direct shadow-map --quiet \
        -o "${lighting%.json}.exr"
done
drawn --script res://tests/relight.gd -- "$folder/lights"

drawn --resolution 480x360 --script res://tests/pictures.gd -- "$pictures"
cp "$folder/lights/lamp.json" "$folder/lights/indirect.json"
for lighting in "$folder"/lights/*.json; do
    name=$(basename "$lighting" .json)
    view=final other=lamp bound=$allowed
    [ "$name" != indirect ] || view=indirect
    [ "$name" != lamp ] && [ "$name" != indirect ] || other=
    [ "$told" != all ] && [ "${told/ $name /}" = "$told" ] || bound=told
    hold_against_viewer "$name" $view "$site/cornell.lprt" "$lighting" "$bound" "$other"
done
drawn --resolution 96x72 --script res://tests/frames.gd -- "$frames"
echo "godot_test: passed"
