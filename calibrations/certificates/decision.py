"""Conformity of a value with its limits, where the value is uncertain: guarded acceptance.

    pass             within the limits by the guard band w or more
    conditionalPass  within the limits, by less than w
    conditionalFail  beyond a limit, by less than w
    fail             beyond a limit by w or more

w is the expanded uncertainty: of what passes, at most 2.5 % is beyond its limit. The probability that the true value is
within the limits is given beside, for a normal distribution about the value.

Source  JCGM 106:2012, 7.3 (probability of conformity) and 8.3.2 (guarded acceptance); ISO/IEC 17025:2017, 7.8.6;
        ILAC-G8:09/2019, 4.2.3 (non-binary statements).
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy.special import ndtr

RULE = (
    "Decision rule: guarded acceptance (JCGM 106, 8.3.2) with a guard band of the expanded uncertainty U inside each "
    "limit. Pass: inside both limits by U or more. Conditional pass: inside, by less than U. Conditional fail: "
    "outside, by less than U. Fail: outside by U or more. Of what passes, at most 2.5 % is beyond its limit."
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
    inside = min(value - low, high - value)
    if inside >= 0:
        statement = "pass" if inside >= expanded else "conditionalPass"
    else:
        statement = "fail" if inside <= -expanded else "conditionalFail"
    probability = float(ndtr((high - value) / std) - ndtr((low - value) / std)) if std > 0 else float(inside >= 0)
    return Decision(low, high, statement, probability)
