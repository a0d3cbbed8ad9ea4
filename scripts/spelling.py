#!/usr/bin/env python3
"""Spelling: American in code, comments and prose. Lists British words in tracked files; exit status 1 if there are any.

Not of these: `metre`, the unit as SI spells it, and `cancelled`, which the ecosystem's names have.
"""
import re
import subprocess
import sys
from pathlib import Path

# Beginnings of words, whatever their end.
BRITISH = re.compile(
    r"(?<![a-z])(colour|centre|neighbour|grey|behaviour|favour|honour|labour|analys(?:e|ing)\b|catalogue|modelling|travell"
    r"|labell|artefact|programme\b|storey|towards\b|whilst|judgement|acknowledgement|centring|cent(?:red)\b"
    r"|(?:normal|optim|initial|serial|raster|voxel|quant|random|organ|minim|maxim|recogn|summar|visual|real|character|discret"
    r"|parametr|linear|synchron|util|priorit|emphas|general|special|local|token|vector|factor)is(?:e|ed|es|ing|ation|er|ers)\b)",
    re.IGNORECASE)
READ = {".rs", ".md", ".wgsl", ".py", ".sh", ".toml", ".js", ".css", ".html"}


def main():
    root = Path(__file__).resolve().parent.parent
    listed = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True).stdout.split("\n")
    found = 0
    for name in listed:
        path = root / name
        if path.suffix not in READ or not path.is_file() or path == Path(__file__).resolve():
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").split("\n"), 1):
            for word in BRITISH.finditer(line):
                found += 1
                print(f"{name}:{number}: {word.group(0)}", file=sys.stderr)
    sys.exit(found > 0)


if __name__ == "__main__":
    main()
