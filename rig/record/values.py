"""What the record holds, as values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from procedures.session import Pose, Samples


@dataclass(frozen=True)
class Run:
    """One run. `state`: running, complete, stopped or failed; `created` and `ended` are ISO 8601, UTC.

    `rows`: kept poses, or the rows of an imported table.
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


@dataclass(frozen=True)
class Block:
    """A stretch of samples: `volts`, shape (n, channels), from `start_s` on the clock."""

    volts: NDArray[np.float64]
    channels: tuple[str, ...]
    rate_hz: float
    start_s: float


@dataclass(frozen=True)
class Kept:
    """A pose as it was kept: its samples, the middle of its dwell (s), its temperature (C, or unknown)."""

    pose: Pose
    samples: Samples
    t_s: float
    temperature_c: float | None


@dataclass(frozen=True)
class Event:
    """Something that happened in a run."""

    at: str
    what: str
    text: str
