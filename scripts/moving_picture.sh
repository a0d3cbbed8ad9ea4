#!/usr/bin/env bash
# The moving picture of the README: a lamp going around in the built-in atrium, lit by one bake.
#   scripts/moving_picture.sh [OUT.png]     default: docs/atrium.png, an animated PNG
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/setup.sh
out=${1:-docs/atrium.png}
cargo build --release -p localprt-precompute -p localprt-viewer --bins
target=${CARGO_TARGET_DIR:-target}/release
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/python"
"$folder/python/bin/pip" install --quiet "pillow>=11,<13"
echo '{"sky": {"type": "constant", "radiance": [0.03, 0.05, 0.1]}, "lights": []}' >"$folder/dusk.json"
"$target/precompute" bake builtin:atrium -o "$folder/atrium.lprt" --preset preview --receivers 30000 --direct-map 1024 --no-cache
# A turn of the lamp takes 240 frames.
"$target/viewer" "$folder/atrium.lprt" --headless --record "$folder/frames" --still --frames 240 --animate --with lamp \
    --lights "$folder/dusk.json" --size 360x216
"$folder/python/bin/python" - "$folder/frames" "$out" <<'END'
import pathlib
import sys

from PIL import Image

FRAMES, MILLISECONDS, COLORS = 48, 100, 96
paths = sorted(pathlib.Path(sys.argv[1]).glob("frame_*.png"))
pictures = [Image.open(path).convert("RGB") for path in paths[:: len(paths) // FRAMES]]
# One palette for all, or colors flicker.
all_of_them = Image.new("RGB", (pictures[0].width, pictures[0].height * len(pictures)))
for number, picture in enumerate(pictures):
    all_of_them.paste(picture, (0, number * picture.height))
palette = all_of_them.quantize(COLORS, method=Image.Quantize.MEDIANCUT)
indexed = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
indexed[0].save(sys.argv[2], save_all=True, append_images=indexed[1:], duration=MILLISECONDS, loop=0, optimize=True)
END
echo "$out: $(wc -c <"$out") bytes"
