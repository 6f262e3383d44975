"""What is odd in the samples of a still record, in words: wild ones, a stretch that is constant, coarse steps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from calibrations.noise_analysis.hidden import Hidden
from calibrations.noise_analysis.outliers import Wild
from calibrations.noise_analysis.stuck import Run

WILD, CONSTANT, COARSE = "wild-samples", "constant-stretch", "coarse-steps"


@dataclass(frozen=True)
class Oddity:
    """`kind`, a text, and whether it moves the level of white noise by more than that is uncertain; `hidden`: the noise
    below a converter's steps, where that is what is odd."""

    kind: str
    text: str
    matters: bool
    hidden: Hidden | None = None


def hidden_in(found: Iterable[Oddity]) -> Hidden | None:
    """The noise that a converter's steps hide; None where they hide none."""
    return next((each.hidden for each in found if each.hidden is not None), None)


def oddities(
    wild: Wild, stuck: Run | None, hidden: Hidden | None, n: int, rate_hz: float, variance: float
) -> tuple[Oddity, ...]:
    """Of a record of n samples, whose neighbours have the Allan variance `variance`."""
    found = []
    if wild.count:
        found.append(_wild(wild, n, rate_hz, variance))
    if stuck is not None and hidden is None:  # below a step, samples are the same for long
        start_s, length_s = stuck.start / rate_hz, stuck.length / rate_hz
        text = f"{stuck.length} samples from t = {start_s:.6g} s on are all the same, for {length_s:.4g} s"
        found.append(Oddity(CONSTANT, text, stuck.length / n > _uncertain(n)))
    if hidden is not None:
        found.append(Oddity(COARSE, hidden.text, True, hidden))
    return tuple(found)


def _wild(wild: Wild, n: int, rate_hz: float, variance: float) -> Oddity:
    share = min(1.0, wild.power / (n * variance))
    many = "a single sample is" if wild.count == 1 else f"{wild.count} single samples are"
    text = (
        f"{many} far from the neighbours, by {wild.deviations:.3g} standard deviations at "
        f"t = {wild.wildest / rate_hz:.6g} s (sample {wild.wildest + 1}): {100 * share:.2g} % of the noise's power"
    )
    return Oddity(WILD, text, share > _uncertain(n))


def _uncertain(n: int) -> float:
    """Relative standard uncertainty of the power of white noise, of n samples."""
    return float(np.sqrt(2 / n))
