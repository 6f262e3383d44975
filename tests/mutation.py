"""Change lines of the program at random, one at a time, and list the changes that no test notices.

    python -m tests.mutation rig/record rig/instruments/guard.py --tests tests/rig/test_store.py --count 20 --seed 1

A change flips a comparison, moves a number by one, exchanges + and -, `and` and `or`, True and False, or drops a `not`.
It is made in a copy of the tree. The tests run once without a change, where coverage.py sees which test executes which
line; then with each change those alone that execute its line, the shortest first. They are collected once: each run is
a fork, where the functions of the file get their changed code. Look at each survivor: it is a missing test, or a change
that means nothing. A line that no test executes is listed as well.

The result of some lines is kept for all tests: such a line counts for the test that executed it first. The tool does
not see lines that run at an import, in a compiled kernel or in another process. `--lines FILE` with `--skip N` goes on
where an earlier call was stopped.
"""

from __future__ import annotations

import argparse
import ast
import gc
import json
import multiprocessing
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType
from typing import TextIO

import coverage
import pytest

ROOT = Path(__file__).parents[1]
PARTS = ("rig", "procedures", "drivers", "calibrations", "tests", "docs", "pyproject.toml")
COMPARISONS = {"<": ">=", ">": "<=", "<=": ">", ">=": "<", "==": "!=", "!=": "==", "is not": "is", "is": "is not"}
COMPARISONS |= {"not in": "in", "in": "not in"}
STARTS_S = 30.0  # imports and collection, on a busy machine
PATIENCE = 3.0  # times as long as without a change: then a test hangs
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
    """A test without a change: how long it takes, whether it passes, and the lines that it executes, by file."""

    test: str
    seconds: float
    passes: bool
    lines: Mapping[str, Sequence[int]]


class Judge:
    """A plugin of pytest: each change is tested in a fork of this process, which has collected all tests."""

    def __init__(self, tree: Path, files: Sequence[str], kept: Path, most_s: float) -> None:
        self.tree, self.files, self.kept, self.most_s = tree, files, kept, most_s
        self.changes: Sequence[Change] = ()
        self.out: TextIO = sys.stdout

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Print each change, and whether a test notices it; the numbers at the end."""
        if session.testsfailed:
            raise session.Interrupted("a file of tests cannot be imported")
        if not self.kept.exists():
            _forked(partial(_trace, session, self.tree, self.files, self.kept))
        tests, modules = json.loads(self.kept.read_text(encoding="utf-8"))
        for name in modules:
            with suppress(Exception):
                import_module(name)  # once, not in each fork
        traced = sorted((Traced(*test) for test in tests), key=lambda test: test.seconds)
        for test in traced:
            if not test.passes:
                print(f"LEFT OUT  {test.test}: it fails without a change", file=self.out, flush=True)
        ends = Counter[str]()
        for change in self.changes:
            end = self.judged(session, change, [test for test in traced if test.passes])
            ends[end] += 1
            line = change.made((self.tree / change.file).read_text(encoding="utf-8")).splitlines()[change.line - 1]
            print(f"{end:8}  {change.file}:{change.line}  {line.strip()}", file=self.out, flush=True)
        noticed = f"{ends['noticed']} of {ends.total()} changes noticed"
        print(f"{noticed}, {ends['NO TEST']} in lines that no test executes", file=self.out, flush=True)
        return True

    def judged(self, session: pytest.Session, change: Change, tests: Sequence[Traced]) -> str:
        """`noticed`, `SURVIVED` or `NO TEST`, by the tests that execute the changed line: the first, up to `most_s`."""
        chosen, left_s = list[str](), self.most_s
        for test in tests:
            if change.line in test.lines.get(change.file, ()) and (left_s > 0 or not chosen):
                chosen.append(test.test)
                left_s -= test.seconds
        if not chosen:
            return "NO TEST"
        path = self.tree / change.file
        text = path.read_text(encoding="utf-8")
        path.write_text(change.made(text), encoding="utf-8")
        try:
            timeout_s = STARTS_S + PATIENCE * (self.most_s - left_s)
            return "SURVIVED" if _forked(partial(_passes, session, chosen, path, text), timeout_s) else "noticed"
        finally:
            path.write_text(text, encoding="utf-8")


def _forked(act: Callable[[], bool], timeout_s: float | None = None) -> bool:
    """Whether a function is true in a fork of this process; false if it takes too long."""

    def answer() -> None:
        os.setsid()  # its own children end with it
        is_true = False
        try:
            is_true = act()
        finally:
            os._exit(not is_true)

    fork = multiprocessing.get_context("fork").Process(target=answer)
    fork.start()
    fork.join(timeout_s)
    if fork.exitcode is None and fork.pid:
        os.killpg(fork.pid, signal.SIGKILL)
        fork.join()
    return fork.exitcode == 0


def _passes(session: pytest.Session, tests: Sequence[str], path: Path, text: str) -> bool:
    """Whether the tests pass after the text of this file has changed."""
    _change_functions(path, text)
    items = {item.nodeid: item for item in session.items}
    for item, following in _with_following([items[test] for test in tests]):
        item.ihook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.testsfailed:
            session._setupstate.teardown_exact(None)
            return False
    return True


def _change_functions(path: Path, text: str) -> None:
    """Give the functions of this file, which were made from `text`, the code that the file has now."""
    before, after = (compile(each, path, "exec") for each in (text, path.read_text(encoding="utf-8")))
    pairs = zip(_codes(before), _codes(after), strict=True)
    changed = {(old.co_qualname, old.co_firstlineno): new for old, new in pairs if old != new}
    for made in gc.get_objects():
        if isinstance(made, FunctionType) and made.__code__.co_filename == str(path):
            code = made.__code__
            made.__code__ = changed.get((code.co_qualname, code.co_firstlineno), code)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code and all that is inside it."""
    yield code
    for value in code.co_consts:
        if isinstance(value, CodeType):
            yield from _codes(value)


def _trace(session: pytest.Session, tree: Path, files: Sequence[str], kept: Path) -> bool:
    """Run all tests; write what each of them executes, and the modules that they need."""
    measured = coverage.Coverage(data_file=None, include=[str(tree / file) for file in files])
    seconds, failed = dict[str, float](), set[str]()
    measured.start()
    for item, following in _with_following(session.items):
        measured.switch_context(item.nodeid)
        began, failed_before = time.perf_counter(), session.testsfailed
        item.ihook.pytest_runtest_protocol(item=item, nextitem=following)
        seconds[item.nodeid] = time.perf_counter() - began
        if session.testsfailed > failed_before:
            failed.add(item.nodeid)
    measured.stop()
    lines = defaultdict[str, dict[str, list[int]]](dict)
    data = measured.get_data()
    for file in data.measured_files():
        for line, tests in data.contexts_by_lineno(file).items():
            for test in tests:
                lines[test].setdefault(str(Path(file).relative_to(tree)), []).append(line)
    traced = [(test, taken_s, test not in failed, lines[test]) for test, taken_s in seconds.items()]
    kept.write_text(json.dumps([traced, sorted(sys.modules)]), encoding="utf-8")
    return True


def _with_following(items: Sequence[pytest.Item]) -> Iterator[tuple[pytest.Item, pytest.Item | None]]:
    """Each test and the next one, which decides which fixtures stay."""
    return zip(items, [*items[1:], None], strict=True)


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
    parser.add_argument("--lines", type=Path, help="file that keeps the lines of each test for the next call")
    parser.add_argument("--skip", type=int, default=0, help="changes that an earlier call has judged")
    asked = parser.parse_args()
    files = [file for place in asked.places for file in _files(place)]
    possible = [change for file in files for change in changes(file, (ROOT / file).read_text(encoding="utf-8"))]
    chosen = random.Random(asked.seed).sample(possible, min(asked.count, len(possible)))
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder).resolve()
        for part in PARTS:
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy2
            copy(ROOT / part, tree / part)
        judge = Judge(tree, files, asked.lines or tree / "lines.json", asked.most_s)
        judge.changes = chosen[asked.skip :]
        judge.out = os.fdopen(os.dup(1), "w")
        output = os.open(tree / "output.txt", os.O_WRONLY | os.O_CREAT)
        os.dup2(output, 1)
        os.dup2(output, 2)
        os.chdir(tree)
        os.environ["PYTHONPATH"] = str(tree)
        sys.path.insert(0, str(tree))
        del sys.modules["tests"]  # of the repository
        words = ["-m", "not slow", "-p", "no:xdist", "--basetemp", str(tree / "tmp"), *asked.tests]
        if pytest.main(words, plugins=[judge]):
            print((tree / "output.txt").read_text(encoding="utf-8")[-2000:], file=judge.out)


if __name__ == "__main__":
    main()
