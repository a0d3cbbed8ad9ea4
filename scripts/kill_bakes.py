#!/usr/bin/env python3
"""Kills bakes at random moments and lets them go on, again and again: `kill_bakes.py PROGRAM [KILLS] [SEED]`.

Every bake that comes to its end has to have written the files of a bake that nobody stopped, and no bake may leave a part of a file
where a whole one is expected. Cached, into the same output again and again: stages, leaves, writing and the check of what is up to
date are all killed. Prints how many kills fell into which stage.
"""

import collections
import hashlib
import pathlib
import random
import subprocess
import sys
import tempfile
import time

OPTIONS = ("--receivers 1500 --direct-map 128 --relight-rays 128 --probe-degree 3 --probes 20 --leaf 64 --gather-rays 64 --volume 0.4"
           " --new-layout --threads 1").split()


def bake(program, folder, *more):
    return subprocess.Popen([program, "bake", "builtin:cornell", "-o", "a.lprt", *OPTIONS, *more], cwd=folder,
                            stderr=subprocess.PIPE, text=True)


def files(folder):
    return [hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in ("a.lprt", "a.glb")]


def main():
    program = str(pathlib.Path(sys.argv[1]).resolve())
    kills = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    chance = random.Random(int(sys.argv[3]) if len(sys.argv) > 3 else 1)
    with tempfile.TemporaryDirectory() as name:
        root = pathlib.Path(name)
        (root / "clean").mkdir()
        start = time.monotonic()
        if bake(program, root / "clean", "--no-cache").wait() != 0:
            sys.exit("the bake that nobody stops fails")
        seconds = time.monotonic() - start
        clean = files(root / "clean")
        done, killed, ends = 0, collections.Counter(), 0
        folder = root / "0"
        folder.mkdir()
        while done < kills:
            child = bake(program, folder)
            try:
                # Most bakes have little left to do: short times as often as long ones.
                _, text = child.communicate(timeout=seconds * chance.random() ** 2)
            except subprocess.TimeoutExpired:
                child.kill()
                _, text = child.communicate()
                stage = next((line.split(":")[0].split(" ...")[0] for line in reversed(text.splitlines()) if line), "start")
                killed[stage] += 1
                done += 1
                for name in ("a.lprt", "a.glb"):
                    there = folder / name
                    if there.exists() and hashlib.sha256(there.read_bytes()).hexdigest() not in clean:
                        sys.exit(f"after kill {done} {name} is another: {there.stat().st_size} bytes")
                continue
            if child.returncode != 0:
                sys.exit(f"after kill {done} a bake ends with {child.returncode}: {text}")
            if files(folder) != clean:
                sys.exit(f"after kill {done} a bake has written another file")
            ends += 1
            folder = root / str(ends)
            folder.mkdir()
    print(f"{done} kills, {ends} bakes came to their end, all files equal; killed after these lines: {dict(killed)}")


main()
