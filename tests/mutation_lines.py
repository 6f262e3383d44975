"""A plugin of pytest for `tests.mutation`: which test executes which lines of some files, and for how long.

MUTATION_FILES lists the files (JSON), MUTATION_OUT is written: [test, seconds, {file: [line, ...]}] of each. A line
that runs once for all tests, because its result is kept, belongs to the first test. Other processes are not seen.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Generator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

FILES = frozenset(json.loads(os.environ.get("MUTATION_FILES", "[]")))
done: list[tuple[str, float, dict[str, list[int]]]] = []
seen: dict[str, set[int]] = {}


def _called(frame: FrameType, event: str, value: Any) -> Callable[..., Any] | None:
    """Follow a function if it is in one of the files."""
    if frame.f_code.co_filename not in FILES:
        return None
    seen.setdefault(frame.f_code.co_filename, set()).add(frame.f_lineno)
    return _stepped


def _stepped(frame: FrameType, event: str, value: Any) -> Callable[..., Any]:
    seen[frame.f_code.co_filename].add(frame.f_lineno)
    return _stepped


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Trace one test with its fixtures."""
    seen.update({file: set() for file in FILES})
    began = time.process_time()
    sys.settrace(_called)
    threading.settrace(_called)
    try:
        return (yield)
    finally:
        sys.settrace(None)
        threading.settrace(None)
        lines = {file: sorted(each) for file, each in seen.items() if each}
        done.append((item.nodeid, time.process_time() - began, lines))


def pytest_sessionfinish() -> None:
    """Write the file."""
    Path(os.environ["MUTATION_OUT"]).write_text(json.dumps(done), encoding="utf-8")
