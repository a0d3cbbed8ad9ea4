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

. scripts/pictures.sh
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
build_commands
bake_cornell -o "$folder/site/cornell.lprt" --lightmap 128 --receiver-degree 1
# Of few texels, for many frames.
bake_cornell -o "$folder/site/small.lprt" --lightmap 64 --receiver-degree 1

npm install --silent --no-audit --no-fund --prefix "$folder/site" "$folder"/three/localprt-*.tgz "three@$three" "@types/three@$three" typescript@7
cp "$folder"/site/node_modules/localprt/example/* "$folder/site/"
cp scripts/web/three_types.mts "$folder/site/"
(cd "$folder/site" && node_modules/.bin/tsc --noEmit --strict --target es2022 --module nodenext three_types.mts) ||
    fail "the types of the package do not hold"

scripts/web/three.py "$folder/site" "$pictures" pictures
for lighting in "$pictures"/*.json; do
    name=$(basename "$lighting" .json)
    view=final other=lamp
    [ "$name" != indirect ] || view=indirect
    [ "$name" != lamp ] && [ "$name" != indirect ] || other=
    hold_against_viewer "$name" $view "$folder/site/cornell.lprt" "$lighting" "$allowed" "$other"
done
scripts/web/three.py "$folder/site" "$pictures" use
scripts/web/three.py "$folder/site" "$pictures" frames "$frames"
echo "three_test: passed"
