# Sourced by the tests that hold pictures of another program against the viewer's: how a test skips and fails, and how far pictures are apart.

test_name=$(basename "$0" .sh)
# Mean FLIP that another light changes at least, or the pictures would say nothing.
changed=0.05

skip() {
    echo "SKIPPED $test_name: $*" >&2
    exit 0
}
fail() {
    echo "$test_name: $*" >&2
    exit 1
}
# precompute, viewer and the comparison, with one set of features for all: another would build the dependencies again.
build_commands() {
    cargo build --release -p localprt-precompute -p localprt-viewer --bins --example flip
    target=${CARGO_TARGET_DIR:-target}
}
# The Cornell box of these tests; further options of `bake`.
bake_cornell() {
    "$target/release/precompute" bake builtin:cornell --quiet --preset preview --probes 20 --probe-degree 4 "$@"
}
# Mean FLIP of two pictures.
flip() { "$target/release/examples/flip" "$1" "$2" | sed 's/FLIP mean //;s/,.*//'; }
at_most() { awk -v found="$1" -v allowed="$2" 'BEGIN { exit !(found + 0 <= allowed) }'; }
# hold_against_viewer NAME VIEW FILE.lprt LIGHTS.json BOUND OTHER: NAME.png of the folder `pictures` after eight gathers, by mean FLIP within
# BOUND of the viewer's view, or told without one; and no less than `changed` from the picture OTHER, if that is not empty.
hold_against_viewer() {
    local name=$1 view=$2 file=$3 lights=$4 bound=$5 other=$6 found apart line
    "$target/release/viewer" "$file" --headless --screenshot "$pictures/$name.viewer.png" --size 480x360 --exposure 2 --frames 8 \
        --tone-map clamp --cull-backs --view "$view" --lights "$lights"
    found=$(flip "$pictures/$name.png" "$pictures/$name.viewer.png")
    line="$name: FLIP mean $found against the viewer"
    [ "$bound" = told ] || at_most "$found" "$bound" || fail "$line, more than $bound"
    if [ -n "$other" ]; then
        apart=$(flip "$pictures/$name.png" "$pictures/$other.png")
        line+=", $apart from the picture of $other"
        at_most "$changed" "$apart" || fail "$line: less than $changed, so this light changes nothing"
    fi
    echo "$line"
}
