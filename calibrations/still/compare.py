"""Where a noise model fails: averaging times at which the Allan deviation is not the model's, and frequencies.

Allan deviations at neighbouring times share samples, so that their chances are not independent: each is compared with
the limit over their number (Bonferroni), which holds whatever their dependence. Neighbours that fail on the same side
are one place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from calibrations.errors import DataError
from calibrations.model import Model
from calibrations.noise_analysis.lines import Line
from calibrations.search.candidates import SIGNIFICANT
from calibrations.still.allan import Averaged, averaged
from calibrations.still.channel_fit import ChannelFit, Values
from calibrations.still.fit import NoiseFit, fit, noise_terms, seen
from calibrations.still.record import Channel, Still
from calibrations.still.scan import stretches

ALIKE = 0.02  # of a deviation: nearer, a model is as good as right
TIME, FREQUENCY = "averaging time", "frequency"


@dataclass(frozen=True)
class Place:
    """Averaging times or frequencies at which a channel is not as the model. `excess`: in standard deviations, rms."""

    where: str
    low: float
    high: float
    axis: str
    excess: float
    text: str


@dataclass(frozen=True)
class Comparison:
    """A noise model beside a record: its fit, both Allan deviations of each channel, and where they differ."""

    fit: NoiseFit
    averaged: tuple[Averaged, ...]
    fails: tuple[Place, ...]

    @property
    def adequate(self) -> bool:
        """Whether the model fails nowhere."""
        return not self.fails


def compare(still: Still, model: Model) -> Comparison:
    """The model as it is, or fitted first where it has no values yet. Raises ModelError, DataError."""
    found = evaluate(model, still) or fit(model, still)
    curves = tuple(averaged(each, still.allan[each.channel.axis]) for each in found.channels)
    return Comparison(found, curves, tuple(_fails(found, curves)))


def evaluate(model: Model, still: Still) -> NoiseFit | None:
    """The model with the values that it has; None where it has none. Raises DataError for a channel that it has not."""
    terms = noise_terms(model)
    if not any(term.estimates for term in terms):
        return None
    known = {(term.name, e.axis, e.name): e.value for term in terms for e in term.estimates}
    axes = {axis for _, axis, _ in known}
    if missing := [channel.axis for channel in still.channels if channel.axis not in axes]:
        raise DataError(
            f"{still.source}: {model.name} has values for the axes {', '.join(sorted(axes))}, and none for "
            f"{', '.join(missing)}; fit it to this record, or name a channel with --channel"
        )
    channels = []
    for channel in still.channels:
        values = {
            term.name: {
                name: v for (effect, axis, name), v in known.items() if (effect, axis) == (term.name, channel.axis)
            }
            for term in terms
        }
        lines = tuple(
            Line(f_hz, amplitude, 0.0)
            for term in terms
            if term.effect.lines is not None
            for f_hz, amplitude in term.effect.lines(values[term.name])
        )
        channels.append(_beside(channel, lines, values, model))
    return NoiseFit(still, replace(model, unit=still.unit), tuple(channels))


def _beside(channel: Channel, lines: tuple[Line, ...], values: dict[str, Values], model: Model) -> ChannelFit:
    effects = tuple(term.effect for term in noise_terms(model) if term.effect.spectrum is not None)
    given = tuple(effect for effect in effects if all(p.name in values[effect.name] for p in effect.parameters))
    return replace(seen(channel, lines), effects=given, values={e.name: values[e.name] for e in given})


def _fails(found: NoiseFit, curves: tuple[Averaged, ...]) -> list[Place]:
    """Surest first, times before frequencies of the same channel."""
    limit = SIGNIFICANT / (2 * len(curves))
    places = [place for each, curve in zip(found.channels, curves, strict=True) for place in _times(each, curve, limit)]
    places += [
        Place(FREQUENCY, each.low_hz, each.high_hz, each.axis, abs(each.deviations), each.text)
        for channel in found.channels
        for each in stretches(channel)
        if each.chance < limit
    ]
    return sorted(places, key=lambda place: -place.excess)


def _times(found: ChannelFit, curve: Averaged, limit: float) -> list[Place]:
    """Stretches of neighbouring averaging times that fail on the same side."""
    off = (curve.chance < limit / len(curve.tau_s)) & (np.abs(curve.ratio - 1) > ALIKE)
    side = np.where(off, np.sign(curve.ratio - 1), 0).astype(int)
    places = []
    for sign, group in groupby(range(len(side)), key=lambda k: side[k]):
        rows = list(group)
        if sign:
            worst = max(rows, key=lambda k: abs(float(curve.deviations[k])))
            excess = float(np.sqrt(np.mean(curve.deviations[rows] ** 2)))
            low, high = float(curve.tau_s[rows[0]]), float(curve.tau_s[rows[-1]])
            places.append(Place(TIME, low, high, found.channel.axis, excess, _text(found, curve, low, high, worst)))
    return places


def _text(found: ChannelFit, curve: Averaged, low: float, high: float, worst: int) -> str:
    span = f"{low:.4g} s" if low == high else f"{low:.4g} to {high:.4g} s"
    unit, axis = found.channel.unit, found.channel.axis
    return (
        f"averaging times of {span}: the Allan deviation of {axis} is {curve.ratio[worst]:.3g} x that of the model at "
        f"{curve.tau_s[worst]:.4g} s ({curve.measured[worst]:.3g} {unit} for {curve.modelled[worst]:.3g}), "
        f"{abs(curve.deviations[worst]):.3g} standard deviations off"
    )
