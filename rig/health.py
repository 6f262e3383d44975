"""What a maintainer needs to know of an installation: versions, the record's health, the bench, the last run's log."""

from __future__ import annotations

import os
import platform
import re
import shutil
import sqlite3
import sys
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

from rig.errors import RecordError
from rig.home import home
from rig.record import Record, Run

PACKAGE = "inertial-rig"
LEAST_FREE_BYTES = 1 << 30  # a night's soak takes half of it
MOST_LINES = 20_000  # of a log
SECRET = re.compile("passw|secret|token|credential|api.?key", re.IGNORECASE)
NAME = re.compile(r"[A-Za-z0-9._-]+")


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    what: str
    ok: bool
    said: str


def versions() -> dict[str, Any]:
    """The program, Python, the system, and each package that it needs; None for one that is missing."""
    needed = [line for line in requires(PACKAGE) or () if "extra ==" not in line]
    names = [match[0] for line in needed if (match := NAME.match(line))]
    return {
        PACKAGE: _version(PACKAGE),
        "python": sys.version,
        "system": platform.platform(),
        "sqlite": sqlite3.sqlite_version,
        "packages": {name: _version(name) for name in names},
        "required": needed,
    }


def findings(folder: Path | None = None) -> list[Finding]:
    """Packages, the record's folder, its disk, its file."""
    folder = folder or home()
    missing = [name for name, found in versions()["packages"].items() if found is None]
    place = next(each for each in (folder, *folder.parents) if each.is_dir())
    free = shutil.disk_usage(place).free
    return [
        Finding("packages", not missing, f"missing: {', '.join(missing)}" if missing else "all there"),
        Finding("folder", os.access(place, os.W_OK), f"{folder}{'' if folder.is_dir() else ', not made yet'}"),
        Finding("disk", free > LEAST_FREE_BYTES, f"{free / 1e9:.1f} GB free"),
        _record_finding(folder / "record.db"),
    ]


def _record_finding(file: Path) -> Finding:
    """Whether SQLite finds the record whole."""
    if not file.is_file():
        return Finding("record", True, "nothing is recorded yet")
    try:
        with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            problems = [row[0] for row in connection.execute("PRAGMA integrity_check(10)")]
    except sqlite3.Error as error:
        problems = [str(error)]
    sound = problems == ["ok"]
    size = f"{file.stat().st_size / 1e6:.1f} MB"
    how = "`rig doctor --recover FOLDER` copies what can be read"
    return Finding("record", sound, size if sound else f"damaged: {problems[0]}; {how}")


def last_run(run: str | None = None) -> dict[str, Any] | None:
    """The newest run (or `run`) with its events and the end of its log; None where there is none.

    Raises RecordError where the record cannot be read.
    """
    if not (home() / "record.db").is_file():
        return None
    with Record() as record:
        found = record.run(run) if run else next((each for each in record.runs() if each.bench), None)
        if found is None:
            return None
        lines = record.lines(found.run)[-MOST_LINES:]
        events = record.events(found.run)
    return {**_told(found), "events": [vars(each) for each in events], "log": [vars(line) for line in lines]}


def listed() -> list[dict[str, Any]]:
    """All runs, newest first, in a line each; empty where the record cannot be read."""
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


def _told(run: Run) -> dict[str, Any]:
    return {**vars(run), "bench": without_secrets(run.bench)}


def without_secrets(value: Any) -> Any:
    """The same, with stars for what is called a password, a token or the like."""
    if isinstance(value, Mapping):
        return {key: "***" if SECRET.search(str(key)) else without_secrets(each) for key, each in value.items()}
    return [without_secrets(each) for each in value] if isinstance(value, (list, tuple)) else value


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
