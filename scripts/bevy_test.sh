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
# Mean FLIP.
allowed=0.02
# Pictures whose difference is told without a bound, beside that of their bounced light: Bevy's own shadows leak by a lamp near a block and
# along walls in the sun, and its diffuse reflection on what glows is another.
told=" moved sun emission "

. scripts/pictures.sh
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

build_commands
bevy() { CARGO_TARGET_DIR=${BEVY_TARGET:-runtime/bevy/target} "${cargo[@]}" "$@" --manifest-path runtime/bevy/Cargo.toml --locked --ignore-rust-version; }
bevy test --quiet
bevy build --quiet --examples
headless() { "${BEVY_TARGET:-runtime/bevy/target}/debug/examples/headless" "$@"; }

bake_cornell -o "$folder/cornell.lprt" --receiver-degree 1 --lightmap 128 --volume 0.125
# Of few texels, for many frames.
bake_cornell -o "$folder/small.lprt" --receiver-degree 1 --lightmap 64

export RUST_LOG=${RUST_LOG:-warn}
headless "$folder/cornell.lprt" pictures "$pictures"
for lighting in "$pictures"/*.json; do
    name=$(basename "$lighting" .json)
    view=final other=lamp bound=$allowed
    [ "$name" = "${name%.indirect}" ] || view=indirect other=lamp.indirect
    case $name in lamp | lamp.indirect | turned | turned.indirect) other= ;; esac
    [ "${told/ $name /}" = "$told" ] || bound=told
    hold_against_viewer "$name" $view "$folder/cornell.lprt" "$lighting" "$bound" "$other"
done
headless "$folder/cornell.lprt" ball "$pictures"
headless "$folder/cornell.lprt" use
headless "$folder/small.lprt" frames "$frames"
echo "bevy_test: passed"
