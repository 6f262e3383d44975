"""A noise analysis in words: coefficients in units that sensor engineers use, the Allan deviation as a table."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from calibrations.noise_analysis.analysis import Coefficient, NoiseAnalysis
from calibrations.noise_analysis.minimum import minimum_s
from calibrations.noise_analysis.oddities import COARSE, hidden_in
from calibrations.numerals import exponent
from calibrations.still.disturbed import Disturbed
from calibrations.still.telegraph import TWO_LEVELS
from calibrations.still.words import sentence
from rig.analysis.stream import Stream, repairs
from rig.cli.output import columns
from rig.numerals import duration

PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "u"), (1e9, "n"), (1e12, "p"))
MEANS = {
    "white-noise": "velocity or angle random walk",
    "flicker-noise": "bias instability",
    "rate-random-walk": "the bias wanders",
    "quantisation-noise": "of the output's sum over time",
    "sinusoidal-noise": "amplitude",
    "gauss-markov-noise": "standard deviation",
}
NOISE = (COARSE, TWO_LEVELS)  # what is told beside the coefficients, and is noise
MISFIT = 1.3  # of the spectrum, beyond which the processes do not describe it
Factor = tuple[float, str]


def summary(samples: Stream, found: NoiseAnalysis, told: Disturbed) -> str:
    """All that there is to say, for a terminal."""
    length_s = found.n / found.rate_hz
    head = (
        f"{samples.source}, {samples.channel}: {found.n} samples at {found.rate_hz:g} Hz, {duration(length_s)}\n"
        if length_s >= 1
        else f"{samples.source}, {samples.channel}: {found.n} samples at {found.rate_hz:g} Hz\n"
    )
    said = [head, _coefficients(samples, found), "", *_disturbances(found, told)]
    return "\n".join([*said, _density(samples, found), "", _allan(found)])


def remarks(samples: Stream, found: NoiseAnalysis, told: Disturbed) -> Iterable[str]:
    """What was done to the data, and what to be careful about."""
    if samples.others:
        yield f"Channel {samples.channel}; --channel takes another: {', '.join(samples.others)}."
    yield from repairs(samples, found.n)
    if np.isfinite(samples.corner_hz):
        yield (
            f"Coefficients are those before the output's {samples.corner_hz:g} Hz low-pass, "
            f"from what is slower than {samples.corner_hz / 2:.3g} Hz."
        )
    hidden = hidden_in(found.record.oddities)
    unknown = [name for name in found.found.power if not found.coefficients[name].identified]
    if doubtful := [name for name in unknown if hidden is None or not hidden.hides(name)]:
        yield f"There is slow noise; the record cannot tell of which kind ({', '.join(doubtful)}?): record for longer."
    if found.misfit > MISFIT and not told.disturbances:
        yield (
            f"The spectrum is {found.misfit:.2g} times as far from these processes as chance leaves it: there is "
            "something else (a filter, a resonance, a disturbance); look at the pictures (--pictures FOLDER)."
        )


def whole_samples(asked_s: Iterable[float], found: NoiseAnalysis) -> Iterable[str]:
    """Which averaging times were asked for and are no whole numbers of samples."""
    for asked, taken in zip(asked_s, found.allan.tau_s.tolist(), strict=False):
        if not np.isclose(asked, taken):
            yield f"An averaging time of {asked:g} s is no whole number of samples: {taken:g} s is taken."


def _coefficients(samples: Stream, found: NoiseAnalysis) -> str:
    second = samples.sensed
    rows = []
    for name, each in found.coefficients.items():
        beside = () if second is None else (_shown(each, second.factor, second.unit),)
        rows.append((name, _shown(each, 1.0, found.unit), *beside, MEANS[name] + _detail(each)))
    head = ("process", "coefficient", *(() if second is None else ("or",)), "")
    return columns(head, rows)


def _disturbances(found: NoiseAnalysis, told: Disturbed) -> Iterable[str]:
    """What is no noise, what it spoils, and what the coefficients are without it."""
    for each in (each for each in told.disturbances if each.kind in NOISE):
        yield f"{sentence(each.text)}\n"
    others = [each for each in told.disturbances if each.kind not in NOISE]
    if not others:
        return
    yield "There is something that is no noise:"
    for each in others:
        spoilt = f"; it spoils {' and '.join(each.spoils)}" if each.spoils else ""
        yield f"  {each.text}{spoilt if each.matters else '; too little to matter'}"
    if told.rest is not None:
        changed = {name for each in told.disturbances for name in each.spoils}
        yield "Without what could be taken off:"
        for name in (name for name in found.coefficients if name in changed):
            each_left = told.rest.coefficients[name]
            yield f"  {name}: {_shown(each_left, 1.0, found.unit)}{_detail(each_left)}"
    yield ""


def _detail(each: Coefficient) -> str:
    if each.frequency_hz is not None:
        return f", {each.frequency_hz:.6g} Hz"
    return f", time constant {each.time_constant_s:.3g} s" if each.time_constant_s and each.identified else ""


def _shown(each: Coefficient, factor: float, unit: str) -> str:
    """`12.34(56) uV/sqrt(Hz)`, or the bound that it stays below."""
    per = each.unit.removeprefix(_base(each.unit))
    if each.upper is not None and np.isinf(each.upper):
        return "not known"
    if each.upper is not None:
        scale, prefix = _prefixed(each.upper * factor, unit)
        return f"not identified, below {each.upper * factor * scale:.2g} {prefix}{unit}{per}"
    value, std = each.value * factor, each.std * factor
    scale, prefix = _prefixed(value, unit)
    digits = min(9, max(0, 1 - exponent(float(f"{std * scale:.1e}"))))
    last = round(std * scale * 10**digits)
    return f"{value * scale:.{digits}f}({last}) {prefix}{unit}{per}"


def _base(unit: str) -> str:
    for per in ("/sqrt(Hz)", "/sqrt(s)", "*s"):
        if unit.endswith(per):
            return unit.removesuffix(per)
    return unit


def _prefixed(value: float, unit: str) -> Factor:
    """The factor and prefix with which a value reads best; counts and compound units have none."""
    if unit not in ("V", "g"):
        return 1.0, ""
    return next(((f, p) for f, p in PREFIXES if abs(value) * f >= 1), (1.0, ""))


def _density(samples: Stream, found: NoiseAnalysis) -> str:
    """White noise as data sheets give it: one-sided, and so sqrt(2) times the coefficient of the Allan deviation."""
    white = found.coefficients["white-noise"]
    if not white.identified:
        return "No white noise was identified."
    scaled = Coefficient(white.value * np.sqrt(2), white.std * np.sqrt(2), white.unit)
    shown = [_shown(scaled, 1.0, found.unit)]
    if (second := samples.sensed) is not None:
        shown.append(_shown(scaled, second.factor, second.unit))
    return f"Noise density as in data sheets (one-sided): {' or '.join(shown)}."


def _allan(found: NoiseAnalysis) -> str:
    curve = found.allan
    modelled = found.modelled(curve.tau_s)
    scale, prefix = _prefixed(float(curve.deviation.max()), found.unit)
    rows = [
        (f"{tau:.4g}", f"{d * scale:.4g}", f"{low * scale:.4g} .. {high * scale:.4g}", f"{m * scale:.4g}")
        for tau, d, low, high, m in zip(curve.tau_s, curve.deviation, curve.low, curve.high, modelled, strict=True)
    ]
    lowest_s = minimum_s(curve)
    end = "" if lowest_s is None else f"\nLowest at {lowest_s:.4g} s: averaging for longer does not help."
    head = ("time (s)", f"Allan deviation ({prefix}{found.unit})", "95 % interval", "by these processes")
    return columns(head, rows) + end
