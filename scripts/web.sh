#!/usr/bin/env bash
# The viewer for browsers with WebGPU: builds it to WebAssembly, puts it into a folder with a baked file and its scene,
# and serves that folder.
#   scripts/web.sh hall.lprt              the scene is hall.lightmap.glb beside it, or else hall.glb
#   scripts/web.sh hall.lprt --scene S    the scene is S, one .glb with everything in it
#   scripts/web.sh                        the viewer alone; what it shows is in the address: ?file=F.lprt&scene=S.glb
#   scripts/web.sh --setup                fetches a compiler for WebAssembly from Debian where rustup has none; no root
#       --out DIR     another folder than target/web
#       --port N      another port than 8000
#       --no-serve    builds only
# Exit codes: 2 for a wrong argument, 5 if nothing here compiles to WebAssembly.
set -euo pipefail

say() { echo "web: $*" >&2; }
has() { command -v "$1" >/dev/null 2>&1; }
usage() {
    say "$*"
    exit 2
}
# Paths are meant from where the user is.
absolute() { case $1 in /*) echo "$1" ;; *) echo "$PWD/$1" ;; esac; }

file=
scene=
out=
port=8000
serve=true
setup=false
while [ $# -gt 0 ]; do
    case $1 in
        --setup) setup=true ;;
        --no-serve) serve=false ;;
        --scene | --out | --port)
            [ $# -ge 2 ] || usage "$1 needs a value"
            case $1 in
                --scene) scene=$(absolute "$2") ;;
                --out) out=$(absolute "$2") ;;
                --port) port=$2 ;;
            esac
            shift
            ;;
        -*) usage "unknown argument $1 (known: --setup, --scene, --out, --port, --no-serve)" ;;
        *)
            [ -z "$file" ] || usage "one baked file at a time: $file, $1"
            file=$(absolute "$1")
            ;;
    esac
    shift
done
if [ -n "$file" ]; then
    if [ -z "$scene" ]; then
        scene=${file%.lprt}.lightmap.glb
        [ -f "$scene" ] || scene=${file%.lprt}.glb
    fi
    for path in "$file" "$scene"; do
        [ -f "$path" ] || usage "$path is not there; name the scene with --scene"
    done
fi
cd "$(dirname "$0")/.."

# shellcheck source=scripts/web/toolchain.sh
. scripts/web/toolchain.sh
build_folder=$(absolute "${CARGO_TARGET_DIR:-target}")
out=${out:-$build_folder/web}

if $setup; then
    wasm_setup
    exit
fi
wasm_find

"${wasm_cargo[@]}" rustc -p localprt-viewer --lib --crate-type cdylib "${wasm_flags[@]}"

mkdir -p "$out"
wasm_bind "$build_folder/$wasm_target/release/localprt_viewer.wasm" "$out" viewer
cp scripts/web/index.html "$out/"
if [ -n "$file" ]; then
    cp "$file" "$scene" "$out/"
    printf '{ "file": "%s", "scene": "%s" }\n' "$(basename "$file")" "$(basename "$scene")" >"$out/files.json"
fi
say "$(wc -c <"$out/viewer_bg.wasm") bytes of WebAssembly in $out"
if $serve; then
    say "http://localhost:$port/ (Ctrl-C ends it)"
    exec python3 -m http.server "$port" --bind 127.0.0.1 --directory "$out"
fi
