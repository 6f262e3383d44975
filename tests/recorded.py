"""Records of standard runs: each is made once per session, shared by all workers, and copied where it is needed."""

from __future__ import annotations

import contextlib
import fcntl
import io
import os
import shutil
from collections.abc import Mapping
from datetime import datetime, timedelta, tzinfo
from pathlib import Path

import pytest

from rig.cli import main

SWEEP = ("run", "sweep", "--inclinations-deg", "90,30,150", "--step-deg", "20", "--dwell-s", "1", "--unattended")
RECORDS: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "sweep": (SWEEP,),
    "noise-floor": (("run", "noise-floor", "--duration-s", "60", "--unattended"),),
    "motion": (("run", "motion", "--unattended", "--duration-s", "20", "--still-s", "10"),),
    "laboratory": (  # after those of "sweep"
        ("run", "noise-floor", "--duration-s", "60", "--unattended"),
        ("run", "motion", "--unattended", "--duration-s", "20", "--still-s", "10"),
        ("run", "misalignment", "--unattended", "--dwell-s", "1"),
        ("run", "soak", "--unattended", "--duration-s", "1200", "--interval-s", "300", "--off-s", "60"),
        ("run", "check-standard", "--unattended"),
        ("run", "check-standard", "--unattended"),
        ("run", "level-check", "--unattended"),
    ),
}
CONTINUED = {"laboratory": "sweep"}  # the record that another begins with


class Dated(datetime):
    """A calendar for runs: the same days and identifiers in every session, a month between runs."""

    today_is = datetime(2026, 1, 1)  # noqa: DTZ001 its zone is given below

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> datetime:  # type: ignore[override]
        return cls.today_is.replace(tzinfo=tz)


def command(*words: str) -> tuple[int, str, str]:
    """Call a command in this process: its exit status, standard output and standard error."""
    out, err, status = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(words)
        except SystemExit as ended:
            status = int(ended.code or 0)
    return status, out.getvalue(), err.getvalue()


def shared_folder(factory: pytest.TempPathFactory) -> Path:
    """A folder that all workers of this session have in common."""
    own = factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


def record(factory: pytest.TempPathFactory, name: str) -> Path:
    """The folder of the record `name`; made by whoever needs it first, while others wait. Copy it before a change."""
    made = shared_folder(factory) / "records" / name
    made.parent.mkdir(exist_ok=True)
    with made.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not made.exists():
            begun = made.with_suffix(".begun")
            shutil.rmtree(begun, ignore_errors=True)
            earlier = CONTINUED.get(name)
            if earlier is not None:
                shutil.copytree(record(factory, earlier), begun)
            with pytest.MonkeyPatch.context() as patch:
                patch.setenv("RIG_HOME", str(begun))
                patch.setattr("rig.record.rows.datetime", Dated)
                patch.setattr("rig.record.rows.secrets.token_hex", lambda _: "000")
                for month, words in enumerate(RECORDS[name], len(RECORDS.get(earlier or "", ()))):
                    patch.setattr(Dated, "today_is", datetime(2026, 1, 1, 12) + timedelta(days=30 * month))  # noqa: DTZ001
                    status, _, err = command(*words)
                    assert status == 0, err
            begun.rename(made)
    return made
