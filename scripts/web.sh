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

target=wasm32-unknown-unknown
toolchain=${LOCALPRT_WEB_TOOLCHAIN:-${XDG_CACHE_HOME:-$HOME/.cache}/localprt-web}
build_folder=$(absolute "${CARGO_TARGET_DIR:-target}")
out=${out:-$build_folder/web}

# Debian's rustc-web, unpacked: it stays out of the way of the Rust that is installed.
fetch_toolchain() {
    if ! has apt-get || ! has dpkg; then
        say "there is no apt-get here; run: rustup target add $target"
        exit 5
    fi
    # Global, for the trap.
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    local packages
    # The compiler in several packages, and LLVM; all else is on every system that compiles.
    packages=$(apt-cache depends --recurse --no-recommends --no-suggests --no-conflicts --no-breaks --no-replaces \
        --no-enhances rustc-web 2>/dev/null | grep -E '^(libstd-rust-web|libllvm)' | sort -u) || true
    # shellcheck disable=SC2086
    (cd "$folder" && apt-get download rustc-web rust-web-src $packages >&2) || {
        say "apt-get has no rustc-web; run: apt-get update, or on another system: rustup target add $target"
        exit 5
    }
    for package in "$folder"/*.deb; do
        dpkg -x "$package" "$folder/root"
    done
    mkdir -p "$toolchain"
    rm -rf "$toolchain/root"
    mv "$folder/root" "$toolchain/root"
    say "$(LD_LIBRARY_PATH=$(toolchain_libraries) "$toolchain/root/usr/bin/rustc" --version) is in $toolchain"
}

toolchain_libraries() { compgen -G "$toolchain/root/usr/lib/*-linux-gnu" | head -n1; }

has_target() { [ -d "$(rustc --print target-libdir --target $target 2>/dev/null)" ]; }

# A linker for WebAssembly: one that is installed, or the one inside of Rust.
linker() {
    command -v wasm-ld || compgen -G "$(rustc --print sysroot)/lib/rustlib/*/bin/rust-lld" || {
        say "there is no linker for WebAssembly; install lld"
        exit 5
    }
}

# Cargo's environment and flags for whatever compiles here.
if $setup; then
    if has_target; then
        say "Rust here compiles to $target; nothing to do"
    else
        fetch_toolchain
    fi
    exit
fi
environment=(env)
flags=(--release --target $target)
if has_target; then
    :
elif [ -x "$toolchain/root/usr/bin/rustc" ]; then
    environment=(
        # For another target than this.
        env -u RUSTFLAGS
        "RUSTC=$toolchain/root/usr/bin/rustc"
        "LD_LIBRARY_PATH=$(toolchain_libraries)"
        # Its standard library comes as source, which only unstable cargo builds.
        RUSTC_BOOTSTRAP=1
        "CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$(linker)"
        CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS=-Clinker-flavor=wasm-ld
    )
    flags+=(-Zbuild-std=std,panic_abort)
else
    say "Rust here does not compile to WebAssembly; run: rustup target add $target"
    say "where that cannot be had (Debian): scripts/web.sh --setup"
    exit 5
fi

# The tool reads what the library wrote into the file, so both have one version.
version=$(sed -n '/^name = "wasm-bindgen"$/{n;s/version = "\(.*\)"/\1/p}' Cargo.lock)
if has wasm-bindgen && [ "$(wasm-bindgen --version)" = "wasm-bindgen $version" ]; then
    bind() { wasm-bindgen --target web --no-typescript --out-name "$3" --out-dir "$2" "$1"; }
else
    grep -q "wasm-bindgen-cli-support = \"=$version\"" scripts/web/bindgen/Cargo.toml || {
        say "scripts/web/bindgen/Cargo.toml has another version of wasm-bindgen than Cargo.lock, $version"
        exit 1
    }
    CARGO_TARGET_DIR="$build_folder/web-bindgen" cargo build --release --manifest-path scripts/web/bindgen/Cargo.toml
    bind() { "$build_folder/web-bindgen/release/localprt-web-bindgen" "$@"; }
fi

"${environment[@]}" cargo rustc -p localprt-viewer --lib --crate-type cdylib "${flags[@]}"

mkdir -p "$out"
bind "$build_folder/$target/release/localprt_viewer.wasm" "$out" viewer
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
