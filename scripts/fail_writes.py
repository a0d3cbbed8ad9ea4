#!/usr/bin/env python3
"""Lets every write of a bake fail once, as on a full disk or a broken one: `fail_writes.py PROGRAM`. Needs strace.

The bake replaces an older one, with a cache. Each call of the system that makes, writes, syncs or renames a file fails in one run, and
in another run that one and all after it. A run has to end with 0 and the files of a clean bake (a cache may fail), or with 6, a message
and files that are whole, the older ones or the new ones; and the next run with 0 and the files of a clean bake.
"""

import collections
import hashlib
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

OPTIONS = ("--receivers 300 --direct-map 32 --relight-rays 64 --probe-degree 2 --leaf 64 --gather-rays 16 --new-layout"
           " --threads 1").split()
NAMES = ("a.lprt", "a.glb")
# What each call fails with.
CALLS = {"write": "ENOSPC", "pwrite64": "ENOSPC", "fsync": "EIO", "renameat": "EIO", "renameat2": "EIO", "rename": "EIO",
         "mkdir": "EACCES", "ftruncate": "EIO", "openat": "EACCES"}


def command(program, *more):
    return [program, "bake", "builtin:cornell", "-o", "a.lprt", "-q", *OPTIONS, *more]


def run(arguments, folder):
    return subprocess.run(arguments, cwd=folder, capture_output=True, text=True, errors="replace")


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else None


def calls(program, folder):
    """Names of the calls that change files, each with the numbers, counted by thread, that it has in a run."""
    log = folder / "log"
    run(["strace", "-f", "-o", str(log), "-e", "trace=" + ",".join(CALLS), *command(program, "--probes", "8")], folder)
    counts, found, loading = collections.Counter(), set(), 0
    for line in log.read_text(errors="replace").splitlines():
        called = re.match(r"(\d+) +(\w+)\(", line)
        if not called or called[2] not in CALLS:
            continue
        thread, name = called.groups()
        counts[thread, name] += 1
        if ".so" in line:
            loading = counts[thread, name]
        if name != "openat" or "O_CREAT" in line or "O_TMPFILE" in line:
            found.add((name, counts[thread, name]))
    # Numbers below those of libraries are of other threads: the program would not start.
    return sorted((name, number) for name, number in found if name != "openat" or number > loading)


def main():
    program = str(pathlib.Path(sys.argv[1]).resolve())
    if not shutil.which("strace"):
        print("strace is not installed (Debian: apt-get install strace)", file=sys.stderr)
        sys.exit(77)
    with tempfile.TemporaryDirectory() as name:
        root = pathlib.Path(name)
        for part in ("older", "clean", "traced"):
            (root / part).mkdir()
        run(command(program, "--probes", "6", "--no-cache"), root / "older")
        run(command(program, "--probes", "8", "--no-cache"), root / "clean")
        older, clean = ([digest(root / part / name) for name in NAMES] for part in ("older", "clean"))
        ends = collections.Counter()
        found = calls(program, root / "traced")
        for number, (call, when) in enumerate(found):
            for onwards in ("", "+"):
                folder = root / f"{number}{onwards}"
                shutil.copytree(root / "older", folder)
                inject = f"inject={call}:error={CALLS[call]}:when={when}{onwards}"
                arguments = ["strace", "-f", "-o", "/dev/null", "-e", f"trace={call}", "-e", inject]
                ended = run(arguments + command(program, "--probes", "8"), folder)
                there = [digest(folder / name) for name in NAMES]
                place = f"{inject}: exit code {ended.returncode}, {ended.stderr[-500:]}"
                if "panicked" in ended.stderr or ended.returncode not in (0, 6):
                    sys.exit(f"{place}: not an orderly end")
                if ended.returncode == 0 and there != clean:
                    sys.exit(f"{place}: the files are others")
                # With a file that failed and all after it, the message fails too.
                if ended.returncode == 6 and inject[-1] != "+" and "error" not in ended.stderr:
                    sys.exit(f"{place}: no message")
                if any(now not in (old, new) for now, old, new in zip(there, older, clean)):
                    sys.exit(f"{place}: a file is neither the older nor the new one")
                again = run(command(program, "--probes", "8"), folder)
                if again.returncode != 0 or [digest(folder / name) for name in NAMES] != clean:
                    sys.exit(f"{place}: the next run ends with {again.returncode}, {again.stderr[-500:]}")
                ends[call, ended.returncode] += 1
                shutil.rmtree(folder)
        with open("/dev/full", "w") as full:
            deaf = subprocess.run([program, "bake", "builtin:cornell", "-o", "a.lprt", *OPTIONS], cwd=root / "older", stderr=full)
        if deaf.returncode != 0:
            sys.exit(f"a bake whose log is full ends with {deaf.returncode}")
    for call in {call for call, _ in found} - {"mkdir"}:
        if not ends[call, 6]:
            sys.exit(f"no run ended with 6 for {call}: the calls do not fail")
    for (call, code), count in sorted(ends.items()):
        print(f"{call}: {count} runs ended with {code}")
    print(f"{len(found)} calls that change files failed, each alone and with all after it: no file was lost or half written")


main()
