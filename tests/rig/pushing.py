"""Runs to push, made without a rig; and all that a record holds of one, to compare."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from calibrations.table import Table
from drivers.recorder import Samples
from procedures.session import Pose, Reading
from rig.errors import LabAway
from rig.lab_url import lab_url
from rig.record import KeptPose, Record
from rig.record.push import PushedRun, push, unsent

POSES, SAMPLES = 12, 400
CHANNELS = ("vx", "vy")


def a_run(record: Record, seed: int = 1, state: str = "complete", poses: int = POSES) -> str:
    """A run as the runner leaves it: poses, readings, log, events, the state of a bench without limits."""
    draw = np.random.default_rng(seed)
    bench = {"seed": seed, "instruments": {}, "world": {"limits_deg": [-math.inf, math.inf]}}
    made = {"bench": bench, "identities": {"adc": {"model": "T7"}}, "configuration": "abc", "source": "a test"}
    run = record.begin("sweep", {"step_deg": 0.1 + 0.2}, constants={"sensor": "ADXL203"}, **made)
    for number in range(poses):
        record.log(run, number / 3, "run", "kept", f"pose {number}")
        samples = Samples(draw.normal(2.5, 1e-3, (SAMPLES, 2)), CHANNELS, 1000.0, number / 7)
        kept = KeptPose(Pose(90, 10.0 * number / 3, 1, "A+ to B-"), samples, number / 3, 20 + number / 9)
        record.keep(run, number, kept, {"clock": number})
    record.keep_readings(run, [Reading("level-x", 1 / 3, "deg", None), Reading("bias-x", 2.5, "V", 1e-4)], None)
    record.note(run, "answer mounting", "yes")
    record.set_state(
        run, state, None, {"bias-x": {"value": 2.5, "std": 1e-4, "unit": "V", "limit": None, "verdict": None}}
    )
    return run


def a_table(record: Record) -> str:
    """An imported table, with numbers to the last bit and texts."""
    columns = {"ax": [0.1, 1 / 3], "ay": [1e-300, 2.0], "az": [-0.0, 3.0]}
    return record.add_table(Table.from_columns("positions", columns, {"unit": "g"}, "x.csv", {"path": ("a", "b")}))


def held(record: Record, run: str) -> dict[str, Any]:
    """All that can be read of a run, but for its name."""
    about = {name: value for name, value in asdict(record.run(run)).items() if name != "run"}
    numbers, texts = record.columns(run)
    kept = [
        {**asdict(each), "samples": (each.samples.volts.tobytes(), each.samples.channels, each.samples.start_s)}
        for each in record.kept(run)
    ]
    return about | {
        "kept": kept,
        "dwells": record.dwells(run),
        "readings": record.readings(run),
        "lines": record.lines(run),
        "events": record.events(run),
        "numbers": {name: column.tobytes() for name, column in numbers.items()},
        "texts": texts,
    }


def pushed(own: Record, url: str) -> list[PushedRun]:
    """Push whatever the lab at `url` does not have."""
    with Record(lab_url(url)) as lab:
        return [push(own, lab, run) for run in unsent(own, lab)]


def until_there(own: Record, url: str, most: int = 500) -> tuple[list[PushedRun], int]:
    """Push again after each cut; what went over by the last push, and how many were cut."""
    for cuts in range(most):
        try:
            return pushed(own, url), cuts
        except LabAway:
            continue
    raise AssertionError(f"not there after {most} pushes")
