#!/usr/bin/env bash
# Holds the viewer in a browser against the viewer here: one bake, one state, two pictures; then uses the page by mouse and
# keys, and loses its device. Chromium runs without a window and without a GPU. Where nothing compiles to WebAssembly, or there is no Chromium, it
# says so and that is no failure. Not part of scripts/test.sh: a first build takes many minutes.
set -euo pipefail
cd "$(dirname "$0")/.."

# Mean FLIP. Two software rasterizers choose other pixels along edges: 0.008 in the Cornell box. Half an exposure value is 0.18.
allowed=0.02
look=(480x360 2 8)

. scripts/pictures.sh
. scripts/web/chromium.sh
find_chromium

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
scripts/setup.sh
build_commands
bake_cornell -o "$folder/cornell.lprt" --lightmap 128 --receiver-degree 1
code=0
scripts/web.sh "$folder/cornell.lprt" --out "$folder/site" --no-serve || code=$?
case $code in
    0) ;;
    5) skip "nothing here compiles to WebAssembly" ;;
    *) exit "$code" ;;
esac

read -r size exposure frames <<<"${look[*]}"
scripts/web/headless.py "$folder/site" "$folder/page.png" size="$size" exposure="$exposure" frames="$frames"
"$target/release/viewer" "$folder/cornell.lprt" --headless --screenshot "$folder/here.png" --size "$size" \
    --exposure "$exposure" --frames "$frames"
found=$(flip "$folder/page.png" "$folder/here.png")
echo "page and viewer: FLIP mean $found"
at_most "$found" $allowed || fail "the pictures differ by more than a mean FLIP of $allowed"
scripts/web/headless.py --open "$folder/site" "$folder/open.png"
scripts/web/headless.py --refuse "$folder/site"
echo "web_test: passed"
