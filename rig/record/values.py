"""The values in the record: runs, poses, events, lines of the log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from calibrations.text import as_written, count_words
from drivers.recorder import Samples
from procedures.session import Dwell, Pose

TURNS_AND_RESTS = ("turn or rest", "turns and rests")
ROW_WORDS = {  # of one and of many rows of a run, by its kind
    "poses": ("pose", "poses"),
    "positions": ("position", "positions"),
    "rates": TURNS_AND_RESTS,
    "turns": TURNS_AND_RESTS,
}


@dataclass(frozen=True)
class Run:
    """One run. `state`: running, complete, stopped or failed; `created` and `ended` are ISO 8601, UTC.

    `rows`: number of poses, or of rows of an imported table. `uid`: the same in all copies of the run; "" for runs of
    older programs.
    """

    run: str
    kind: str
    procedure: str
    state: str
    settings: Mapping[str, Any]
    bench: Mapping[str, Any]
    identities: Mapping[str, Any]
    configuration: str
    constants: Mapping[str, str | float]
    source: str
    created: str
    ended: str | None
    message: str | None
    results: Mapping[str, Any]
    rows: int
    uid: str = ""

    @property
    def sensors(self) -> dict[str, str]:
        """Each name and serial number of a sensor -> its name in the batch, "" without a batch, or for several."""
        if batch := self.bench.get("sensors"):
            names_of = {member: {member, *_names(sensor, "name")} for member, sensor in batch.items()}
            owners = {name: [m for m in names_of if name in names_of[m]] for name in set().union(*names_of.values())}
            return {name: members[0] if len(members) == 1 else "" for name, members in sorted(owners.items())}
        return dict.fromkeys(_names(self.constants, "sensor"), "")

    @property
    def batch(self) -> tuple[str, ...]:
        """The names of the sensors of the batch, in order; empty without a batch."""
        return tuple(self.bench.get("sensors") or ())

    @property
    def data(self) -> list[str]:
        """The names that its data have in commands: `RUN`, or `RUN/SENSOR` of each sensor of a batch."""
        return [f"{self.run}/{sensor}" for sensor in self.batch] or [self.run]

    @property
    def instruments(self) -> dict[str, str]:
        """The identity of each instrument by its role, as text."""
        return {
            role: " ".join(str(part) for part in identity.values() if part)
            for role, identity in self.identities.items()
        }

    @property
    def extent(self) -> str:
        """The number of poses, rows or turns, as text. A record without gaps consists of many blocks."""
        if not self.bench:
            return count_words(self.rows, "row", "rows")
        if not self.rows:
            return "no poses"
        singular, plural = ROW_WORDS.get(self.kind, ("pose or block", "poses and blocks"))
        return count_words(self.rows, singular, plural)


@dataclass(frozen=True)
class KeptPose:
    """A recorded pose: its samples, the middle of its dwell (s), its temperature (C, or None)."""

    pose: Pose
    samples: Samples
    t_s: float
    temperature_c: float | None
    excluded: str | None = None  # reason of the exclusion from every analysis
    alpha_read_deg: float | None = None  # reading of the dial of a manual stage
    beta_read_deg: float | None = None
    number: int = 0  # in the run, from 0; excluded poses count

    @cached_property
    def dwell(self) -> Dwell:
        """Mean and standard deviation of every channel."""
        volts, names = self.samples.volts, self.samples.channels
        stds = volts.std(axis=0, ddof=1) if len(volts) > 1 else np.zeros(len(names))
        means = dict(zip(names, volts.mean(axis=0).tolist(), strict=True))
        return Dwell(
            self.pose, self.t_s, means, dict(zip(names, stds.tolist(), strict=True)), len(volts), self.temperature_c
        )


@dataclass(frozen=True)
class LogLine:
    """One line of a run's log: when (ISO 8601, UTC, and the rig's clock), who, what, and its text."""

    at: str
    clock_s: float
    who: str
    what: str
    text: str


CHANGED = "program changed"  # event: the poses from here on were measured by another program or procedure


@dataclass(frozen=True)
class Event:
    """An event of a run."""

    at: str
    what: str
    text: str


def _names(sensor: Mapping[str, Any], key: str) -> list[str]:
    return [as_written(sensor[name]) for name in (key, "serial") if sensor.get(name)]
