"""The state of an installation, for a maintainer: versions, the record, the bench, the log of the last run.

A damaged installation has to be described too: a module that may need a damaged package is imported where it is used.
"""

from __future__ import annotations

import importlib
import os
import platform
import re
import sqlite3
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, packages_distributions, requires, version
from pathlib import Path
from typing import Any

from rig.errors import RecordError
from rig.files import free_bytes, home

PACKAGE = "inertial-rig"
LEAST_FREE_BYTES = 1 << 30  # a soak of a night takes half of it
MOST_LINES = 20_000  # of the log
SECRET = re.compile("passw|secret|token|credential|api.?key", re.IGNORECASE)
NAME = re.compile(r"[A-Za-z0-9._-]+")


@dataclass(frozen=True)
class Finding:
    """The result of one check."""

    what: str
    ok: bool
    detail: str


def versions() -> dict[str, Any]:
    """Versions of the program, Python, the system, and each required package; None for a missing package."""
    requirements = [line for line in requires(PACKAGE) or () if "extra ==" not in line]
    names = [match[0] for line in requirements if (match := NAME.match(line))]
    return {
        PACKAGE: _version(PACKAGE),
        "python": sys.version,
        "system": platform.platform(),
        "sqlite": sqlite3.sqlite_version,
        "packages": {name: _version(name) for name in names},
        "required": requirements,
    }


def findings(folder: Path | None = None) -> list[Finding]:
    """Checks of the packages, the folder of the record, its disk and its file."""
    folder = folder or home()
    faults = list(package_faults())
    existing = next(place for place in (folder, *folder.parents) if place.is_dir())
    free = free_bytes(folder)
    return [
        Finding("packages", not faults, "; ".join(faults) or "all installed"),
        Finding("folder", os.access(existing, os.W_OK), f"{folder}{'' if folder.is_dir() else ', not made yet'}"),
        Finding("disk", free > LEAST_FREE_BYTES, f"{free / 1e9:.1f} GB free"),
        _record_finding(folder / "record.db"),
    ]


def package_faults() -> Iterator[str]:
    """Each required package that is missing or cannot be imported."""
    modules = defaultdict(list)
    for module, names in packages_distributions().items():
        for name in names:
            modules[name.lower()].append(module)
    for name, number in versions()["packages"].items():
        if number is None:
            yield f"missing: {name}"
        for module in modules[name.lower()]:
            if module.isidentifier() and not module.startswith("_"):
                try:
                    importlib.import_module(module)
                except Exception as error:  # a damaged file may raise anything
                    yield f"{name} {number} cannot be imported ({type(error).__name__}: {error}); install it again"


def collect_part(part: Callable[[], Any]) -> Any:
    """The result of `part`, or the error that it raises, as a document."""
    try:
        return part()
    except Exception as error:  # one damaged part hides no other
        return {"error": f"{type(error).__name__}: {error}"}


def _record_finding(file: Path) -> Finding:
    """The integrity check of SQLite."""
    if not file.is_file():
        return Finding("record", True, "there is no run yet")
    try:
        with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            problems = [row[0] for row in connection.execute("PRAGMA integrity_check(10)")]
        if problems == ["ok"]:
            from rig.record import Record

            with Record(file.parent) as record:
                problems = [*record.damaged_runs(), *record.damaged_rows()] or ["ok"]
    except ImportError as error:
        return Finding("record", False, f"not checked: {error}")
    except (sqlite3.Error, RecordError) as error:
        problems = [str(error)]
    sound = problems == ["ok"]
    size = f"{file.stat().st_size / 1e6:.1f} MB"
    remedy = "`rig doctor --recover FOLDER` copies the readable rows"
    return Finding("record", sound, size if sound else f"damaged: {problems[0]}; {remedy}")


def last_run(run: str | None = None) -> dict[str, Any] | None:
    """The newest run (or `run`) with its events and the end of its log; None without a run.

    Raises RecordError if the record cannot be read.
    """
    if not (home() / "record.db").is_file():
        return None
    from rig.record import Record

    with Record() as record:
        selected = record.run(run) if run else next((any_run for any_run in record.runs() if any_run.bench), None)
        if selected is None:
            return None
        lines = record.lines(selected.run)[-MOST_LINES:]
        events = record.events(selected.run)
    document = {**vars(selected), "bench": without_secrets(selected.bench)}
    return {**document, "events": [vars(event) for event in events], "log": [vars(line) for line in lines]}


def list_runs() -> list[dict[str, Any]]:
    """A summary of all runs, newest first; empty if the record cannot be read."""
    from rig.record import Record

    try:
        with Record() as record:
            return [
                {
                    "run": run.run,
                    "procedure": run.procedure,
                    "state": run.state,
                    "rows": run.rows,
                    "message": run.message,
                }
                for run in record.runs()
            ]
    except RecordError:
        return []


def without_secrets(value: Any) -> Any:
    """The value with stars in place of passwords, tokens and similar keys."""
    if isinstance(value, Mapping):
        return {key: "***" if SECRET.search(str(key)) else without_secrets(part) for key, part in value.items()}
    return [without_secrets(part) for part in value] if isinstance(value, (list, tuple)) else value


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
