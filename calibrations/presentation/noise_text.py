"""A noise analysis in words: coefficients in units that sensor engineers use, the Allan deviation as a table."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from calibrations.noise.analysis import ChannelNoise, Coefficient, NoiseAnalysis
from calibrations.noise.deviations import minimum_s
from calibrations.noise.doubts import Disturbance
from calibrations.noise.record import Sensed
from calibrations.noise.samples import COARSE
from calibrations.noise.telegraph import SEVERAL_LEVELS, TWO_LEVELS
from calibrations.text import (
    PREFIX_UNITS,
    Cells,
    columns,
    concise,
    duration,
    prefix,
    rounded,
    sentence,
    typeset,
    unit,
)

MEANS = {
    "white-noise": "velocity or angle random walk",
    "flicker-noise": "bias instability",
    "rate-random-walk": "random walk of the bias",
    "quantisation-noise": "error of the integrated output",
    "sinusoidal-noise": "amplitude",
    "gauss-markov-noise": "standard deviation",
}
SYMBOLS = {"white-noise": "N", "flicker-noise": "B", "rate-random-walk": "K", "quantisation-noise": "Q"}
NOISE = (COARSE, TWO_LEVELS, SEVERAL_LEVELS)  # noise that the coefficients alone do not describe


def summary(analysis: NoiseAnalysis) -> str:
    """The whole analysis, for a terminal."""
    record = analysis.record
    length = f", {duration(record.length_s)}" if record.length_s >= 1 else ""
    parts = [f"{record.source}: {record.n} samples at {record.rate_hz:g} Hz{length}\n", *_disturbances(analysis)]
    for axis, noise in analysis.channels.items():
        sensed = record.sensed.get(axis)
        parts += [f"Noise of {axis}\n", columns(*coefficient_table(noise, sensed)), ""]
        parts += [density(noise, sensed), "", _allan(noise), ""]
    return "\n".join(parts).rstrip()


def remarks(analysis: NoiseAnalysis) -> Iterable[str]:
    """Warnings about the coefficients."""
    for name, rivals in analysis.search.rivals.items():
        if rivals:
            yield f"The record cannot separate {name} from {' or '.join(rivals)}: record for longer."


def coefficient_table(noise: ChannelNoise, sensed: Sensed | None) -> Cells:
    """Head and rows of the coefficients of one channel: in its unit, and in that of the sensed quantity, if known."""
    rows: list[tuple[str, ...]] = []
    for name, coefficient in noise.coefficients.items():
        second = () if sensed is None else (_coefficient_text(coefficient, sensed.factor, sensed.unit, noise.unit),)
        meaning = MEANS.get(name, "") + _detail(coefficient)
        rows.append((name, _coefficient_text(coefficient, 1.0, noise.unit, noise.unit), *second, meaning))
    return ("process", "coefficient", *(() if sensed is None else (f"in {sensed.unit}",)), "meaning"), rows


def typeset_coefficients(noise: ChannelNoise, sensed: Sensed | None) -> tuple[Cells, str]:
    """`coefficient_table` with a first column of usual symbols, and `density`; both with the signs of a page."""
    head, rows = coefficient_table(noise, sensed)
    cells = [(SYMBOLS.get(row[0], ""), *map(_with_signs, row)) for row in rows]
    return (("", *map(_with_signs, head)), cells), _with_signs(density(noise, sensed))


def _with_signs(text: str) -> str:
    return unit(typeset(text))


def _disturbances(analysis: NoiseAnalysis) -> Iterable[str]:
    """Disturbances that are not a noise process, and the coefficients that they change."""
    for disturbance in analysis.disturbances:
        if disturbance.kind in NOISE:
            yield f"{sentence(disturbance.text)}\n"
    removable = [disturbance for disturbance in analysis.disturbances if disturbance.kind not in NOISE]
    if not removable:
        return
    yield "Disturbances that are not noise:"
    for disturbance in removable:
        effect = " and ".join(analysis.spoils(disturbance))
        removed_words = ", removed before the fit" if disturbance.pattern is not None else ""
        spoils = f"; it spoils {effect}" if effect else ""
        yield f"  {disturbance.text}{removed_words}{spoils}{'' if disturbance.matters else '; too small to matter'}"
    yield ""
    yield from _uncleaned_lines(analysis, removable)


def _uncleaned_lines(analysis: NoiseAnalysis, removed: Iterable[Disturbance]) -> Iterable[str]:
    """The coefficients that the removed disturbances would change."""
    if analysis.uncleaned is None:
        return
    yield "With these disturbances in the record, the fit would give:"
    for axis, noise in analysis.uncleaned.items():
        changed_coefficients = {
            name for disturbance in removed if disturbance.axis == axis for name in analysis.spoils(disturbance)
        }
        for name, coefficient in noise.coefficients.items():
            if name in changed_coefficients:
                text = _coefficient_text(coefficient, 1.0, noise.unit, noise.unit)
                yield f"  {axis}: {name} {text}{_detail(coefficient)}"
    yield ""


def _detail(coefficient: Coefficient) -> str:
    if coefficient.frequency_hz is not None:
        return f", {coefficient.frequency_hz:.6g} Hz"
    if coefficient.alternatives:
        return f"; this or {' or '.join(coefficient.alternatives)}"
    time_s = coefficient.time_constant_s
    return f", time constant {time_s:.3g} s" if time_s and coefficient.identified else ""


def _coefficient_text(coefficient: Coefficient, factor: float, unit: str, base: str) -> str:
    """`12.34(56) uV/sqrt(Hz)`, or the upper bound. `base` is the unit of the channel, `unit` that of the result."""
    per = coefficient.unit.removeprefix(base).replace("*", "·")  # uV·s
    if coefficient.upper is not None and np.isinf(coefficient.upper):
        return "not known"
    if coefficient.upper is not None:
        scale, spelt = _ascii_prefixed(coefficient.upper * factor, unit)
        return f"not identified, below {rounded(coefficient.upper * factor * scale, 2)} {spelt}{per}"
    scale, spelt = _ascii_prefixed(coefficient.value * factor, unit)
    return concise(coefficient.value * factor * scale, coefficient.std * factor * scale, f"{spelt}{per}")


def _ascii_prefixed(value: float, unit: str) -> tuple[float, str]:
    """(factor, unit with prefix) in ASCII; counts and compound units take no prefix."""
    factor, letter = prefix(value) if unit in PREFIX_UNITS else (1.0, "")
    return factor, letter.replace("µ", "u") + unit


def density(noise: ChannelNoise, sensed: Sensed | None) -> str:
    """White noise as data sheets give it: one-sided, and so sqrt(2) times the coefficient of the Allan deviation."""
    white = noise.coefficients["white-noise"]
    if not white.identified:
        return "No white noise was identified."
    scaled = Coefficient(white.value * np.sqrt(2), white.std * np.sqrt(2), white.unit)
    texts = [_coefficient_text(scaled, 1.0, noise.unit, noise.unit)]
    if sensed is not None:
        texts.append(_coefficient_text(scaled, sensed.factor, sensed.unit, noise.unit))
    return f"Noise density as in data sheets (one-sided): {' or '.join(texts)}."


def _allan(noise: ChannelNoise) -> str:
    curve, cleaned = noise.allan, noise.cleaned_allan
    scale, spelt = _ascii_prefixed(float(curve.deviation.max()), noise.unit)
    values = [f"{value * scale:.4g}" for value in curve.deviation.tolist()]
    bounds = [f"{low * scale:.4g} .. {high * scale:.4g}" for low, high in zip(curve.low, curve.high, strict=True)]
    table = [[f"{tau:.4g}" for tau in curve.tau_s.tolist()], values, bounds]
    head = ["time (s)", f"Allan deviation ({spelt})", "95 % interval"]
    if noise.search.patterns and np.array_equal(cleaned.tau_s, curve.tau_s):
        head.append("without disturbances")
        table.append([f"{value * scale:.4g}" for value in cleaned.deviation.tolist()])
    head.append("by these processes")
    table.append([f"{value * scale:.4g}" for value in noise.modelled(curve.tau_s).tolist()])
    lowest_s = minimum_s(curve)
    end = "" if lowest_s is None else f"\nLowest at {lowest_s:.4g} s: averaging for longer does not help."
    return columns(head, list(zip(*table, strict=True))) + end
