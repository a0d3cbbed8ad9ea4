#!/usr/bin/env bash
# Bakes a scene once and opens the viewer on it.
#   scripts/view.sh cornell             a built-in scene
#   scripts/view.sh SCENE.glb           a scene file
#   scripts/view.sh FILE.lprt           a baked file as it is
# What follows goes to the viewer: scripts/view.sh cornell --view clusters. Bakes lie in the folder target/view.
set -euo pipefail
start=$PWD
cd "$(dirname "$0")/.."

usage() { sed -n '2,6s/^# \{0,1\}//p' scripts/view.sh; }
case ${1:-} in
    -h | --help)
        usage
        exit 0
        ;;
    '')
        usage >&2
        exit 2
        ;;
esac
source=$1
shift
scripts/setup.sh
cargo build --release --workspace --bins
target=${CARGO_TARGET_DIR:-target}
bin=$PWD/$target/release
case $target in /*) bin=$target/release ;; esac

# From the folder where it was called, so that paths mean what they meant there.
cd "$start"
case $source in
    *.lprt) file=$source ;;
    *)
        folder=${bin%/release}/view
        mkdir -p "$folder"
        case $source in
            *.glb | *.gltf)
                # Scenes of one name may lie in several folders.
                name=$(basename "${source%.*}")-$(realpath "$source" | cksum | cut -d' ' -f1)
                ;;
            *)
                name=$source
                source=builtin:$source
                ;;
        esac
        file=$folder/$name.lprt
        if [ "$file" -ot "$bin/precompute" ] || { [ -f "$source" ] && [ "$file" -ot "$source" ]; }; then
            # Normal maps want degree 1.
            "$bin/precompute" bake "$source" -o "$file" --preset preview --receiver-degree 1
        fi
        ;;
esac
if [[ " $* " == *" --headless "* ]]; then
    exec "$bin/viewer" "$file" "$@"
fi
if [ "$(uname)" = Linux ] && [ -z "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
    picture=${file%.lprt}.png
    echo "view.sh: there is no display here; the picture goes to $picture" >&2
    exec "$bin/viewer" "$file" --headless --screenshot "$picture" "$@"
fi
exec "$bin/viewer" "$file" "$@"
