#!/usr/bin/env bash
# A bake in shards by Slurm: an array job with a task per shard, and a merge when all of them are done.
#   scripts/farm/slurm.sh PROGRAM SCENE OUT.lprt SHARDS [options of `precompute plan`]
# Plan, leaves, logs and reports lie in OUT.farm, which all nodes must reach by the same path. Prints the numbers of both jobs.
# FARM_CPUS are those of a shard (1); partition, account and so on are told to sbatch by its own variables (SBATCH_PARTITION, ...).
# Shards of a node that fails are queued again. Where a shard fails itself the merge is canceled: the same command goes on.
set -euo pipefail
if [ $# -lt 4 ]; then
    echo "usage: slurm.sh PROGRAM SCENE OUT.lprt SHARDS [options of precompute plan]" >&2
    exit 2
fi
program=$(realpath "$1")
scene=$2
output=$(realpath "$3")
shards=$4
shift 4
farm=${output%.lprt}.farm
export program output farm FARM_CPUS=${FARM_CPUS:-1}

mkdir -p "$farm"
"$program" plan "$scene" -o "$farm/plan" --shards "$shards" "$@"

submit() {
    sbatch --parsable --export=ALL --requeue --open-mode=append --cpus-per-task="$FARM_CPUS" --job-name="$(basename "$farm")" "$@"
}
# The variables are those of the jobs: shells there read them.
# shellcheck disable=SC2016
array=$(submit --array="0-$((shards - 1))" --output="$farm/shard-%a.log" --wrap='exec "$program" bake --plan "$farm/plan" \
    --shard "$SLURM_ARRAY_TASK_ID" --report "$farm/$SLURM_ARRAY_TASK_ID.json" --threads "$FARM_CPUS"')
# shellcheck disable=SC2016
merge=$(submit --dependency="afterok:$array" --kill-on-invalid-dep=yes --output="$farm/merge.log" \
    --wrap='exec "$program" merge --plan "$farm/plan" -o "$output" --threads "$FARM_CPUS"')
echo "$array $merge"
