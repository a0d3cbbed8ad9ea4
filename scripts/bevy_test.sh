#!/usr/bin/env bash
# Tests the Bevy plugin as games use it: unit tests, then the example that draws off screen, without a window and without a GPU. Pictures
# are held against the viewer's in the same light; a ball in the light of the volume against the relighter on the CPU; the scene is taken
# away and spawned anew; a thousand frames are drawn. Where there is no compiler that Bevy takes, or no driver, it says so and that is
# no failure. Not part of scripts/test.sh: a first build takes many minutes.
#   FRAMES=N     other than 1000
#   KEEP=DIR     pictures stay there
#   BEVY_TARGET=DIR     built there, not in runtime/bevy/target
set -euo pipefail
cd "$(dirname "$0")/.."

frames=${FRAMES:-1000}
# Mean FLIP of bounced light alone. With Bevy's direct light on top, whose shadows and diffuse reflection are others, the difference is told.
allowed=0.02
# What another light changes at least, or the pictures would say nothing.
changed=0.05

skip() {
    echo "SKIPPED bevy_test: $*" >&2
    exit 0
}
fail() {
    echo "bevy_test: $*" >&2
    exit 1
}
# Bevy names a newer compiler than it needs: a nightly of the version before builds it with --ignore-rust-version.
needed=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' runtime/bevy/Cargo.toml)
cargo=()
for toolchain in "" +nightly; do
    found=$(rustc ${toolchain:+"$toolchain"} --version 2>/dev/null | cut -d' ' -f2 | sed 's/-.*//')
    if [ -n "$found" ] && [ "$(printf '%s\n%s\n' "$needed" "$found" | sort -V | head -n1)" = "$needed" ]; then
        cargo=(cargo ${toolchain:+"$toolchain"})
        break
    fi
done
[ ${#cargo[@]} -gt 0 ] || skip "Bevy takes Rust $needed or newer, and there is no such compiler (rustup toolchain install nightly)"

scripts/setup.sh
if [ "$(uname)" = Linux ] && ! compgen -G "/usr/share/vulkan/icd.d/*.json" >/dev/null && [ -z "${VK_DRIVER_FILES:-}" ]; then
    skip "there is no Vulkan driver"
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
pictures=${KEEP:-$folder/pictures}
mkdir -p "$pictures"

target=${CARGO_TARGET_DIR:-target}
cargo build --release -p localprt-precompute -p localprt-viewer --bins --example flip
bevy() { CARGO_TARGET_DIR=${BEVY_TARGET:-runtime/bevy/target} "${cargo[@]}" "$@" --manifest-path runtime/bevy/Cargo.toml --locked --ignore-rust-version; }
bevy test --quiet
bevy build --quiet --examples
headless() { "${BEVY_TARGET:-runtime/bevy/target}/debug/examples/headless" "$@"; }

bake() { "$target/release/precompute" bake builtin:cornell --quiet --preset preview --probes 20 --probe-degree 4 --receiver-degree 1 "$@"; }
bake -o "$folder/cornell.lprt" --lightmap 128 --volume 0.125
# Of few texels, for many frames.
bake -o "$folder/small.lprt" --lightmap 64

export RUST_LOG=${RUST_LOG:-warn}
headless "$folder/cornell.lprt" pictures "$pictures"
flip() { "$target/release/examples/flip" "$1" "$2" | sed 's/FLIP mean //'; }
at_most() { awk -v found="$1" -v allowed="$2" 'BEGIN { exit !(found + 0 <= allowed) }'; }
for lighting in "$pictures"/*.json; do
    name=$(basename "$lighting" .json)
    view=final lamp=lamp
    [ "$name" = "${name%.indirect}" ] || view=indirect lamp=lamp.indirect
    "$target/release/viewer" "$folder/cornell.lprt" --headless --screenshot "$pictures/$name.viewer.png" --size 480x360 \
        --exposure 2 --frames 8 --tone-map clamp --cull-backs --view $view --lights "$lighting"
    found=$(flip "$pictures/$name.png" "$pictures/$name.viewer.png")
    line="$name: FLIP mean $found against the viewer"
    [ $view = final ] || at_most "$found" "$allowed" || fail "$line, more than $allowed"
    case $name in
        lamp | lamp.indirect | turned | turned.indirect) ;;
        *)
            other=$(flip "$pictures/$name.png" "$pictures/$lamp.png")
            line+=", $other from the lamp's picture"
            at_most $changed "$other" || fail "$line: less than $changed, so this light changes nothing"
            ;;
    esac
    echo "$line"
done
headless "$folder/cornell.lprt" ball "$pictures"
headless "$folder/cornell.lprt" use
headless "$folder/small.lprt" frames "$frames"
echo "bevy_test: passed"
