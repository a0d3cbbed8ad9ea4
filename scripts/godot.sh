#!/usr/bin/env bash
# The add-on for Godot: compiles what makes its shaders and surfaces, and puts the add-on together in a folder.
#   scripts/godot.sh              target/godot: addons/localprt, and localprt-godot, which prepares baked scenes
#   scripts/godot.sh --out DIR    in another folder
# Shaders are validated by spirv-val where there is one (Debian: spirv-tools). Exit code 2 for a wrong argument.
set -euo pipefail

# shellcheck source=scripts/out_folder.sh
. "$(dirname "$0")/out_folder.sh"
out=${out:-$build_folder/godot}

CARGO_TARGET_DIR="$build_folder/godot-tool" cargo build --release --locked --manifest-path runtime/godot/Cargo.toml
addon=$out/addons/localprt
rm -rf "$addon"
mkdir -p "$out/addons"
cp -r runtime/godot/addons/localprt "$addon"
cp LICENSE-MIT LICENSE-APACHE runtime/godot/README.md "$addon/"
cp "$build_folder/godot-tool/release/localprt-godot" "$out/"
"$out/localprt-godot" shaders "$addon/shaders"

shaders=("$addon"/shaders/*.spv)
if command -v spirv-val >/dev/null 2>&1; then
    for shader in "${shaders[@]}"; do
        spirv-val --target-env vulkan1.1 "$shader" || { say "$shader is not valid"; exit 1; }
    done
    say "${#shaders[@]} shaders, all valid"
else
    say "${#shaders[@]} shaders; there is no spirv-val to validate them"
fi
say "$addon: $(cat "${shaders[@]}" | wc -c) bytes of shaders, $(cat "$addon"/*.gd | wc -c) of GDScript"
