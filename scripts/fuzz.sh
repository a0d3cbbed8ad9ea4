#!/usr/bin/env bash
# Fuzz targets of fuzz/, one after the other, from seeds that this makes: what reads baked files, records of caches, plans, glTF,
# lighting and options. Names the input that a target does not survive: a panic, 5 s, or 512 MB. What they find on their way stays
# in fuzz/corpus, and is where the next run begins. Skips, says so and ends with exit code 77 where cargo-fuzz or a nightly compiler
# is missing; REQUIRE_FUZZ=1 makes that a failure.
#   scripts/fuzz.sh [SECONDS] [TARGET ...]     60 s of each
#   scripts/fuzz.sh --runs N [TARGET ...]      so many executions of each instead
set -euo pipefail
cd "$(dirname "$0")/.."

say() { echo "fuzz: $*" >&2; }
skip() {
    say "SKIPPED: $*"
    if [ "${REQUIRE_FUZZ:-}" = 1 ]; then exit 1; fi
    exit 77
}

limit=(-max_total_time=60)
if [ "${1:-}" = --runs ]; then
    limit=("-runs=${2:?--runs needs a number}")
    shift 2
elif [[ "${1:-}" =~ ^[0-9]+$ ]]; then
    limit=("-max_total_time=$1")
    shift
fi
targets=("$@")
if [ $# = 0 ]; then targets=(file cache_record plan gltf lighting settings); fi

host=$(rustup run nightly rustc -vV 2>/dev/null | sed -n 's/^host: //p') || true
if [ -z "$host" ]; then skip "there is no nightly compiler: rustup toolchain install nightly --profile minimal"; fi
if ! cargo fuzz --version >/dev/null 2>&1; then skip "there is no cargo-fuzz: cargo install cargo-fuzz --version 0.13.2"; fi

# Nothing here is unsafe but the mapping of files. Without a sanitizer it is twice as fast, and memory is what a reader takes.
target_dir=$(realpath -m "${CARGO_TARGET_DIR:-fuzz/target}")
cargo +nightly fuzz build --sanitizer none --target "$host" --target-dir "$target_dir" >&2
programs=$target_dir/$host/release
"$programs/seeds" fuzz/corpus
export RAYON_NUM_THREADS=1

failed=()
for target in "${targets[@]}"; do
    say "$target: ${limit[*]}"
    artifacts=fuzz/artifacts/$target
    mkdir -p "$artifacts"
    log=$(mktemp)
    code=0
    "$programs/$target" "${limit[@]}" -max_len=65536 -timeout=5 -rss_limit_mb=512 -print_final_stats=1 -verbosity=0 \
        -artifact_prefix="$artifacts/" "fuzz/corpus/$target" >"$log" 2>&1 || code=$?
    number() { sed -n "s/^stat::$1: *//p" "$log"; }
    if [ $code = 0 ]; then
        say "$target: $(number number_of_executed_units) executions, $(number average_exec_per_sec) a second, at most $(number peak_rss_mb) MB"
    else
        tail -n40 "$log" >&2
        failed+=("$target: $(sed -n 's/.*Test unit written to //p' "$log")")
    fi
    rm -f "$log"
done
for each in "${failed[@]}"; do
    say "FAILED: $each; again: $programs/${each%%:*} ${each#*: }"
done
if [ ${#failed[@]} -gt 0 ]; then exit 1; fi
say "passed: ${targets[*]}"
