#!/usr/bin/env bash
# Bakes in shards by the engines of scripts/farm, on this machine: 16 shards, two workers of one CPU each, one of which is killed
# in the middle; then the merged files against those of a plain bake, byte for byte. HyperQueue and OpenJD come from PyPI into
# target/farm, Slurm from Debian where this is root, with keys, sockets and settings in a folder of its own. An engine that cannot be
# had is skipped, and named; exit code 77: none could. REQUIRE_FARM=1 makes that a failure.
#   scripts/test_farm.sh [PRECOMPUTE]    a program that is built already
set -euo pipefail
program=${1:+$(realpath "$1")}
cd "$(dirname "$0")/.."

target=${CARGO_TARGET_DIR:-target}
scene=builtin:two-rooms
bake=(--receivers 7000 --gather-rays 2048 --leaf 64 --direct-map 256 --probes 40)
shards=16
tested=() skipped=() ids=() queued=
say() { echo "test_farm: $SECONDS s: $*" >&2; }
fail() {
    say "FAILED: $*"
    exit 1
}
skip() {
    say "SKIPPED: $1: $2"
    skipped+=("$1")
}

if [ -z "$program" ]; then
    cargo build --release -p localprt-precompute
    program=$(realpath "$target/release/precompute")
fi
python=$target/farm/bin/python
if command -v python3 >/dev/null 2>&1 && [ ! -x "$python" ]; then
    python3 -m venv "$target/farm" >&2 || rm -rf "$target/farm"
fi
# from_pypi NAME MODULE
from_pypi() {
    [ -x "$python" ] && { "$python" -c "import $2" 2>/dev/null || "$python" -m pip install -q --disable-pip-version-check "$1" >&2; }
}
if [ -x "$python" ]; then python=$(realpath -s "$python"); fi
farm=$PWD/scripts/farm
work=$(mktemp -d)
work=$(realpath "$work")
export NO_COLOR=1 TMPDIR=$work

# A process with all that it started.
tree() {
    local child
    echo "$1"
    for child in $(pgrep -P "$1"); do tree "$child"; done
}
# kill_all PID ...: at once, as when a machine loses power.
kill_all() {
    local id all=()
    for id in "$@"; do
        mapfile -t -O "${#all[@]}" all < <(tree "$id")
        unset "ids[$id]"
    done
    kill -9 "${all[@]}" 2>/dev/null || true
}
# started PID: is killed at the end, if not before. Nothing waits for it, and bash does not say that it was killed.
started() {
    ids[$1]=$1
    disown "$1"
}
clean() {
    # shellcheck disable=SC2086
    if [ -n "$queued" ]; then scancel $queued && sleep 2; fi
    kill_all "${ids[@]}"
    rm -rf "$work"
}
trap clean EXIT

done_shards() { { find "$1" -maxdepth 1 -name '[0-9]*.json' 2>/dev/null || true; } | wc -l; }
# until_done FOLDER N: waits until N shards are baked.
until_done() {
    local _
    for _ in $(seq 3000); do
        if [ "$(done_shards "$1")" -ge "$2" ]; then return; fi
        sleep 0.1
    done
    fail "only $(done_shards "$1") shards are done after five minutes"
}
same() {
    cmp "$1/hall.lprt" "$work/plain/hall.lprt" && cmp "$1/hall.glb" "$work/plain/hall.glb" || fail "$1: not the files of a plain bake"
    say "$(basename "$1"): .lprt and .glb are those of a plain bake"
}
now() { date +%s%3N; }

mkdir "$work/plain"
say "a plain bake with one thread"
start=$(now)
"$program" bake "$scene" "${bake[@]}" --new-layout --no-cache --threads 1 -q -o "$work/plain/hall.lprt"
plain=$(($(now) - start))
say "took $plain ms"

# HyperQueue. Its wheel has server and workers in one process, and no program `hq`: workers that are killed alone, and servers that read
# their journal, are not tested.
hyperqueue() {
    local folder=$work/hyperqueue start wall server client
    local command=("$python" "$farm/hyperqueue.py" "$program" "$scene" "$folder/hall.lprt" $shards "${bake[@]}")
    start=$(now)
    "${command[@]}" --workers 2 >"$work/hyperqueue.log" 2>&1 || fail "HyperQueue: $(tail -n5 "$work/hyperqueue.log")"
    wall=$(($(now) - start))
    same "$folder"
    "$program" bake --plan "$folder/hall.farm/plan" --shard 0 --threads 1 --report "$folder/again.json" -q
    python3 - "$folder" "$wall" "$plain" >&2 <<'PYTHON'
import glob, json, sys
folder, wall, plain = sys.argv[1], float(sys.argv[2]) / 1000, float(sys.argv[3]) / 1000
seconds = [json.load(open(name))["seconds"] for name in glob.glob(folder + "/hall.farm/[0-9]*.json")]
again = json.load(open(folder + "/again.json"))
assert again["baked"] == 0, again
work, before = sum(seconds), again["seconds"]
print(f"test_farm: hyperqueue: {len(seconds)} shards of {min(seconds):.1f} to {max(seconds):.1f} s, wall {wall:.1f} s with plan and merge")
print(f"test_farm: hyperqueue: efficiency {work / (2 * wall):.2f} (shard seconds over workers x wall)")
print(f"test_farm: hyperqueue: of each shard {before:.1f} s, {len(seconds) * before / work:.0%} of all, are the stages before its "
      f"leaves; a plain bake takes {plain:.1f} s")
PYTHON

    say "hyperqueue: a server that runs; it is killed with its workers, and later a shard"
    folder=$work/hyperqueue-killed
    command[4]=$folder/hall.lprt
    cluster
    "${command[@]}" --server "$work/server" >"$work/client.log" 2>&1 &
    client=$!
    until_done "$folder/hall.farm" 5
    kill_all "$server"
    if wait "$client"; then fail "the client says that all is done"; fi
    local before after shard
    before=$(done_shards "$folder/hall.farm")
    rm "$folder"/hall.farm/*.json
    cluster
    "${command[@]}" --server "$work/server" >"$work/client.log" 2>&1 &
    client=$!
    until_done "$folder/hall.farm" $((before + 2))
    for _ in $(seq 100); do
        shard=$(pgrep -P "$server" | head -n1) || true
        if [ -n "$shard" ]; then break; fi
        sleep 0.05
    done
    kill -9 "$shard" || fail "no shard runs"
    wait "$client" || fail "HyperQueue: $(tail -n5 "$work/client.log")"
    say "hyperqueue: $(grep '^shard-' "$work/client.log" | head -n1)"
    grep -q '^shard-' "$work/client.log" || fail "no shard was tried again"
    after=$(grep -l '"baked": 0' "$folder"/hall.farm/[0-9]*.json | wc -l)
    [ "$after" -ge "$before" ] || fail "$before shards were baked, $after of them are kept"
    say "hyperqueue: $before shards were done when the server was killed, and were not made again"
    same "$folder"
    kill_all "$server"
}
# A server with two workers, in a process of its own.
cluster() {
    rm -rf "$work/server"
    "$python" - "$work/server" >"$work/server.log" 2>&1 <<'PYTHON' &
import signal, sys
from hyperqueue import LocalCluster
from hyperqueue.cluster import WorkerConfig
with LocalCluster(sys.argv[1]) as cluster:
    for _ in range(2):
        cluster.start_worker(WorkerConfig(cores=1))
    signal.pause()
PYTHON
    server=$!
    started "$server"
    for _ in $(seq 100); do
        if [ -e "$work/server/hq-current" ]; then return; fi
        sleep 0.1
    done
    fail "the server does not start: $(tail -n3 "$work/server.log")"
}

# OpenJD: `openjd run` is one worker, and takes the tasks that it is told; here the test is the queue.
openjd() {
    local folder=$work/openjd first second left
    mkdir "$folder"
    step() {
        local name=$1
        shift
        "${python%/*}/openjd" run "$farm/openjd.yaml" --step "$name" --no-run-dependencies -p "Program=$program" -p "Scene=$scene" \
            -p "Output=$folder/hall.lprt" -p "Shards=$shards" -p "Options=${bake[*]}" "$@"
    }
    numbers() { printf '%s\n' "$@" | python3 -c 'import json, sys; print(json.dumps([{"Number": int(n)} for n in sys.stdin]))'; }
    step Plan >"$folder/plan.log" 2>&1 || fail "OpenJD: $(tail -n5 "$folder/plan.log")"
    # shellcheck disable=SC2046
    step Shards --tasks "$(numbers $(seq 1 2 $shards))" >"$folder/first.log" 2>&1 &
    first=$!
    # shellcheck disable=SC2046
    step Shards --tasks "$(numbers $(seq 2 2 $shards))" >"$folder/second.log" 2>&1 &
    second=$!
    started "$second"
    until_done "$folder/hall.farm" 6
    kill_all "$second"
    wait "$first" || fail "OpenJD: $(tail -n5 "$folder/first.log")"
    left=$(for n in $(seq $shards); do [ -e "$folder/hall.farm/$((n - 1)).json" ] || echo "$n"; done)
    say "openjd: a worker was killed; another bakes what it left: $(echo $left)"
    # shellcheck disable=SC2086
    step Shards --tasks "$(numbers $left)" >"$folder/first.log" 2>&1 || fail "OpenJD: $(tail -n5 "$folder/first.log")"
    step Merge >"$folder/merge.log" 2>&1 || fail "OpenJD: $(tail -n5 "$folder/merge.log")"
    same "$folder"
}

# Slurm: two nodes on this machine. One of them dies with its shard, which the controller then gives to the other.
slurm() {
    local folder=$work/slurm host user ports jobs id file killed=()
    host=$(hostname -s) user=$(id -un)
    mkdir -p "$folder/state"
    read -ra ports < <(python3 -c 'import socket
sockets = [socket.socket() for _ in range(3)]
print(*[(s.bind(("127.0.0.1", 0)), s.getsockname()[1])[1] for s in sockets])')
    (umask 077 && head -c 1024 /dev/urandom >"$folder/munge.key")
    cat >"$folder/slurm.conf" <<CONF
ClusterName=loopback
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=${ports[0]}
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
SlurmUser=$user
SlurmdUser=$user
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool-%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd-%n.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdTimeout=10
ReturnToService=2
SchedulerParameters=batch_sched_delay=0,sched_interval=2
NodeName=node1 NodeHostname=$host NodeAddr=127.0.0.1 Port=${ports[1]} CPUs=1
NodeName=node2 NodeHostname=$host NodeAddr=127.0.0.1 Port=${ports[2]} CPUs=1
PartitionName=all Nodes=ALL Default=YES State=UP
CONF
    export SLURM_CONF=$folder/slurm.conf PATH=$PATH:/usr/sbin
    munged --foreground --force --socket="$folder/munge.socket" --key-file="$folder/munge.key" --pid-file="$folder/munged.pid" \
        --log-file="$folder/munged.log" --seed-file="$folder/munge.seed" >"$folder/munge.out" 2>&1 &
    started $!
    slurmctld -D >"$folder/slurmctld.log" 2>&1 &
    started $!
    slurmd -D -N node1 >"$folder/node1.log" 2>&1 &
    started $!
    slurmd -D -N node2 >"$folder/node2.log" 2>&1 &
    local node=$!
    started "$node"
    for _ in $(seq 100); do
        if [ "$(sinfo -h -N -t idle 2>/dev/null | wc -l)" = 2 ]; then break; fi
        sleep 0.2
    done
    [ "$(sinfo -h -N -t idle | wc -l)" = 2 ] || fail "Slurm does not start: $(tail -n3 "$folder/slurmctld.log")"
    jobs=$("$farm/slurm.sh" "$program" "$scene" "$folder/hall.lprt" $shards "${bake[@]}" 2>"$folder/submit.log") ||
        fail "Slurm: $(tail -n5 "$folder/submit.log")"
    queued=$jobs
    until_done "$folder/hall.farm" 6
    # What runs on that node: the shard, and the daemon of its step.
    for file in /proc/[0-9]*/environ; do
        id=${file#/proc/} id=${id%/environ}
        if { tr '\0' '\n' <"$file"; } 2>/dev/null | grep -qx -e "farm=$folder/hall.farm" &&
            { tr '\0' '\n' <"$file"; } 2>/dev/null | grep -qx -e "SLURMD_NODENAME=node2"; then
            killed+=("$id" "$(ps -o ppid= -p "$id" | tr -d ' ')")
        fi
    done
    [ ${#killed[@]} -gt 0 ] || fail "nothing runs on the second node"
    kill_all "$node" "${killed[@]}"
    say "slurm: killed a node with its shard; jobs $jobs"
    for _ in $(seq 600); do
        if [ -z "$(squeue -h -t all -j "${jobs#* }" 2>/dev/null | awk '$5 != "CD"')" ]; then break; fi
        sleep 0.5
    done
    queued=
    [ -e "$folder/hall.lprt" ] || fail "Slurm: $(squeue -t all; tail -n2 "$folder/slurmctld.log")"
    grep -qi requeu "$folder/slurmctld.log" || fail "Slurm: nothing was queued again"
    say "slurm: $(grep -i -m1 requeu "$folder/slurmctld.log")"
    same "$folder"
}
slurm_there() { PATH=$PATH:/usr/sbin type slurmctld slurmd sbatch munged python3 >/dev/null 2>&1; }

if from_pypi 'hyperqueue>=0.26,<1' hyperqueue; then
    hyperqueue
    tested+=(hyperqueue)
else
    skip hyperqueue "it cannot be installed from PyPI"
fi
if from_pypi 'openjd-cli>=0.8,<1' openjd.cli; then
    openjd
    tested+=(openjd)
else
    skip openjd "openjd-cli cannot be installed from PyPI"
fi
if ! slurm_there && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    say "installing slurmctld, slurmd, slurm-client and munge"
    # In run level 1 no service starts.
    RUNLEVEL=1 DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends slurmctld slurmd slurm-client munge >&2 || true
fi
if slurm_there; then
    slurm
    tested+=(slurm)
else
    skip slurm "slurmctld, slurmd, sbatch and munged are not here, and cannot be installed"
fi

if [ ${#skipped[@]} -gt 0 ] && [ "${REQUIRE_FARM:-}" = 1 ]; then fail "skipped: ${skipped[*]}"; fi
if [ ${#tested[@]} = 0 ]; then exit 77; fi
say "passed: ${tested[*]}; skipped: ${skipped[*]:-none}; not tested: the program hq of HyperQueue, its journal"
