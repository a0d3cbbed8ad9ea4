#!/usr/bin/env python3
"""A bake in shards by HyperQueue (`pip install hyperqueue`; Linux): a task per shard, and a merge that depends on all of them.

Starts a server with workers in this process, or submits to a server that runs (`--server`, HQ_SERVER_DIR). Plan, leaves, logs and
reports lie in OUT.farm, which all workers must reach. What failed is tried again; started again, it goes on where it was.
"""
import argparse, os, subprocess, sys
from pathlib import Path

sys.path.pop(0)  # There this file has the name of the package.
from hyperqueue import Client, Job, LocalCluster
from hyperqueue.cluster import WorkerConfig
from hyperqueue.ffi.protocol import ResourceRequest


def run(client, arguments, farm, attempts=3):
    plan, cpus = str(farm / "plan"), arguments.cpus
    shards = range(arguments.shards)
    for _ in range(attempts):
        job = Job(max_fails=None, name=farm.stem)

        def task(name, command, after=()):
            command = [arguments.program, *command, "--plan", plan, "--threads", str(cpus)]
            return job.program(command, name=name, deps=after, stdout=None, stderr=str(farm / f"{name}.log"),
                               resources=ResourceRequest(cpus=cpus), crash_limit=5)

        tasks = {}
        for shard in shards:
            command = ["bake", "--shard", str(shard), "--report", str(farm / f"{shard}.json")]
            tasks[task(f"shard-{shard}", command)] = shard
        task("merge", ["merge", "-o", arguments.output], list(tasks))
        submitted = client.submit(job)
        if client.wait_for_jobs([submitted], raise_on_error=False):
            return 0
        failed = client.get_failed_tasks(submitted)
        for number, failure in failed.items():
            print(f"{job.task_by_id(number).name}: {failure.error}; see {failure.stderr}", file=sys.stderr)
        shards = [shard for made, shard in tasks.items() if made.task_id in failed]
    return 1


parser = argparse.ArgumentParser(description="A bake in shards by HyperQueue; further options are those of `precompute plan`.")
parser.add_argument("program"), parser.add_argument("scene"), parser.add_argument("output"), parser.add_argument("shards", type=int)
parser.add_argument("--workers", type=int, default=os.cpu_count(), help="workers to start, if no server is named")
parser.add_argument("--cpus", type=int, default=1, help="of a shard")
parser.add_argument("--server", default=os.environ.get("HQ_SERVER_DIR"), help="folder of a server that runs")
arguments, options = parser.parse_known_args()
for name in ("program", "output"):
    setattr(arguments, name, os.path.abspath(getattr(arguments, name)))
farm = Path(arguments.output).with_suffix(".farm")
farm.mkdir(parents=True, exist_ok=True)
subprocess.run([arguments.program, "plan", arguments.scene, "-o", farm / "plan", "--shards", str(arguments.shards), *options], check=True)
if arguments.server:
    sys.exit(run(Client(arguments.server), arguments, farm))
with LocalCluster() as cluster:
    for _ in range(arguments.workers):
        cluster.start_worker(WorkerConfig(cores=arguments.cpus))
    sys.exit(run(cluster.client(), arguments, farm))
