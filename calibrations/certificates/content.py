"""All that a certificate says, as frozen values: what HTML, PDF and XML are written from.

Terms follow IEEE Std 1293 (K0 bias, K1 scale factor, K2, K3, K_ip ...) and IEEE Std 2700 (zero-g offset, sensitivity).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from calibrations.certificates.decision import Decision

UNSTATED = "not stated"


@dataclass(frozen=True)
class Laboratory:
    """Who calibrates. `country` is its ISO 3166 code, ZZ where nobody said."""

    name: str = UNSTATED
    person: str = UNSTATED
    role: str = "head of the laboratory"
    email: str = ""
    street: str = ""
    post_code: str = ""
    city: str = UNSTATED
    country: str = "ZZ"


@dataclass(frozen=True)
class Instrument:
    """One instrument of the rig, as it identified itself, and its own certificate."""

    role: str
    model: str
    serial: str = ""
    firmware: str = ""
    certificate: str = ""
    due: str = ""
    expired: bool = False


@dataclass(frozen=True)
class Condition:
    """An influence while the sensor was measured: lowest, mean and highest value."""

    name: str
    unit: str
    low: float
    mean: float
    high: float


@dataclass(frozen=True)
class Source:
    """One line of a budget: `contribution` in the result's unit, `sensitivity` and `std` None for type A."""

    name: str
    kind: str
    unit: str
    std: float | None
    sensitivity: float | None
    contribution: float
    freedom: float


@dataclass(frozen=True)
class Simulated:
    """The same result by the propagation of distributions: standard deviation and 95 % interval.

    `verdict` on the budget: confirmed, conservative (and `why`, where it is known), or widened to the simulation.
    """

    std: float
    low: float
    high: float
    verdict: str
    why: str = ""


@dataclass(frozen=True)
class Outcome:
    """One result. `found` is the value (and standard uncertainty) of the calibration before; `weights` says how much
    each row of the data weighs in it, greatest first, by the row's number and as shares that add up to 1.
    """

    name: str
    term: str
    effect: str
    parameter: str
    axis: str
    unit: str
    value: float
    std: float
    coverage: float
    freedom: float
    sources: tuple[Source, ...]
    simulated: Simulated
    found: tuple[float, float | None] | None
    decision: Decision | None
    weights: tuple[tuple[int, float], ...]

    @property
    def expanded(self) -> float:
        """Expanded uncertainty, about 95 %."""
        return self.coverage * self.std


@dataclass(frozen=True)
class Error:
    """Error of indication of one axis over the data, in `unit`: rms and greatest; as found None where not known."""

    axis: str
    unit: str
    found: tuple[float, float] | None
    left: tuple[float, float]


@dataclass(frozen=True)
class Sample:
    """One row of the data: the number of the pose in its run, where and when, and the digest of its samples."""

    number: int
    t_s: float | None
    place: str
    means: tuple[float, ...]
    n: int
    sha256: str


@dataclass(frozen=True)
class Figures:
    """What a fit gives: results, errors, budget sources that nobody gave, trials of the simulation, remarks.

    `correlations` has a row and a column for each of the results, in their order.
    """

    model: str
    outcomes: tuple[Outcome, ...]
    errors: tuple[Error, ...]
    not_given: tuple[str, ...]
    trials: int
    remarks: tuple[str, ...]
    correlations: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Certificate:
    """A whole certificate. Dates are ISO 8601; `facts` of procedure and run by name."""

    number: str
    issued: str
    program: str
    laboratory: Laboratory
    customer: str
    sensor: str
    serial: str
    manufacturer: str
    rig: str
    instruments: tuple[Instrument, ...]
    procedure: str
    facts: Mapping[str, str]
    began: str
    ended: str
    gravity_m_s2: float
    conditions: tuple[Condition, ...]
    before: str
    figures: Figures
    samples: tuple[Sample, ...]
    data: str
    data_sha256: str
    model_sha256: str
    remarks: tuple[str, ...]
    simulated: bool = False

    @property
    def headline(self) -> str:
        """What it is, and of what; a simulation is not passed off as a measurement."""
        kind = "Simulated calibration, no certificate" if self.simulated else "Calibration certificate"
        return f"{kind}: {self.sensor}, {self.serial}"
