#!/usr/bin/env bash
# Packages for people without Rust: the commands with manual pages, completions and licenses, as archives with checksums.
#   scripts/release.sh [FOLDER]     default: target/packages
#   SKIP="static windows"           packages to leave out
# host: precompute and viewer of this system. static: precompute for any Linux of this architecture, without the GPU, which needs a driver
# that is loaded. windows: precompute and viewer, if Rust has the target here. What cannot be built is said, and is no failure.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { echo "release: $*" >&2; }
has_target() { [ -d "$(rustc --print target-libdir --target "$1" 2>/dev/null)" ]; }
is_wanted() { case " ${SKIP:-} " in *" $1 "*) return 1 ;; esac; }

scripts/setup.sh
target=${CARGO_TARGET_DIR:-target}
out=${1:-$target/packages}
mkdir -p "$out"
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n1)
host=$(rustc -vV | sed -n 's/^host: //p')
# Replaces .cargo/config.toml where other flags come with it.
cpu="-C target-cpu=x86-64-v3"
case $host in x86_64-*) ;; *) cpu= ;; esac

# pack NAME PROGRAM...: programs, licenses, manual pages and completions of precompute.
pack() {
    local name=localprt-$version-$1
    shift
    local folder=$target/package-$name
    rm -rf "$folder"
    mkdir -p "$folder/$name"
    cp "$@" "$folder/$name/"
    # Line numbers of the source are half of a program and more.
    if command -v strip >/dev/null 2>&1; then strip --strip-debug "$folder/$name/"*; fi
    mkdir "$folder/$name/man" "$folder/$name/completions"
    cp LICENSE-APACHE LICENSE-MIT README.md CHANGELOG.md "$folder/$name/"
    "$precompute" man -o "$folder/$name/man" >/dev/null
    for shell in bash zsh fish powershell; do
        "$precompute" completions "$shell" >"$folder/$name/completions/precompute.$shell"
    done
    tar --sort=name --owner=0 --group=0 --numeric-owner --mtime=@0 -C "$folder" -czf "$out/$name.tar.gz" "$name"
    rm -rf "$folder"
    say "$out/$name.tar.gz: $(wc -c <"$out/$name.tar.gz") bytes"
}

cargo build --release
precompute=$target/release/precompute
pack "$host" "$precompute" "$target/release/viewer"

headless=(--package localprt-precompute --bin precompute --no-default-features --features command,compressed)
if is_wanted static; then
    musl=${host%%-*}-unknown-linux-musl
    case $host in
        *-linux-*)
            if has_target "$musl" && command -v musl-g++ >/dev/null 2>&1; then
                static=$musl
                cargo build --release --target "$static" "${headless[@]}"
            else
                say "no $musl here (rustup target add $musl, and a musl-g++): linked with this system's C library instead"
                static=$host
                RUSTFLAGS="$cpu -C target-feature=+crt-static" cargo build --release --target "$static" "${headless[@]}"
            fi
            program=$target/$static/release/precompute
            # A dynamic program names its loader.
            if readelf --program-headers "$program" | grep -q INTERP; then
                say "$program still loads libraries"
                exit 1
            fi
            "$program" info --help >/dev/null
            pack "${host%%-*}-linux-static" "$program"
            ;;
        *) say "no static package: this is no Linux" ;;
    esac
fi

if is_wanted windows; then
    windows=x86_64-pc-windows-gnu
    if has_target "$windows" && command -v x86_64-w64-mingw32-g++ >/dev/null 2>&1; then
        cargo build --release --target "$windows"
        pack "x86_64-windows" "$target/$windows/release/precompute.exe" "$target/$windows/release/viewer.exe"
    else
        say "no package for Windows: it needs rustup target add $windows, and g++-mingw-w64-x86-64"
    fi
fi
(cd "$out" && sha256sum ./*.tar.gz >SHA256SUMS)
say "$out/SHA256SUMS"
