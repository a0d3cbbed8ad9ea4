#!/usr/bin/env bash
# Finds what is missing to build and test localprt, and installs it with apt where there is apt and root.
# Baking needs nothing but these. Optional tools that cannot be had are named, and are no failure unless asked for:
#   scripts/setup.sh                     Rust, a linker and a C++ compiler, and what is optional
#   scripts/setup.sh --bake              nothing optional: what bakes need
#   scripts/setup.sh --require-xatlas    libclang as well, or exit code 1
#   scripts/setup.sh --require-gpu       a driver for the GPU tests as well, or exit code 1
#   scripts/setup.sh --require-window    a virtual display for the window tests as well, or exit code 1
# With --print-optional the last line on standard output is three words, "yes" or "no": whether the feature xatlas can be
# built, whether there is a driver for the GPU tests, and whether there is a display for the window tests.
set -euo pipefail
cd "$(dirname "$0")/.."

bake_only=false
require_xatlas=false
require_gpu=false
require_window=false
print_optional=false
for argument in "$@"; do
    case $argument in
        --bake) bake_only=true ;;
        --require-xatlas) require_xatlas=true ;;
        --require-gpu) require_gpu=true ;;
        --require-window) require_window=true ;;
        --print-optional) print_optional=true ;;
        *)
            echo "setup.sh: unknown argument $argument (known: --bake, --require-xatlas, --require-gpu," \
                "--require-window, --print-optional)" >&2
            exit 2
            ;;
    esac
done

say() { echo "setup: $*" >&2; }
has() { command -v "$1" >/dev/null 2>&1; }

updated=false
# Installs packages if this machine lets us; says why not otherwise.
install() {
    if ! has apt-get; then
        say "cannot install $*: there is no apt-get here"
        return 1
    fi
    if [ "$(id -u)" -ne 0 ]; then
        say "cannot install $* without root; run: sudo apt-get install --no-install-recommends $*"
        return 1
    fi
    export DEBIAN_FRONTEND=noninteractive
    say "installing $*"
    if ! $updated && ! apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1; then
        # No or stale package lists: once per run.
        apt-get update -qq >&2 || say "the package lists could not be updated"
        updated=true
    fi
    apt-get install -y -qq --no-install-recommends "$@" >&2 </dev/null || {
        say "apt-get could not install $*"
        return 1
    }
}

has_libclang() {
    if [ -n "${LIBCLANG_PATH:-}" ]; then
        compgen -G "$LIBCLANG_PATH/libclang*.so*" >/dev/null || [ -f "$LIBCLANG_PATH" ]
        return
    fi
    compgen -G "/usr/lib/llvm-*/lib/libclang*.so*" | grep -qv cpp && return
    compgen -G "/usr/lib*/libclang*.so*" | grep -qv cpp && return
    compgen -G "/usr/lib/*-linux-gnu*/libclang*.so*" | grep -qv cpp && return
    compgen -G "/opt/homebrew/opt/llvm/lib/libclang.dylib" >/dev/null && return
    compgen -G "/Library/Developer/CommandLineTools/usr/lib/libclang.dylib" >/dev/null
}

# libclang-dev brings the compiler's own headers, which the bindings need too.
has_clang_headers() {
    [ -n "${BINDGEN_EXTRA_CLANG_ARGS:-}" ] || [ "$(uname)" = Darwin ] ||
        compgen -G "/usr/lib*/llvm*/lib/clang/*/include/stddef.h" >/dev/null ||
        compgen -G "/usr/lib*/clang/*/include/stddef.h" >/dev/null
}

# A Vulkan loader and a driver for it. Elsewhere the system brings its own interface to the GPU.
has_gpu_driver() {
    [ "$(uname)" != Linux ] && return
    # Not grep -q, which would end the pipe early.
    PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null | grep 'libvulkan\.so\.1' >/dev/null || return 1
    [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] ||
        compgen -G "/usr/share/vulkan/icd.d/*.json" >/dev/null ||
        compgen -G "/usr/local/share/vulkan/icd.d/*.json" >/dev/null ||
        compgen -G "/etc/vulkan/icd.d/*.json" >/dev/null
}

# An X server without a screen, something that moves its mouse, and what windows load at run time.
window_packages="xvfb xdotool libxkbcommon-x11-0 libxcursor1 libxi6 libxrandr2"
has_virtual_display() {
    has Xvfb && has xdotool &&
        PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null | grep 'libxkbcommon-x11\.so\.0' >/dev/null
}

# Needed by everything.
if ! has cargo; then
    say "Rust is missing; install it with: curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh"
    exit 1
fi
needed=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
found=$(rustc --version | cut -d' ' -f2)
if [ "$(printf '%s\n%s\n' "$needed" "$found" | sort -V | head -n1)" != "$needed" ]; then
    say "Rust $needed is needed, this is $found; run: rustup update"
    exit 1
fi
if ! has cc && ! install gcc libc6-dev; then
    say "a C compiler is missing (Rust links with it); install gcc or clang"
    exit 1
fi
if ! has c++ && ! has g++ && ! has clang++ && ! install g++; then
    say "a C++ compiler is missing (the picture metric FLIP is C++); install g++ or clang"
    exit 1
fi

if $bake_only; then
    exit 0
fi

# Needed by the GPU tests only; Mesa's lavapipe runs them without a GPU.
gpu=yes
if ! has_gpu_driver && ! install libvulkan1 mesa-vulkan-drivers; then
    gpu=no
    say "GPU tests need a Vulkan driver (Debian, Ubuntu: libvulkan1 mesa-vulkan-drivers;" \
        "Fedora: vulkan-loader mesa-vulkan-drivers)"
    if $require_gpu; then
        exit 1
    fi
    say "going on without it; they are skipped, and --backend gpu will say that there is no adapter"
fi

# Needed by the tests of the viewer's window only.
window=yes
# shellcheck disable=SC2086  # several packages
if [ "$(uname)" != Linux ] || { ! has_virtual_display && ! install $window_packages; }; then
    window=no
    say "tests of the viewer's window need a virtual display (Debian, Ubuntu: $window_packages)"
    if $require_window; then
        exit 1
    fi
    say "going on without it; they are skipped"
fi

# Needed by the feature xatlas only.
xatlas=yes
if { ! has_libclang || ! has_clang_headers; } && ! install libclang-dev; then
    xatlas=no
fi
if [ $xatlas = no ]; then
    say "the unwrap backend xatlas needs libclang (Debian, Ubuntu: libclang-dev;" \
        "Fedora: clang-devel; macOS: brew install llvm)"
    if $require_xatlas; then
        exit 1
    fi
    say "going on without it; the default backend is not affected"
fi
if $print_optional; then
    echo "$xatlas $gpu $window"
fi
