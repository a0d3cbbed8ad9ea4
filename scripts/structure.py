#!/usr/bin/env python3
"""Lines of Rust by crate, and import cycles between the top-level modules of each crate. Exit code 1 if there is one.

    scripts/structure.py [--lines]

Lines are those that are neither blank, nor comment, nor test. Imports are `crate::` paths outside of tests.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
CRATES = ["formats", "scenes", "scenes/surfaces", "scenes/tools", "runtime", "systems", "precompute", "precompute/bucket", "runtime/viewer"]


def without_tests(text):
    """The text up to its test module, which stands last by custom."""
    return re.split(r"^#\[cfg\((?:all\()?test\b[^\n]*\n(?:#\[[^\n]*\n)*mod \w+ \{", text, maxsplit=1, flags=re.M)[0]


def is_test(path):
    return path.stem in ("tests", "test_scenes", "test_bake", "test_gpu", "layout_test") or "tests" in path.parts


def imports(text):
    """Top-level modules that `crate::` paths name, in groups of braces too."""
    text = re.sub(r"//[^\n]*", "", text)
    for found in re.finditer(r"\bcrate::", text):
        rest = text[found.end():]
        if not rest.startswith("{"):
            yield re.match(r"\w+", rest).group()
            continue
        depth, start = 0, 1
        for place, letter in enumerate(rest):
            depth += (letter == "{") - (letter == "}")
            if depth == 1 and letter in "{,":
                start = place + 1
            if name := re.match(r"\s*(\w+)", rest[start:]) if depth == 1 and letter in "{," else None:
                yield name.group(1)
            if depth == 0:
                break


def cycles(graph):
    """Strongly connected sets of more than one module (Tarjan 1972)."""
    index, low, stack, found = {}, {}, [], []

    def visit(node):
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in graph[node]:
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            members = stack[stack.index(node):]
            del stack[stack.index(node):]
            if len(members) > 1:
                found.append(sorted(members))

    for node in graph:
        if node not in index:
            visit(node)
    return found


def main():
    failed = False
    for crate in CRATES:
        source = ROOT / crate / "src"
        files = [path for path in sorted(source.rglob("*.rs")) if not is_test(path.relative_to(source))]
        graph, lines = {}, 0
        for path in files:
            text = without_tests(path.read_text())
            lines += sum(1 for line in text.splitlines() if line.strip() and not line.strip().startswith("//"))
            module = path.relative_to(source).parts[0].removesuffix(".rs")
            if module not in ("lib", "main"):
                graph.setdefault(module, set()).update(imports(text))
        for module, used in graph.items():
            graph[module] = sorted(name for name in used if name in graph and name != module)
        found = cycles(graph)
        if "--lines" in sys.argv:
            print(f"{crate}: {lines} lines")
        for members in found:
            failed = True
            edges = [f"{a} -> {b}" for a in members for b in graph[a] if b in members]
            print(f"{crate}: cycle of {', '.join(members)}: {'; '.join(edges)}")
    sys.exit(failed)


if __name__ == "__main__":
    main()
