#!/usr/bin/env bash
# Tests the package for three.js as pages use it: packs it, installs the tarball beside three, opens the example in Chromium without a
# window and without a GPU. Pictures are held against the viewer's in the same light; the lamp is dragged, the device lost, scenes are
# disposed of, a thousand frames drawn. Where nothing compiles to WebAssembly, or there is no Chromium or npm, it says so and that is no
# failure. Not part of scripts/test.sh: a first build takes many minutes.
#   FRAMES=N     other than 1000
#   KEEP=DIR     pictures stay there
set -euo pipefail
cd "$(dirname "$0")/.."

three=0.187.0
frames=${FRAMES:-1000}
# Mean FLIP. Edges of triangles are antialiased otherwise, and three.js draws shadow maps of its own: 0.006 to 0.015 in the Cornell box.
allowed=0.02
# What another light changes at least, or the pictures would say nothing.
changed=0.05

skip() {
    echo "SKIPPED three_test: $*" >&2
    exit 0
}
fail() {
    echo "three_test: $*" >&2
    exit 1
}
. scripts/web/chromium.sh
find_chromium
command -v npm >/dev/null 2>&1 || skip "there is no npm"

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
pictures=${KEEP:-$folder/pictures}
mkdir -p "$folder/site" "$pictures"
scripts/setup.sh
code=0
scripts/three.sh --out "$folder/three" || code=$?
case $code in
    0) ;;
    5) skip "nothing here compiles to WebAssembly" ;;
    *) exit "$code" ;;
esac
# One set of features for all: another would build the dependencies again.
cargo build --release -p localprt-precompute -p localprt-viewer --bins --example flip
target=${CARGO_TARGET_DIR:-target}
"$target/release/precompute" bake builtin:cornell -o "$folder/site/cornell.lprt" --quiet --preset preview --probes 20 \
    --probe-degree 4 --lightmap 128 --receiver-degree 1
# Of few texels, for many frames.
"$target/release/precompute" bake builtin:cornell -o "$folder/site/small.lprt" --quiet --preset preview --probes 20 \
    --probe-degree 4 --lightmap 64 --receiver-degree 1

npm install --silent --no-audit --no-fund --prefix "$folder/site" "$folder"/three/localprt-*.tgz "three@$three" "@types/three@$three" typescript@7
cp "$folder"/site/node_modules/localprt/example/* "$folder/site/"
cp scripts/web/three_types.mts "$folder/site/"
(cd "$folder/site" && node_modules/.bin/tsc --noEmit --strict --target es2022 --module nodenext three_types.mts) ||
    fail "the types of the package do not hold"

scripts/web/three.py "$folder/site" "$pictures" pictures
flip() { "$target/release/examples/flip" "$1" "$2" | sed 's/FLIP mean //'; }
at_most() { awk -v found="$1" -v allowed="$2" 'BEGIN { exit !(found + 0 <= allowed) }'; }
for lighting in "$pictures"/*.json; do
    name=$(basename "$lighting" .json)
    view=final
    [ "$name" != indirect ] || view=indirect
    "$target/release/viewer" "$folder/site/cornell.lprt" --headless --screenshot "$pictures/$name.viewer.png" --size 480x360 \
        --exposure 2 --frames 8 --tone-map clamp --cull-backs --view $view --lights "$lighting"
    found=$(flip "$pictures/$name.png" "$pictures/$name.viewer.png")
    line="$name: FLIP mean $found against the viewer"
    at_most "$found" "$allowed" || fail "$line, more than $allowed"
    if [ "$name" != lamp ] && [ "$name" != indirect ]; then
        other=$(flip "$pictures/$name.png" "$pictures/lamp.png")
        line+=", $other from the lamp's picture"
        at_most $changed "$other" || fail "$line: less than $changed, so this light changes nothing"
    fi
    echo "$line"
done
scripts/web/three.py "$folder/site" "$pictures" use
scripts/web/three.py "$folder/site" "$pictures" frames "$frames"
echo "three_test: passed"
