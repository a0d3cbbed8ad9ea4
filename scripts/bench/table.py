#!/usr/bin/env python3
"""Prints the tables of scripts/bench.sh.

    scripts/bench/table.py REPORT.json NAIVE

NAIVE has a line `PROGRAM KIND RAYS SECONDS MILLIONS_A_SECOND` for each program and kind of ray.
"""
import json
import sys

report = json.load(open(sys.argv[1]))
seconds = {}
for stage in report["stages"]:
    seconds[stage["name"]] = seconds.get(stage["name"], 0.0) + stage["seconds"]
total = report["seconds"]
print("\n| stage | seconds | share |\n|---|---|---|")
for name, spent in sorted(seconds.items(), key=lambda pair: -pair[1]):
    if spent >= 0.005 * total:
        print(f"| {name} | {spent:.2f} | {spent / total:.0%} |")
print(f"| all | {total:.2f} | |")

receivers = report["receivers"]
rays = {"gather": report["gather_rays"], "visibility": report["visibility_rays"]}
print(f"\n{receivers} receivers, {report['probes']} probes, {report['clusters']} clusters; peak {report['peak_rss_bytes'] / 1e6:.0f} MB")
print("rays a receiver: " + ", ".join(f"{count / receivers:.0f} {kind}" for kind, count in rays.items()))

# Naive rays for as many receivers as the bake had: sky is left where rays meet nothing, so that they have fewer visibility rays.
programs = {}
for line in open(sys.argv[2]):
    program, kind, count, spent, speed = line.split()
    programs.setdefault(program, {})[kind] = (int(count), float(spent), float(speed))
print("\n| naive rays by | gather, M/s | visibility, M/s | seconds for these receivers | bake / naive |\n|---|---|---|---|---|")
for program, kinds in programs.items():
    traced = kinds["gather"][0] / 1024
    naive = sum(spent for _, spent, _ in kinds.values()) / traced * receivers
    speeds = " | ".join(f"{kinds[kind][2]:.2f}" for kind in ("gather", "visibility"))
    print(f"| {program} | {speeds} | {naive:.1f} | {total / naive:.2f} |")
