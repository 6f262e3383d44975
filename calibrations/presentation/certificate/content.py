"""A certificate as frozen values: who, what, conditions, figures; conformity with limits; and the JSON document.

Terms follow IEEE Std 1293 (K0 bias, K1 scale factor, K2, K3, K_ip ...) and IEEE Std 2700 (zero-g offset, sensitivity).

A value with the expanded uncertainty w conforms by guarded acceptance:

    pass             within the limits by w or more
    conditionalPass  within the limits, by less than w
    conditionalFail  beyond a limit, by less than w
    fail             beyond a limit by w or more

At most 2.5 % of the values that pass are beyond their limit. The probability that the true value is within the limits
assumes a normal distribution about the value.

Source  JCGM 106:2012, 7.3 (probability of conformity) and 8.3.2 (guarded acceptance); ISO/IEC 17025:2017, 7.8.6;
        ILAC-G8:09/2019, 4.2.3 (non-binary statements).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from scipy.special import ndtr

from calibrations.presentation.budget import Source

RULE = (
    "Decision rule: guarded acceptance (JCGM 106, 8.3.2) with a guard band of the expanded uncertainty U inside each "
    "limit. Pass: inside both limits by U or more. Conditional pass: inside, by less than U. Conditional fail: "
    "outside, by less than U. Fail: outside by U or more. Of the results that pass, at most 2.5 % are beyond a limit."
)
Limit = float | tuple[float, float]


@dataclass(frozen=True)
class Decision:
    """A statement of conformity; `probability` that the true value is between `low` and `high`."""

    low: float
    high: float
    statement: str
    probability: float


def decide(value: float, std: float, expanded: float, limit: Limit) -> Decision:
    """The statement for a limit of the magnitude, or for a (lowest, highest) value."""
    low, high = limit if isinstance(limit, tuple) else (-limit, limit)
    margin = min(value - low, high - value)
    if margin >= 0:
        statement = "pass" if margin >= expanded else "conditionalPass"
    else:
        statement = "fail" if margin <= -expanded else "conditionalFail"
    probability = float(ndtr((high - value) / std) - ndtr((low - value) / std)) if std > 0 else float(margin >= 0)
    return Decision(low, high, statement, probability)


UNSTATED = "not stated"


@dataclass(frozen=True)
class Laboratory:
    """The calibrating laboratory. `country` is its ISO 3166 code, ZZ if not stated."""

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
class SimulatedInterval:
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
    """One result. `found` is the value (and standard uncertainty) of the previous calibration. `weights` has the number
    of each row of the data and its share in the result, greatest first; the shares add up to 1.
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
    simulated: SimulatedInterval
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
    """The figures of a fit: results, errors, budget sources not given, trials of the simulation, remarks.

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
    reference: str = ""

    @property
    def headline(self) -> str:
        """Kind of document and sensor; a simulated calibration is named as such."""
        kind = "Simulated calibration, no certificate" if self.simulated else "Calibration certificate"
        return f"{kind}: {self.sensor}, {self.serial}"


def document(c: Certificate) -> dict[str, Any]:
    """Plain mappings; an infinite value is null."""
    fields = asdict(c)
    figures = fields.pop("figures")
    outcomes = [_outcome(o) for o in c.figures.outcomes]
    result: dict[str, Any] = _finite({"schema": "rig.certificate/1", **fields, **figures, "outcomes": outcomes})
    return result


def _outcome(o: Outcome) -> dict[str, Any]:
    return {**asdict(o), "expanded": o.expanded, "weights": {str(number): share for number, share in o.weights}}


def _finite(value: Any) -> Any:
    """JSON has no infinity: no limit is null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, (list, tuple)) else value
