"""Change lines of the program at random, one at a time, and list the changes that no test notices.

    python -m tests.mutation rig/record rig/instruments/guard.py --tests tests/rig/test_store.py --count 20 --seed 1

A change flips a comparison, moves a number by one, exchanges + and -, `and` and `or`, True and False, or drops a `not`.
It is made in a copy of the tree. The tests run once without a change, where `tests/mutation_lines.py` sees which test
executes which line, and for how long; then with each change those alone that execute its line, the shortest first. Look
at each survivor: it is a missing test, or a change that means nothing. A line that no test executes is listed as well.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PARTS = ("rig", "procedures", "drivers", "calibrations", "tests", "pyproject.toml")
COMPARISONS = {"<": ">=", ">": "<=", "<=": ">", ">=": "<", "==": "!=", "!=": "==", "is not": "is", "is": "is not"}
COMPARISONS |= {"not in": "in", "in": "not in"}
STARTS_S = 20.0  # Python and the imports, on a busy machine
PATIENCE = 10.0  # times as long as without a change: then a test hangs
SWAPS = {"+": "-", "-": "+", "and": "or", "or": "and"}


@dataclass(frozen=True)
class Change:
    """Characters of one line, and what replaces them; lines count from 1."""

    file: str
    line: int
    start: int
    end: int
    new: str

    def made(self, text: str) -> str:
        lines = text.splitlines(keepends=True)
        line = lines[self.line - 1]
        lines[self.line - 1] = line[: self.start] + self.new + line[self.end :]
        return "".join(lines)


def changes(file: str, text: str) -> list[Change]:
    """Every change that can be made in a file, in functions only; one line each."""
    lines = text.splitlines()
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
    found = {
        Change(file, *place)
        for function in functions
        for statement in function.body
        for node in _expressions(statement)
        for place in _places(node, lines)
        if lines[place[0] - 1].isascii()  # offsets count bytes
    }
    return sorted(found, key=lambda change: (change.line, change.start))


def _expressions(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes below, without annotations and what is inside f-strings."""
    yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns") or isinstance(value, ast.JoinedStr):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not isinstance(child, ast.JoinedStr):
                yield from _expressions(child)


def _places(node: ast.AST, lines: list[str]) -> Iterator[tuple[int, int, int, str]]:
    """(line, start, end, new text) of what can be changed in one node."""
    match node:
        case ast.Compare(left=left, comparators=[right]):
            yield from _between(left, right, COMPARISONS, lines)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            yield from _between(left, right, SWAPS, lines)
        case ast.BoolOp(values=[left, right]):
            yield from _between(left, right, SWAPS, lines)
        case ast.UnaryOp(op=ast.Not()):
            yield node.lineno, node.col_offset, node.col_offset + len("not "), ""
        case ast.Constant(value=bool() as value):
            yield node.lineno, node.col_offset, node.end_col_offset or 0, str(not value)
        case ast.Constant(value=int() | float() as value):
            yield node.lineno, node.col_offset, node.end_col_offset or 0, repr(value + 1)


def _between(
    left: ast.expr, right: ast.expr, swaps: dict[str, str], lines: list[str]
) -> Iterator[tuple[int, int, int, str]]:
    if left.end_lineno != right.lineno or left.end_col_offset is None:
        return
    between = lines[right.lineno - 1][left.end_col_offset : right.col_offset]
    operator = between.strip(" ()")
    if operator in swaps:
        start = left.end_col_offset + between.index(operator)
        yield right.lineno, start, start + len(operator), swaps[operator]


@dataclass(frozen=True)
class Traced:
    """A test without a change: how long it takes, and the lines that it executes, by file."""

    test: str
    seconds: float
    lines: Mapping[str, frozenset[int]]


def traced(tree: Path, files: Sequence[str], tests: Sequence[str]) -> list[Traced]:
    """Run all tests in the tree once. Raises SystemExit if one fails."""
    out = tree / "lines.json"
    more = {"MUTATION_FILES": json.dumps([str(tree / file) for file in files]), "MUTATION_OUT": str(out)}
    words = ["-p", "no:xdist", "-p", "tests.mutation_lines", *tests]
    ended = subprocess.run(_pytest(words), cwd=tree, env=_environment(tree) | more, check=False, capture_output=True)
    if ended.returncode:
        raise SystemExit(f"The tests fail without any change:\n{ended.stdout.decode()[-2000:]}")
    return [
        Traced(test, seconds, {str(Path(file).relative_to(tree)): frozenset(each) for file, each in lines.items()})
        for test, seconds, lines in json.loads(out.read_text(encoding="utf-8"))
    ]


def judged(tree: Path, change: Change, tests: Sequence[Traced], most_s: float) -> str:
    """`noticed`, `SURVIVED` or `NO TEST`, by the tests that execute the changed line: the shortest, up to `most_s`."""
    chosen, left_s = list[str](), most_s
    for test in sorted(tests, key=lambda each: each.seconds):
        if change.line in test.lines.get(change.file, ()) and (left_s > 0 or not chosen):
            chosen.append(test.test)
            left_s -= test.seconds
    if not chosen:
        return "NO TEST"
    path = tree / change.file
    text = path.read_text(encoding="utf-8")
    path.write_text(change.made(text), encoding="utf-8")
    try:
        survives = passes(tree, chosen, STARTS_S + PATIENCE * (most_s - left_s))
    finally:
        path.write_text(text, encoding="utf-8")
    return "SURVIVED" if survives else "noticed"


def passes(tree: Path, tests: Sequence[str], timeout_s: float) -> bool:
    """Whether all tests pass; a run that takes too long does not."""
    words = _pytest(["-x", "-p", "no:xdist", *tests])
    try:
        return not subprocess.run(
            words, cwd=tree, env=_environment(tree), capture_output=True, timeout=timeout_s, check=False
        ).returncode
    except subprocess.TimeoutExpired:
        return False


def _pytest(words: Sequence[str]) -> list[str]:
    return [sys.executable, "-m", "pytest", "-q", "-m", "not slow", *words]


def _environment(tree: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}


def _files(place: str) -> list[str]:
    """The Python files of a file or a folder, relative to the repository."""
    path = ROOT / place
    return [place] if path.is_file() else [str(file.relative_to(ROOT)) for file in sorted(path.rglob("*.py"))]


def main() -> None:
    """Print each change, and whether it was noticed; the numbers at the end."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="+", help="files and folders of the program, relative to the repository")
    parser.add_argument("--tests", nargs="+", required=True, help="what pytest runs")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--most-s", type=float, default=60.0, help="of tests for one change")
    asked = parser.parse_args()
    files = [file for place in asked.places for file in _files(place)]
    possible = [change for file in files for change in changes(file, (ROOT / file).read_text(encoding="utf-8"))]
    chosen = random.Random(asked.seed).sample(possible, min(asked.count, len(possible)))
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        for part in PARTS:
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy2
            copy(ROOT / part, tree / part)
        tests = traced(tree, files, asked.tests)
        ends = Counter[str]()
        for change in chosen:
            end = judged(tree, change, tests, asked.most_s)
            ends[end] += 1
            text = (ROOT / change.file).read_text(encoding="utf-8")
            line = change.made(text).splitlines()[change.line - 1].strip()
            print(f"{end:8}  {change.file}:{change.line}  {line}", flush=True)
    print(f"{ends['noticed']} of {ends.total()} changes noticed, {ends['NO TEST']} in lines that no test executes")


if __name__ == "__main__":
    main()
