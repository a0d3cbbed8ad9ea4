#!/usr/bin/env bash
# The npm package for three.js: compiles runtime/three to WebAssembly, puts the package together in a folder, and packs it.
#   scripts/three.sh              the package in target/three/package, its tarball in target/three
#   scripts/three.sh --out DIR    in another folder
# Exit codes: 2 for a wrong argument, 5 if nothing here compiles to WebAssembly (scripts/web.sh --setup).
set -euo pipefail

# shellcheck source=scripts/out_folder.sh
. "$(dirname "$0")/out_folder.sh"
has() { command -v "$1" >/dev/null 2>&1; }
# shellcheck source=scripts/web/toolchain.sh
. scripts/web/toolchain.sh
out=${out:-$build_folder/three}
wasm_find

CARGO_TARGET_DIR="$build_folder/three-wasm" "${wasm_cargo[@]}" build --manifest-path runtime/three/Cargo.toml "${wasm_flags[@]}"
rm -rf "$out/package"
mkdir -p "$out/package/wasm"
wasm_bind "$build_folder/three-wasm/$wasm_target/release/localprt_three.wasm" "$out/package/wasm" localprt_wasm runtime/three/Cargo.lock
wasm=$out/package/wasm/localprt_wasm_bg.wasm
size() { wc -c <"$1"; }
raw=$(size "$wasm")
# Binaryen makes it smaller; without it the package works as well. What rustc uses is named: with all features it writes types that no
# browser reads yet.
features=(--enable-bulk-memory --enable-reference-types --enable-multivalue --enable-mutable-globals --enable-sign-ext
    --enable-nontrapping-float-to-int)
# Versions before 120 lose the table of JavaScript's objects.
if has wasm-opt && [ "$(wasm-opt --version | grep -oE '[0-9]+' | head -n1)" -ge 120 ]; then
    optimizer=(wasm-opt)
elif has npm; then
    optimizer=(npm exec --yes --package=binaryen@132.0.0 -- wasm-opt)
else
    optimizer=(false)
fi
if "${optimizer[@]}" "${features[@]}" -Oz "$wasm" -o "$wasm.small" 2>"$out/wasm-opt.log"; then
    mv "$wasm.small" "$wasm"
else
    rm -f "$wasm.small"
    say "there is no wasm-opt here that takes this WebAssembly (npm: binaryen); it stays as it is"
fi
cp -r runtime/three/{package.json,README.md,localprt.js,localprt.d.ts,example} LICENSE-MIT LICENSE-APACHE "$out/package/"
gzip -9 -k -f -c "$wasm" >"$out/wasm.gz"
sizes="$raw bytes of WebAssembly, $(size "$wasm") after wasm-opt, $(size "$out/wasm.gz") by gzip -9"
if has brotli; then
    brotli -f -q 11 -o "$out/wasm.br" "$wasm"
    sizes+=", $(size "$out/wasm.br") by brotli -q 11"
fi
say "$sizes"
if has npm; then
    (cd "$out/package" && npm pack --silent --pack-destination "$out")
else
    say "there is no npm here, so no tarball; the package is $out/package"
fi
