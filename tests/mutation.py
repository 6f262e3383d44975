"""Change lines of the program at random, one at a time, and list the changes that no test notices.

    python -m tests.mutation rig/record/store.py --tests tests/rig/test_store.py --count 20 --seed 1

A change flips a comparison, moves a number by one, exchanges + and -, `and` and `or`, True and False, or drops a `not`.
It is made in a copy of the tree. Look at each survivor: it is a missing test, or a change that means nothing.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PARTS = ("rig", "procedures", "drivers", "calibrations", "tests", "pyproject.toml")
COMPARISONS = {"<": ">=", ">": "<=", "<=": ">", ">=": "<", "==": "!=", "!=": "==", "is not": "is", "is": "is not"}
COMPARISONS |= {"not in": "in", "in": "not in"}
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


def survives(tree: Path, change: Change, tests: list[str], timeout_s: float) -> bool:
    """Whether all tests pass with the change."""
    path = tree / change.file
    text = path.read_text(encoding="utf-8")
    path.write_text(change.made(text), encoding="utf-8")
    try:
        return passes(tree, tests, timeout_s)
    finally:
        path.write_text(text, encoding="utf-8")


def passes(tree: Path, tests: list[str], timeout_s: float) -> bool:
    """Whether all tests pass; a run that takes too long does not."""
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow", *tests]
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        return not subprocess.run(
            words, cwd=tree, env=environment, capture_output=True, timeout=timeout_s, check=False
        ).returncode
    except subprocess.TimeoutExpired:
        return False


def main() -> None:
    """Print each change, and whether it was noticed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", help="files of the program, relative to the repository")
    parser.add_argument("--tests", nargs="+", required=True, help="what pytest runs")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--timeout-s", type=float, default=300.0, help="of one run of the tests")
    asked = parser.parse_args()
    possible = [change for file in asked.files for change in changes(file, (ROOT / file).read_text(encoding="utf-8"))]
    chosen = random.Random(asked.seed).sample(possible, min(asked.count, len(possible)))
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        for part in PARTS:
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy2
            copy(ROOT / part, tree / part)
        if not passes(tree, asked.tests, asked.timeout_s):
            raise SystemExit("The tests fail without any change, or take longer than --timeout-s.")
        survivors = 0
        for change in chosen:
            text = (ROOT / change.file).read_text(encoding="utf-8")
            alive = survives(tree, change, asked.tests, asked.timeout_s)
            survivors += alive
            line = change.made(text).splitlines()[change.line - 1].strip()
            print(f"{'SURVIVED' if alive else 'noticed '}  {change.file}:{change.line}  {line}", flush=True)
    print(f"{survivors} of {len(chosen)} changes survived")


if __name__ == "__main__":
    main()
