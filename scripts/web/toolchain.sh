# Sourced by scripts/web.sh and scripts/three.sh, from the root of the repository: what compiles to WebAssembly here.
#   wasm_setup            fetches a compiler from Debian where rustup has none
#   wasm_find             sets `wasm_cargo` and `wasm_flags`; exit code 5 if nothing here compiles to WebAssembly
#   wasm_bind IN.wasm FOLDER NAME    an ES module for browsers: NAME.js and NAME_bg.wasm
# `say` is the script's own.

wasm_target=wasm32-unknown-unknown
wasm_toolchain=${LOCALPRT_WEB_TOOLCHAIN:-${XDG_CACHE_HOME:-$HOME/.cache}/localprt-web}

# Debian's rustc-web, unpacked: it stays out of the way of the Rust that is installed.
wasm_fetch() {
    if ! has apt-get || ! has dpkg; then
        say "there is no apt-get here; run: rustup target add $wasm_target"
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
        say "apt-get has no rustc-web; run: apt-get update, or on another system: rustup target add $wasm_target"
        exit 5
    }
    for package in "$folder"/*.deb; do
        dpkg -x "$package" "$folder/root"
    done
    mkdir -p "$wasm_toolchain"
    rm -rf "$wasm_toolchain/root"
    mv "$folder/root" "$wasm_toolchain/root"
    say "$(LD_LIBRARY_PATH=$(wasm_libraries) "$wasm_toolchain/root/usr/bin/rustc" --version) is in $wasm_toolchain"
}

wasm_libraries() { compgen -G "$wasm_toolchain/root/usr/lib/*-linux-gnu" | head -n1; }

wasm_has_target() { [ -d "$(rustc --print target-libdir --target $wasm_target 2>/dev/null)" ]; }

# A linker for WebAssembly: one that is installed, or the one inside of Rust.
wasm_linker() {
    command -v wasm-ld || compgen -G "$(rustc --print sysroot)/lib/rustlib/*/bin/rust-lld" || {
        say "there is no linker for WebAssembly; install lld"
        exit 5
    }
}

wasm_setup() {
    if wasm_has_target; then
        say "Rust here compiles to $wasm_target; nothing to do"
    else
        wasm_fetch
    fi
}

wasm_find() {
    wasm_cargo=(env cargo)
    wasm_flags=(--release --target $wasm_target)
    if wasm_has_target; then
        return
    fi
    if ! [ -x "$wasm_toolchain/root/usr/bin/rustc" ]; then
        say "Rust here does not compile to WebAssembly; run: rustup target add $wasm_target"
        say "where that cannot be had (Debian): scripts/web.sh --setup"
        exit 5
    fi
    wasm_cargo=(
        # For another target than this.
        env -u RUSTFLAGS
        "RUSTC=$wasm_toolchain/root/usr/bin/rustc"
        "LD_LIBRARY_PATH=$(wasm_libraries)"
        # Its standard library comes as source, which only unstable cargo builds.
        RUSTC_BOOTSTRAP=1
        "CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$(wasm_linker)"
        CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS=-Clinker-flavor=wasm-ld
        cargo
    )
    wasm_flags+=(-Zbuild-std=std,panic_abort)
}

# The tool reads what the library wrote into the file, so both have one version: that of the lock file named last.
wasm_bind() {
    local version
    version=$(sed -n '/^name = "wasm-bindgen"$/{n;s/version = "\(.*\)"/\1/p}' "${4:-Cargo.lock}")
    if has wasm-bindgen && [ "$(wasm-bindgen --version)" = "wasm-bindgen $version" ]; then
        wasm-bindgen --target web --no-typescript --out-name "$3" --out-dir "$2" "$1"
        return
    fi
    grep -q "wasm-bindgen-cli-support = \"=$version\"" scripts/web/bindgen/Cargo.toml || {
        say "scripts/web/bindgen/Cargo.toml has another version of wasm-bindgen than ${4:-Cargo.lock}, $version"
        exit 1
    }
    CARGO_TARGET_DIR="$build_folder/web-bindgen" cargo build --release --manifest-path scripts/web/bindgen/Cargo.toml
    "$build_folder/web-bindgen/release/localprt-web-bindgen" "$1" "$2" "$3"
}
