"""Records on which one cause looks like another, and the experiment that would tell: as a regular expression over its
procedure and settings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tests.benchmark.discovery.layouts import Array
from tests.benchmark.discovery.mechanisms import MECHANISMS
from tests.benchmark.discovery.rig import Mechanism, Run, Stand

HOLD = r"soak.*oven_c|temperature-cycle"
FACE = r"sweep.*face.*both|flip"


@dataclass(frozen=True)
class Question:
    """A cause, the record that hides it, and what would tell."""

    mechanism: Mechanism
    experiment: str
    layout: str = ""
    room: str = "breathing"


def _turned_about_z(a: Array, run: Run, size: Array) -> Array:
    c, s = np.cos(size[0]), np.sin(size[0])
    return a @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def _leaning(s: Stand, run: Run, size: Array) -> Stand:
    return replace(s, alpha=s.alpha + size[0])


def _slow_warming(v: Array, run: Run, size: Array) -> Array:
    return v + np.outer(np.exp(-run.u / 40.0), size)


MISALIGNED = frozenset({"axis-misalignment"})
INSEPARABLE: dict[str, Question] = {
    "package turned about z": Question(Mechanism("body", _turned_about_z, MISALIGNED), FACE),
    "alpha's mark": Question(Mechanism("stage", _leaning, frozenset({"stage-zero-offset"})), "level-check"),
    "settling room, bias": Question(MECHANISMS["stressed package"], HOLD, room="settling"),
    "settling room, scale": Question(MECHANISMS["softened beams"], HOLD, room="settling"),
    "rising room": Question(MECHANISMS["stressed package"], HOLD, room="rising"),
    "end of a long warming": Question(
        Mechanism("volts", _slow_warming, frozenset({"warm-up-bias"}), cold=True), "soak"
    ),
    "one inclination": Question(MECHANISMS["drawn-in beams"], r"sweep.*inclinations", layout="upright"),
    "one way round": Question(MECHANISMS["loose gear"], "sweep", layout="one way"),
}
