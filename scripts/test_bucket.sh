#!/usr/bin/env bash
# Caches in a bucket, against an S3 server on this machine: moto, from PyPI, in target/moto. Skips, says so and ends with exit code 77
# where there is no Python, or moto cannot be installed; REQUIRE_BUCKET=1 makes that a failure.
# Held against each other: bakes with a bucket, with one that is only read, two at once, with a server that is killed meanwhile
# or was never there, and without a cache.
#   scripts/test_bucket.sh [PRECOMPUTE]    a program that is built already, with the feature
set -euo pipefail
program=${1:+$(realpath "$1")}
cd "$(dirname "$0")/.."

target=${CARGO_TARGET_DIR:-target}
say() { echo "test_bucket: $*" >&2; }
fail() {
    say "FAILED: $*"
    exit 1
}
skip() {
    say "SKIPPED: $*"
    if [ "${REQUIRE_BUCKET:-}" = 1 ]; then exit 1; fi
    exit 77
}

if ! command -v python3 >/dev/null 2>&1; then skip "there is no python3, so no S3 server"; fi
server=$target/moto/bin/moto_server
if [ ! -x "$server" ]; then
    say "installing moto into $target/moto"
    { python3 -m venv "$target/moto" && "$target/moto/bin/pip" install -q --disable-pip-version-check 'moto[server]>=5.1,<6'; } >&2 ||
        { rm -rf "$target/moto" && skip "moto, an S3 server, cannot be installed from PyPI"; }
fi
if [ -z "$program" ]; then
    cargo build --release -p localprt-precompute --features bucket
    program=$(realpath "$target/release/precompute")
fi
server=$(realpath "$server")

work=$(mktemp -d)
server_id=
stop_server() {
    if [ -n "$server_id" ]; then
        kill -9 "$server_id" 2>/dev/null || true
        wait "$server_id" 2>/dev/null || true
        server_id=
    fi
}
trap 'stop_server; rm -rf "$work"' EXIT
cd "$work"

port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
export AWS_ENDPOINT=http://127.0.0.1:$port AWS_ALLOW_HTTP=true AWS_REGION=us-east-1
export AWS_ACCESS_KEY_ID=name AWS_SECRET_ACCESS_KEY=never-told NO_COLOR=1
unset AWS_SESSION_TOKEN AWS_PROFILE AWS_ENDPOINT_URL AWS_CONDITIONAL_PUT || true
bucket=s3://bakes/hall/v1

# moto keeps everything in memory: a server that starts anew is empty.
start_server() {
    "$server" -H 127.0.0.1 -p "$port" >server.log 2>&1 &
    server_id=$!
    for _ in $(seq 100); do
        if request PUT bakes >/dev/null 2>&1; then return; fi
        sleep 0.2
    done
    fail "the server does not start: $(tail -n3 server.log)"
}
request() {
    python3 - "$@" <<'PYTHON'
import os, sys, urllib.request
print(urllib.request.urlopen(urllib.request.Request(os.environ["AWS_ENDPOINT"] + "/" + sys.argv[2], method=sys.argv[1])).read().decode())
PYTHON
}
# bake FOLDER [FLAGS]: of a scene so small that its leaves take no time; the report into FOLDER/report.json.
bake() {
    local folder=$1
    shift
    mkdir -p "$folder"
    (cd "$folder" && "$program" bake builtin:cornell -o a.lprt --receivers 400 --probes 8 --gather-rays "${rays:-16}" --relight-rays 64 \
        --direct-map 64 --leaf 64 --report report.json "$@" 2>messages.txt) ||
        fail "bake $* ended with $?: $(cat "$folder/messages.txt")"
}
leaves() { python3 -c 'import json, sys; c = json.load(open(sys.argv[1]))["cache"]; print(c["reused"], c["baked"])' "$1/report.json"; }
same() { cmp "$1/a.lprt" "$2/a.lprt" && cmp "$1/a.glb" "$2/a.glb" || fail "$1 and $2 are not the same"; }
facts() { "$program" cache "$bucket" --json "$@" | python3 -c 'import json, sys; f = json.load(sys.stdin); print(f["records"], f["bytes"], f.get("damaged"))'; }
# refused CODE WORDS... : a command that has to end so.
refused() {
    local expected=$1 words=$2 code=0
    shift 2
    "$@" >out.txt 2>&1 || code=$?
    [ "$code" = "$expected" ] || fail "$* ended with $code instead of $expected: $(cat out.txt)"
    grep -q "$words" out.txt || fail "$* does not say '$words': $(cat out.txt)"
    if grep -q never-told out.txt; then fail "$* tells a secret"; fi
}

bake clean --no-cache

say "a server that is not there"
refused 6 "help: check the server" "$program" bake builtin:cornell -o a.lprt --cache "$bucket"
[ ! -e a.lprt ] && [ ! -e s3: ] || fail "a refused bake leaves something behind"
refused 6 "help: check the server" "$program" cache "$bucket"

start_server
say "two bakes, one after the other"
refused 6 "there is no such bucket" "$program" bake builtin:cornell -o a.lprt --cache s3://nobody/hall
refused 6 "there is no cache" "$program" cache "$bucket"
bake first --cache "$bucket"
bake second --cache "$bucket"
read -r reused made <<<"$(leaves first)"
[ "$reused" = 0 ] && [ "$made" -gt 3 ] || fail "the first bake made $made leaves and found $reused"
[ "$(leaves second)" = "$made 0" ] || fail "the second bake found $(leaves second) of $made leaves"
same clean first
same clean second
if compgen -G "*/s3:" >/dev/null; then fail "the bucket became a folder"; fi

say "a bucket that is only read"
before=$(facts)
bake reading --cache "$bucket" --cache-read
[ "$(leaves reading)" = "$made 0" ] || fail "the reading bake found $(leaves reading)"
bake reading --cache "$bucket" --cache-read --threshold 0.02
[ "$(facts)" = "$before" ] || fail "$before records and bytes are $(facts) after bakes that only read"

say "two bakes at once"
rays=64
bake clean64 --no-cache
(bake left --cache "$bucket") &
left=$!
(bake right --cache "$bucket") &
right=$!
wait "$left" && wait "$right" || fail "one of two bakes at once"
same clean64 left
same clean64 right

say "trimming and verifying"
read -r records bytes damaged <<<"$(facts --verify)"
[ "$damaged" = 0 ] || fail "$damaged of $records records are damaged"
before=$records half=$((bytes / 2))
say "$records records of $bytes bytes"
read -r records bytes _ <<<"$(facts --trim "$half")"
[ "$records" -gt 0 ] && [ "$records" -lt "$before" ] && [ "$bytes" -le "$half" ] || fail "$bytes bytes in $records records after trimming"
bake again --cache "$bucket" --cache-limit "$((half / 2))"
same clean64 again
read -r _ bytes _ <<<"$(facts)"
[ "$bytes" -le "$((half / 2))" ] || fail "$bytes bytes after a bake with a limit"

say "a server that is killed during a bake"
rays=4096
bake long --no-cache
"$program" cache "$bucket" --trim 0 >/dev/null
(bake killed --cache "$bucket") &
baking=$!
leaf_is_kept() { request GET "bakes?list-type=2&max-keys=1000" 2>/dev/null | grep -q '\.leaf<'; }
for _ in $(seq 200); do
    if leaf_is_kept || ! kill -0 "$baking" 2>/dev/null; then break; fi
    sleep 0.05
done
kill -0 "$baking" 2>/dev/null || fail "the bake was over before the server was killed"
stop_server
began=$SECONDS
wait "$baking" || fail "a bake whose server is gone"
same long killed
grep -q "results could not be kept in $bucket" killed/messages.txt || fail "nothing is said: $(cat killed/messages.txt)"
say "it ended after $((SECONDS - began)) s: $(grep "could not be kept" killed/messages.txt)"
if grep -rq never-told --include=messages.txt .; then fail "a message tells a secret"; fi
say "all passed: $made leaves"
